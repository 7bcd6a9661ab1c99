"""Lengths with a unit: understood where the file's format or content has one, refused elsewhere."""

import subprocess
from pathlib import Path

import numpy as np
import pytest
from command import COMMAND, obscurance, refused, succeeded
from fuzz_seeds import DAE, MODEL, archive
from gltf_files import Builder
from mesh_files import ply
from meshes import hills

import obscurance as obscurance_package
from obscurance import ao
from obscurance.raytrace.errors import InputError, OptionError
from obscurance.scenes.bake.options import BakeOptions
from obscurance.scenes.bake.plan import plan_bake

NAMES = ("half_distance", "max_distance", "ground", "texel_size", "cage")


def of_model(content):
    """A 3MF file of a model."""
    return archive(**{"3D/3dmodel.model": content})


def planned(mesh, name, length):
    options = {"max_distance": "9"} | {name: length} | ({"high": [Path("fine.ply")]} if name == "cage" else {})
    output = "w.png" if name == "texel_size" else "w.npz"
    return plan_bake(BakeOptions(mesh=[Path(mesh)], output=Path(output), **options)).options


@pytest.mark.parametrize("mesh", ["duck.glb", "duck.GLTF", "dem.tif", "dem.asc"])
@pytest.mark.parametrize(
    ("length", "metres"), [("10mm", 0.01), ("10 km", 10_000), (" 2.5cm", 0.025), ("0.5m", 0.5), ("1e3 m ", 1000)]
)
def test_a_unit_counts_where_the_format_is_in_metres(mesh, length, metres):
    for name in NAMES:
        if name != "texel_size" or mesh.lower().startswith("duck"):
            assert float(getattr(planned(mesh, name, length), name)) == pytest.approx(metres, rel=1e-12)


@pytest.mark.parametrize("mesh", ["duck.obj", "duck.stl", "duck.ply", "duck.zae", "<stdin>.ply"])
@pytest.mark.parametrize("name", NAMES)
def test_a_unit_is_refused_where_the_file_names_none(mesh, name):
    with pytest.raises(
        OptionError, match=rf"{name}: expected a length above 0 without a unit, which {mesh} does"
    ) as caught:
        planned(mesh, name, "0.5m")
    assert caught.value.got == "'0.5m'"


INCHES = DAE.replace(b"<up_axis>", b'<contributor/><unit name="inch" meter="0.0254"/><up_axis>')
NAMED = {
    "millimetres.3mf": (of_model(MODEL), 1e-3),
    "feet.3mf": (of_model(MODEL.replace(b"millimeter", b"foot")), 0.3048),
    "by_default.3mf": (of_model(MODEL.replace(b' unit="millimeter"', b"")), 1e-3),
    "inches.dae": (INCHES, 0.0254),
    "metres.DAE": (INCHES.replace(b' meter="0.0254"', b""), 1.0),
}


@pytest.mark.parametrize("file", NAMED)
@pytest.mark.parametrize("name", NAMES)
def test_a_file_may_name_its_unit(tmp_path, file, name):
    content, unit = NAMED[file]
    (tmp_path / file).write_bytes(content)
    planned_lengths = planned(tmp_path / file, name, "5 cm")
    assert float(getattr(planned_lengths, name)) == pytest.approx(0.05 / unit, rel=1e-12)


MALFORMED = {
    "none.3mf": (None, "file: expected an existing file"),
    "cut.3mf": (of_model(MODEL)[:-30], "content: expected a complete and valid 3MF file"),
    "parsecs.3mf": (of_model(MODEL.replace(b"millimeter", b"parsec")), "content: expected .*, got no 'parsec'"),
    "empty.dae": (b"", "content: expected a complete and valid DAE file"),
    "below.dae": (INCHES.replace(b"0.0254", b"-1"), "unit: expected a finite one above 0, got -1.0"),
    "word.dae": (INCHES.replace(b"0.0254", b"x"), "content: expected a complete and valid DAE file"),
    "nowhere.dae": (DAE, "max_distance: expected a length above 0 without a unit"),
    "later.dae": (DAE.replace(b"</scene>", b'<asset><unit meter="2"/></asset></scene>'), "above 0 without a unit"),
}  # fmt: skip


