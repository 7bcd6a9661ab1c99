"""What a command imports and loads before it works: nothing that an earlier run has made superfluous."""

import json
import os
import re
import subprocess
import sys

import numpy as np
import pytest
from command import obscurance
from mesh_files import obj, ply, stl
from meshes import hills, two_boxes
from project import ROOT

import ao
import raytrace
from raytrace.kernel import notice

COMMAND = """
import json, sys, cli
sys.argv[0] = "obscurance"
try:
    cli.main()
except SystemExit:
    from raytrace.kernel import jit
    heavy = ("numba", "scipy", "trimesh", "OpenImageIO", "rich", "PIL", "lxml", "networkx", "pydantic.v1", "asyncio")
    heavy = (*heavy, "scenes.formats.gltf.asset", "scenes.formats.gltf.occlusion")
    print(json.dumps([[name for name in heavy if name in sys.modules], len(jit.loaded), len(jit.compiled)]))
"""


def run(*arguments, **environment):
    command = [sys.executable, "-c", COMMAND, *map(str, arguments)]
    result = subprocess.run(
        command, cwd=ROOT, capture_output=True, text=True, check=True, timeout=300, env={**os.environ, **environment}
    )
    return json.loads(result.stdout.splitlines()[-1]), result.stderr


@pytest.fixture
def meshes(tmp_path):
    (tmp_path / "hills.obj").write_bytes(obj(*hills(12)))
    (tmp_path / "hills.ply").write_bytes(ply(*hills(12)))
    flat = obj(*hills(12)).replace(b"\nf", b"\nvt 0 0\nvt 1 0\nvt 0 1\nf", 1)
    (tmp_path / "textured.obj").write_bytes(re.sub(rb"f (\d+) (\d+) (\d+)", rb"f \1/1 \2/2 \3/3", flat))
    vertices, faces = two_boxes()
    (tmp_path / "boxes.stl").write_bytes(stl(vertices[faces]))
    return tmp_path


BAKE, SURFACE, TEXTURE, RENDER = 57, 48, 60, 40  # kernels at most, three of them for an OBJ file
COMMANDS = {
    "bake": ("bake hills.obj -o w.ply --samples 64", BAKE, []),
    "bake a ply": ("bake hills.ply -o w.npz --falloff binary", BAKE, []),
    "bake closed parts": ("bake boxes.stl -o w.npz --samples 64", BAKE, []),
    "bake to a tolerance": ("bake hills.obj -o w.npy --tolerance 0.01", BAKE, []),
    "bake to a page": ("bake hills.obj -o w.html --samples 64 --report r.json", BAKE, []),
    "bake a texture": ("bake textured.obj -o w.png --size 16 --samples 16", TEXTURE, ["scipy", "OpenImageIO"]),
    "fit": ("bake hills.obj -o w.ply --method surface --samples 64", SURFACE, ["scipy"]),
    "render": (
        "render hills.obj -o w.png --width 32 --height 32 --samples 4",
        RENDER,
        ["OpenImageIO"],
    ),
}


@pytest.mark.parametrize("name", COMMANDS)
def test_a_second_run_compiles_nothing_and_imports_neither_the_compiler_nor_what_it_does_not_use(meshes, name):
    line, most, needed = COMMANDS[name]
    words = [meshes / word if "." in word and word[0].isalpha() else word for word in line.split()]
    assert obscurance(*words).returncode == 0  # keeps the kernels
    (heavy, loaded, compiled), errors = run(*words)
    assert heavy == needed
    assert compiled == 0
    assert most / 3 < loaded <= most
    assert "ompiling" not in errors


def test_help_imports_no_format():
    code = "import atexit, sys, cli; atexit.register(lambda: print('scenes.formats' in sys.modules)); cli.main()"
    command = [sys.executable, "-c", code, "--help"]
    shown = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True, timeout=60).stdout
    assert shown.endswith("False\n")


class Terminal:
    def __init__(self):
        self.text = ""

    def write(self, text):
        self.text += text

    def flush(self):
        pass

    def isatty(self):
        return True


def said_when(monkeypatch, folder, expected, *names):
    """What a terminal shows while kernels of these names are compiled."""
    terminal = Terminal()
    with monkeypatch.context() as patch:
        patch.setattr(sys, "stderr", terminal)
        patch.setattr("raytrace.kernel.cache.cache_folder", lambda: folder)
        notice._is_first_run.cache_clear()
        notice._announce.cache_clear()
        with notice.compiling(expected):
            for name in names:
                notice.notices[0](name)
        notice._is_first_run.cache_clear()
    assert not notice.notices
    return terminal.text


def test_a_first_run_says_on_a_terminal_how_far_compiling_is(monkeypatch, tmp_path):
    said = said_when(monkeypatch, tmp_path / "none", 3, *(f"ao.{name}.kernel.0123" for name in "abcd"))
    assert said.startswith("First run of this version: compiling kernels")
    shown = [part.strip() for part in said.split("\r")[1:]]
    assert shown == ["1 of about 3", "2 of about 3", "3 of about 3", "4 of about 4", "", ""]


