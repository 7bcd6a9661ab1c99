"""TOML scenes and meshes alone: what is said is what comes."""

import re
from math import inf

import numpy as np
import pytest
from project import ROOT
from scene_files import PLAIN, SQUARE, scene

from obscurance import ao
from obscurance.raytrace import OrenNayar
from obscurance.raytrace.camera import Camera
from obscurance.raytrace.errors import MeshError, OptionError
from obscurance.raytrace.image.texture import Texture
from obscurance.raytrace.image.write import write_image
from obscurance.raytrace.lights.sources import AmbientLight, DirectionalLight, PointLight
from obscurance.raytrace.settings import Settings
from obscurance.scenes.description.obscurance import with_obscurance
from obscurance.scenes.description.read import read_scene


def test_everything_said_arrives(tmp_path):
    made = scene(
        tmp_path,
        """
background = [0.1, 0.2, 0.3]
[camera]
position = [1, 2, 3]
target = [0, 0, 0]
up = [0, 1, 0]
field_of_view = 50
aperture = 0.1
focus = 2.5
[render]
width = 320
height = 200
samples = 4
shading = "gouraud"
shadows = false
terminator = false
crop = [10, 20, 30, 40]
seed = 7
normals = "area"
[obscurance]
form = "ambient and diffuse"
falloff = "exponential"
tau = 2.0
max_distance = "25%"
samples = 64
seed = 3
[[materials]]
name = "chalk"
model = "oren_nayar"
albedo = 0.9
sigma = 0.3
[[objects]]
name = "it"
mesh = "square.obj"
material = "chalk"
texture = "paint.png"
wrap = ["clamp_to_edge", "mirrored_repeat"]
translate = [1, 0, 0]
rotate = [0, 0, 90]
scale = 2
[[lights]]
light = "point"
position = [0, 0, 5]
intensity = [10, 20, 30]
[[lights]]
light = "ambient"
intensity = 0.2
""",
    )
    assert made.camera == Camera((1, 2, 3), (0, 0, 0), (0, 1, 0), 50, aperture=0.1, focus=2.5)
    form, crop = "ambient and diffuse", (10, 20, 30, 40)
    assert made.settings == Settings(320, 200, 4, "gouraud", form, False, False, crop, 7, "area")
    assert made.w_from == "bake"
    assert made.bake.falloff == ao.Exponential(tau=2.0, max_distance="25%")
    assert (made.bake.samples, made.bake.seed) == (64, 3)
    assert made.scene.background == (0.1, 0.2, 0.3)
    assert made.scene.lights == (PointLight(position=(0, 0, 5), intensity=(10, 20, 30)), AmbientLight(intensity=0.2))
    (item,) = made.scene.objects
    assert item.name == "it"
    assert item.shape.material == OrenNayar(albedo=0.9, sigma=0.3)
    assert item.shape.texture == Texture(tmp_path / "paint.png", wrap=("clamp_to_edge", "mirrored_repeat"))
    np.testing.assert_allclose(item.transform @ [1, 0, 0, 1], [1, 2, 0, 1], atol=1e-15)


def test_the_shortest_scene_has_defaults(tmp_path):
    made = scene(tmp_path, PLAIN)
    assert made.settings == Settings()
    assert made.w_from == "bake"
    assert made.bake.falloff == ao.Exponential()
    assert [type(light) for light in made.scene.lights] == [DirectionalLight] * 3 + [AmbientLight]


def test_size_in_place_of_the_files_own(tmp_path):
    scene(tmp_path, "[render]\nwidth = 100\nheight = 100\n" + PLAIN)
    made = read_scene(tmp_path / "scene.toml", (400, 300))
    assert (made.settings.width, made.settings.height) == (400, 300)
    with pytest.raises(OptionError, match="render: width: expected a whole number from 1 to 32768, got 0"):
        read_scene(tmp_path / "scene.toml", (0, 300))


@pytest.mark.parametrize("extra", ["", "direction = [1, 0, 0.2]\n", "field_of_view = 70\n", "up = [0, 1, 0]\n"])
@pytest.mark.parametrize("size", [(200, 100), (100, 200)])
def test_automatic_framing_sees_every_vertex_and_little_else(tmp_path, extra, size):
    width, height = size
    made = scene(tmp_path, f"[camera]\n{extra}[render]\nwidth = {width}\nheight = {height}\n" + PLAIN)
    right, above, forward = made.camera.axes()
    offset = made.scene.flattened().vertices - made.camera.position
    half = np.tan(np.radians(made.camera.field_of_view / 2))
    x, y = offset @ right / (offset @ forward) / half / (width / height), offset @ above / (offset @ forward) / half
    assert (offset @ forward > 0).all()
    assert 0.8 < max(np.abs(x).max(), np.abs(y).max()) <= 1


