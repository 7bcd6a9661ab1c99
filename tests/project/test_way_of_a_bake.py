"""The way of a bake through the project: how many files it runs through, how often it goes from one to another, and
what it imports."""

import json
import subprocess
import sys

import numpy as np
from mesh_files import obj, ply
from project import ROOT, environment

FILES, MOVES = 24, 167  # of the command and of `scenes`, where a bake is decided, read and written
MODULES = 125  # of the packages
NEEDLESS = {
    *(
        "numpy.ma",
        "difflib",
        "shlex",
        "unicodedata",
        "click.shell_completion",
        "obscurance.ao.profile",
        "obscurance.ao.execute.sample_means",
    ),
    *(
        "obscurance.scenes.safe_paths",
        "obscurance.scenes.commands.usage",
    ),
}
WALK = """
import json, sys
from obscurance import cli

root = sys.argv.pop(1) + "/"
files, moves = set(), []


def file_of(frame):
    name = frame.f_code.co_filename
    ours = name.startswith(root) and "/.venv/" not in name
    return name.removeprefix(root) if ours else None


def profile(frame, event, _):
    is_function = frame.f_code.co_flags & 1 and frame.f_code.co_name != "<module>"
    file = file_of(frame)
    if event != "call" or not is_function or file is None:
        return
    files.add(file)
    caller = frame.f_back
    while caller and file_of(caller) is None:
        caller = caller.f_back
    if caller and file_of(caller) != file:
        moves.append((file_of(caller), file))


def run():
    try:
        cli.main()
    except SystemExit as end:
        assert not end.code


run()  # what is compiled and imported but once
sys.setprofile(profile)
run()
sys.setprofile(None)
print(json.dumps({"files": sorted(files), "moves": moves}))
"""
IMPORTED = """
import json, sys
from obscurance import cli

try:
    cli.main()
except SystemExit as end:
    assert not end.code
print(json.dumps(sorted(sys.modules)))
"""


def run(folder, code, *words):
    """What a script whose arguments are these prints in its last line, JSON."""
    command = [sys.executable, "-c", code, *words]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True, env=environment())
    return json.loads(done.stdout.splitlines()[-1])


CORNERS = np.array([(x, y, z) for z in (0, 1) for y in (0, 1) for x in (0, 1)])
SIDES = np.array([(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)])


def of_scenes(file):
    return file.startswith(("scenes/", "cli.py"))


def test_a_bake_of_a_cube_runs_through_few_files(tmp_path):
    (tmp_path / "cube.ply").write_bytes(ply(CORNERS, SIDES))
    way = run(tmp_path, WALK, str(ROOT), "bake", "cube.ply", "-o", "w.ply", "--threads", "1", "--quiet")
    files = [file for file in way["files"] if of_scenes(file)]
    moves = [caller for caller, _ in way["moves"] if of_scenes(caller)]
    assert 10 < len(files) <= FILES, files
    assert 50 < len(moves) <= MOVES


def test_a_bake_of_a_cube_imports_nothing_that_it_does_not_use(tmp_path):
    (tmp_path / "cube.obj").write_bytes(obj(CORNERS, [(*side[:3],) for side in SIDES]))
    modules = run(tmp_path, IMPORTED, "bake", "cube.obj", "-o", "w.ply", "-q")
    packages = ("obscurance.ao.", "obscurance.raytrace.", "obscurance.scenes.")
    assert 100 < len([name for name in modules if name.startswith(packages)]) <= MODULES
    assert NEEDLESS.isdisjoint(modules)


def test_an_image_needs_nothing_of_gltf(tmp_path):
    lines = ["v 0 0 0", "v 1 0 0", "v 0 1 0", "vt 0 0", "vt 1 0", "vt 0 1", "f 1/1 2/2 3/3"]
    (tmp_path / "triangle.obj").write_text("\n".join(lines))
    modules = run(tmp_path, IMPORTED, "bake", "triangle.obj", "-o", "w.png", "--size", "8", "--samples", "4", "--quiet")
    assert "obscurance.scenes.bake.texture" in modules
    assert not [name for name in modules if name.startswith("obscurance.scenes.formats.gltf.")]
