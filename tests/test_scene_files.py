"""TOML scenes: what is said is what comes, and every mistake is one line with its place."""

import re
from math import inf, radians
from pathlib import Path

import numpy as np
import pytest

import ao
from raytrace.camera import Camera
from raytrace.errors import InputError, MeshError, OptionError, SceneError
from raytrace.lights import AmbientLight, DirectionalLight, PointLight
from raytrace.materials import OrenNayar
from raytrace.settings import Settings
from scenes.obscured import obscured
from scenes.read import read_scene

CUBE = """\
v 0 0 0
v 1 0 0
v 1 1 0
v 0 1 0
vt 0 0
vt 1 0
vt 1 1
vt 0 1
vt .5 .5
vn 0 0 1
f 1/1/1 2/2/1 3/3/1
f 1/5/1 3/3/1 4/4/1
"""
PLAIN = '[[objects]]\nbuiltin = "plane"\nfineness = 0.5\n'


def scene(folder, text, **files):
    """The scene of a TOML text in a folder with `square.obj`, `paint.png` and more files."""
    folder.mkdir(exist_ok=True)
    contents = {"square.obj": CUBE, "paint.png": "any content: it is read when a ray has seen it", "scene.toml": text}
    for name, content in {**contents, **files}.items():
        target = folder / name
        target.parent.mkdir(exist_ok=True, parents=True)
        target.write_bytes(content if isinstance(content, bytes) else content.encode())
    return read_scene(folder / "scene.toml")


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
[obscurance]
form = "book"
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
    assert made.settings == Settings(320, 200, 4, "gouraud", "book", False, False, (10, 20, 30, 40), 7)
    assert made.bake.source == "bake"
    assert made.bake.falloff == ao.Exponential(tau=2.0, max_distance="25%")
    assert (made.bake.samples, made.bake.seed) == (64, 3)
    assert made.scene.background == (0.1, 0.2, 0.3)
    assert made.scene.lights == (
        PointLight(position=(0, 0, 5), intensity=(10, 20, 30)),
        AmbientLight(intensity=0.2),
    )
    (item,) = made.scene.objects
    assert item.name == "it"
    assert item.shape.material == OrenNayar(albedo=0.9, sigma=0.3)
    assert item.shape.texture.path == tmp_path / "paint.png"
    np.testing.assert_allclose(item.transform @ [1, 0, 0, 1], [1, 2, 0, 1], atol=1e-15)


def test_the_shortest_scene_has_defaults(tmp_path):
    made = scene(tmp_path, PLAIN)
    assert made.settings == Settings()
    assert made.bake.source == "bake"
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
    (item,) = scene(tmp_path, text, **{"parts/deep/it.obj": CUBE}).scene.objects
    assert item.name == "it"


def test_own_material_named_as_a_preset_wins(tmp_path):
    text = '[[materials]]\nname = "clay"\npreset = "clay"\nsigma = 0.1\n' + PLAIN + 'material = "clay"'
    assert scene(tmp_path, text).scene.objects[0].shape.material.sigma == 0.1


def test_obscurance_off_baked_and_binary(tmp_path):
    off = scene(tmp_path, '[obscurance]\nform = "off"\n' + PLAIN)
    assert (off.settings.obscurance, off.bake.source) == ("off", "off")
    text = '[obscurance]\nbaked = "w.npy"\n' + PLAIN
    assert scene(tmp_path, text, **{"w.npy": "-"}).bake.source == tmp_path / "w.npy"
    binary = scene(tmp_path, '[obscurance]\nfalloff = "binary"\nmax_distance = inf\n' + PLAIN)
    assert binary.bake.falloff == ao.Binary(inf)


def test_a_utf8_scene_with_byte_order_mark_and_windows_lines(tmp_path):
    text = "\ufeff" + PLAIN.replace("\n", "\r\n") + 'name = "Würfel"\r\n'
    assert scene(tmp_path, text).scene.objects[0].name == "Würfel"


