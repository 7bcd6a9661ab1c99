"""Bakes that are interrupted or killed as processes: continued by the command, they give the bytes of a whole one."""

import json
import os
import signal
import subprocess
import sys
import time
from warnings import warn

import pytest
from command import obscurance, started
from interrupted_bakes import MESH, folders
from killed_commands import textured
from project import HELPERS, ROOT, environment

from obscurance.ao.execute.kept import Kept
from obscurance.raytrace.errors import OutputError

pytestmark = pytest.mark.skipif(os.name == "nt", reason="POSIX signals")

AT_ONCE = """
import time, warnings
from obscurance.ao.execute import work
from obscurance.ao.execute.kept import Kept
put = Kept._put
def slowly(*arguments):
    put(*arguments)
    time.sleep(0.1)
Kept._put = slowly
Kept.__init__.__defaults__ = (warnings.warn, 0.0, *Kept.__init__.__defaults__[2:])
work._BLOCK_RAYS = 1 << 14
from obscurance import cli
cli.main()
"""


@pytest.mark.parametrize(
    ("options", "name"), [(["--samples", 512], "w.npz"), (["--size", 96, "--samples", 64], "w.png")]
)
def test_the_command_continues_after_an_interrupt(tmp_path, options, name):
    mesh, target, whole = tmp_path / "hills.ply", tmp_path / name, tmp_path / f"whole-{name}"
    mesh.write_bytes(textured(MESH.vertices, MESH.faces))
    bake = "bake", mesh, "--quiet", *options
    command = [sys.executable, "-c", AT_ONCE, *map(str, bake), "-o", target]
    assert obscurance(*bake, "-o", whole).returncode == 0
    with started(command, cwd=ROOT, stderr=subprocess.PIPE, text=True) as running:
        latest = time.monotonic() + 300
        while running.poll() is None and not any(list(folder.glob("?*.?*")) for folder in folders(target)):
            assert time.monotonic() < latest, "no rows in five minutes"
            time.sleep(0.01)
        running.send_signal(signal.SIGINT)
        _, errors = running.communicate(timeout=60)
    assert running.returncode == 130, errors
    (folder,) = folders(target)
    assert f"{folder} keeps the rows that are done: run the command again to go on from there" in errors
    assert not target.exists()
    assert obscurance(*bake, "-o", target).stderr == ""
    assert target.read_bytes() == whole.read_bytes()
    assert not folders(target)


def test_rows_outlive_an_output_that_cannot_be_written(tmp_path, monkeypatch):
    mesh, target = tmp_path / "hills.ply", tmp_path / "w.npz"
    mesh.write_bytes(textured(MESH.vertices, MESH.faces))
    bake = "bake", mesh, "--quiet", "--samples", 128, "-o", target

    def full(*_):
        raise OutputError(f"{target}: cannot write: No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(Kept.__init__, "__defaults__", (warn, 0.0, *Kept.__init__.__defaults__[2:]))
        patch.setattr("obscurance.scenes.bake.vertices.write_vertices", full)
        failed = obscurance(*bake)
    (folder,) = folders(target)
    assert failed.stderr.splitlines() == [
        f"obscurance: {folder} keeps the rows that are done: run the command again to go on from there",
        f"obscurance: {target}: cannot write: No space left on device",
    ]
    assert list(folder.iterdir())
    assert obscurance(*bake).returncode == 0
    assert not folders(target)


def killed(tmp_path, kills, method, options):
    script = HELPERS / "bakes" / "killed_bakes.py"
    command = [sys.executable, script, str(kills), "1", method, json.dumps(options), tmp_path]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    with started(command, env=environment(), **pipes) as running:  # it forks: the bakes are to end with it
        output, errors = running.communicate(timeout=3600)
    assert running.returncode == 0, errors
    seen = json.loads(output)
    assert seen["killed"] == kills
    assert seen["continued"] > 0
    assert (seen["different"], seen["failed"]) == (0, 0)


@pytest.mark.parametrize("method", ["vertex", "surface", "texture"])
def test_killed_at_random_moments_nothing_is_lost(tmp_path, method):
    killed(tmp_path, 4, method, {"samples": 128})


@pytest.mark.slow
@pytest.mark.parametrize(
    ("method", "options"),
    [
        ("vertex", {"samples": 256}),
        ("vertex", {"tolerance": 0.005}),
        ("surface", {"samples": 256}),
        ("texture", {"samples": 256}),
        ("texture", {"tolerance": 0.005}),
        ("texture", {"samples": 64, "profile": True}),
        ("faces", {"samples": 256}),
    ],
    ids=str,
)
def test_killed_at_forty_random_moments_nothing_is_lost(tmp_path, method, options):
    killed(tmp_path, 40, method, options)
