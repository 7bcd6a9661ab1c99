"""Mistakes in scene files end in one line that names file, field, what was expected and what was found."""

import pytest
from command import refused_without_a_trace

BOX = '[[objects]]\nbuiltin = "box"\n'


SCENES = [
    ("hello", "end of document: expected valid TOML"),
    ("[camra]\n" + BOX, "camra: expected one of background", "did you mean camera?"),
    ('[[object]]\nbuiltin = "box"', "object: expected one of background", "did you mean objects?"),
    ('[[objects]]\nbuiltn = "box"', "objects[0]: expected either mesh or builtin, got neither; did you mean builtin?"),
    (BOX + 'materiel = "gold"', "objects[0].materiel: expected one of", "did you mean material?"),
    (BOX + 'material = "Golden"', 'got "Golden"; did you mean gold?'),
    (BOX + 'material = { preset = "clya" }', "objects[0].material.preset", "got clya; did you mean clay?"),
    (BOX + 'material = { model = "lambrt", albedo = 1 }', "got lambrt; did you mean lambert?"),
    (BOX + 'material = { model = "phong", k_d = 1, exponnt = 3 }', ".exponnt: expected one of", "mean exponent?"),
    (BOX + 'material = { model = "lambert", albdo = 1 }', ".albdo: expected one of", "did you mean albedo?"),
    (BOX + 'material = { model = "lambert" }', "objects[0].material.albedo: expected a value, got nothing"),
    (BOX + 'material = { model = "lambert", albedo = "red" }', "albedo: expected a list of numbers, got red"),
    (BOX + 'material = { model = "lambert", albedo = 1.1 }', "albedo[0]: expected a number in [0, 1], got 1.1"),
    (BOX + 'material = { model = "oren_nayar", albedo = 1, sigma = 30 }', "expected radians in [0, π/2], got 30"),
    (
        BOX + 'material = { model = "cook_torrance", albedo = 1, m = 1, distribution = "bekmann" }',
        "distribution: expected one of beckmann, gaussian, got bekmann; did you mean beckmann?",
    ),
    (BOX + 'material = { model = "phong", k_d = 0.8, k_s = 0.8 }', "k_d + k_s [0]: expected at most 1, got"),
    ('[[objects]]\nbuiltin = "ball"', 'expected one of plane, box, sphere, cylinder, temple, sponge, got "ball"'),
    ('[[objects]]\nbuiltin = "shpere"', 'got "shpere"; did you mean sphere?'),
    ('[[objects]]\nbuiltin = "sphere"\nradius = -1', "objects[0].radius: expected a number in", "got -1"),
    ('[[objects]]\nbuiltin = "sphere"\nraduis = 1', "objects[0].raduis", "did you mean radius?"),
    ('[[objects]]\nmesh = "gone.obj"', 'objects[0].mesh: expected an existing file, got "gone.obj"'),
    (BOX + "rotate = 90", "objects[0].rotate: expected a list of numbers, got 90"),
    (BOX + "translate = [1, 2]", "objects[0].translate[2]: expected a value, got nothing"),
    (BOX + 'texture = "paint.jpg"', 'objects[0].texture: expected an existing file, got "paint.jpg"'),
    (BOX + "copies = [{ translat = [1, 2, 3] }]", "copies[0].translat: expected one of", "did you mean translate?"),
    ("[camera]\nposition = [0, 0, 9]\n" + BOX, "camera.target: expected position and target together, got nothing"),
    ("[camera]\nfov = 30\n" + BOX, "camera.fov: expected one of", "did you mean field_of_view?"),
    ("[camera]\nfield_of_view = 200\n" + BOX, "camera.field_of_view: expected degrees above 0", "got 200"),
    ('[camera]\nposition = "front"\n' + BOX, 'camera.position: expected a list of numbers, got "front"'),
    ('[render]\nwidth = "big"\n' + BOX, 'render.width: expected a whole number from 1 to 32768, got "big"'),
    ("[render]\nsamples = 0\n" + BOX, "render.samples: expected a whole number from 1 to 4096, got 0"),
    ('[render]\nshading = "gourad"\n' + BOX, "got gourad; did you mean gouraud?"),
    ("[render]\nshadow = true\n" + BOX, "render.shadow: expected one of", "did you mean shadows?"),
    ('[obscurance]\nform = "ambiant"\n' + BOX, 'got "ambiant"; did you mean ambient?'),
    ('[obscurance]\nfalloff = "exp"\n' + BOX, "got exp; did you mean exponential?"),
    ("[obscurance]\ntua = 1\n" + BOX, "obscurance.tua: expected one of", "did you mean tau?"),
    ("[obscurance]\nsamples = 1e3\n" + BOX, "obscurance.samples: expected a whole number, got 1000.0"),
    ('[obscurance]\nmax_distance = "far"\n' + BOX, "obscurance.max_distance: expected a length above 0", "'far'"),
    (BOX + '[[lights]]\nlight = "pont"\nposition = [0, 0, 1]', "lights[0].light", "got pont; did you mean point?"),
    (BOX + "[[lights]]\nposition = [0, 0, 1]", "lights[0].light: expected a value, got nothing"),
    (BOX + '[[lights]]\nlight = "ambient"\nintesity = 1', "lights[0].intesity", "did you mean intensity?"),
    (
        BOX + '[[lights]]\nlight = "spot"\nposition = [0, 0, 1]\ndirection = [0, 0, 1]\nhalf_angle = 120',
        "lights[0].half_angle: expected degrees in (0, 90], got 120",
    ),
    ('[[materials]]\nname = "a"\nmodel = "strauss"\ncolour = 1\nsmoothness = 1\n' + BOX, "smoothness", "[0, 1), got 1"),
    (BOX + '[[objects]]\nmesh = "../a.ply"\n', "objects[1].mesh", "../a.ply"),
    ('[obscurance]\nbaked = "w.npy"\n' + BOX, "obscurance.baked", "w.npy"),
    (BOX + 'material = "cheese"', "objects[0].material", "cheese"),
    (BOX + "[fog]\nend = 3\n", "fog", "unknown"),
    (BOX + '[[lights]]\nlight = "point"\nposition = [0, 0, 1]\nintensity = nan', "lights[0].intensity", "nan"),
    (BOX + '[[lights]]\nlight = "point"\nposition = [inf, 0, 1]', "lights[0].position", "inf"),
    ("[render]\nwidth = 0\n" + BOX, "render.width", "got 0"),
    ("background = 0.5\n", "objects"),
    (BOX + "]\n", "line 3"),
    ("", "empty"),
    ('background = "blue"\n' + BOX, 'background: expected a list of numbers, got "blue"'),
]


@pytest.mark.parametrize("case", SCENES, ids=[repr(text)[:60] for text, *_ in SCENES])
def test_a_wrong_scene(tmp_path, case):
    text, *words = case
    (tmp_path / "scene.toml").write_text(text)
    refused_without_a_trace(
        tmp_path, ("scene.toml: ", *words), "render", tmp_path / "scene.toml", "-o", tmp_path / "x.png"
    )