MISTAKES = {
    "objects: expected at least one, got nothing": "background = 0.1",
    "objects: expected at least one, got none": "objects = []",
    "objects: expected": "objects = 3",
    'objects[0]: expected a table, got "x"': 'objects = ["x"]',
    "line 2, column 8: expected valid TOML, got a mistake": "a = 1\n[camera\n",
    "end of document: expected valid TOML": "a = [1,",
    "sky: expected one of background, camera, render, obscurance, materials, objects, lights, got an unknown key": (
        "sky = 1\n" + PLAIN
    ),
    "objects[0]: expected either mesh or builtin, got neither": '[[objects]]\nmaterial = "gold"',
    "objects[0]: expected either mesh or builtin, got both": PLAIN + 'mesh = "square.obj"',
    "objects[1].material: expected one of": PLAIN + PLAIN + 'material = "glod"',
    'vinyl_record, white_standard, got "glod"': PLAIN + 'material = "glod"',
    "objects[0].material: expected a name or a table, got 3": PLAIN + "material = 3",
    "objects[0].material.albedo[0]: expected a number in [0, 1], got 2": (
        PLAIN + 'material = { model = "lambert", albedo = 2 }'
    ),
    "objects[0].material.model: expected one of": PLAIN + 'material = { model = "lambret" }',
    "objects[0].material.model: expected a value": PLAIN + "material = { albedo = 1 }",
    "objects[0].'a\\nb': expected one of": PLAIN + '"a\\nb" = 1',
    "objects[0].radius: expected one of fineness, size, name, builtin, material": PLAIN + "radius = 2",
    "objects[0].colour: expected one of name, mesh, material": '[[objects]]\nmesh = "square.obj"\ncolour = 1',
    'objects[0].builtin: expected one of plane, box, sphere, cylinder, temple, sponge, got "cone"': (
        '[[objects]]\nbuiltin = "cone"'
    ),
    "objects[0].size[1]: expected a number in [1e-100, 1e100], got 0": PLAIN + "size = [1, 0]",
    "objects[0].radius: expected a number in [1e-100, 1e100], got nan": '[[objects]]\nbuiltin = "sphere"\nradius = nan',
    "objects[0].level: expected": '[[objects]]\nbuiltin = "sponge"\nlevel = 9',
    "objects[0].fineness: expected a length that makes at most": '[[objects]]\nbuiltin = "box"\nfineness = 1e-9',
    'objects[0].mesh: expected an existing file, got "none.obj"': '[[objects]]\nmesh = "none.obj"',
    'objects[0].mesh: expected a file, got "folder"': '[[objects]]\nmesh = "folder"',
    'objects[0].mesh: expected a path in the scene\'s folder or below, got "../x.obj"': (
        '[[objects]]\nmesh = "../x.obj"'
    ),
    'objects[0].mesh: expected a path in the scene\'s folder or below, got "/etc/passwd"': (
        '[[objects]]\nmesh = "/etc/passwd"'
    ),
    'objects[0].mesh: expected a path in the scene\'s folder or below, got "http://a.b/x.obj"': (
        '[[objects]]\nmesh = "http://a.b/x.obj"'
    ),
    'objects[0].mesh: expected a path in the scene\'s folder or below, got "..\\x.obj"': (
        "[[objects]]\nmesh = '..\\x.obj'"
    ),
    'objects[0].mesh: expected a path in the scene\'s folder or below, got "c:x.obj"': '[[objects]]\nmesh = "c:x.obj"',
    'objects[0].mesh: expected a path in the scene\'s folder or below, got "out.obj", a link out of it': (
        '[[objects]]\nmesh = "out.obj"'
    ),
    'objects[0].mesh: expected a path in the scene\'s folder or below, got ""': '[[objects]]\nmesh = ""',
    "objects[0].mesh: expected a readable file": '[[objects]]\nmesh = "a\\u0000b"',
    "broken.obj: content: expected a complete and valid OBJ file": '[[objects]]\nmesh = "broken.obj"',
    "paint.png: ending: expected one of obj": '[[objects]]\nmesh = "paint.png"',
    'objects[0].texture: expected an existing file, got "no.png"': PLAIN + 'texture = "no.png"',
    "objects[0].texture: expected a mesh with texture coordinates, got one without": (
        '[[objects]]\nbuiltin = "sponge"\nlevel = 1\ntexture = "paint.png"'
    ),
    "plain.obj: vt: expected texture coordinates": '[[objects]]\nmesh = "plain.obj"\ntexture = "paint.png"',
    'objects[0].translate[0]: expected a number, got "1"': PLAIN + 'translate = ["1", 0, 0]',
    "objects[0].translate": PLAIN + "translate = [1, 0]",
    "objects[0].translate[2]: expected a finite number, got nan": PLAIN + "translate = [1, 0, nan]",
    "objects[0].scale: expected numbers other than 0": PLAIN + "scale = 0",
    "objects[0].axis: expected axis and angle together, got one alone": PLAIN + "angle = 3",
    "objects[0].axis: expected a vector other than zero": PLAIN + "axis = [0, 0, 0]\nangle = 3",
    "objects[0].rotate: expected either rotate, or axis and angle, got both": (
        PLAIN + "rotate = [0, 0, 0]\naxis = [0, 0, 1]\nangle = 3"
    ),
    "objects[0].matrix: expected nothing beside it, got scale": (
        PLAIN + "scale = 2\nmatrix = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]"
    ),
    "objects[0].matrix: expected four rows of four numbers": PLAIN + "matrix = [[1, 0], [0, 1]]",
    "objects[0].matrix: expected an invertible matrix": (
        PLAIN + "matrix = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 0], [0, 0, 0, 1]]"
    ),
    "objects[0].copies: expected at least one, got none": PLAIN + "copies = []",
    "objects[0].copies[1].scale: expected numbers other than 0": PLAIN + "copies = [{}, { scale = [1, 0, 1] }]",
    "objects[0].copies[0].mesh: expected one of translate, rotate": PLAIN + 'copies = [{ mesh = "square.obj" }]',
    'objects[0].own_normals: expected true or false, got "no"': PLAIN + 'own_normals = "no"',
    "materials[0].name: expected a name on one line, got nothing": (
        '[[materials]]\nmodel = "lambert"\nalbedo = 1\n' + PLAIN
    ),
    'materials[1].name: expected a name of its own, got "a" again': (
        2 * '[[materials]]\nname = "a"\npreset = "gold"\n' + PLAIN
    ),
    "materials[0].preset: expected one of": '[[materials]]\nname = "a"\npreset = "glod"\n' + PLAIN,
    "materials[0].albdo: expected no such field": (
        '[[materials]]\nname = "a"\nmodel = "lambert"\nalbdo = 1\nalbedo = 1\n' + PLAIN
    ),
    "lights[0].intensity[0]: expected a number in [0, inf), got nan": (
        PLAIN + '[[lights]]\nlight = "ambient"\nintensity = nan'
    ),
    "lights[1].position: expected a value, got nothing": (
        PLAIN + '[[lights]]\nlight = "ambient"\n[[lights]]\nlight = "point"'
    ),
    "lights[0].light: expected one of": PLAIN + '[[lights]]\nlight = "laser"',
    "lights[0].half_angle: expected a number in": (
        PLAIN + '[[lights]]\nlight = "spot"\nposition = [0, 0, 1]\ndirection = [0, 0, -1]\nhalf_angle = 45'
    ),
    "camera.field_of_view: expected degrees above 0 and below 180, got 180": "[camera]\nfield_of_view = 180\n" + PLAIN,
    "camera.target: expected position and target together, got nothing": "[camera]\nposition = [1, 2, 3]\n" + PLAIN,
    "camera.target: expected a point other than position": (
        "[camera]\nposition = [1, 2, 3]\ntarget = [1, 2, 3]\n" + PLAIN
    ),
    "camera.up: expected a direction other than the view's": (
        "[camera]\nposition = [0, 0, 3]\ntarget = [0, 0, 0]\n" + PLAIN
    ),
    "camera.direction: expected either direction, or position and target, got both": (
        "[camera]\nposition = [1, 0, 3]\ntarget = [0, 0, 0]\ndirection = [1, 0, 0]\n" + PLAIN
    ),
    "camera.direction: expected a vector other than zero": "[camera]\ndirection = [0, 0, 0]\n" + PLAIN,
    "camera.height: expected either height or field_of_view, got both": (
        "[camera]\nheight = 3\nfield_of_view = 30\n" + PLAIN
    ),
    "camera.aperture: expected a finite length of 0 or more, got -1": "[camera]\naperture = -1\n" + PLAIN,
    "camera.fov: expected one of position, target, direction, up": "[camera]\nfov = 3\n" + PLAIN,
    "camera: expected a table, got 3": "camera = 3\n" + PLAIN,
    "render.width: expected a whole number from 1 to 32768, got 0": "[render]\nwidth = 0\n" + PLAIN,
    "render.width: expected a whole number, got 10.0": "[render]\nwidth = 10.0\n" + PLAIN,
    "render.samples: expected a whole number, got True": "[render]\nsamples = true\n" + PLAIN,
    "render.shading: expected one of constant, gouraud, phong, quadratic, got flat": (
        '[render]\nshading = "flat"\n' + PLAIN
    ),
    "render.crop: expected a part of 960×640 pixels": "[render]\ncrop = [0, 0, 961, 1]\n" + PLAIN,
    "render.obscurance: expected one of width": '[render]\nobscurance = "off"\n' + PLAIN,
    'obscurance.form: expected one of off, ambient, book, got "on"': '[obscurance]\nform = "on"\n' + PLAIN,
    'obscurance.falloff: expected one of exponential, binary, got "linear"': (
        '[obscurance]\nfalloff = "linear"\n' + PLAIN
    ),
    'obscurance.tau: expected falloff = "exponential" with it, got 1.0': (
        '[obscurance]\nfalloff = "binary"\ntau = 1\n' + PLAIN
    ),
    "obscurance.tau: expected either tau or half_distance, got both": (
        "[obscurance]\nhalf_distance = 1\ntau = 1\n" + PLAIN
    ),
    "obscurance.tau: expected a finite rate above 0, got 0.0": "[obscurance]\ntau = 0\n" + PLAIN,
    "obscurance.max_distance: expected a length above 0": '[obscurance]\nmax_distance = "-3%"\n' + PLAIN,
    "obscurance.half_distance: expected a length": "[obscurance]\nhalf_distance = true\n" + PLAIN,
    "obscurance.samples: expected a whole number from 1 to": "[obscurance]\nsamples = 0\n" + PLAIN,
    "obscurance.seed: expected a whole number from 0 to": "[obscurance]\nseed = -1\n" + PLAIN,
    'obscurance.samples: expected nothing beside form = "off", got 3': (
        '[obscurance]\nform = "off"\nsamples = 3\n' + PLAIN
    ),
    "obscurance.seed: expected nothing beside baked but form, got 3": (
        '[obscurance]\nbaked = "w.npy"\nseed = 3\n' + PLAIN
    ),
    'obscurance.baked: expected an existing file, got "none.npy"': '[obscurance]\nbaked = "none.npy"\n' + PLAIN,
    'obscurance.baked: expected a name ending in .npy, .npz, got "paint.png"': (
        '[obscurance]\nbaked = "paint.png"\n' + PLAIN
    ),
}