def test_an_orthographic_camera(tmp_path):
    made = scene(tmp_path, "[camera]\nposition = [0, 0, 9]\ntarget = [0, 0, 0]\nup = [0, 1, 0]\nheight = 3\n" + PLAIN)
    assert made.camera.height == 3
    made = scene(tmp_path, "[camera]\ndirection = [0, -1, 1]\nheight = 3\naperture = 0.5\n" + PLAIN)
    assert (made.camera.height, made.camera.aperture) == (3, 0.5)


POINT = np.array([1.0, 2.0, 3.0, 1.0])


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("translate = [1, 1, 1]", [2, 3, 4]),
        ("scale = 2", [2, 4, 6]),
        ("scale = [1, 2, -1]", [1, 4, -3]),
        ("rotate = [90, 0, 0]", [1, -3, 2]),
        ("rotate = [90, 0, 90]", [3, 1, 2]),
        ("axis = [0, 0, 5]\nangle = 90", [-2, 1, 3]),
        ("scale = 2\nrotate = [0, 0, 90]\ntranslate = [1, 0, 0]", [-3, 2, 6]),
        ("matrix = [[0, 0, 1, 5], [1, 0, 0, 6], [0, 1, 0, 7], [0, 0, 0, 1]]", [8, 7, 9]),
    ],
)
def test_transforms(tmp_path, text, expected):
    (item,) = scene(tmp_path, PLAIN + text).scene.objects
    np.testing.assert_allclose((item.transform @ POINT)[:3], expected, atol=1e-12)


def test_copies_share_one_shape_and_follow_the_objects_own_transform(tmp_path):
    text = PLAIN + 'name = "tile"\nscale = 2\ncopies = [{ translate = [1, 0, 0] }, { rotate = [0, 0, 90] }]'
    objects = scene(tmp_path, text).scene.objects
    assert [item.name for item in objects] == ["tile 0", "tile 1"]
    assert objects[0].shape is objects[1].shape
    np.testing.assert_allclose((objects[0].transform @ POINT)[:3], [3, 4, 6])
    np.testing.assert_allclose((objects[1].transform @ POINT)[:3], [-4, 2, 6], atol=1e-12)


def test_what_is_the_same_is_one_shape(tmp_path):
    mesh = '[[objects]]\nmesh = "square.obj"\n'
    text = (
        mesh + mesh + mesh + 'material = "gold"\n' + mesh + "own_normals = false\n" + mesh + 'texture = "paint.png"\n'
    )
    shapes = [item.shape for item in scene(tmp_path, text + PLAIN + PLAIN).scene.objects]
    assert shapes[0] is shapes[1]
    assert shapes[5] is shapes[6]
    assert len({id(shape) for shape in shapes}) == 5
    assert shapes[2].mesh is shapes[0].mesh
    assert shapes[0].mesh.normals is not None
    assert shapes[3].mesh.normals is None


def test_a_texture_on_an_obj_splits_vertices_at_seams_only(tmp_path):
    mesh = '[[objects]]\nmesh = "square.obj"\n'
    plain, textured = scene(tmp_path, mesh + mesh + 'texture = "paint.png"\n').scene.objects
    assert len(plain.shape.mesh.vertices) == 4
    shape = textured.shape
    assert len(shape.mesh.vertices) == 5
    corners = shape.mesh.vertices[shape.mesh.faces]
    np.testing.assert_array_equal(corners, plain.shape.mesh.vertices[plain.shape.mesh.faces])
    expected = [[[0, 0], [1, 0], [1, 1]], [[0.5, 0.5], [1, 1], [0, 1]]]
    np.testing.assert_array_equal(shape.uv[shape.mesh.faces], expected)
    np.testing.assert_array_equal(shape.mesh.normals, [[0, 0, 1]] * 5)


def test_files_in_a_folder_below(tmp_path):
    text = '[[objects]]\nmesh = "parts/deep/it.obj"\n'
    (item,) = scene(tmp_path, text, **{"parts/deep/it.obj": SQUARE}).scene.objects
    assert item.name == "it"


def test_own_material_named_as_a_preset_wins(tmp_path):
    text = '[[materials]]\nname = "clay"\npreset = "clay"\nsigma = 0.1\n' + PLAIN + 'material = "clay"'
    assert scene(tmp_path, text).scene.objects[0].shape.material.sigma == 0.1


def test_obscurance_off_baked_and_binary(tmp_path):
    off = scene(tmp_path, '[obscurance]\nform = "off"\n' + PLAIN)
    assert (off.settings.obscurance, off.w_from) == ("off", "off")
    text = '[obscurance]\nbaked = "w.npy"\n' + PLAIN
    assert scene(tmp_path, text, **{"w.npy": "-"}).w_from == tmp_path / "w.npy"
    binary = scene(tmp_path, '[obscurance]\nfalloff = "binary"\nmax_distance = inf\n' + PLAIN)
    assert binary.bake.falloff == ao.Binary(inf)
    smooth = scene(tmp_path, '[obscurance]\nfalloff = "smooth"\nmax_distance = "30%"\n' + PLAIN)
    assert smooth.bake.falloff == ao.Smooth("30%")
    (tmp_path / "mu.csv").write_text("0,0\n1,.2\n3,1\n")
    table = scene(tmp_path, '[obscurance]\nfalloff = "table:mu.csv"\n' + PLAIN)
    assert table.bake.falloff == ao.Tabulated(["0", "1", "3"], [0, 0.2, 1])
    assert tmp_path / "mu.csv" in table.files


