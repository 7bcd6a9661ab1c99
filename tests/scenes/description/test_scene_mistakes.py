"""Scene files: every mistake is one line with its place."""

import re

import numpy as np
import pytest
from command import refused_without_a_trace
from scene_files import PLAIN, SQUARE, scene, written

from obscurance.raytrace.errors import InputError, SceneError
from obscurance.scenes.description.obscurance import with_obscurance
from obscurance.scenes.description.read import read_scene

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
    'vinyl_record, white_standard, got "glod"': PLAIN + 'material = "glod"',
    "objects[0].material: expected a name or a table, got 3": PLAIN + "material = 3",
    "objects[0].'a\\nb': expected one of": PLAIN + '"a\\nb" = 1',
    "objects[0].radius: expected one of fineness, size, name, builtin, material": PLAIN + "radius = 2",
    "objects[0].colour: expected one of name, mesh, material": '[[objects]]\nmesh = "square.obj"\ncolour = 1',
    'objects[0].builtin: expected one of plane, box, sphere, cylinder, temple, sponge, got "cone"': (
        '[[objects]]\nbuiltin = "cone"'
    ),
    "objects[0].size[1]: expected a number in [1e-100, 1e100], got 0": PLAIN + "size = [1, 0]",
    "objects[0].radius: expected a number in [1e-100, 1e100], got nan": '[[objects]]\nbuiltin = "sphere"\nradius = nan',
    "objects[0].level: expected": '[[objects]]\nbuiltin = "sponge"\nlevel = 9',
    "objects[0].fineness: expected at most 1,500,000 triangles": '[[objects]]\nbuiltin = "box"\nfineness = 1e-9',
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
    "paint.png: ending: expected that of 3MF": '[[objects]]\nmesh = "paint.png"',
    'objects[0].texture: expected an existing file, got "no.png"': PLAIN + 'texture = "no.png"',
    "objects[0].texture: expected a mesh with texture coordinates, got one without": (
        '[[objects]]\nbuiltin = "sponge"\nlevel = 1\ntexture = "paint.png"'
    ),
    'objects[0].wrap: expected one or two of repeat, mirrored_repeat, clamp_to_edge, got "clamp"': (
        PLAIN + 'texture = "paint.png"\nwrap = "clamp"'
    ),
    "objects[0].wrap: expected one or two of": PLAIN + 'texture = "paint.png"\nwrap = ["repeat", 3]',
    'objects[0].grain: expected an existing file, got "no.png"': PLAIN + 'material = "rolled_brass"\ngrain = "no.png"',
    "objects[0].grain: expected a mesh with texture coordinates, got one without": (
        '[[objects]]\nbuiltin = "sponge"\nlevel = 1\nmaterial = "rolled_brass"\ngrain = "paint.png"'
    ),
    "objects[0].grain: expected an anisotropic material without a grain of its own": PLAIN + 'grain = "paint.png"',
    "objects[0].wrap: expected texture, grain or opacity_texture with it, got none": PLAIN + 'wrap = "repeat"',
    'objects[0].material.two_sided: expected true, false or "viewer", got light': (
        PLAIN + 'material = { model = "lambert", albedo = 1, two_sided = "light" }'
    ),
    "objects[0].texture: expected a mesh with texture coordinates, got one": (
        '[[objects]]\nmesh = "plain.obj"\ntexture = "paint.png"'
    ),
    'objects[0].translate[0]: expected a number, got "1"': PLAIN + 'translate = ["1", 0, 0]',
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
    "materials[0].albdo: expected one of emission, two_sided, albedo, k_a, model, got an unknown key; did you mean": (
        '[[materials]]\nname = "a"\nmodel = "lambert"\nalbdo = 1\nalbedo = 1\n' + PLAIN
    ),
    "lights[0].intensity[0]: expected a number in [0, inf), got nan": (
        PLAIN + '[[lights]]\nlight = "ambient"\nintensity = nan'
    ),
    "lights[1].position: expected a value, got nothing": (
        PLAIN + '[[lights]]\nlight = "ambient"\n[[lights]]\nlight = "point"'
    ),
    'lights[0].image: expected an existing file, got "none.hdr"': (
        PLAIN + '[[lights]]\nlight = "environment"\nimage = "none.hdr"'
    ),
    "lights[0].image: expected a path in the scene's folder or below": (
        PLAIN + '[[lights]]\nlight = "environment"\nimage = "../none.hdr"'
    ),
    "lights[0].image: expected the path of an image, got 3": PLAIN + '[[lights]]\nlight = "environment"\nimage = 3',
    "lights[0].zenith: expected a value, got nothing": PLAIN + '[[lights]]\nlight = "sky"\nhorizon = 1',
    "lights[0].up: expected a vector other than zero": (
        PLAIN + '[[lights]]\nlight = "sky"\nzenith = 1\nhorizon = 1\nup = [0, 0, 0]'
    ),
    "lights[0].half_angle: expected degrees in (0, 90], got 95": (
        PLAIN + '[[lights]]\nlight = "spot"\nposition = [0, 0, 1]\ndirection = [0, 0, -1]\nhalf_angle = 95'
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
    "camera: expected a table, got 3": "camera = 3\n" + PLAIN,
    "render.width: expected a whole number from 1 to 32768, got 0": "[render]\nwidth = 0\n" + PLAIN,
    "render.samples: expected a whole number from 1 to 4096, got True": "[render]\nsamples = true\n" + PLAIN,
    "render.shading: expected one of constant, flat, gouraud, phong, quadratic, got smooth": (
        '[render]\nshading = "smooth"\n' + PLAIN
    ),
    "render.normals: expected one of file, angle, area, equal, got own": '[render]\nnormals = "own"\n' + PLAIN,
    "render.crop: expected a part of 960×640 pixels": "[render]\ncrop = [0, 0, 961, 1]\n" + PLAIN,
    "render.obscurance: expected one of width": '[render]\nobscurance = "off"\n' + PLAIN,
    'obscurance.form: expected one of off, ambient, ambient and diffuse, got "on"': '[obscurance]\nform = "on"\n'
    + PLAIN,
    "obscurance.falloff: expected one of exponential, binary, linear, smooth, table:FILE, got cubic": (
        '[obscurance]\nfalloff = "cubic"\n' + PLAIN
    ),
    'obscurance.falloff = "linear" needs max_distance': '[obscurance]\nfalloff = "linear"\n' + PLAIN,
    "obscurance.falloff: expected a path in the scene's folder": '[obscurance]\nfalloff = "table:../t.csv"\n' + PLAIN,
    'obscurance.tau needs falloff = "exponential"': ('[obscurance]\nfalloff = "binary"\ntau = 1\n' + PLAIN),
    "obscurance.tau and half_distance exclude each other": ("[obscurance]\nhalf_distance = 1\ntau = 1\n" + PLAIN),
    "obscurance.tau: expected a finite rate above 0, got 0.0": "[obscurance]\ntau = 0\n" + PLAIN,
    "obscurance.max_distance: expected a length above 0": '[obscurance]\nmax_distance = "-3%"\n' + PLAIN,
    "obscurance.samples: expected a whole number from 1 to": "[obscurance]\nsamples = 0\n" + PLAIN,
    "obscurance.seed: expected a whole number from 0 to": "[obscurance]\nseed = -1\n" + PLAIN,
    'obscurance.samples: expected nothing beside form = "off", got 3': (
        '[obscurance]\nform = "off"\nsamples = 3\n' + PLAIN
    ),
    "obscurance.seed: expected nothing beside baked but form, half_distance and power, got 3": (
        '[obscurance]\nbaked = "w.npy"\nseed = 3\n' + PLAIN
    ),
    'obscurance.baked: expected an existing file, got "none.npy"': '[obscurance]\nbaked = "none.npy"\n' + PLAIN,
    'obscurance.baked: expected a name ending in .glb, .gltf, .npy, .npz, .ply, .tif, .tiff, .vtp, got "paint.png"': (
        '[obscurance]\nbaked = "paint.png"\n' + PLAIN
    ),
}


