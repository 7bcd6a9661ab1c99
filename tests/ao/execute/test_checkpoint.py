"""Interrupted bakes: what was traced is kept, what is continued has the same bits."""

import errno
import os
import shutil
import subprocess
import sys

import numpy as np
import pytest
from interrupted_bakes import MESH, METHODS, OPTIONS, Stopped, bake, bake_surface, bits, interrupted
from project import environment

import ao
import ao.execute.tracer
import ao.least_squares.fit
import ao.least_squares.patch
import ao.methods.surface_method
from ao.execute.checkpoint import Checkpoint
from ao.execute.journal import Journal
from ao.least_squares.conjugate_gradients import solve_within

POSIX = pytest.mark.skipif(os.name == "nt", reason="POSIX locks, limits and signals")


@pytest.fixture(scope="module")
def whole():
    return bits(ao.bake(MESH, **OPTIONS))


@pytest.fixture(scope="module")
def whole_surface():
    return bits(bake_surface(MESH, **OPTIONS))


@pytest.fixture
def traced(monkeypatch):
    """The number of rows or faces that were traced rather than copied."""
    count = [0]
    for module, name in (
        (ao.execute.tracer, "gather_hemispheres"),
        (ao.execute.tracer, "gather_streams"),
        (ao.least_squares.patch, "gather_faces"),
    ):

        def counted(*arguments, gather=getattr(module, name)):
            count[0] += len(arguments[-1])
            gather(*arguments)

        monkeypatch.setattr(module, name, counted)
    return count


def test_a_continued_bake_copies_what_was_traced(path, whole, traced):
    interrupted(path)
    first, traced[0] = traced[0], 0
    messages = []
    assert bits(bake(path, messages, resume=True)) == whole
    assert first > 0.5 * len(MESH.vertices)
    assert traced[0] < 0.6 * len(MESH.vertices)
    assert messages == []
    assert not path.exists()


def test_a_continued_bake_of_the_surface_copies_what_was_traced(path, whole_surface, traced):
    interrupted(path, make=bake_surface)
    first, traced[0] = traced[0], 0
    messages = []
    assert bits(bake(path, messages, make=bake_surface, resume=True)) == whole_surface
    assert first > 0.5 * len(MESH.faces)
    assert traced[0] < 0.6 * len(MESH.faces)
    assert messages == []
    assert not path.exists()


def test_a_bake_interrupted_after_its_last_ray_traces_nothing_again(path, whole_surface, traced, monkeypatch):
    def stop(*_):
        raise Stopped

    with monkeypatch.context() as patch:
        patch.setattr(ao.methods.surface_method, "fit_values", stop)
        interrupted(path, stop=None, make=bake_surface)
    traced[0] = 0
    assert bits(bake(path, make=bake_surface, resume=True)) == whole_surface
    assert traced[0] == 0


def test_a_fit_is_continued_where_it_was_interrupted(path, whole_surface, traced, monkeypatch):
    def stop(*_, **__):
        raise Stopped

    def then_stop(*arguments, **named):
        patch.setattr(ao.least_squares.fit, "solve", stop)  # the bent normals'
        return solve_within(*arguments, **named)

    with monkeypatch.context() as patch:
        patch.setattr(ao.least_squares.fit, "solve_within", then_stop)
        interrupted(path, stop=None, make=bake_surface)
    solved = []
    with monkeypatch.context() as patch:
        patch.setattr(ao.least_squares.fit, "cross_validated", stop)
        patch.setattr(ao.least_squares.fit, "solve_within", lambda *a, **k: solved.append(a) or solve_within(*a, **k))
        traced[0] = 0
        assert bits(bake(path, make=bake_surface, resume=True)) == whole_surface
    assert traced[0] == 0
    assert len(solved) == 1  # the relaxed one


def test_much_that_waits_is_written_before_a_minute(path):
    interrupted(path, make=bake_surface, after=60, most_waiting=150_000)
    assert path.stat().st_size > 150_000


def test_what_is_written_before_a_minute_counts_for_nothing_after_a_crash(path, whole):
    sizes = []

    def crash_later(done, total, stage):
        if path.exists():
            sizes.append(path.stat().st_size)
            shutil.copy(path, copy)

    copy = path.with_suffix(".copy")
    with Checkpoint(path, after=60, most_waiting=1000) as checkpoint:
        ao.bake(MESH, checkpoint=checkpoint, progress=crash_later, **OPTIONS)
    assert max(sizes) > 50_000
    assert not path.exists()
    copy.rename(path)
    messages = []
    assert bits(bake(path, messages, resume=True)) == whole
    assert messages == [f"{path}: nothing to resume; starting from the beginning"]


THIRD = {"samples": 128, "only": np.arange(2500) % 3 == 0}
WAYS = [
    ("vertex", {"tolerance": 0.003}),
    ("vertex", THIRD),
    ("vertex", {"tolerance": 0.01, "falloff": ["binary", "exponential"]}),
    ("surface", {"samples": 128, "only": np.arange(2500) < 500}),
    ("surface", {"tolerance": 0.01}),
]


@pytest.mark.parametrize(("method", "options"), WAYS, ids=str)
def test_every_way_to_bake_is_continued(path, method, options):
    make = METHODS[method]
    interrupted(path, 0.5, options=options, make=make)
    assert bits(bake(path, resume=True, options=options, make=make)) == bits(make(MESH, **options))


