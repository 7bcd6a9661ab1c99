"""Workers that are started for a bake: late, not at all, stopped, and closed to strangers."""

import asyncio
import os
import time
from dataclasses import replace

import pytest
from clusters import BAKES, LEFT_SOCKETS, MEDIUM, SMALL_BLOCKS, bake_on, impatient, scheduler
from parts_of_bakes import bits

from ao.cluster.dask_cluster import LOCAL
from ao.execute.checkpoint import Checkpoint
from raytrace.errors import ClusterError

__all__ = ["impatient"]
pytestmark = LEFT_SOCKETS
BRIEF = replace(SMALL_BLOCKS, silence=3.0, patience=0.5)


def test_workers_may_come_late_and_a_lost_scheduler_leaves_a_journal_for_one_process(tmp_path, medium):
    messages, path, lost, script = [], tmp_path / "w.partial", tmp_path / "lost", tmp_path / "hold.py"
    script.write_text(f"from clusters import holding\nholding(1, {str(lost)!r})()")
    with scheduler(0, [str(script)]) as late:

        def progress(done, total, stage):
            late.sync(late.scheduler.close)
            late.shutdown_scheduler = False  # it need not be asked again
            lost.touch()

        def notify(line):
            messages.append(line)
            if len(messages) == 1:
                late.scale(1)

        pace = replace(SMALL_BLOCKS, patience=0.2)
        with pytest.raises(ClusterError, match=r"tls://.*: the cluster is lost"):
            bake_on(late.scheduler_address, MEDIUM, path, notify, progress, pace, after=0, every=0)
    assert list(dict.fromkeys(messages)) == [
        f"{late.scheduler_address}: no workers; waiting for some to join",
        f"{path} keeps the finished part; the same command with --resume continues from it",
    ]
    with Checkpoint(path, resume=True, notify=pytest.fail) as checkpoint:
        assert bits(MEDIUM(checkpoint=checkpoint)) == medium


STOPS = """
import os, signal
from pathlib import Path
from clusters import holding
try:
    Path({stopped!r}).open("x").write(str(os.getpid()))
except FileExistsError:
    holding(0, {reported!r})()
else:
    os.kill(os.getpid(), signal.SIGSTOP)
"""


@pytest.fixture
def starting(tmp_path, monkeypatch, impatient):
    """A function: let workers of this machine run a script as they start."""
    pytest.importorskip("distributed", reason="needs obscurance[cluster]")

    def starting(text):
        script = tmp_path / "starts.py"
        script.write_text(text)
        monkeypatch.setitem(LOCAL, "preload", [*LOCAL["preload"], str(script)])

    return starting


def test_a_worker_that_is_stopped_as_it_starts_is_reported_and_others_trace(tmp_path, medium, starting):
    stopped, reported, messages = tmp_path / "stopped", tmp_path / "reported", []
    starting(STOPS.format(stopped=str(stopped), reported=str(reported)))

    def notify(line):
        messages.append(line)
        if "have started" in line:
            reported.touch()

    baked, dispatch = bake_on("local:2", MEDIUM, tmp_path / "w.partial", notify, pace=BRIEF)
    assert bits(baked) == medium
    assert len(dispatch.blocks) == 1
    assert "local:2: 1 of 2 workers have started within 3 s; going on without the rest" in messages
    with pytest.raises(ProcessLookupError):
        os.kill(int(stopped.read_text()), 0)


def test_where_all_workers_are_stopped_as_they_start_the_bake_ends(tmp_path, starting):
    stopped, messages = tmp_path / "stopped", []
    starting(STOPS.format(stopped=str(stopped), reported=""))

    def notify(line):
        messages.append(line)
        while not stopped.exists() or not stopped.read_text():
            time.sleep(0.05)

    with pytest.raises(ClusterError, match="local: no worker has started within "):
        bake_on("local", MEDIUM, tmp_path / "w.partial", notify, pace=replace(BRIEF, start=4.0))
    assert messages == ["local: no workers; waiting for some to join"]
    with pytest.raises(ProcessLookupError):
        os.kill(int(stopped.read_text()), 0)


def test_workers_that_cannot_start_end_the_bake_at_once(tmp_path, starting, capfd):
    starting("raise RuntimeError('no worker here')")
    with pytest.raises(ClusterError, match="local: no worker has started within "):
        bake_on("local", MEDIUM, tmp_path / "w.partial", pace=replace(SMALL_BLOCKS, patience=0.5, silence=60.0))
    assert capfd.readouterr().err == ""


def test_a_worker_that_is_stopped_at_work_does_not_hold_the_end(tmp_path, medium, starting):
    stopped, messages = tmp_path / "stopped", []
    starting(f"""
import os, signal
from pathlib import Path
import ao.cluster.worker
from ao.execute.work import fill
def stop(*arguments):
    try:
        Path({str(stopped)!r}).open("x").write(str(os.getpid()))
    except FileExistsError:
        return fill(*arguments)
    os.kill(os.getpid(), signal.SIGSTOP)
ao.cluster.worker.fill = stop
""")
    baked, _ = bake_on("local:2", MEDIUM, tmp_path / "w.partial", messages.append, pace=BRIEF)
    assert bits(baked) == medium
    assert any("has not been heard of for 3 s" in line for line in messages)
    with pytest.raises(ProcessLookupError):
        os.kill(int(stopped.read_text()), 0)


def test_workers_started_here_let_nobody_in_without_their_credentials():
    psutil = pytest.importorskip("psutil", reason="pip install '.[cluster]'")
    from distributed import Security
    from distributed.comm import connect

    from ao.cluster.dask_cluster import DaskCluster

    def listening():
        here = psutil.Process()
        found = [each for process in (here, *here.children(recursive=True)) for each in process.net_connections()]
        return {each.laddr for each in found if each.status == "LISTEN"}

    async def call(address, security):
        comm = await connect(address, timeout=3, **security.get_connection_args("client"))
        await comm.write({"op": "identity", "reply": True})
        return await comm.read()

    async def attack(places):
        calls = [
            asyncio.wait_for(call(f"{protocol}://{ip}:{port}", security), 5)
            for protocol, security in (("tcp", Security(require_encryption=False)), ("tls", Security.temporary()))
            for ip, port in places
        ]
        return await asyncio.gather(*calls, return_exceptions=True)

    before = listening()
    cluster = DaskCluster("local:1", 1)
    try:
        cluster.connect()
        until = time.monotonic() + 60
        while len(places := listening() - before) < 3:  # the scheduler's, the worker's, its nanny's
            assert time.monotonic() < until
            time.sleep(0.1)
        assert {place.ip for place in places} == {"127.0.0.1"}
        answers = asyncio.run(attack(places))
        assert [answer for answer in answers if not isinstance(answer, OSError | TimeoutError)] == []
    finally:
        cluster.close()


def test_a_scheduler_without_credentials_is_warned_of(tmp_path):
    distributed = pytest.importorskip("distributed", reason="pip install '.[cluster]'")
    messages = []
    with distributed.LocalCluster(n_workers=1, **LOCAL | {"security": None}) as open_to_all:
        address = open_to_all.scheduler_address
        baked, _ = bake_on(address, BAKES["binary"], tmp_path / "w.partial", messages.append)
    assert bits(baked) == bits(BAKES["binary"]())
    assert messages == [
        f"{address}: whoever reaches this scheduler can run code on its workers and here; tls:// keeps others out"
    ]