@pytest.mark.parametrize(("message", "text"), MISTAKES.items(), ids=[m[:50] for m in MISTAKES])
def test_a_mistake_is_one_line_with_its_path(tmp_path, message, text):
    folder = tmp_path / "inside"
    (folder / "folder").mkdir(parents=True)
    (tmp_path / "x.obj").write_text(CUBE)
    (folder / "out.obj").symlink_to(tmp_path / "x.obj")
    plain = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
    with pytest.raises(SceneError) as caught:
        scene(folder, text, **{"broken.obj": "v a b c\nf 1 2 3\n", "plain.obj": plain, "w.npy": "-"})
    line = str(caught.value)
    assert line.startswith(str(folder / "scene.toml"))
    assert message in line
    assert "\n" not in line
    assert len(line) < 500


def test_not_utf8(tmp_path):
    with pytest.raises(SceneError, match=re.escape("scene.toml: line 2: expected UTF-8, got byte 0xff")):
        scene(tmp_path, b"# fine\n# \xff\n")


@pytest.mark.parametrize("content", [b"", b" \n\t\n"])
def test_an_empty_file(tmp_path, content):
    with pytest.raises(SceneError, match=r"scene\.toml: content: expected a TOML scene, got an empty file"):
        scene(tmp_path, content)


@pytest.mark.parametrize("ending", ["toml", "glb", "gltf", "ply"])
def test_missing_files_and_folders(tmp_path, ending):
    with pytest.raises(InputError, match=f"none.{ending}: file: expected an existing file, got none"):
        read_scene(tmp_path / f"none.{ending}")
    (tmp_path / f"folder.{ending}").mkdir()
    with pytest.raises(InputError, match=f"folder.{ending}: file: expected .*, got a folder"):
        read_scene(tmp_path / f"folder.{ending}")