def test_a_later_run_that_compiles_more_names_it(monkeypatch, tmp_path):
    said = said_when(monkeypatch, tmp_path, 30, "ao.estimate.upsampling._upsample.0123")
    assert said.startswith("Compiling kernels that no run of this version has needed before")
    assert "\r_upsample" in said


def test_what_compiles_nothing_says_nothing(monkeypatch, tmp_path):
    assert said_when(monkeypatch, tmp_path, 30) == ""


SMALL = "from raytrace.mesh.interpolation import centroid; centroid((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))"
LOGGED = "import logging; logging.basicConfig(level='INFO', format='%(name)s %(message)s'); "


@pytest.mark.skipif(os.name == "nt", reason="pseudoterminals")
def test_a_first_use_from_python_says_on_a_terminal_or_to_a_log_that_it_compiles(tmp_path):
    def said(code, folder, stderr=subprocess.PIPE):
        environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / folder)}
        command = [sys.executable, "-c", code]
        return subprocess.run(
            command, cwd=ROOT, env=environment, stdout=subprocess.PIPE, stderr=stderr, check=True
        ).stderr

    terminal, other_end = os.openpty()
    said(SMALL, "kept", other_end)
    shown = os.read(terminal, 10_000).decode()
    assert shown.startswith("First run of this version: compiling kernels takes up to a minute…\r\n\r1 of about")
    assert shown.endswith("\r")
    said(SMALL, "kept", other_end)
    os.set_blocking(terminal, False)
    with pytest.raises(BlockingIOError):
        os.read(terminal, 1)
    assert said(SMALL, "other") == b""
    assert said(LOGGED + SMALL, "another").startswith(b"obscurance compiling kernel 1: raytrace.")


def test_baking_and_rendering_count_all_that_they_compile():
    found = {"bake": [], "texture": [], "render": []}
    mesh, uv = raytrace.Mesh(*hills(5)), np.tile([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], (32, 1, 1))
    ao.bake(mesh, samples=4, progress=lambda *_: found["bake"].extend(notice.notices))
    ao.bake_texture(mesh, uv, 8, samples=4, progress=lambda *_: found["texture"].extend(notice.notices))
    scene = raytrace.Scene((raytrace.Object(raytrace.Shape(mesh, raytrace.Lambert(albedo=0.8))),), ())
    small = raytrace.Settings(width=8, height=8)
    camera = raytrace.Camera.framing(mesh, (1, 1, 1))
    raytrace.render(scene, camera, small, progress=lambda *_: found["render"].extend(notice.notices))
    assert all(found.values())


INTERRUPTED = """
import os, runpy, signal, sys

class Interrupt:
    def find_spec(self, name, *_):
        if name == {name!r}:
            os.kill(os.getpid(), signal.{by})

signal.signal(signal.SIGINT, signal.default_int_handler)
sys.meta_path.insert(0, Interrupt())
sys.argv[1:] = ["bake", {mesh!r}, "-o", {target!r}]
runpy.run_path({cli!r}, run_name="__main__")
"""


MODULES = ["typer", "scenes.commands.parameters", "scenes.commands.bake", "numpy", "llvmlite.binding"]


@pytest.mark.skipif(os.name != "posix", reason="signals")
@pytest.mark.parametrize(("name", "by"), [*((name, "SIGINT") for name in MODULES), ("typer", "SIGTERM")])
def test_an_interrupt_while_modules_are_imported_is_reported_in_a_line(meshes, name, by):
    files = {"mesh": str(meshes / "hills.obj"), "target": str(meshes / "w.npy"), "cli": str(ROOT / "cli.py")}
    command = [sys.executable, "-c", INTERRUPTED.format(name=name, by=by, **files)]
    result = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False, timeout=60)
    assert (result.returncode, result.stderr) == (130, "interrupted; no file is half-written\n")


@pytest.mark.skipif(os.name != "posix", reason="a shell")
@pytest.mark.parametrize(
    ("closed", "line", "status", "said"),
    [
        (">&-", "bake hills.ply -o w.npz --samples 16", 1, "obscurance: standard output: Bad file descriptor\n"),
        (">&-", "--help", 1, "obscurance: standard output: Bad file descriptor\n"),
        (">&-", "bake - -o - --samples 16 < hills.ply", 1, "obscurance: standard output: Bad file descriptor\n"),
        ("2>&-", "bake nothing.ply -o w.npz", 2, ""),
        ("<&- >&- 2>&-", "bake hills.ply -o w.npz --samples 16 --quiet", 0, ""),
        (
            "<&-",
            "bake - -o w.npz",
            2,
            "obscurance: standard input: content: expected a mesh, got Bad file descriptor\n",
        ),
    ],
)
def test_closed_standard_streams_are_reported_in_a_line(meshes, closed, line, status, said):
    command = f"exec '{sys.executable}' '{ROOT / 'cli.py'}' {line} {closed}"
    result = subprocess.run(["sh", "-c", command], cwd=meshes, capture_output=True, text=True, check=False, timeout=120)
    assert (result.returncode, without_note(result.stderr)) == (status, said)
    assert (meshes / "w.npz").exists() == ("hills.ply -o w" in line)


def without_note(text):
    """Without the note that kernels are compiled."""
    return "".join(line for line in text.splitlines(True) if "ompiling kernels" not in line)