MEANT = [
    ("[camra]\n" + PLAIN, "camra: expected one of background", "did you mean camera?"),
    ('[[object]]\nbuiltin = "box"', "object: expected one of background", "did you mean objects?"),
    ('[[objects]]\nbuiltn = "box"', "objects[0]: expected either mesh or builtin, got neither; did you mean builtin?"),
    (PLAIN + 'materiel = "gold"', "objects[0].materiel: expected one of", "did you mean material?"),
    (PLAIN + 'material = "Golden"', 'got "Golden"; did you mean gold?'),
    (PLAIN + 'material = { preset = "clya" }', "objects[0].material.preset", "got clya; did you mean clay?"),
    (PLAIN + 'material = { model = "lambrt", albedo = 1 }', "got lambrt; did you mean lambert?"),
    (PLAIN + 'material = { model = "phong", k_d = 1, exponnt = 3 }', ".exponnt: expected one of", "mean exponent?"),
    (PLAIN + 'material = { model = "lambert", albdo = 1 }', ".albdo: expected one of", "did you mean albedo?"),
    (PLAIN + 'material = { model = "lambert" }', "objects[0].material.albedo: expected a value, got nothing"),
    (PLAIN + 'material = { model = "lambert", albedo = "red" }', "albedo: expected a list of numbers, got red"),
    (PLAIN + 'material = { model = "lambert", albedo = 1.1 }', "albedo[0]: expected a number in [0, 1], got 1.1"),
    (
        PLAIN + 'material = { model = "cook_torrance", albedo = 1, m = 1, distribution = "bekmann" }',
        "distribution: expected one of beckmann, gaussian, got bekmann; did you mean beckmann?",
    ),
    ('[[objects]]\nbuiltin = "shpere"', 'got "shpere"; did you mean sphere?'),
    ('[[objects]]\nbuiltin = "sphere"\nraduis = 1', "objects[0].raduis", "did you mean radius?"),
    (PLAIN + "rotate = 90", "objects[0].rotate: expected a list of numbers, got 90"),
    (PLAIN + "translate = [1, 2]", "objects[0].translate[2]: expected a value, got nothing"),
    (PLAIN + "copies = [{ translat = [1, 2, 3] }]", "copies[0].translat: expected one of", "did you mean translate?"),
    ("[camera]\nfov = 30\n" + PLAIN, "camera.fov: expected one of", "did you mean field_of_view?"),
    ('[render]\nwidth = "big"\n' + PLAIN, 'render.width: expected a whole number from 1 to 32768, got "big"'),
    ("[render]\nshadow = true\n" + PLAIN, "render.shadow: expected one of", "did you mean shadows?"),
    ('[obscurance]\nform = "ambiant"\n' + PLAIN, 'got "ambiant"; did you mean ambient?'),
    ("[obscurance]\ntua = 1\n" + PLAIN, "obscurance.tua: expected one of", "did you mean tau?"),
    ("[obscurance]\nsamples = 1e3\n" + PLAIN, "obscurance.samples: expected a whole number, got 1000.0"),
    (PLAIN + '[[lights]]\nlight = "pont"\nposition = [0, 0, 1]', "lights[0].light", "got pont; did you mean point?"),
    (PLAIN + "[[lights]]\nposition = [0, 0, 1]", "lights[0].light: expected a value, got nothing"),
    (PLAIN + '[[lights]]\nlight = "ambient"\nintesity = 1', "lights[0].intesity", "did you mean intensity?"),
    ('background = "blue"\n' + PLAIN, 'background: expected a list of numbers, got "blue"'),
]
CASES = [(text, message) for message, text in MISTAKES.items()] + MEANT


