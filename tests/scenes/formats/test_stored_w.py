"""w that a bake has stored is rendered and shown."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
import trimesh
from command import obscurance, refused, succeeded
from gltf_files import HALVES, QUAD, TRIANGLE, Builder
from gltf_samples import occluded
from mesh_files import ply
from PIL import Image

from obscurance import ao, scenes
from obscurance.raytrace.image.read import read_image
from obscurance.scenes.formats.load import load

SIZE = ("--width", 48, "--height", 32, "--samples", 4)
CORNER = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [1, 0, 1], [0, 0, 1]], float)
FACES = np.array([[0, 1, 2], [0, 2, 3], [0, 5, 4], [0, 4, 1]])
PLAIN = '[[objects]]\nmesh = "{mesh}"\n[obscurance]\nbaked = "{baked}"\n'


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A corner of two squares, and w of it in every format, one value a vertex for both sides of the edge."""
    folder = tmp_path_factory.mktemp("made")
    mesh = folder / "corner.ply"
    trimesh.Trimesh(CORNER, FACES, process=False).export(mesh)
    for target in ("w.npy", "w.npz", "w.ply", "w.vtp"):
        succeeded("bake", mesh, "-o", folder / target, "--samples", 64, "--seed", 3)
    scenes.write(folder / "w.glb", ao.bake(load(mesh).mesh, samples=64, seed=3), mesh)
    return folder


@pytest.fixture
def folder(made, tmp_path, monkeypatch):
    monkeypatch.chdir(shutil.copytree(made, tmp_path, dirs_exist_ok=True))
    return tmp_path


def picture(scene, *options):
    """The layer of w, of a picture without further rays for it."""
    return picture_of("obscurance", scene, *options)


def picture_of(layer, scene, *options):
    succeeded("render", scene, "-o", "p.exr", *SIZE, "--report", "p.json", *options)
    assert "bake" not in json.loads(Path("p.json").read_text())["rays"]
    return read_image("p.exr")[0][layer]


@pytest.mark.parametrize("ending", ["npz", "ply", "glb", "vtp"])
def test_every_format_gives_the_same_picture(folder, ending):
    expected = None
    for baked in ("w.npy", f"w.{ending}"):
        (folder / "s.toml").write_text(PLAIN.format(mesh="corner.ply", baked=baked))
        found = picture("s.toml")
        assert found.min() < 0.9
        expected = found if expected is None else expected
        np.testing.assert_array_equal(found, expected)
    np.testing.assert_array_equal(picture("corner.ply", "--baked", f"w.{ending}").shape, expected.shape)


@pytest.mark.parametrize("ending", ["ply", "glb"])
def test_a_baked_mesh_is_rendered_with_its_own_w(folder, ending):
    stored = picture(f"w.{ending}", "--baked", f"w.{ending}")
    np.testing.assert_array_equal(stored, picture("corner.ply", "--baked", "w.npy"))
    assert stored.min() < 0.9


def test_instances_of_a_glb_have_their_own_w_and_flattened_nodes_none(folder):
    builder = Builder()
    builder.mesh(builder.primitive(QUAD, HALVES))
    builder.mesh(builder.primitive(TRIANGLE, [[0, 1, 2]]))
    turned = [0.7071067811865476, 0, 0, 0.7071067811865476]
    nodes = [{"mesh": 0}, {"mesh": 1, "scale": [0, 1, 1]}, {"mesh": 0, "rotation": turned}]
    (folder / "in.glb").write_bytes(builder.glb(nodes))
    succeeded("bake", "in.glb", "-o", "out.glb", "--samples", 64)
    assert picture("out.glb", "--baked", "out.glb").min() < 0.9


def test_w_of_another_mesh_is_refused(folder):
    (folder / "other.ply").write_bytes(ply())
    succeeded("bake", "other.ply", "-o", "o.glb", "--samples", 8)
    render = ("render", "corner.ply", "-o", "p.png", *SIZE, "--baked")
    refused(obscurance(*render, "o.glb"), "o.glb: w: expected 6 values, one a vertex of the scene's files", "got 7")
    refused(obscurance(*render, "corner.ply"), "corner.ply: w: expected obscurance at every vertex", "got none")
    refused(obscurance(*render, "gone.ply"), "--baked: expected an existing file, got gone.ply")
    refused(
        obscurance(*render, "w.obj"), "--baked: expected a name ending in .glb, .gltf, .npy, .npz, .ply, .tif, .tiff"
    )
    refused(obscurance(*render, "w.ply", "--obscurance", "off"), "render: --baked does not go with --obscurance off")
    assert not (folder / "p.png").exists()


