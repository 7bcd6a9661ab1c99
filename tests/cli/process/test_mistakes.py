"""A newcomer's mistakes: one line each, with what came, what was expected and what was probably meant."""

import shlex

import numpy as np
import pytest
import trimesh
from command import obscurance, refused, refused_without_a_trace
from mesh_files import ply
from meshes import hills
from uv_meshes import FLOOR_AND_WALL

from obscurance.raytrace.image.write import write_image

COMMANDS = [
    (
        "bkae a.ply -o w.npy",
        "command: expected one of bake, view, check, falloff, prune, info",
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
    ("bake a.ply --no-denoise off -o w.npy", "bake INPUT: expected mesh files, got off"),
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
    ("bake a.ply -o w.ply --resume", "bake: --resume needs --output-dir"),
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
        "bake 'z*.ply' --output-dir out",
        "bake INPUT: expected a pattern that matches files, got z*.ply, which matches none",
    ),
    ("bake a.ply --output-dir out --report r.json", "bake: --report and --output-dir exclude each other"),
    ("bake a.ply --output-dir out --format stl", "bake --format: expected one of npy, npz, ply, glb", "got stl"),
    ("bake a.ply -o", "bake --output: expected a value, got nothing"),
    ("bake a.ply -o -q", "bake --output: expected a value, got -q; see obscurance bake --help"),
    ("bake a.ply --samples --no-denoise -o w.npy", "bake --samples: expected a value, got --no-denoise"),
    (
        "bake a.ply -o w",
        "bake --output: expected a name ending in .glb,",
        ".html, .npy, .npz, .obj, .ply, .vtp, .png, .exr,",
        "got w;",
    ),
    ("bake a.ply -o c.stl", "got c.stl; did you mean c.ply?"),
    ("bake a.ply -o c.JPG", "got c.JPG; did you mean c.png?"),
    ("bake a.ply -o c.gltf", "got c.gltf; did you mean c.glb?"),
    ("bake a.ply -o ''", "bake --output", "got ., a folder;"),
    ("bake a.ply -o none/w.npy", "none/w.npy: cannot write: there is no folder"),
    ("bake aa.ply -o w.npy", "aa.ply: file: expected an existing file, got none"),
    ("bake A.ply -o w.npy", "did you mean a.ply?"),
    ("bake a.pyl -o w.npy", "did you mean a.ply?"),
    ("bake pictur.ply -o w.npy", "did you mean picture.png?"),
    ("bake folder -o w.npy", "folder: file: expected a mesh file, got a folder"),
    ("bake cloud.obj -o w.npy", "cloud.obj: faces: expected at least one triangle"),
    ("bake scene.toml -o w.npy", "scene.toml: ending: expected that of 3MF", "got .toml"),
    ("bake a.ply -o w.npy --samples abc", "bake --samples: expected a whole number, got abc; see obscurance bake"),
    ("bake a.ply -o w.npy --samples 1e3", "got 1e3"),
    ("bake a.ply -o w.npy --samples 0", "bake --samples: expected a whole number from 1 to 1048576, got 0"),
    ("bake a.ply -o w.npy --sample 3", "got --sample; did you mean --samples?"),
    ("bake a.ply -o w.npy --max_distance 3", "got --max_distance; did you mean --max-distance?"),
    ("bake a.ply -o w.npy --tolerance 0", "bake --tolerance: expected a number in [1e-5, 1], got 0"),
    ("bake a.ply -o w.npy --tolerance 1%", "bake --tolerance: expected a number, got 1%"),
    (
        "bake a.ply -o w.npy --thickness --interior fill",
        "bake: --thickness does not go with --interior fill, as rays start inside; see obscurance bake --help",
    ),
    (
        "bake a.ply -o w.npy --falloff exp",
        "table:FILE, got exp; did you mean exponential?",
    ),
    ("bake a.ply -o w.npy --falloff binary --tau 2", "bake: --tau needs --falloff exponential"),
    ("bake a.ply -o w.npy --falloff smooth --half-distance 2", "bake: --half-distance needs --falloff exponential"),
    ("bake a.ply -o w.npy --falloff linear", "bake: --falloff linear needs --max-distance"),
    ("bake a.ply -o w.npy --falloff table:a.ply", "a.ply: file: expected a table, a name ending in .csv, .txt, .npy"),
    ("bake a.ply -o w.npy --falloff table:no.csv", "no.csv: file: expected an existing file, got none"),
    ("bake a.ply -o mu.csv --falloff table:mu.csv", "mu.csv"),
    ("bake a.ply -o w.npy --tau 1 --half-distance 3", "bake: --tau and --half-distance exclude each other"),
    ("bake a.ply -o w.npy --tau -1", "bake --tau: expected a finite rate above 0, got -1.0"),
    ("bake a.ply -o w.npy --half-distance -5%", "bake --half-distance: expected a length above 0", "got '-5%'"),
    ("bake a.ply -o w.npy --max-distance 0", "bake --max-distance", "got '0'"),
    ("bake a.ply -o w.npy --seed -1", "bake --seed", "got -1"),
    ("bake a.ply -o w.npy --tau inf", "bake --tau: expected a finite number, got inf"),
    ("bake a.ply -o w.npy --half-distance 10cm", "bake --half-distance: expected a length above 0", "got '10cm'"),
    (
        "bake a.ply -o w.npy --normals vertex",
        "bake --normals: expected one of angle, area, equal, file, up, got vertex",
    ),
    ("bake a.ply -o w.npy --normals aera", "did you mean area?"),
    ("bake a.ply -o w.npy --method surfaces", "got surfaces; did you mean surface?"),
    ("bake a.ply -o w.npy --threads 0", "bake --threads: expected a whole number from 1 to 4096, got 0"),
    ("bake a.ply -o w.npy --report folder", "bake --report: expected a name ending in .json or .html, got folder"),
    ("bake a.ply -o w.npy --report mine.html", "--report", "a page of obscurance to replace"),
    ("view zero.obj", "zero.obj: f: expected v indices from 1 to 3, got 0"),
    ("bake a.ply -o w.npy --debug-image m.bmp", "bake --debug-image: expected a name ending in", "got m.bmp"),
    ("bake a.ply -o m.ply --preset unity", "--preset unity needs an output that ends in .glb .png .exr .tif"),
    ("bake corner.obj -o m.exr --bits 8", "--bits needs w or bent normals in an image that ends in .png"),
    ("bake a.ply -o w.npy --colors", "bake: --colors needs a .glb or .ply output"),
    ("bake a.ply -o w.glb --occlusion rmap", "expected one of none, ramp, texture, got rmap; did you mean ramp?"),
    ("bake a.ply -o w.ply --occlusion ramp", "bake: --occlusion ramp needs a .glb output"),
    ("bake a.ply -o w.glb --occlusion ramp --colors", "bake: --colors does not go with --occlusion ramp"),
    ("bake a.ply -o w.ply --replace-occlusion", "bake: --replace-occlusion needs an occlusion texture"),
    ("bake a.ply -o w.glb --replace-occlusion --occlusion none", "bake: --replace-occlusion needs an occlusion"),
    ("bake a.ply -o w.npy -qz", "got -z"),
    ("bake a.ply -o w.npy --quiet=yes", "bake --quiet: expected the option alone, got a value"),
    ("info", "info: expected MESH, got nothing"),
    ("info a.ply a.ply", "info: expected no more arguments, got a.ply"),
    ("info picture.png", "picture.png: ending", "got .png"),
    ("validate --samples 0", "validate --samples: expected a whole number from 1", "got 0"),
    ("validate --stress", "test suites: python -m pytest tests/stress tests/random_meshes"),
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
    ("render scene.toml -o none/x.png", "none/x.png: cannot write: there is no folder"),
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
    ("bench A.ply", "did you mean a.ply?"),
    ("demo x", "demo: expected no more arguments, got x"),
    ("demo -o a.ply", "a.ply: cannot make this folder: it is a file"),
    # meshes
    ("bake empty.obj -o w.npy", "empty.obj: content: expected", "empty"),
    ("bake noise.ply -o w.npy", "noise.ply", "PLY"),
    ("bake infinite.obj -o w.npy", "infinite.obj", "finite"),
    ("bake range.obj -o w.npy", "range.obj", "from 1 to 3", "got 9"),
    ("bake line.obj --high a.ply -o w.npz", "line.obj: faces: expected some that have an area, got none"),
    ("bake a.ply --high line.obj -o w.npz", "line.obj: faces: expected some that have an area, got none"),
    # what is baked, and what occludes
    ("bake a.ply -o w.npy --report no/r.json", "r.json"),
    ("bake a.ply -o w.npy --cluster ucx://127.0.0.1:9", "bake --cluster: expected"),
    ("bake a.ply -o w.npy --cluster here", "bake --cluster: expected local, local:N or the address", "'here'"),
    ("bake a.ply -o w.npy --cluster local --dry-run", "bake: --cluster and --dry-run exclude each other"),
    ("render a.ply -o x.png --cluster here", "render --cluster: expected local, local:N or the address"),
    ("bake a.ply -o w.npy --part 1/3", "got --part"),
    ("bake a.ply -o w.npy --ground 0", "a.ply: ground: expected a height up to -0.5, that of the lowest", "got 0.0"),
    ("bake a.ply -o w.npy --ground low", "--ground: expected auto, or a height in mesh units, got 'low'"),
    ("bake a.ply -o w.npy --ground nan", "ground: expected a height up to -0.5", "got nan"),
    ("bake a.ply -o w.npy --ground auto --high a.ply", "--ground and --high exclude each other"),
    ("bake a.ply -o w.npy --occluder gone.obj", "gone.obj: file: expected an existing file, got none"),
    ("bake a.ply -o w.npy --occluder a.ply --high a.ply", "--occluder and --high exclude each other"),
    (
        "bake a.ply -o w.npy --up z",
        "--up needs --ground, --normals up, --debug-image or .html, .ply, .glb",
    ),
    ("bake a.ply -o w.npy --between 0.02", "--between needs an output that ends in .glb .ply, whose faces can be"),
    ("bake a.ply -o w.glb --between 0", "bake --between: expected an error from 0.001 to 1, got 0"),
    ("bake a.ply -o w.glb --between 0.02 --high a.ply", "--between and --high exclude each other"),
    ("bake a.ply -o w.png --between 0.02", "--between does not go with a texture"),
    ("bake a.ply -o w.npy --high a.ply --cage corner.obj", "corner.obj: vertices: expected 8, as a.ply has, got 6"),
    ("bake a.ply -o w.glb --at faces", "--at faces needs an output that ends in .npy .npz .ply"),
    ("bake a.ply -o w.png --at faces", "--at does not go with a texture"),
    ("bake a.ply -o w.obj --both-sides", "--both-sides needs an output that ends in .npy .npz .ply"),
    ("bake a.ply -o w.npy --at faces --method surface", "--method surface, which fits vertices"),
    ("bake a.ply -o w.npy --at faces --debug-image d.png", "--at and --debug-image exclude each other"),
    ("bake a.ply -o w.npy --high a.ply --at faces", "--at", "--high"),
    ("bake points.ply -o w.ply", "faces", "--points"),
    ("bake points.ply -o w.glb --points", "--points needs", ".npy .npz .ply"),
    ("bake corner.obj -o w.npy --points", "corner.obj", "points", "faces"),
    ("bake bare.ply -o w.npy --points", "points without normals"),
    ("bake points.ply -o w.npy --points --at faces", "exclude each other"),
    ("bake a.ply -o w.exr --instances own --overlap mean", "bake: --instances and --overlap exclude each other"),
    ("bake a.ply -o w.glb --occlusion texture --instances own --uv pack", "--instances does not go with --uv pack"),
    ("bake a.ply -o w.glb --instances first", "--instances needs an image as --output, or --occlusion texture"),
    ("bake a.ply -o w.exr --uv pack", "bake: --uv pack needs --mesh-output"),
    # pages
    ("bake bare.obj -o w.png", "bare.obj: texture coordinates: expected some on every face, got none"),
    ("bake bare.obj -o w.png --uv unwrap", "bake: --uv unwrap needs --mesh-output"),
    ("bake corner.obj -o w.png --uv 3", "expected some of number 3 on every face, got none"),
    ("bake corner.obj -o w.png --uv x", "bake --uv: expected auto, unwrap, fill, pack or the number", "got 'x'"),
    ("bake nan.obj -o w.png", "texture coordinates"),
    ("bake flat.obj -o w.png", "flat.obj: texture coordinates: expected faces with an area on the page, got none"),
    ("bake far.obj -o w.png", "expected finite numbers up to 100000"),
    (
        "bake corner.obj -o w.png --size 0",
        "--size: expected one or two whole numbers of texels from 1 to 16384, got 0",
    ),
    ("bake corner.obj -o w.png --size big", "bake --size: expected a number of texels", "got 'big'"),
    ("bake corner.obj -o w.png --size 8 --texel-size 1", "bake: --texel-size and --size exclude each other"),
    ("bake corner.obj -o w.png --texel-size 1e-9", "bake --texel-size: expected at least"),
    ("bake corner.obj -o w.png --texel-size 0", "bake --texel-size: expected a length above 0"),
    ("bake corner.obj -o w.png --half", "images that end in .exr or .tif"),
    ("bake corner.obj -o w.png --interior mark", "--interior mark does not go with a texture, whose"),
    ("bake corner.obj -o w.png --method surface", "bake: --method does not go with a texture"),
    ("bake corner.obj -o w.png --colors", "bake: --colors does not go with a texture"),
    ("bake corner.obj -o w.npy --size 8", "bake: --size needs an image as --output, or --occlusion texture"),
    ("bake corner.obj -o w.npy --occlusion texture", "bake: --occlusion texture needs a .glb output"),
    ("bake corner.obj -o w.png --bent-normals n.glb", "bake --bent-normals: expected a name ending in .png .exr"),
    ("bake corner.obj -o w.png --error-map w.png", "--error-map", "the same file"),
    ("bake corner.obj -o w.<UDIM>.png --error-map e.png", "bake --error-map: expected <UDIM> in all names"),
    ("bake corner.obj -o w.png --mesh-output corner.obj", "expected a name ending in .glb"),
    ("bake corner.obj -o w.npy --high far.obj --method surface", "--method surface, which fits over"),
    ("bake corner.obj -o w.npy --high far.obj", "far.obj: surface: expected some of it within the cage", "got none"),
    ("bake corner.obj -o w.npy --cage 1%", "bake: --cage needs --high"),
    ("bake corner.obj -o w.npy --high far.obj --cage no", "bake --cage"),
    ("bake corner.obj -o w.png --orm", "bake: --orm needs a .glb to write, as --output or --mesh-output"),
    ("bake corner.obj -o w.npy --orm", "bake: --orm needs an image as --output"),
    ("bake corner.obj -o w.png --replace-occlusion", "bake: --replace-occlusion needs a .glb"),
    ("bake negative.obj -o w.<UDIM>.png", "texture coordinates of UDIM tiles"),
    # other commands
    ("prune a.ply -o out.png", "output", ".glb"),
    ("prune a.ply -o a.ply", "a.ply"),
    ("prune a.ply -o out.glb --by x", "prune --by", "faces, parts, objects"),
    ("prune a.ply -o out.glb --keep-neighbours -1", "--keep-neighbours", "from 0 on"),
    ("prune none.glb -o out.glb", "none.glb"),
    ("prune bad.glb -o out.glb", "bad.glb"),
    ("render scene.toml -o x.png --seed -1", "seed", "got -1"),
    ("render scene.toml -o x.png --threads 0", "threads", "got 0"),
    ("render scene.toml -o x.png --crop=-1,0,5,5", "crop", "-1"),
    ("render scene.toml -o x.png --crop 40,20,9,9 --width 48 --height 32", "crop", "48×32"),
    ("render scene.toml -o x.png --report no/such/folder/r.json", "r.json"),
    ("scenes cornell -o no/x.toml", "x.toml"),
    ("compare picture.png wide.png", "wide.png", "size", "4×4", "5×4"),
]


TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"
CHART = "vt 0 0\nvt {}\nvt 0 1\nf 1/1 2/2 3/3\n"
POINTS = "ply\nformat ascii 1.0\nelement vertex 3\n{}end_header\n" + "1 0 0 1 0 0\n0 1 0 0 1 0\n0 0 1 0 0 1\n"
FILES = {
    "empty.obj": "",
    "mine.html": "<h1>mine</h1>",
    "zero.obj": TRIANGLE + "f 0 1 2\n",
    "noise.ply": "\x89PNG\r\n\x1a\n not a mesh",
    "bad.glb": "glTF" + "\0" * 40,
    "infinite.obj": TRIANGLE.replace("1 0 0", "1 0 inf") + "f 1 2 3\n",
    "range.obj": TRIANGLE + "f 1 2 9\n",
    "line.obj": "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n",
    "bare.obj": TRIANGLE + "f 1 2 3\n",
    "nan.obj": TRIANGLE + CHART.format("nan 0"),
    "flat.obj": TRIANGLE + CHART.format("0 0").replace("0 1", "0 0"),
    "far.obj": TRIANGLE.replace("0 0 0", "9 9 9") + CHART.format("1e7 0"),
    "negative.obj": TRIANGLE + CHART.format("-1 0"),
    "corner.obj": FLOOR_AND_WALL,
    "points.ply": POINTS.format("".join(f"property float {name}\n" for name in ("x", "y", "z", "nx", "ny", "nz"))),
    "bare.ply": POINTS.format("".join(f"property float {name}\n" for name in "xyzabc")),
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("mistakes")
    trimesh.creation.box().export(folder / "a.ply")
    (folder / "cloud.obj").write_text("v 0 0 0\n")
    (folder / "scene.toml").write_text('[[objects]]\nbuiltin = "box"\n')
    (folder / "folder").mkdir()
    (folder / "folder" / "a.obj").write_text("v 0 0 0\n")
    write_image(folder / "picture.png", np.zeros((4, 4, 3)))
    write_image(folder / "wide.png", np.zeros((4, 5, 3)))
    for name, content in FILES.items():
        (folder / name).write_bytes(content.encode())
    return folder


@pytest.mark.parametrize("case", COMMANDS, ids=[line for line, *_ in COMMANDS])
def test_a_wrong_command(folder, monkeypatch, case):
    line, *words = case
    monkeypatch.chdir(folder)
    refused_without_a_trace(folder, words, *shlex.split(line))


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


def test_memory_that_runs_out_after_the_estimate_is_reported_in_a_line(tmp_path, monkeypatch):
    def run_out(*_, **__):
        raise MemoryError

    mesh = tmp_path / "hills.ply"
    mesh.write_bytes(ply(*hills(4)))
    monkeypatch.setattr("obscurance.scenes.bake.vertices.bake_vertices", run_out)
    refused(obscurance("bake", mesh, "-o", tmp_path / "w.npz"), "out of memory: the system or a limit, ulimit -v")
    assert not (tmp_path / "w.npz").exists()
