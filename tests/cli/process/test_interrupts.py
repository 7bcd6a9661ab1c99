"""Ctrl-C and SIGTERM end the command within a second whatever it is at, and nothing is half-written or untold."""

import os
import random
import signal
import subprocess
import sys
import time
from contextlib import suppress
from warnings import warn

import pytest
from command import COMMAND, obscurance, started, succeeded
from interrupted_bakes import MESH, folders
from killed_commands import textured
from mesh_files import obj
from meshes import hills
from project import ROOT, environment

from obscurance.ao.execute.kept import Kept
from obscurance.raytrace.errors import OutputError

pytestmark = pytest.mark.skipif(os.name == "nt", reason="signals")
ENDED = "interrupted; no file is half-written"
STUCK = """
import hashlib, os, sys, warnings
from obscurance import cli
from obscurance.ao.execute.kept import Kept
from obscurance.raytrace.system import interrupts

def long_call(_):
    hashlib.pbkdf2_hmac("sha256", b"", b"", 1 << 30)  # some minutes, in which no handler is called

def lost(_):
    try:
        while True:
            pass
    except KeyboardInterrupt:  # as where Python calls back from C
        long_call(_)

def stuck(file):
    print("begun", flush=True)
    {stuck}(file)

Kept.__init__.__defaults__ = (warnings.warn, 0.0, *Kept.__init__.__defaults__[2:])
interrupts._LAST = 0.5
os.fsync = stuck
cli.main()
"""


@pytest.mark.parametrize(("stuck", "by"), [("long_call", signal.SIGTERM), ("lost", signal.SIGINT)])
def test_a_signal_that_python_cannot_raise_ends_the_command_as_one_that_it_can(tmp_path, stuck, by):
    """While the output is written: rows are kept, and it is not whole."""
    mesh, target = tmp_path / "hills.ply", tmp_path / "w.npy"
    mesh.write_bytes(textured(MESH.vertices, MESH.faces))
    target.write_bytes(b"\x93NUMPY precious")
    command = [sys.executable, "-c", STUCK.format(stuck=stuck), "bake", mesh, "--samples", "16", "-o", target]
    with started(command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as running:
        assert running.stdout.readline() == "begun\n"
        running.send_signal(by)
        _, errors = running.communicate(timeout=60)
    (folder,) = folders(target)
    assert running.returncode == 128 + by
    kept = f"obscurance: {folder} keeps the rows that are done: run the command again to go on from there"
    assert errors.splitlines() == [kept, ENDED]
    assert target.read_bytes() == b"\x93NUMPY precious"
    assert set(tmp_path.iterdir()) == {mesh, target, folder}


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
    ("options", "name", "by"),
    [(["--samples", 512], "w.npz", signal.SIGINT), (["--size", 96, "--samples", 64], "w.png", signal.SIGTERM)],
)
def test_the_command_continues_after_an_interrupt(tmp_path, options, name, by):
    mesh, target, whole = tmp_path / "hills.ply", tmp_path / name, tmp_path / f"whole-{name}"
    mesh.write_bytes(textured(MESH.vertices, MESH.faces))
    bake = "bake", mesh, "--quiet", *options
    command = [sys.executable, "-c", AT_ONCE, *map(str, bake), "-o", target]
    succeeded(*bake, "-o", whole)
    with started(command, cwd=ROOT, stderr=subprocess.PIPE, text=True) as running:
        latest = time.monotonic() + 300
        while running.poll() is None and not any(list(folder.glob("?*.?*")) for folder in folders(target)):
            assert time.monotonic() < latest, "no rows in five minutes"
            time.sleep(0.01)
        running.send_signal(by)
        _, errors = running.communicate(timeout=60)
    (folder,) = folders(target)
    kept = f"obscurance: {folder} keeps the rows that are done: run the command again to go on from there"
    assert (running.returncode, errors.splitlines()[-2:]) == (128 + by, [kept, ENDED])
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
    succeeded(*bake)
    assert not folders(target)


TWICE = """
import os, signal
from obscurance.raytrace.system import interrupts
interrupts.take()
interrupts.raise_interrupt()
try:
    os.kill(os.getpid(), signal.SIGTERM)
except KeyboardInterrupt:
    os.kill(os.getpid(), signal.SIGINT)
    os.kill(os.getpid(), signal.SIGTERM)
    print(interrupts.exit_status())
"""