@pytest.mark.parametrize("other", [np.array([1.5], "<f4").tobytes(), np.array([0x7FA00001], "<u4").tobytes()])
def test_values_that_are_no_w_are_refused(folder, other):
    """The second is a signalling NaN, at which conversions warn."""
    data = (folder / "w.ply").read_bytes()
    w = np.load("w.npy")
    (folder / "bad.ply").write_bytes(data.replace(w[:1].tobytes(), other))
    refused(obscurance("render", "corner.ply", "-o", "p.png", *SIZE, "--baked", "bad.ply"), "values in [0, 1]")
    assert "1 values are not in [0, 1]" in obscurance("info", "bad.ply").stdout


@pytest.mark.parametrize("ending", ["ply", "glb"])
def test_info_shows_stored_w(folder, ending):
    w = load(folder / f"w.{ending}").w
    np.testing.assert_array_equal(w[:6], np.load("w.npy"))
    line = next(row for row in obscurance("info", f"w.{ending}").stdout.splitlines() if row.startswith("stored w"))
    assert line.split(maxsplit=2)[2] == f"{w.min():.4g} to {w.max():.4g}, mean {w.mean(dtype=np.float64):.4g}"
    assert "stored w        none in the file" in obscurance("info", "corner.ply").stdout


def test_w_of_an_obj_fits_it_with_a_texture_too(folder):
    """Seams give vertices twice in the picture, and the file has w of each once."""
    Image.new("RGB", (2, 2), (255, 255, 255)).save(folder / "paint.png")
    places = "".join(f"v {x} {y} {z}\n" for x, y, z in CORNER)
    text = "v .5 .5 .5\n" + places + "vt 0 0\nvt 1 0\nvt 1 1\n"
    corners = [" ".join(f"{v + 2}/{(v + k) % 3 + 1}" for v in face) for k, face in enumerate(FACES.tolist())]
    (folder / "corner.obj").write_text(text + "".join(f"f {row}\n" for row in corners))
    succeeded("bake", "corner.obj", "-o", "o.npy", "--samples", 64, "--seed", 3)
    (folder / "plain.toml").write_text(PLAIN.format(mesh="corner.obj", baked="o.npy"))
    textured = PLAIN.format(mesh="corner.obj", baked="o.npy").replace("[obs", 'texture = "paint.png"\n[obs')
    (folder / "textured.toml").write_text(textured)
    np.testing.assert_array_equal(picture("textured.toml"), picture("plain.toml"))
    np.save("wrong.npy", np.ones(5))
    (folder / "wrong.toml").write_text(textured.replace("o.npy", "wrong.npy"))
    words = ("expected 7 values, one a vertex of the scene's files, or 13, one a vertex of the scene, got 5",)
    refused(obscurance("render", "wrong.toml", "-o", "p.png", *SIZE), *words)


@pytest.mark.parametrize("seams", [False, True])
def test_a_baked_ply_keeps_its_texture_in_a_scene(folder, seams):
    """The texture coordinates and w of an OBJ come through a PLY: the picture is the same."""
    Image.fromarray(np.random.default_rng(1).integers(0, 256, (8, 8, 3), np.uint8)).save(folder / "paint.png")
    text = "".join(f"v {x} {y} {z}\nvt {x} {z + y / 2}\n" for x, y, z in CORNER) + "vt .3 .9\n"
    for number, face in enumerate(FACES.tolist()):
        shift = 1 if seams and number == 2 else 0
        text += "f " + " ".join(f"{v + 1}/{v + 1 + shift}" for v in face) + "\n"
    (folder / "corner.obj").write_text(text)
    succeeded("bake", "corner.obj", "-o", "corner2.ply", "--samples", 64)
    for name in ("corner.obj", "corner2.ply"):
        scene = PLAIN.format(mesh=name, baked="corner2.ply").replace("[obs", 'texture = "paint.png"\n[obs')
        (folder / f"{name}.toml").write_text(scene)
    one, two = (picture_of("beauty", f"{name}.toml") for name in ("corner.obj", "corner2.ply"))
    np.testing.assert_allclose(one, two, atol=0.03)  # rounding moves a few samples across texels
    assert np.ptp(one[..., :3], axis=2).max() > 0.05
    (folder / "bare.toml").write_text('[[objects]]\nmesh = "corner.ply"\ntexture = "paint.png"\n')
    refused(
        obscurance("render", "bare.toml", "-o", "p.png", *SIZE), "objects[0].texture", "a mesh with texture coordinates"
    )


