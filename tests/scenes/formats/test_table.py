"""The registry of formats and what follows it: names of functions, choices of options, pipes, formats from outside."""

import re
import subprocess
import sys
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


def test_a_format_is_one_file_as_the_guide_for_contributors_says(tmp_path, monkeypatch):
    """The reader of OFF that is shown there, under another name, here as a package from outside has it."""
    (text,) = re.findall(
        "```python\n(.*?)```", (ROOT / "CONTRIBUTING.md").read_text().partition("## A falloff")[0], re.DOTALL
    )
    assert len(text.split("\n")) <= 28
    file = tmp_path / "simple_off.py"
    file.write_text(text.replace("obscurance.scenes.formats.off", "simple_off").replace('".off"', '".soff"'))
    monkeypatch.syspath_prepend(tmp_path)
    content = b"OFF\n4 2 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 1 2\n4 0 1 3 2\n"
    (tmp_path / "m.soff").write_bytes(content)
    (tmp_path / "m.off").write_bytes(content)
    with pytest.raises(MeshError, match="ending: expected that of"):
        scenes.load(tmp_path / "m.soff")
    try:
        table.register(*table.rows_of(file))
        one, other = (scenes.load(tmp_path / name) for name in ("m.soff", "m.off"))
        assert ".soff" in endings("read")
    finally:
        table._FOREIGN.pop(".soff", None)
    for name in ("corners", "sizes"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    np.testing.assert_array_equal(one.mesh.vertices, other.mesh.vertices)
    np.testing.assert_array_equal(one.mesh.faces, other.mesh.faces)


def test_formats_are_found_without_being_imported():
    code = "import sys; from obscurance.scenes.formats import table; assert len(table.formats()) > 15; "
    code += "print([name for name in sys.modules if 'scenes.formats.' in name])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    assert done.stdout.strip() == "['obscurance.scenes.formats.table']"


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