def test_a_utf8_scene_with_byte_order_mark_and_windows_lines(tmp_path):
    text = "\ufeff" + PLAIN.replace("\n", "\r\n") + 'name = "Würfel"\r\n'
    assert scene(tmp_path, text).scene.objects[0].name == "Würfel"


def test_a_mesh_alone(tmp_path):
    (tmp_path / "it.obj").write_text(SQUARE)
    made = read_scene(tmp_path / "it.obj")
    (item,) = made.scene.objects
    assert item.name == "it"
    assert len(item.shape.mesh.vertices) == 4
    assert len(made.scene.lights) == 4
    assert made.camera.up == (0, 1, 0)
    stl = (
        "solid s\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid"
    )
    (tmp_path / "it.stl").write_text(stl)
    assert read_scene(tmp_path / "it.stl").camera.up == (0, 0, 1)
    with pytest.raises(MeshError, match=r"it\.xyz: ending"):
        read_scene((tmp_path / "it.obj").rename(tmp_path / "it.xyz"))


def test_obscurance_comes_as_it_was_asked(tmp_path):
    corner = '[[objects]]\nbuiltin = "plane"\nfineness = 0.25\n'
    corner += "copies = [{ translate = [0.5, 0, 0] }, { rotate = [0, 90, 0] }]"
    small = "[render]\nwidth = 32\nheight = 32\n"
    made = scene(tmp_path, small + "[obscurance]\nsamples = 64\n" + corner)
    baked, bake = with_obscurance(made)
    w = np.concatenate([item.w for item in baked.objects])
    np.testing.assert_array_equal(w, bake.w)
    assert w.min() < 0.8

    np.save(tmp_path / "w.npy", w.astype(np.float32))
    again, none = with_obscurance(scene(tmp_path, '[obscurance]\nbaked = "w.npy"\n' + corner))
    assert none is None
    np.testing.assert_array_equal(np.concatenate([item.w for item in again.objects]), w.astype(np.float32))

    off, none = with_obscurance(scene(tmp_path, '[obscurance]\nform = "off"\n' + corner))
    assert none is None
    assert all(item.w is None for item in off.objects)


SKY = '[[lights]]\nlight = "sky"\nzenith = 1\nhorizon = 0.5\n'


def test_bent_normals_come_with_a_sky(tmp_path):
    corner = SKY + '[[objects]]\nbuiltin = "plane"\nfineness = 0.5\ncopies = [{ }, { rotate = [0, 90, 0] }]\n'
    small = "[render]\nwidth = 8\nheight = 8\n[obscurance]\nsamples = 64\n"
    baked, bake = with_obscurance(scene(tmp_path, small + corner))
    found = np.concatenate([item.bent_normals for item in baked.objects])
    np.testing.assert_array_equal(found, bake.bent_normals)
    baked, _ = with_obscurance(scene(tmp_path, small + corner.replace(SKY, "")))
    assert all(item.bent_normals is None for item in baked.objects)


def test_environment_images_and_grains_are_files_of_the_scene(tmp_path):
    for name in ("sky.png", "grain.png"):
        write_image(tmp_path / name, np.full((2, 4, 3), 0.5))
    made = scene(
        tmp_path,
        '[[lights]]\nlight = "environment"\nimage = "sky.png"\nturn = 30\n'
        '[[objects]]\nbuiltin = "plane"\nmaterial = "rolled_brass"\ngrain = "grain.png"\nwrap = "clamp_to_edge"\n',
    )
    (light,), (item,) = made.scene.lights, made.scene.objects
    assert light.image == tmp_path / "sky.png"
    assert light.turn == 30
    assert item.shape.grain.path == tmp_path / "grain.png"
    assert not item.shape.grain.srgb
    assert item.shape.grain.wrap == ("clamp_to_edge", "clamp_to_edge")
    assert {tmp_path / "sky.png", tmp_path / "grain.png"} <= set(made.files)


def test_the_example_in_the_documentation_is_a_scene(tmp_path):
    page = (ROOT / "docs" / "scenes.md").read_text(encoding="utf-8")
    (example,) = re.findall(r"```toml\n(.*?)```", page, re.DOTALL)
    files = {"models/vase.obj": SQUARE, "models/checker.png": "-"}
    made = scene(tmp_path, example, **files)
    assert len(made.scene.objects) == 5
    assert made.scene.lights[1].half_angle == 25
