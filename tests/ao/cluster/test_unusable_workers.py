"""Workers of a cluster that cannot be used: one line says why, others trace, and what they answer is never run."""

import os
import signal
import time

import pytest
from clusters import LEFT_SOCKETS, MEDIUM, Attack, bake_on, kill, on_one, scheduler, victims_of
from interrupted_bakes import bits

from obscurance.ao.execute.work import bit_environment
from obscurance.raytrace.errors import ClusterError

pytestmark = LEFT_SOCKETS


def made_useless(how):
    """A function for a worker, which is sent as it is."""

    def become_another():
        from obscurance.ao.execute.work import bit_environment

        bit_environment()["test"] = "a z80"

    def forget_the_package():
        import sys

        sys.modules["test.hidden"], sys.modules["obscurance.ao.cluster.workers"] = (
            sys.modules["obscurance.ao.cluster.workers"],
            None,
        )

    return become_another if how == "another processor" else forget_the_package


@pytest.mark.parametrize(
    ("how", "start", "end"),
    [
        ("another processor", "test: expected ", ", got a z80"),
        ("no package", "ModuleNotFoundError(", "None in sys.modules"),
    ],
)
def test_a_worker_unlike_the_client_is_reported_in_one_line(cluster, tmp_path, medium, monkeypatch, how, start, end):
    with on_one(cluster, made_useless(how), tmp_path / "reported", monkeypatch) as (odd, messages, notify):
        baked, _ = bake_on(cluster.scheduler_address, MEDIUM, tmp_path / "w.npy", notify)
    assert bits(baked) == medium
    assert len(messages) == 1
    assert messages[0].startswith(f"worker {odd} gets no work: {start}")
    assert end in messages[0]


def test_where_no_worker_can_be_used_one_is_waited_for(cluster, tmp_path, monkeypatch):
    monkeypatch.setitem(bit_environment(), "Embree", "4.0.0")
    monkeypatch.setattr("obscurance.ao.cluster.workers._PATIENCE", 1.0)
    messages = []

    def notify(line):
        messages.append(line)
        if "waiting" in line:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        bake_on(cluster.scheduler_address, MEDIUM, tmp_path / "w.npy", notify)
    assert sorted(line.partition(": ")[2].partition(",")[0] for line in messages[:2]) == ["Embree: expected 4.0.0"] * 2
    assert messages[2:] == [f"{cluster.scheduler_address}: no workers; waiting for some to join"]


@pytest.mark.parametrize("answer", ["code", "few"])
def test_an_answer_that_is_no_table_ends_the_bake_and_is_never_run(cluster, tmp_path, monkeypatch, answer):
    def lie():
        import obscurance.ao.cluster.workers

        honest = obscurance.ao.cluster.workers.packed
        obscurance.ao.cluster.workers.packed = {
            "code": lambda *_: Attack(str(tmp_path / "attacked")),
            "few": lambda *arguments: honest(*arguments)[:-8],
        }[answer]

    with on_one(cluster, lie, tmp_path / "reported", monkeypatch) as (_, messages, notify):
        with pytest.raises(ClusterError, match="tls://"):
            bake_on(cluster.scheduler_address, MEDIUM, tmp_path / "w.npy", notify)
        (tmp_path / "reported").touch()
    assert not (tmp_path / "attacked").exists()
    assert messages == []


FULL = """
import obscurance.ao.cluster.workers
def full(*_):
    raise OSError(28, "No space left on device")
obscurance.ao.cluster.workers.make_on_threads = full
"""


def test_a_worker_that_fails_at_once_gets_no_more_work(tmp_path, medium):
    script, failing, reported, messages = (*(tmp_path / name for name in ("full.py", "failing", "reported")), [])
    script.write_text(f"""
from clusters import holding, is_first
if is_first({str(failing)!r}):
    exec({FULL!r})
else:
    holding(0, {str(reported)!r})()
""")

    def notify(line):
        messages.append(line)
        reported.touch()

    with scheduler(2, [str(script)]) as cluster:
        baked, _ = bake_on(cluster.scheduler_address, MEDIUM, tmp_path / "w.npy", notify)
    assert bits(baked) == medium
    assert len(messages) == 1
    assert messages[0].endswith(" gets no more work: OSError: [Errno 28] No space left on device")


@pytest.mark.slow
def test_where_all_workers_fail_the_bake_ends(tmp_path):
    script = tmp_path / "full.py"
    script.write_text(FULL)
    with scheduler(1, [str(script)]) as cluster, pytest.raises(ClusterError, match="fails on every worker: OSError"):
        bake_on(cluster.scheduler_address, MEDIUM, tmp_path / "w.npy", lambda _: None)


def test_others_trace_the_blocks_of_a_worker_that_stands_still(tmp_path, medium):
    config = pytest.importorskip("dask").config

    def stop():
        import obscurance.ao.cluster.workers

        obscurance.ao.cluster.workers.make_on_threads = lambda *_: os.kill(os.getpid(), signal.SIGSTOP)

    def prepare(number):
        return stop if number == 0 else int

    from obscurance.ao.cluster import workers

    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(workers.CONFIG, "distributed.scheduler.worker-ttl", "2s")
        with config.set({}), scheduler(2) as cluster, victims_of(cluster, 2, prepare) as pids:
            baked, _ = bake_on(cluster.scheduler_address, MEDIUM, tmp_path / "w.npy", lambda _: None)
            kill(pids[0])  # or the cluster waits for it to end
    assert bits(baked) == medium


SILENT = """
import asyncio, os, signal
from pathlib import Path
import obscurance.ao.cluster.workers as workers
from clusters import holding, is_first
from obscurance.ao.execute.work import bit_environment

async def say_nothing(*_):
    Path({asked!r}).write_text(str(os.getpid()))
    {instead}

if is_first({first!r}):
    holding(1, {reported!r})()
elif is_first({second!r}):
    workers.declare_likeness = say_nothing
else:
    bit_environment()["test"] = "a z80"
"""


@pytest.mark.parametrize(
    "instead",
    [pytest.param("await asyncio.sleep(600)", marks=pytest.mark.slow), "os.kill(os.getpid(), signal.SIGSTOP)"],
)
def test_a_late_worker_that_says_nothing_keeps_nobody_waiting(tmp_path, medium, instead):
    """Nor another one from being named that cannot be used either."""
    places = {name: tmp_path / name for name in ("first", "second", "asked", "reported")}
    script, messages, late = tmp_path / "silent.py", [], []
    script.write_text(SILENT.format(instead=instead, **{name: str(place) for name, place in places.items()}))

    def notify(line):
        messages.append(line)
        while not (places["asked"].exists() and places["asked"].read_text()):
            time.sleep(0.01)
        places["reported"].touch()

    def progress(done, total, stage):
        if not late:
            late.append(cluster.scale(3))
            while len(cluster.scheduler_info["workers"]) < 3:  # and asked at once
                time.sleep(0.01)

    with scheduler(1, [str(script)]) as cluster:
        baked, _ = bake_on(cluster.scheduler_address, MEDIUM, tmp_path / "w.npy", notify, progress)
        kill(int(places["asked"].read_text()))  # or the cluster waits for it to end
    assert bits(baked) == medium
    assert [line.partition(": ")[2] for line in messages] == ["test: expected nothing, got a z80"]
