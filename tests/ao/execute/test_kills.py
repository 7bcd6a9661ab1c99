"""Bakes that are interrupted or killed as processes: continued by the command, they give the bytes of a whole one."""

import json
import os
import signal
import subprocess
import sys
import time

import pytest
from command import obscurance, refused, started
from interrupted_bakes import MESH
from project import HELPERS, ROOT, environment

METHODS = ("vertex", "surface")
pytestmark = pytest.mark.skipif(os.name == "nt", reason="POSIX signals")

AT_ONCE = """
import time, warnings
from ao.execute.checkpoint import Checkpoint
put = Checkpoint.put
def slowly(*arguments):
    put(*arguments)
    time.sleep(0.1)
Checkpoint.put = slowly
Checkpoint.__init__.__defaults__ = (False, warnings.warn, 0.0, 0.0, *Checkpoint.__init__.__defaults__[4:])
import cli
cli.main()
"""


@pytest.mark.parametrize(("method", "samples"), [("vertex", 512), ("surface", 128)])
def test_the_command_continues_after_an_interrupt(tmp_path, method, samples):
    mesh, target, journal = tmp_path / "hills.obj", tmp_path / "w.npz", tmp_path / "w.npz.partial"
    lines = [f"v {x} {y} {z}" for x, y, z in MESH.vertices] + [f"f {a} {b} {c}" for a, b, c in MESH.faces + 1]
    mesh.write_text("\n".join(lines))
    arguments = [mesh, "--samples", samples, "--quiet", "--method", method]
    command = [sys.executable, "-c", AT_ONCE, "bake", *arguments, "-o", target]
    assert obscurance("bake", *arguments, "-o", tmp_path / "whole.npz").returncode == 0
    with started(command, cwd=ROOT, stderr=subprocess.PIPE, text=True) as running:
        latest = time.monotonic() + 300
        while running.poll() is None and (not journal.exists() or journal.stat().st_size < 5000):
            assert time.monotonic() < latest, "no checkpoint in five minutes"
            time.sleep(0.01)
        running.send_signal(signal.SIGINT)
        _, errors = running.communicate(timeout=60)
    assert running.returncode == 130, errors
    assert f"{journal} keeps the finished part; the same command with --resume continues from it" in errors
    assert not target.exists()
    assert obscurance("bake", *arguments, "-o", target, "--resume").stderr == ""
    assert target.read_bytes() == (tmp_path / "whole.npz").read_bytes()
    assert not journal.exists()
    journal.write_text("mine")
    refused(obscurance("bake", *arguments, "-o", target), "w.npz.partial", "another file")


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


@pytest.mark.parametrize("method", [*METHODS, "texture"])
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
    ],
    ids=str,
)
def test_killed_at_a_hundred_random_moments_nothing_is_lost(tmp_path, method, options):
    killed(tmp_path, 100, method, options)
