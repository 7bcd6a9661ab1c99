"""The registry of formats and what follows it: names of functions, choices of options, pipes, formats from outside."""

import re
from pkgutil import resolve_name
from typing import get_args

import numpy as np
import pytest
from command import succeeded
from gltf_files import HALVES, QUAD, Builder
from project import ROOT

from obscurance import scenes
from obscurance.raytrace import MeshError
from obscurance.scenes.bake.options import Format, InputFormat
from obscurance.scenes.formats import table
from obscurance.scenes.formats.images import ENDINGS as IMAGES
from obscurance.scenes.formats.table import endings, format_of, formats, sniffed_format


@pytest.mark.parametrize("row", formats().values(), ids=formats())
def test_functions_of_a_row_are_there(row):
    for name in filter(None, (row.read, row.write)):
        assert callable(resolve_name(name))
    assert bool(row.read) == bool(row.peak)
    assert "source" not in row.holds or row.write


def test_options_offer_the_formats_of_the_table():
    piped = {*endings("read")} - {*endings("raster")}
    assert {f".{name}" for name in get_args(InputFormat)} == piped
    assert {f".{name}" for name in get_args(Format)} == {*endings("write"), *IMAGES} - {".tiff"}


def test_endings_are_found_in_any_case_and_others_go_to_libraries():
    assert format_of("a/b.PLY") is formats()[".ply"]
    assert format_of("mesh.msh").ending == format_of("mesh").ending == ""


@pytest.mark.parametrize(
    ("content", "ending"),
    [
        (b"ply\nformat", ".ply"), (b"glTF\x02", ".glb"), (b' {"asset"', ".gltf"), (b"PK\x03\x04", ".3mf"),
        (b"# a comment\n\nv 0 0 0\n", ".obj"), (b"COFF 3 1 0", ".off"), (b"solid x\n facet normal", ".stl"),
        (b"solid", None), (b"vertex 1", None),
    ],
)  # fmt: skip
def test_first_bytes_show_the_format(content, ending):
    assert sniffed_format(content) == ending


def test_a_format_from_outside_is_read_as_the_guide_for_contributors_says(tmp_path, monkeypatch):
    row, reader = re.findall("```python\n(.*?)```", (ROOT / "CONTRIBUTING.md").read_text(), re.DOTALL)[:2]
    assert len((row + reader).split("\n")) <= 14
    (tmp_path / "tri_format.py").write_text(reader)
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "m.tri").write_text("0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 1\n0 1 1\n")
    with pytest.raises(MeshError, match="ending: expected that of"):
        scenes.load(tmp_path / "m.tri")
    try:
        exec(row.replace("obscurance.scenes.formats.tri", "tri_format"))
        mesh = scenes.load(tmp_path / "m.tri").mesh
        assert ".tri" in endings("read")
    finally:
        table._REGISTERED.pop(".tri", None)
    assert np.array_equal(mesh.faces, [[0, 1, 2], [3, 4, 5]])
    assert mesh.vertices[5].tolist() == [0, 1, 1]


def test_a_vrm_is_a_glb(tmp_path):
    builder = Builder()
    builder.mesh(builder.primitive(QUAD, HALVES))
    content = builder.glb([{"mesh": 0}])
    for name in ("m.glb", "m.vrm"):
        (tmp_path / name).write_bytes(content)
    one, other = (scenes.load(tmp_path / name) for name in ("m.glb", "m.vrm"))
    np.testing.assert_array_equal(one.mesh.vertices, other.mesh.vertices)
    for target in ("w.glb", "w.ply", "w.html"):
        succeeded("bake", tmp_path / "m.vrm", "-o", tmp_path / target, "--samples", 8, "--max-distance", "5 cm")
    succeeded("render", tmp_path / "m.vrm", "-o", tmp_path / "p.png", "--width", 8, "--height", 8)
    succeeded("info", tmp_path / "m.vrm")
