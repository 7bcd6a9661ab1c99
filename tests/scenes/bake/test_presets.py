"""`bake --preset`: what it sets of each output, what wins over it, and what reports say."""

import json
from pathlib import Path

import numpy as np
import pytest
from command import succeeded
from gltf_files import check_glb
from project import ROOT

from obscurance.raytrace.errors import ConflictError
from obscurance.scenes.bake.options import BAKE, PRESETS, ROWS, BakeOptions
from obscurance.scenes.bake.plan import plan_bake

FLOOR_AND_WALL = """v -1 0 0\nv 1 0 0\nv 1 2 0\nv -1 2 0\nv -1 2 .01\nv 1 2 .01\nv 1 2 1\nv -1 2 1
vt .05 .05\nvt .95 .05\nvt .95 .45\nvt .05 .45\nvt .05 .55\nvt .95 .55\nvt .95 .95\nvt .05 .95
f 1/1 2/2 3/3 4/4\nf 5/5 6/6 7/7 8/8\n"""
FEW = ("--samples", 64, "--size", 32)


def planned(preset, output, **given):
    """The plan, as options of the command make it."""
    return plan_bake(BakeOptions(mesh=[Path("m.obj")], output=Path(output), preset=preset, **given))


TANGENT = [preset for preset, values in PRESETS.items() if "bent_space" in values]


@pytest.mark.parametrize("preset", PRESETS)
def test_a_preset_sets_options_of_the_table_to_values_that_they_may_have(preset):
    for name, value in PRESETS[preset].items():
        row = next(row for row in BAKE if row.name == name)
        assert value != row.default
        assert row.kind in (bool, str | None) or value in str(row.kind)
    assert preset in str(ROWS["preset"].kind)


@pytest.mark.parametrize(
    ("preset", "output", "expected"),
    [
        ("unreal", "m.glb", {"occlusion": "texture", "bits": None, "bent_space": None}),
        ("unreal", "m.png", {"occlusion": None, "bits": "8", "bent_space": None}),
        ("unity", "m.exr", {"occlusion": None, "bits": None}),
        ("blender", "m.glb", {"colors": "rgb", "occlusion": None}),
        ("blender", "m.ply", {"colors": "rgb"}),
        ("three", "m.glb", {"colors": None, "occlusion": "ramp"}),
        ("three", "m.ply", {"colors": None, "occlusion": None}),
        ("meshlab", "m.ply", {"colors": None, "ply_name": "quality"}),
        ("meshlab", "m.obj", {"ply_name": None}),
    ],
)
def test_it_applies_where_it_can(preset, output, expected):
    plan = planned(preset, output)
    assert {name: getattr(plan.options, name) for name in expected} == expected
    assert plan.described()["preset"] == preset


def test_green_goes_down_for_unreal_alone():
    spaces = {preset: planned(preset, "m.png", bent_normals=Path("b.png")).options.bent_space for preset in TANGENT}
    assert {preset for preset, space in spaces.items() if space == "tangent-directx"} == {"unreal"}
    assert set(spaces.values()) == {"tangent", "tangent-directx"}


def test_what_is_given_wins():
    options = planned("unreal", "m.png", bits="16", bent_normals=Path("b.png"), bent_space="world").options
    assert (options.bits, options.bent_space) == ("16", "world")
    assert planned("unreal", "m.glb", occlusion="ramp").options.occlusion == "ramp"
    assert not planned("blender", "m.glb", occlusion="ramp").options.colors
    assert planned("unreal", "m.glb", colors="rgb").options.occlusion is None


def test_an_output_that_the_program_does_not_read_is_refused():
    for preset, output in (("unreal", "m.ply"), ("godot", "m.tif"), ("blender", "m.npz")):
        with pytest.raises(ConflictError, match=f"preset='{preset}' needs an output that ends in .glb"):
            planned(preset, output)


