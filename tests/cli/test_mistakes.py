"""A newcomer's mistakes: one line each, with what came, what was expected and what was probably meant."""

import os
import shlex

import numpy as np
import pytest
import trimesh
from command import obscurance, process, refused
from mesh_files import ply
from meshes import hills
from typer.main import get_command

from cli import app
from raytrace.image.write import write_image
from scenes.jobs.options import BAKE

COMMANDS = [
    (
        "bkae a.ply -o w.npy",
        "command: expected one of bake, merge, view, info",
        "bkae; did you mean bake? See obscurance --help",
    ),
    ("Bake a.ply -o w.npy", "got Bake; did you mean bake?"),
    ("val", "got val; did you mean validate?"),
    ("a.ply", "got a.ply; see obscurance --help"),
    ("help", "got help; see obscurance --help"),
    ("--verbose", "got --verbose; did you mean --version?"),
    ("-o w.npy bake", "got -o; see obscurance --help"),
    ("bake", "bake: expected INPUT, got nothing; see obscurance bake --help"),
    ("bake a.ply", "bake --output: expected a file, or --output-dir for several inputs, got nothing"),
    ("bake a.ply w.npy", "bake --output: expected a file", "got nothing; did you mean -o w.npy?"),
    ("bake a.ply cloud.obj", "got nothing; did you mean --output-dir?"),
    (
        "bake a.ply b.ply -o w.npy",
        "bake --output: expected --output-dir for 2 inputs, got w.npy; did you mean --output",
    ),
    ("bake *.ply -o w.npy", "bake --output: expected --output-dir for a pattern, got w.npy"),
    (
        "bake a.ply -o w.npy --output-dir out",
        "bake: --output-dir and --output exclude each other; see obscurance bake --help",
    ),
    ("bake a.ply -o w.npy --format glb", "bake: --format needs --output-dir or -o -; see"),
    ("bake a.ply --output-dir a.ply", "a.ply: cannot make this folder: it is a file"),
    ("bake a.ply --output-dir a.ply/out", "a.ply/out: cannot make this folder: Not a directory"),
    (f"bake a.ply -o {'x' * 300}.ply", "xxx.ply: cannot write: File name too long"),
    (f"bake a.ply --output-dir {'x' * 300}", "xxx: cannot make this folder: File name too long"),
    ("bake a.ply -o w.npy --high a.ply --cage inf", "bake --cage: expected a finite length, got inf"),
    ("bake a.ply -o folder", "bake --output: expected a file, got folder, a folder; did you mean --output-dir?"),
    ("bake a.ply --output-dir w.ply", "expected a folder, got w.ply, the name of a file; did you mean --output?"),
    ("bake a.ply -o - --resume", "bake: --resume does not go with -o -, standard output"),
    ("bake a.ply --output-dir .", "expected a file that is not read, got a.ply, an input"),
    (
        "bake a.ply a.obj --output-dir out",
        "bake --output-dir: expected inputs of different names in each folder, got a.ply and a.obj",
    ),
    (
        "bake folder --output-dir out",
        "bake INPUT: expected mesh files, got folder, a folder; did you mean 'folder/*.obj'?",
    ),
    (
        "bake 'n*.ply' --output-dir out",
        "bake INPUT: expected a pattern that matches files, got n*.ply, which matches none",
    ),
    ("bake a.ply --output-dir out --report r.json", "bake: --report and --output-dir exclude each other"),
    ("bake a.ply --output-dir out --format obj", "bake --format: expected one of npy, npz, ply, glb", "got obj"),
    ("bake a.ply --output-dir out --samples 0", "bake --samples"),
    ("bake a.ply -o", "bake -o: expected a value, got nothing"),
    (
        "bake a.ply -o w",
        "bake --output: expected a name ending in .npy,",
        ".glb, .html, .png, .exr,",
        "got w;",
    ),
    ("bake a.ply -o c.obj", "got c.obj; did you mean c.ply?"),
    ("bake a.ply -o c.JPG", "got c.JPG; did you mean c.png?"),
    ("bake a.ply -o c.gltf", "got c.gltf; did you mean c.glb?"),
    ("bake a.ply -o w.npy.txt", "got w.npy.txt"),
    ("bake a.ply -o ''", "bake --output", "got ., a folder;"),
    ("bake a.ply -o none/w.npy", "none/w.npy: cannot write: there is no folder"),
    ("bake aa.ply -o w.npy", "aa.ply: file: expected an existing file, got none; did you mean a.ply?"),
    ("bake A.ply -o w.npy", "did you mean a.ply?"),
    ("bake a.pyl -o w.npy", "did you mean a.ply?"),
    ("bake pictur.ply -o w.npy", "did you mean picture.png?"),
    ("bake folder -o w.npy", "folder: file: expected a mesh file, got a folder"),
    ("bake cloud.obj -o w.npy", "cloud.obj: faces: expected at least one triangle"),
    ("bake scene.toml -o w.npy", "scene.toml: ending: expected one of obj", "got .toml"),
    ("bake a.ply -o w.npy --samples abc", "bake --samples: expected a whole number, got abc; see obscurance bake"),
    ("bake a.ply -o w.npy --samples 1e3", "got 1e3"),
    ("bake a.ply -o w.npy --samples 0", "bake --samples: expected a whole number from 1 to 1048576, got 0"),
    ("bake a.ply -o w.npy --samples=-3", "got -3"),
    ("bake a.ply -o w.npy --sample 3", "got --sample; did you mean --samples?"),
    ("bake a.ply -o w.npy --smaples 3", "got --smaples; did you mean --samples?"),
    ("bake a.ply -o w.npy --max_distance 3", "got --max_distance; did you mean --max-distance?"),
    ("bake a.ply -o w.npy --colours", "got --colours; did you mean --colors?"),
    ("bake a.ply -o w.npy --tolerance 0", "bake --tolerance: expected a number from 1e-5 to 1, got 0"),
    ("bake a.ply -o w.npy --tolerance 1%", "bake --tolerance: expected a number, got 1%"),
    (
        "bake a.ply -o w.npy --tolerance .1 --no-denoise",
        "bake: --no-denoise does not go with --tolerance; see obscurance bake --help",
    ),
    (
        "bake a.ply -o w.npy --falloff exp",
        "table:FILE, got exp; did you mean exponential?",
    ),
    ("bake a.ply -o w.npy --falloff binary --tau 2", "bake: --tau needs --falloff exponential"),
    ("bake a.ply -o w.npy --falloff smooth --half-distance 2", "bake: --half-distance needs --falloff exponential"),
    ("bake a.ply -o w.npy --falloff linear", "bake --max-distance: expected a finite length", "got 'inf'"),
    ("bake a.ply -o w.npy --falloff table:a.ply", "a.ply: file: expected a table, a name ending in .csv, .txt, .npy"),
    ("bake a.ply -o w.npy --falloff table:no.csv", "no.csv: file: expected an existing file, got none"),
    ("bake a.ply -o mu.csv --falloff table:mu.csv", "mu.csv"),
    ("bake a.ply -o w.npy --tau 1 --half-distance 3", "bake: --tau and --half-distance exclude each other"),
    ("bake a.ply -o w.npy --tau inf", "bake --tau: expected a finite rate above 0, got inf"),
    ("bake a.ply -o w.npy --half-distance 10cm", "bake --half-distance: expected a length above 0", "got '10cm'"),
    ("bake a.ply -o w.npy --max-distance -1", "bake --max-distance", "got '-1'"),
    ("bake a.ply -o w.npy --normals vertex", "bake --normals: expected one of angle, area, equal, file, got vertex"),
    ("bake a.ply -o w.npy --normals aera", "did you mean area?"),
    ("bake a.ply -o w.npy --interior yes", "bake --interior: expected one of auto, ignore, mark, fill, got yes"),
    ("bake a.ply -o w.npy --method surfaces", "got surfaces; did you mean surface?"),
    (
        "bake a.ply -o w.npy --method surface --tolerance .1 --interior mark",
        "bake: --interior mark does not go with --method surface",
    ),
    (
        "bake a.ply -o w.npy --method surface --traversal embree",
        "bake: --traversal embree does not go with --method surface",
    ),
    ("bake a.ply -o w.npy --traversal embre", "bake --traversal: expected one of auto, embree", "did you mean embree?"),
    ("bake a.ply -o w.npy --seed x", "bake --seed: expected a whole number, got x"),
    ("bake a.ply -o w.npy --threads many", "bake --threads: expected a whole number, got many"),
    ("bake a.ply -o w.npy --threads 0", "bake --threads: expected a whole number from 1 to 4096, got 0"),
    ("bake a.ply -o w.npy --report folder", "bake --report: expected a name ending in .json or .html, got folder"),
    ("bake a.ply -o w.npy --debug-image m.bmp", "bake --debug-image: expected a name ending in", "got m.bmp"),
    ("bake a.ply -o w.npy --colors", "bake: --colors needs a .glb or .ply output"),
    ("bake a.ply -o w.glb --occlusion rmap", "expected one of none, ramp, texture, auto, got rmap; did you mean ramp?"),
    ("bake a.ply -o w.ply --occlusion ramp", "bake: --occlusion ramp needs a .glb output"),
    ("bake a.ply -o w.glb --occlusion ramp --colors", "bake: --colors does not go with --occlusion ramp"),
    ("bake a.ply -o w.ply --replace-occlusion", "bake: --replace-occlusion needs an occlusion texture"),
    ("bake a.ply -o w.glb --replace-occlusion --occlusion none", "bake: --replace-occlusion needs an occlusion"),
    ("bake a.ply -o w.glb --ocluson ramp", "got --ocluson; did you mean --occlusion?"),
    ("bake a.ply -o w.npy -qz", "got -z"),
    ("bake a.ply -o w.npy --quiet=yes", "bake --quiet: expected the option alone, got a value"),
    ("info", "info: expected MESH, got nothing"),
    ("info a.ply a.ply", "info: expected no more arguments, got a.ply"),
    ("info picture.png", "picture.png: ending", "got .png"),
    ("validate --samples 0", "validate --samples: expected a whole number from 1", "got 0"),
    ("validate --stress", "test suites: python -m pytest tests/stress tests/random_meshes"),
    ("validate --generated --long", "test suites: python -m pytest tests/stress tests/random_meshes"),
    ("validate a.ply", "validate: expected no more arguments, got a.ply"),
    ("render a.ply", "render --output: expected an image file, or --show, got nothing"),
    ("render a.ply --show", "render --show: expected a terminal as standard output, got a file or a pipe"),
    ("render scene.toml -o x.bmp", "render --output: expected a name ending in .exr", "got x.bmp"),
    ("render scene.toml -o x.png --width 100", "render: --width needs --height"),
    ("render scene.toml -o x.png --width 0 --height 9", "render --width: expected a whole number", "got 0"),
    ("render scene.toml -o x.png --shading goroud", "got goroud; did you mean gouraud?"),
    (
        "render scene.toml -o x.png --obscurance on",
        "render --obscurance: expected one of off, ambient, ambient and diffuse, got on",
    ),
    ("render scene.toml -o x.png --crop 1,2", "render --crop: expected four whole numbers X,Y,W,H, got '1,2'"),
    ("render scene.toml -o x.png --crop 0,0,5000,1", "render --crop: expected a part of 960×640 pixels"),
    ("render scene.toml -o x.png --half", "render --half: expected an output that ends in .exr, got x.png"),
    ("render scene.toml -o x.png --no-shadow", "got --no-shadow; did you mean --no-shadows?"),
    ("render scene.tml -o x.png", "got none; did you mean scene.toml?"),
    ("render temple -o x.png", "got none; obscurance scenes temple -o temple.toml writes that built-in scene"),
    ("scenes tempel", "scenes NAME: expected one of plane_wall", "got tempel; did you mean temple?"),
    ("scenes still", "got still; did you mean still_life?"),
    ("scenes -o x.toml", "scenes NAME: expected the scene to write, got nothing"),
    ("scenes cornell -o folder", "scenes --output: expected a name ending in .toml, got folder"),
    ("compare picture.png", "compare: expected B, got nothing"),
    ("compare a.ply picture.png", "a.ply: content: expected an image"),
    ("compare picture.png pictur.png", "pictur.png: file", "did you mean picture.png?"),
    ("compare picture.png picture.png --metric ssim", "compare --metric: expected one of flip, rms, max, got ssim"),
    ("compare picture.png picture.png --threshold x", "compare --threshold: expected a number, got x"),
    ("compare picture.png picture.png --threshold -1", "compare --threshold: expected a number in [0, inf), got -1"),
    ("compare picture.png picture.png --difference d.bmp", "compare --difference: expected a name", "got d.bmp"),
    (
        "bench --falloff none",
        "bench --falloff: expected one of exponential,",
        "smooth, table:FILE, got none",
    ),
    ("bench aa.ply", "did you mean a.ply?"),
    ("demo x", "demo: expected no more arguments, got x"),
    ("demo -o a.ply", "a.ply: cannot make this folder: it is a file"),
]
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
        "distribution: expected 'beckmann' or 'gaussian', got bekmann; did you mean beckmann?",
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
    ('[render]\nwidth = "big"\n' + BOX, "render.width: expected a whole number from 1 to 32768, got big"),
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
    ('background = "blue"\n' + BOX, 'background: expected a list of numbers, got "blue"'),
]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("mistakes")
    trimesh.creation.box().export(folder / "a.ply")
    (folder / "cloud.obj").write_text("v 0 0 0\n")
    (folder / "scene.toml").write_text(BOX)
    (folder / "folder").mkdir()
    (folder / "folder" / "a.obj").write_text("v 0 0 0\n")
    write_image(folder / "picture.png", np.zeros((4, 4, 3)))
    return folder