def test_hostile_toml(tmp_path):
    for text in ("a = " + "[" * 100_000, "a." * 3000 + "b = 1", "width = " + "9" * 5000, PLAIN + "scale = 1e-200"):
        with pytest.raises(SceneError) as caught:
            scene(tmp_path, text)
        assert len(str(caught.value)) < 1000 + len(str(tmp_path))


def test_a_mesh_alone(tmp_path):
    (tmp_path / "it.obj").write_text(CUBE)
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
    baked, bake = obscured(made)
    w = np.concatenate([item.w for item in baked.objects])
    np.testing.assert_array_equal(w, bake.w)
    assert w.min() < 0.8

    np.save(tmp_path / "w.npy", w.astype(np.float32))
    again, none = obscured(scene(tmp_path, '[obscurance]\nbaked = "w.npy"\n' + corner))
    assert none is None
    np.testing.assert_array_equal(np.concatenate([item.w for item in again.objects]), w.astype(np.float32))

    off, none = obscured(scene(tmp_path, '[obscurance]\nform = "off"\n' + corner))
    assert none is None
    assert all(item.w is None for item in off.objects)


def test_a_baked_file_of_something_else(tmp_path):
    made = scene(tmp_path, '[obscurance]\nbaked = "w.npy"\n' + PLAIN, **{"w.npy": "no array"})
    with pytest.raises(SceneError, match=r"w\.npy: content: expected w as obscurance bake writes it"):
        obscured(made)
    np.save(tmp_path / "w.npy", np.ones(3))
    with pytest.raises(SceneError, match=r"w.npy: w: expected shape \(9,\), .*, got \(3,\)"):
        obscured(made)
    np.save(tmp_path / "w.npy", np.full(9, 2.0))
    with pytest.raises(SceneError, match=r"w.npy: w: expected values in \[0, 1\]"):
        obscured(made)
    zipped = scene(tmp_path, '[obscurance]\nbaked = "w.npz"\n' + PLAIN, **{"w.npz": "no archive"})
    with pytest.raises(SceneError, match=r"w\.npz: content"):
        obscured(zipped)
    np.savez(tmp_path / "w.npz", w=np.linspace(0, 1, 9))
    assert obscured(zipped)[0].objects[0].w[-1] == 1


def test_the_example_in_the_documentation_is_a_scene(tmp_path):
    page = (Path(__file__).parent.parent / "docs" / "scenes.md").read_text(encoding="utf-8")
    (example,) = re.findall(r"```toml\n(.*?)```", page, re.DOTALL)
    files = {"models/vase.obj": CUBE, "models/checker.png": "-"}
    made = scene(tmp_path, example, **files)
    assert len(made.scene.objects) == 5
    assert made.scene.lights[1].half_angle == pytest.approx(radians(25), abs=1e-3)
