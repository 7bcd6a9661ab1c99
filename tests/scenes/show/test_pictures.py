"""One face: what `import obscurance` has, results that save themselves, renderings and pages in one call."""

import subprocess
import sys
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
from meshes import hills, two_boxes
from project import ROOT

import obscurance
from obscurance import ao, scenes
from obscurance.raytrace import AmbientLight, Camera, Lambert, Mesh, Object, OptionError, Scene, Settings, Shape
from obscurance.raytrace.errors import SceneError
from obscurance.raytrace.image.read import read_image

BOXES = two_boxes()
SMALL = Settings(width=48, height=32, samples=4)
NAMES = [
    *("Binary", "Camera", "Exponential", "Linear", "Smooth", "Tabulated"),
    *("ao", "bake", "bake_points", "bake_texture", "load", "raytrace", "render", "scenes", "unwrap", "view", "write"),
]


@pytest.fixture(scope="module")
def baked():
    return obscurance.bake(BOXES, samples=64)


def test_the_face_has_these_names_and_is_the_packages():
    assert dir(obscurance) == NAMES == sorted(obscurance.__all__)
    stub = (ROOT / "obscurance" / "__init__.pyi").read_text()
    for name in NAMES:
        package = "obscurance" + stub.split(f" import {name} as")[0].split()[-1].rstrip(".")
        assert getattr(obscurance, name) is getattr(import_module(package), name)
    with pytest.raises(AttributeError, match="unknown"):
        _ = obscurance.unknown


def test_importing_the_face_imports_nothing_else():
    code = "import sys; before = {*sys.modules}; import obscurance; print(*({*sys.modules} - before))"
    found = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    beside = ("obscurance", "lazy_loader", "ast", "_ast")
    assert not {name.split(".")[0] for name in found.stdout.split()}.difference(beside)


@pytest.mark.parametrize("ending", [".ply", ".glb", ".npz", ".npy"])
@pytest.mark.parametrize("kind", [str, Path])
def test_a_bake_saves_itself_and_is_read_back(baked, tmp_path, ending, kind):
    path = kind(tmp_path / f"w{ending}")
    baked.save(path)
    expected = baked.w.astype(np.float32)
    count = len(expected)  # a .glb repeats vertices at creases, after these
    np.testing.assert_array_equal(scenes.read_w(path)[:count], expected)
    np.testing.assert_array_equal(scenes.read_w(path, len(expected)), expected)
    with pytest.raises(SceneError, match="w: expected 15 values"):
        scenes.read_w(path, 15)
    if ending in (".ply", ".glb"):
        np.testing.assert_array_equal(obscurance.load(path).w[:count], expected)


def test_an_array_of_another_shape_is_refused(tmp_path):
    np.save(tmp_path / "w.npy", np.zeros((3, 2)))
    with pytest.raises(SceneError, match=r"w: expected an array \(n,\), one value a vertex, got shape \(3, 2\)"):
        scenes.read_w(tmp_path / "w.npy")


def test_what_was_baked_may_have_any_form_for_write(baked, tmp_path):
    baked.save(tmp_path / "file.ply")
    source = obscurance.load(tmp_path / "file.ply", "a.ply")
    for number, given in enumerate((source, tmp_path / "file.ply", str(tmp_path / "file.ply"))):
        obscurance.write(tmp_path / f"{number}.ply", baked, given)
        assert (tmp_path / f"{number}.ply").read_bytes() == (tmp_path / "file.ply").read_bytes()
    for number, given in enumerate((None, BOXES, baked, Mesh(*BOXES))):
        obscurance.write(tmp_path / f"bare{number}.glb", baked, given)
        assert obscurance.load(tmp_path / f"bare{number}.glb").w is not None
    with pytest.raises(OptionError, match=r"bake: expected w of the 64 vertices of .*, got 16"):
        obscurance.write(tmp_path / "x.ply", baked, hills(8))
    assert not (tmp_path / "x.ply").exists()


def test_a_texture_saves_itself(tmp_path):
    vertices, faces = BOXES
    baked = obscurance.bake_texture((vertices, faces), vertices[:, :2] % 1, 16, samples=16)
    assert len(baked.mesh.faces) == len(faces)
    baked.save(tmp_path / "ao.png")
    assert read_image(tmp_path / "ao.png")[0]["beauty"].shape[:2] == (16, 16)
    baked.save(tmp_path / "ao.glb")
    assert obscurance.load(tmp_path / "ao.glb").raw.header["materials"][0]["occlusionTexture"]


@pytest.mark.usefixtures("entry_points")
def test_saving_needs_somebody_who_writes_files(baked, tmp_path):
    with pytest.raises(OptionError, match="save: expected the package obscurance, installed"):
        baked.save(tmp_path / "x.ply")


def test_a_bake_is_rendered_in_its_w(baked):
    dark = obscurance.render(baked, settings=SMALL).layers
    light = obscurance.render(baked.mesh, settings=SMALL).layers
    seen = light["object_id"][..., 0] > 0
    assert dark["obscurance"][seen].min() < baked.w.max() - 0.05
    assert (light["obscurance"] == 1).all()


def test_a_file_is_rendered_as_the_command_does_and_a_scene_as_it_is(baked, tmp_path):
    baked.save(tmp_path / "boxes.ply")
    described = scenes.read_scene(tmp_path / "boxes.ply", (48, 32))
    frame = obscurance.render(tmp_path / "boxes.ply", settings=SMALL)
    assert frame.layers["obscurance"].min() < 0.95
    np.testing.assert_array_equal(
        frame.layers["depth"], obscurance.render(described.scene, described.camera, SMALL).layers["depth"]
    )
    stored = obscurance.render(obscurance.load(tmp_path / "boxes.ply"), settings=SMALL)
    np.testing.assert_allclose(
        stored.layers["obscurance"], obscurance.render(baked, settings=SMALL).layers["obscurance"]
    )
    lit = Scene((Object(Shape(BOXES, Lambert(albedo=1))),), (AmbientLight(),))
    np.testing.assert_array_equal(
        obscurance.render(lit, settings=SMALL).layers["beauty"],
        obscurance.render(lit, Camera.framing(BOXES, aspect=1.5), SMALL).layers["beauty"],
    )


def test_a_page_of_a_bake_and_of_a_file(baked, tmp_path, shown_in_browser):
    baked.save(tmp_path / "boxes.ply")
    for source in (baked, tmp_path / "boxes.ply"):
        assert obscurance.view(source, tmp_path / "page.html") == tmp_path / "page.html"
        assert (tmp_path / "page.html").read_bytes().startswith(b"<!doctype html>")
        assert not shown_in_browser
    page = obscurance.view(baked)
    assert shown_in_browser == [page.resolve().as_uri()]


def test_a_function_is_a_falloff():
    exponential = ao.Exponential(tau=0.5)
    by_function = obscurance.bake(BOXES, lambda d: 1 - np.exp(-0.5 * d), samples=64)
    np.testing.assert_allclose(by_function.w, obscurance.bake(BOXES, exponential, samples=64).w, atol=2e-6)
    both = obscurance.bake(BOXES, [exponential, lambda d: float(d >= 2)], samples=64)
    np.testing.assert_array_equal(both.values[:, 1], obscurance.bake(BOXES, ao.Binary(2.0), samples=64).w)
    with pytest.raises(OptionError, match=r"function: expected values that reach 1, or ao\.Tabulated\.of"):
        obscurance.bake(BOXES, lambda d: 0.5)