def check(folder, words, *arguments):
    before = {path: path.read_bytes() for path in folder.iterdir() if path.is_file()}
    refused(obscurance(*arguments), *words)
    assert {path: path.read_bytes() for path in folder.iterdir() if path.is_file()} == before


def test_there_are_enough():
    assert len(COMMANDS) >= 60
    assert len(SCENES) >= 30


@pytest.mark.parametrize("case", COMMANDS, ids=[line for line, *_ in COMMANDS])
def test_a_wrong_command(folder, monkeypatch, case):
    line, *words = case
    monkeypatch.chdir(folder)
    check(folder, words, *shlex.split(line))


@pytest.mark.parametrize("case", SCENES, ids=[repr(text)[:60] for text, *_ in SCENES])
def test_a_wrong_scene(tmp_path, case):
    text, *words = case
    (tmp_path / "scene.toml").write_text(text)
    check(tmp_path, ("scene.toml: ", *words), "render", tmp_path / "scene.toml", "-o", tmp_path / "x.png")


@pytest.mark.parametrize("arguments", [(), ("-h",), ("--help",)])
def test_help_of_the_whole(arguments):
    result = obscurance(*arguments)
    assert (result.returncode, result.stderr) == (0, "")
    assert result.stdout.startswith("Usage: obscurance [OPTIONS] COMMAND")
    assert result.stdout.count("\n") > 10
    assert "..." not in result.stdout.split("Commands:")[1]  # no sentence cut short


