"""What a command imports and loads before it works: no compiler, and nothing that it does not use."""

import json
import os
import re
import signal
import subprocess
import sys

import pytest
from mesh_files import obj, ply, stl
from meshes import hills, two_boxes
from project import ROOT

COMMAND = """
import json, sys
from obscurance import cli
sys.argv[0] = "obscurance"
try:
    cli.main()
except SystemExit:
    from obscurance.raytrace.kernel import jit
    heavy = ("numba", "llvmlite", "scipy", "trimesh", "OpenImageIO", "rich", "PIL", "lxml", "asyncio")
    late = ("formats.gltf.asset", "formats.gltf.occlusion", "bake.batch")
    heavy = (*heavy, *("obscurance.scenes." + name for name in late))
    print(json.dumps([[name for name in heavy if name in sys.modules], len(jit.loaded), jit.compiled]))
"""


def run(*arguments, **environment):
    command = [sys.executable, "-c", COMMAND, *map(str, arguments)]
    result = subprocess.run(
        command, cwd=ROOT, capture_output=True, text=True, check=True, timeout=300, env={**os.environ, **environment}
    )
    return json.loads(result.stdout.splitlines()[-1])


@pytest.fixture
def meshes(tmp_path):
    (tmp_path / "hills.obj").write_bytes(obj(*hills(12)))
    (tmp_path / "hills.ply").write_bytes(ply(*hills(12)))
    flat = obj(*hills(12)).replace(b"\nf", b"\nvt 0 0\nvt 1 0\nvt 0 1\nf", 1)
    (tmp_path / "textured.obj").write_bytes(re.sub(rb"f (\d+) (\d+) (\d+)", rb"f \1/1 \2/2 \3/3", flat))
    vertices, faces = two_boxes()
    (tmp_path / "boxes.stl").write_bytes(stl(vertices[faces]))
    return tmp_path


COMMANDS = {
    "bake": ("bake hills.obj -o w.ply --samples 64", []),
    "bake a ply": ("bake hills.ply -o w.npz --falloff binary", []),
    "bake closed parts": ("bake boxes.stl -o w.npz --samples 64", []),
    "bake to a tolerance": ("bake hills.obj -o w.npy --tolerance 0.01", []),
    "bake to a page": ("bake hills.obj -o w.html --samples 64 --report r.json", []),
    "bake a texture": ("bake textured.obj -o w.png --size 16 --samples 16", ["scipy", "OpenImageIO"]),
    "fit": ("bake hills.obj -o w.ply --method surface --samples 64", ["scipy"]),
    "render": (
        "render hills.obj -o w.png --width 32 --height 32 --samples 4",
        ["OpenImageIO"],
    ),
}


@pytest.mark.parametrize("name", COMMANDS)
def test_a_run_compiles_nothing_and_imports_neither_the_compiler_nor_what_it_does_not_use(meshes, name):
    line, needed = COMMANDS[name]
    words = [meshes / word if "." in word and word[0].isalpha() else word for word in line.split()]
    heavy, loaded, compiled = run(*words)
    assert heavy == needed
    assert compiled == []
    assert loaded


@pytest.mark.skipif(sys.platform != "linux", reason="/proc")
def test_a_command_starts_no_threads_of_a_linear_algebra_library():
    code = "import os; from obscurance import cli; import numpy; print(len(os.listdir('/proc/self/task')))"
    environment = {name: value for name, value in os.environ.items() if name != "OPENBLAS_NUM_THREADS"}
    command = [sys.executable, "-c", code]
    shown = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True, timeout=60, env=environment)
    assert shown.stdout == "1\n"


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


MODULES = [
    "click",
    "obscurance.scenes.commands.parameters",
    "obscurance.scenes.commands.bake",
    "numpy",
    "obscurance.raytrace.kernel.library",
]


@pytest.mark.skipif(os.name != "posix", reason="signals")
@pytest.mark.parametrize(("name", "by"), [*((name, "SIGINT") for name in MODULES), ("click", "SIGTERM")])
def test_an_interrupt_while_modules_are_imported_is_reported_in_a_line(meshes, name, by):
    files = {"mesh": str(meshes / "hills.obj"), "target": str(meshes / "w.npy"), "cli": str(ROOT / "cli.py")}
    command = [sys.executable, "-c", INTERRUPTED.format(name=name, by=by, **files)]
    result = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False, timeout=60)
    assert (result.returncode, result.stderr) == (128 + signal.Signals[by], "interrupted; no file is half-written\n")


@pytest.mark.skipif(os.name != "posix", reason="a shell")
@pytest.mark.parametrize(
    ("closed", "line", "status", "said"),
    [
        (">&-", "bake hills.ply -o w.npz --samples 16", 1, "obscurance: standard output: Bad file descriptor\n"),
        (">&-", "--help", 1, "obscurance: standard output: Bad file descriptor\n"),
        (">&-", "bake - -o - --normals up -q < hills.ply", 1, "obscurance: standard output: Bad file descriptor\n"),
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
    assert (result.returncode, result.stderr) == (status, said)
    assert (meshes / "w.npz").exists() == ("hills.ply -o w" in line)