@pytest.mark.parametrize("file", MALFORMED)
def test_a_unit_that_is_none_is_told_in_a_line(tmp_path, file):
    content, said = MALFORMED[file]
    if content is not None:
        (tmp_path / file).write_bytes(content)
    with pytest.raises(InputError, match=said) as caught:
        planned(tmp_path / file, "max_distance", "5 cm")
    assert file in str(caught.value)
    assert planned(tmp_path / file, "max_distance", "5").max_distance == "5"


def glb(vertices, faces):
    builder = Builder()
    builder.mesh(builder.primitive(vertices.astype("<f4"), faces))
    return builder.glb([{"mesh": 0}])


PIPED = {"glb": (glb(*hills(4)), 1.0), "3mf": (of_model(MODEL), 1e-3), "dae": (INCHES, 0.0254)}


@pytest.mark.parametrize("ending", PIPED)
def test_a_pipe_has_the_unit_of_its_format_or_content(tmp_path, ending):
    content, unit = PIPED[ending]
    (tmp_path / f"m.{ending}").write_bytes(content)
    options = "--samples", "16", "--half-distance"
    command = [*COMMAND, "bake", "-", "-o", "piped.npy", *options, f"{30 * unit} cm"]
    subprocess.run(command, input=content, cwd=tmp_path, check=True, capture_output=True)
    succeeded("bake", tmp_path / f"m.{ending}", "-o", tmp_path / "w.npy", *options, 0.3)
    np.testing.assert_allclose(np.load(tmp_path / "piped.npy"), np.load(tmp_path / "w.npy"), atol=1e-6)
    w = obscurance_package.bake(tmp_path / f"m.{ending}", samples=16, half_distance=f"{30 * unit} cm").w
    np.testing.assert_allclose(w, np.load(tmp_path / "w.npy"), atol=1e-6)


def test_all_inputs_of_a_batch_have_one_unit(tmp_path):
    one, same, feet, none = (tmp_path / name for name in ("millimetres.3mf", "by_default.3mf", "feet.3mf", "hills.ply"))
    for file in (one, same, feet):
        file.write_bytes(NAMED[file.name][0])
    none.write_bytes(ply(*hills(4)))
    options = "--output-dir", tmp_path / "out", "--half-distance", "5mm", "--samples", 8
    refused(obscurance("bake", one, feet, *options), "expected files in the unit of ", "feet.3mf")
    refused(obscurance("bake", one, none, *options), "without a unit, which ", "hills.ply does not name")
    assert not (tmp_path / "out").exists()
    succeeded("bake", one, same, *options)


@pytest.mark.parametrize("length", ["0.5", "25%", "12e-1"])
def test_numbers_and_per_cent_are_of_any_file(length):
    for mesh in ("duck.obj", "duck.glb"):
        assert planned(mesh, "half_distance", length).half_distance == length


@pytest.mark.parametrize("length", ["10 parsecs", "m", "1..5m", "mm", "-1m", "0 km", "1%m"])
def test_other_words_are_no_lengths(length):
    with pytest.raises(OptionError, match=r"max_distance: expected a length above 0, such as 0\.5, \"25%\" or inf"):
        planned("duck.glb", "max_distance", length)


@pytest.mark.parametrize("bake", [ao.bake, obscurance_package.bake])
def test_arrays_have_no_unit(bake):
    with pytest.raises(OptionError, match="max_distance: expected a length above 0"):
        bake(hills(4), ao.Binary("0.5m"))
    with pytest.raises(OptionError, match="max_distance: expected a length above 0 without a unit, which mesh does"):
        obscurance_package.bake(hills(4), max_distance="0.5m")