def test_help_of_every_command():
    listed = obscurance().stdout.split("Commands:\n")[1].split("\n\n")[0]
    commands = [line.split()[0] for line in listed.splitlines()]
    assert "bake" in commands
    for command in commands:
        short, long = (obscurance(command, flag) for flag in ("-h", "--help"))
        assert short.returncode == 0
        assert short.stdout == long.stdout
        assert short.stdout.isascii()
        assert short.stdout.startswith(f"Usage: obscurance {command}")


def test_the_help_of_bake_has_a_place_for_every_option_and_examples_that_work(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shown = obscurance("bake", "--help").stdout
    assert [str(item.name) for item in get_command(app).commands["bake"].params] == [row.name for row in BAKE]
    for title in ("Arguments", "Options", *(row.section for row in BAKE if row.section)):
        assert shown.count(f"\n{title}:\n") == 1
    for option in ("--output-dir", "--falloff", "--size", "--options", "--quiet"):
        assert shown.count(f"  {option} ") + shown.count(f", {option} ") == 1
    examples = [line.split()[1:] for line in shown.splitlines() if line.startswith("    obscurance ")]
    assert len(examples) >= 3
    for words in examples:
        result = obscurance(*(word.strip("'") for word in words))
        assert "file: expected an existing file" in result.stderr or "which matches none" in result.stderr


def test_the_version():
    result = obscurance("--version")
    assert result.returncode == 0
    lines = dict(line.split(maxsplit=1) for line in result.stdout.splitlines())
    assert list(lines) == ["obscurance", "Embree", "CPU", "Python"]
    assert lines["Embree"].startswith("4.")
    assert "lanes of float32" in lines["CPU"]


def test_a_shell_completes_commands_options_and_choices():
    for words, count, expected in (
        ("obscurance be", 1, "bench"),
        ("obscurance bake --fal", 2, "--falloff"),
        ("obscurance bake --falloff b", 3, "binary"),
        ("obscurance render a.ply --shading g", 4, "gouraud"),
        ("obscurance scenes cor", 2, "cornell"),
        ("obscurance materials red_p", 2, "red_plastic"),
    ):
        asked = {"_OBSCURANCE_COMPLETE": "complete_bash", "COMP_WORDS": words, "COMP_CWORD": str(count)}
        assert process(env={**os.environ, **asked}).stdout.split() == [expected]


LONG = "n" * 100_000


@pytest.mark.parametrize(
    "line",
    [
        f"bake {LONG}.obj -o w.npz",
        f"bake long.obj -o {LONG}.npz",
        f"bake long.obj -o w.npz --{LONG}",
        f"render {LONG} -o w.png",
        f"materials {LONG}",
        "info long.obj",
        "bake long.obj -o w.glb --samples 1",
    ],
    ids=lambda line: line[:20],
)
def test_however_long_a_name_is_messages_are_lines_that_people_read(tmp_path, monkeypatch, line):
    (tmp_path / "long.obj").write_text(f"mtllib {LONG}\nusemtl {LONG}\no {LONG}\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    monkeypatch.chdir(tmp_path)
    done = obscurance(*line.split())
    assert done.returncode == (2 if LONG in line else 0)
    assert max(map(len, (done.stdout + done.stderr).splitlines())) < 1100


def test_a_name_that_shares_its_ending_alone_is_not_offered(tmp_path):
    (tmp_path / "fandisk.glb").write_bytes(b"")
    (tmp_path / "duck2.glb").write_bytes(b"")
    assert "did you mean" not in obscurance("bake", tmp_path / "Suzanne.glb", "-o", tmp_path / "w.npy").stderr
    result = obscurance("bake", tmp_path / "Duck.glb", "-o", tmp_path / "w.npy")
    assert result.stderr.endswith(f"did you mean {tmp_path / 'duck2.glb'}?\n")


def test_memory_that_runs_out_after_the_estimate_is_told_in_a_line(tmp_path, monkeypatch):
    def run_out(*_, **__):
        raise MemoryError

    mesh = tmp_path / "hills.ply"
    mesh.write_bytes(ply(*hills(4)))
    monkeypatch.setattr("ao.bake", run_out)
    refused(obscurance("bake", mesh, "-o", tmp_path / "w.npz"), "out of memory: the system or a limit, ulimit -v")
    assert not (tmp_path / "w.npz").exists()
