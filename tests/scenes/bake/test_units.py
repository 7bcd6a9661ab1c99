"""Lengths with a unit: in metres where the file's format is in metres, refused elsewhere."""

from pathlib import Path

import pytest
from meshes import hills

import obscurance
from obscurance import ao
from obscurance.raytrace.errors import OptionError
from obscurance.scenes.bake.options import BakeOptions
from obscurance.scenes.bake.plan import plan_bake
from obscurance.scenes.commands.bake import run_bake

NAMES = ("half_distance", "max_distance", "ground", "texel_size", "cage")


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


@pytest.mark.parametrize("mesh", ["duck.obj", "duck.stl", "duck.ply", "duck.3mf", "<stdin>.ply"])
@pytest.mark.parametrize("name", NAMES)
def test_a_unit_is_refused_where_the_file_names_none(mesh, name):
    with pytest.raises(
        OptionError, match=rf"{name}: expected a length above 0 without a unit, which {mesh} does"
    ) as caught:
        planned(mesh, name, "0.5m")
    assert caught.value.got == "'0.5m'"


@pytest.mark.parametrize("length", ["0.5", "25%", "12e-1"])
def test_numbers_and_per_cent_are_of_any_file(length):
    for mesh in ("duck.obj", "duck.glb"):
        assert planned(mesh, "half_distance", length).half_distance == length


@pytest.mark.parametrize("length", ["10 parsecs", "m", "1..5m", "mm", "-1m", "0 km", "1%m"])
def test_other_words_are_no_lengths(length):
    with pytest.raises(OptionError, match=r"max_distance: expected a length above 0, such as 0\.5, \"25%\" or inf"):
        planned("duck.glb", "max_distance", length)


@pytest.mark.parametrize("bake", [ao.bake, obscurance.bake])
def test_arrays_have_no_unit(bake):
    with pytest.raises(OptionError, match="max_distance: expected a length above 0"):
        bake(hills(4), ao.Binary("0.5m"))
    with pytest.raises(OptionError, match="max_distance: expected a length above 0 without a unit, which mesh does"):
        obscurance.bake(hills(4), max_distance="0.5m")


def test_all_inputs_of_a_batch_are_in_metres_or_none(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a.glb").write_bytes(b"")
    (tmp_path / "b.stl").write_bytes(b"")
    options = BakeOptions(mesh=[Path("a.glb"), Path("b.stl")], output_dir=Path("out"), max_distance="5 m")
    with pytest.raises(OptionError, match=r"max_distance: expected a length above 0 without a unit, which b\.stl does"):
        run_bake(options)
    assert not (tmp_path / "out").exists()