@pytest.mark.parametrize("case", CASES, ids=[words[0][:50] for _, *words in CASES])
def test_a_mistake_is_one_line_with_its_path(tmp_path, case):
    text, *words = case
    folder = tmp_path / "inside"
    (folder / "folder").mkdir(parents=True)
    (tmp_path / "x.obj").write_text(SQUARE)
    (folder / "out.obj").symlink_to(tmp_path / "x.obj")
    plain = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
    path = written(folder, text, **{"broken.obj": "v a b c\nf 1 2 3\n", "plain.obj": plain, "w.npy": "-"})
    line = f"{path}: ", *words
    refused_without_a_trace(folder, line, "render", path, "-o", folder / "picture.png")


def test_not_utf8(tmp_path):
    with pytest.raises(SceneError, match=re.escape("scene.toml: line 2: expected UTF-8, got byte 0xff")):
        scene(tmp_path, b"# fine\n# \xff\n")


@pytest.mark.parametrize("content", [b"", b" \n\t\n"])
def test_an_empty_file(tmp_path, content):
    with pytest.raises(SceneError, match=r"scene\.toml: content: expected a TOML scene, got an empty file"):
        scene(tmp_path, content)


def test_a_file_too_large_to_parse(tmp_path):
    with pytest.raises(SceneError, match="content: expected at most 16,777,216 bytes of TOML, got 16,777,217"):
        scene(tmp_path, b"#" * (2**24 + 1))


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


def test_a_baked_file_of_something_else(tmp_path):
    made = scene(tmp_path, '[obscurance]\nbaked = "w.npy"\n' + PLAIN, **{"w.npy": "no array"})
    with pytest.raises(SceneError, match=r"w\.npy: content: expected w as obscurance bake writes it"):
        with_obscurance(made)
    np.save(tmp_path / "w.npy", np.ones(3))
    with pytest.raises(SceneError, match=r"w.npy: w: expected 9 values, .*, got 3"):
        with_obscurance(made)
    np.save(tmp_path / "w.npy", np.full(9, 2.0))
    with pytest.raises(SceneError, match=r"w.npy: w: expected values in \[0, 1\]"):
        with_obscurance(made)
    zipped = scene(tmp_path, '[obscurance]\nbaked = "w.npz"\n' + PLAIN, **{"w.npz": "no archive"})
    with pytest.raises(SceneError, match=r"w\.npz: content"):
        with_obscurance(zipped)
    np.savez(tmp_path / "w.npz", w=np.linspace(0, 1, 9))
    assert with_obscurance(zipped)[0].objects[0].w[-1] == 1