def test_a_short_bake_leaves_no_trace(path, whole):
    interrupted(path, after=60)
    assert not path.exists()
    assert bits(bake(path, after=60)) == whole


def test_starting_over_is_reported_and_tidies_up(path, whole, traced):
    interrupted(path)
    traced[0] = 0
    messages = []
    assert bits(bake(path, messages, after=60)) == whole
    assert traced[0] > len(MESH.vertices)
    assert len(messages) == 1
    assert "--resume would continue it" in messages[0]
    assert not path.exists()


@pytest.mark.parametrize("share", [0.0, 0.3, 0.9, 0.999])
@pytest.mark.parametrize("method", METHODS)
def test_a_torn_journal_is_used_as_far_as_it_is_whole(path, whole, whole_surface, share, method):
    interrupted(path, make=METHODS[method])
    os.truncate(path, int(share * path.stat().st_size))
    expected = whole if method == "vertex" else whole_surface
    assert bits(bake(path, resume=True, make=METHODS[method])) == expected


def test_a_changed_byte_is_not_believed(path, whole):
    interrupted(path)
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)
    assert bits(bake(path, resume=True)) == whole


def test_zeros_that_a_power_failure_leaves_are_not_believed(path, whole):
    interrupted(path)
    size = path.stat().st_size
    os.truncate(path, size // 2)
    os.truncate(path, size)
    assert bits(bake(path, resume=True)) == whole
    path.write_bytes(bytes(1000))
    assert bits(bake(path, resume=True)) == whole


def test_nothing_to_resume_is_reported(path, whole):
    messages = []
    assert bits(bake(path, messages, resume=True)) == whole
    assert "nothing to resume" in messages[0]


@pytest.mark.parametrize("gone", ["journal", "folder"])
def test_a_journal_that_vanished_is_a_fresh_start(tmp_path, whole, gone):
    path = tmp_path / "out" / "w.npy.partial"
    path.parent.mkdir()
    interrupted(path)
    path.unlink() if gone == "journal" else shutil.rmtree(path.parent)
    messages = []
    assert bits(bake(path, messages, resume=True)) == whole
    assert messages[0] == f"{path}: nothing to resume; starting from the beginning"
    later = [] if gone == "journal" else [f"{path}: No such file or directory; going on without checkpoints"]
    assert messages[1:] == later


@POSIX
@pytest.mark.parametrize("gone", ["journal", "folder"])
def test_a_journal_that_vanishes_while_it_is_continued_costs_no_row(tmp_path, whole, gone):
    path = tmp_path / "out" / "w.npy.partial"
    path.parent.mkdir()
    interrupted(path)

    def vanish(done, total, stage):
        if path.exists() and done > 0.8 * total:
            path.unlink() if gone == "journal" else shutil.rmtree(path.parent)

    messages = []
    with Checkpoint(path, resume=True, notify=messages.append, after=0, every=0) as checkpoint:
        assert bits(ao.bake(MESH, checkpoint=checkpoint, progress=vanish, **OPTIONS)) == whole
    assert messages == [f"{path}: No such file or directory; going on without checkpoints"]
    assert not path.exists()


@POSIX
def test_of_two_bakes_that_begin_together_one_goes_on_without(path, whole):
    messages, holder = [], []

    class BesideAnother(Checkpoint):
        def begin(self, *arguments):
            super().begin(*arguments)
            holder.append(Journal(path, create=True))

    with BesideAnother(path, notify=messages.append, after=0, every=0) as checkpoint:
        assert bits(ao.bake(MESH, checkpoint=checkpoint, **OPTIONS)) == whole
    holder[0].close()
    assert len(messages) == 1
    assert "another bake to the same target is at work; going on without checkpoints" in messages[0]
    assert path.exists()


@pytest.mark.parametrize(
    ("code", "method"), [(errno.ENOSPC, "vertex"), (errno.EIO, "vertex"), (errno.ENOSPC, "surface")]
)
def test_a_disk_that_refuses_does_not_stop_the_bake(path, whole, whole_surface, fail_call, code, method):
    messages = []
    fail_call("fsync", code)
    assert bits(bake(path, messages, make=METHODS[method])) == (whole if method == "vertex" else whole_surface)
    assert len(messages) == 1
    assert messages[0].endswith(f"w.npy.partial: {os.strerror(code)}; going on without checkpoints")


LIMITED = """
import resource, signal, sys
resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000))
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
from pathlib import Path
import interrupted_bakes as t
messages = []
assert t.bits(t.bake(Path(sys.argv[1]), messages)) == t.bits(t.ao.bake(t.MESH, **t.OPTIONS))
print(messages)
messages = []
t.interrupted(Path(sys.argv[1]))
print(Path(sys.argv[1]).stat().st_size)
"""


@POSIX
def test_a_file_that_may_not_grow_further(path, whole):
    """A write that the system takes a part of; what was whole before is continued."""
    command = [sys.executable, "-c", LIMITED, path]
    result = subprocess.run(command, env=environment(), capture_output=True, text=True, timeout=120, check=True)
    messages, size = result.stdout.splitlines()
    assert messages.count("going on without checkpoints") == 1
    assert 50_000 < int(size) <= 100_000
    assert bits(bake(path, resume=True)) == whole