def test_the_documents_have_the_table():
    lines = (ROOT / "docs" / "programs.md").read_text().splitlines()
    for preset, values in PRESETS.items():
        (line,) = (each for each in lines if each.startswith(f"| `{preset}`"))
        for value in values.values():
            assert f"`{value}`" in line


@pytest.fixture
def folder(tmp_path, monkeypatch):
    (tmp_path / "corner.obj").write_text(FLOOR_AND_WALL)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def codes(path):
    import OpenImageIO as oiio

    image = oiio.ImageBuf(str(path))
    return image.spec(), image.get_pixels(image.spec().format)


def test_images_for_unreal_and_unity_differ_by_green(folder):
    for preset in ("unreal", "unity"):
        files = ("-o", f"{preset}.png", "--bent-normals", f"{preset}-n.png", "--report", f"{preset}.json")
        succeeded("bake", "corner.obj", "--preset", preset, *files, *FEW)
    (spec, unreal), (_, unity) = (codes(folder / f"{preset}-n.png") for preset in ("unreal", "unity"))
    assert (str(spec.format), spec.nchannels) == ("uint8", 3)
    assert not any("gamma" in each.name.lower() or "icc" in each.name.lower() for each in spec.extra_attribs)
    floor, other = (image[18:22, 4:28].astype(int) for image in (unreal, unity))
    assert np.array_equal(floor[..., [0, 2]], other[..., [0, 2]])
    assert np.abs(floor[..., 1] + other[..., 1] - 255).max() <= 1
    assert other[..., 1].mean() < 110  # away from the wall, down in the image
    grey, w = codes(folder / "unreal.png")
    assert (str(grey.format), grey.nchannels) == ("uint8", 1)
    assert w.min() < 200 < w.max()
    options = json.loads((folder / "unreal.json").read_text())["options"]
    assert {name: options[name] for name in ("preset", "bits", "bent_space")} == {
        "preset": "unreal", "bits": "8", "bent_space": "tangent-directx",
    }  # fmt: skip


def test_blender_gets_one_attribute_of_a_name_of_its_own(folder):
    ply = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
    ply += "property float quality\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
    (folder / "q.ply").write_text(ply + "0 0 0 1\n1 0 0 2\n0 1 0 3\n3 0 1 2\n")
    for source, output, preset, kept in [
        ("q.ply", "all.glb", (), "QUALITY OBSCURANCE OBSCURANCE_ERROR OBSCURANCE_BENT_NORMALS OBSCURANCE_FLAGS"),
        ("q.ply", "one.glb", ("--preset", "blender"), "OBSCURANCE"),
        ("all.glb", "again.glb", ("--preset", "blender"), "OBSCURANCE"),
        ("corner.obj", "corner.glb", ("--preset", "blender"), "OBSCURANCE"),
    ]:
        done = succeeded("bake", source, "-o", output, *preset, "--samples", 8)
        (primitive,) = check_glb((folder / output).read_bytes())[0]["meshes"][0]["primitives"]
        assert {name[1:] for name in primitive["attributes"] if name[0] == "_"} == set(kept.split())
        is_lost = output in ("one.glb", "again.glb")
        assert ("quality of vertices" in done.stderr.lower()) == is_lost, done.stderr


def test_an_earlier_bake_is_repeated_for_another_program(folder):
    succeeded("bake", "corner.obj", "--output-dir", "a", "--preset", "blender", "--samples", 8)
    manifest = json.loads((folder / "a" / "manifest.json").read_text())
    assert (manifest["inputs"][0]["output"], manifest["options"]["colors"]) == ("a/corner.glb", "rgb")
    again = ("--options", "a/manifest.json", "--report", "b.json")
    succeeded("bake", "corner.obj", "-o", "same.glb", *again)
    assert (folder / "same.glb").read_bytes() == (folder / "a" / "corner.glb").read_bytes()
    succeeded("bake", "corner.obj", "-o", "b.png", *again, "--preset", "godot", "--size", 16)
    options = json.loads((folder / "b.json").read_text())["options"]
    assert (options["preset"], options["bits"], options["samples"]) == ("godot", "8", 8)