def test_what_an_interrupt_has_begun_to_end_is_not_interrupted():
    done = subprocess.run([sys.executable, "-c", TWICE], cwd=ROOT, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, "143\n", "")


STAGES = {
    "reading and page": "bake large.obj -o out/w.html --samples 1",
    "vertices": "bake large.ply -o out/w.glb --tolerance .02",
    "fit": "bake medium.ply -o out/w.npz --method surface --samples 64",
    "page, seams and images": "bake medium.ply -o out/w.png --size 1024 --samples 1 --error-map out/e.exr",
    "unwrapping": "bake medium.ply -o out/w.glb --occlusion texture --uv unwrap --size 1024 --samples 4",
    "a fine mesh": "bake small.ply -o out/w.png --high large.ply --size 1024 --samples 4",
    "faces": "bake medium.ply -o out/w.npz --at faces --report out/r.json",
    "batch": "bake small.ply medium.ply other.ply --output-dir out --format glb",
    "workers": "bake medium.ply -o out/w.npy --tolerance .005 --cluster local:2",
    "prune": "prune medium.ply -o out/w.glb",
    "picture": "render scene.toml -o out/p.exr",
}


def burden():
    """By how much longer than on an idle machine a process takes now."""
    begun, cpu = time.perf_counter(), time.process_time()
    while time.process_time() < cpu + 0.05:
        pass
    return max((time.perf_counter() - begun) / 0.05, 1.0)


def living(group):
    """The processes of a group that have not ended."""
    psutil, found = pytest.importorskip("psutil", reason="pip install '.[cluster]'"), []
    for each in psutil.process_iter():
        with suppress(ProcessLookupError, psutil.Error):
            if os.getpgid(each.pid) == group and each.status() != psutil.STATUS_ZOMBIE:
                found.append(each.cmdline())
    return found


@pytest.mark.slow
@pytest.mark.parametrize("stage", STAGES)
def test_a_signal_at_any_moment_ends_the_command_within_a_second(tmp_path, stage):
    for name, steps in (("small", 60), ("other", 100), ("medium", 200), ("large", 400)):
        (tmp_path / f"{name}.ply").write_bytes(textured(*hills(steps)))
    (tmp_path / "large.obj").write_bytes(obj(*hills(400)))
    (tmp_path / "scene.toml").write_text(
        '[render]\nwidth = 900\nheight = 600\nsamples = 16\n[[objects]]\nmesh = "medium.ply"\n'
    )
    output, chance = tmp_path / "out", random.Random(stage)
    output.mkdir()
    command = [*COMMAND, *STAGES[stage].split()]
    options = {"cwd": tmp_path, "env": environment(), "stdout": subprocess.DEVNULL, "stderr": subprocess.PIPE}
    begun = time.monotonic()
    subprocess.run(command, check=True, **options)
    took, slowest = time.monotonic() - begun, []
    for path in output.iterdir():
        path.unlink()
    for _ in range(8):
        by = chance.choice((signal.SIGINT, signal.SIGTERM))
        with started(command, text=True, **options) as running:
            try:
                running.wait(took * chance.uniform(0.02, 1))
            except subprocess.TimeoutExpired:
                before, sent = burden(), time.monotonic()
                running.send_signal(by)
                _, errors = running.communicate(timeout=60)
                slowest.append((time.monotonic() - sent) / max(before, burden()))
                if running.returncode not in (0, -by):  # Python ends, or has not begun
                    assert running.returncode == 128 + by
                    assert "interrupted" in errors.splitlines()[-1]
                assert not any(words in errors for words in ("Traceback", "Exception ignored")), errors
            latest = time.monotonic() + 10
            while living(running.pid) and time.monotonic() < latest:  # workers notice that it has gone
                time.sleep(0.1)
            assert not living(running.pid)
        assert not list(output.glob(".obscurance-*"))
        assert len(list(output.iterdir())) <= 3
    print(stage, f"{took:.1f} s", " ".join(f"{seconds:.2f}" for seconds in sorted(slowest)))
    assert max(slowest) < 1