def without_attribute(name):
    """The GLB file without w at its vertices: its occlusion textures are left."""
    data = Path(name).read_bytes()
    assert b"_OBSCURANCE" in data
    Path(name).write_bytes(data.replace(b"_OBSCURANCE", b"_IRRELEVANT"))


def test_a_ramp_is_read_as_w(folder):
    expected = picture("corner.ply", "--baked", "w.npy")
    without_attribute("w.glb")
    found = picture("corner.ply", "--baked", "w.glb")
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-6)


def test_a_gltf_is_rendered_with_its_own_occlusion_and_needs_no_bake(folder):
    expected = picture("corner.ply", "--baked", "w.npy")
    np.testing.assert_allclose(picture("w.glb"), expected, rtol=0, atol=1e-6)
    book = picture_of("beauty", "w.glb", "--obscurance", "ambient and diffuse")
    baked = picture_of("beauty", "w.glb", "--obscurance", "ambient and diffuse", "--baked", "w.glb")
    np.testing.assert_allclose(book, baked, rtol=0, atol=1e-5)
    assert np.abs(book - picture_of("beauty", "w.glb", "--obscurance", "off")).max() > 0.05


def test_a_bake_can_take_the_place_of_a_gltf_s_own_occlusion(folder):
    command = "render", "w.glb", "-o", "p.exr", *SIZE, "--report", "p.json"
    succeeded(*command, "--no-own-occlusion")
    assert json.loads(Path("p.json").read_text())["rays"]["bake"] > 0
    np.testing.assert_allclose(read_image("p.exr")[0]["obscurance"], picture("w.glb"), rtol=0, atol=0.12)


def test_objects_without_an_occlusion_texture_are_baked_beside_those_with(folder):
    Path("half.glb").write_bytes(occluded(0.5))
    succeeded("render", "half.glb", "-o", "p.exr", *SIZE, "--report", "p.json")
    report = json.loads(Path("p.json").read_text())
    assert report["rmse_estimate"] is not None  # there was a bake
    assert report["rays_skipped"]["bake_not_wanted"] > 0
    found = read_image("p.exr")[0]["obscurance"]
    assert np.isclose(found, 1 - 0.5 * (1 - 64 / 255), atol=1e-6).any()
    line = next(row for row in obscurance("info", "half.glb").stdout.splitlines() if row.startswith("occlusion"))
    assert line.split(maxsplit=1)[1] == "textures of 1 of 2 primitives"


def test_scenes_of_toml_bake_what_they_place(folder):
    (folder / "s.toml").write_text('[[objects]]\nmesh = "w.glb"\n')
    succeeded("render", "s.toml", "-o", "p.exr", *SIZE, "--report", "p.json")
    assert json.loads(Path("p.json").read_text())["rays"]["bake"] > 0


def test_info_names_ramps(folder):
    said = " ".join(obscurance("info", "w.glb").stdout.split())
    assert "occlusion textures of 1 of 1 primitives, 1 of them ramps of a bake" in said
    assert "occlusion       no textures in the file" in obscurance("info", "corner.ply").stdout


def test_an_occlusion_texture_that_cannot_be_read(folder):
    data = Path("w.glb").read_bytes()
    Path("w.glb").write_bytes(data.replace(b"\x89PNG", b"\x89GNP"))
    refused(obscurance("render", "w.glb", "-o", "p.png", *SIZE), "images[0]", "an image")
    without_attribute("w.glb")
    refused(obscurance("render", "corner.ply", "-o", "p.png", *SIZE, "--baked", "w.glb"), "images[0]", "an image")
