"""Workers that are started for a bake: late, not at all, stopped, and closed to strangers."""

import asyncio
import os
import time

import pytest
from clusters import BAKES, LEFT_SOCKETS, MEDIUM, bake_on, impatient, kill, scheduler
from interrupted_bakes import bits

from obscurance.ao.cluster.workers import LOCAL, Workers
from obscurance.ao.execute.kept import Kept
from obscurance.raytrace.errors import ClusterError

__all__ = ["impatient"]
pytestmark = LEFT_SOCKETS


def test_workers_may_come_late_and_a_lost_scheduler_leaves_rows_for_one_process(tmp_path, medium, monkeypatch):
    messages, output, lost, script = [], tmp_path / "w.npy", tmp_path / "lost", tmp_path / "hold.py"
    script.write_text(f"from clusters import holding\nholding(1, {str(lost)!r})()")
    monkeypatch.setattr("obscurance.ao.cluster.workers._PATIENCE", 0.2)
    with scheduler(0, [str(script)]) as late:

        def progress(done, total, stage):
            late.sync(late.scheduler.close)
            late.shutdown_scheduler = False  # it need not be asked again
            lost.touch()

        def notify(line):
            messages.append(line)
            if len(messages) == 1:
                late.scale(1)

        with pytest.raises(ClusterError, match=r"tls://.*: the cluster is lost"):
            bake_on(late.scheduler_address, MEDIUM, output, notify, progress, after=0)
    (folder,) = tmp_path.glob("w.npy.partial-*")
    assert list(dict.fromkeys(messages)) == [
        f"{late.scheduler_address}: no workers; waiting for some to join",
        f"{folder} keeps the rows that are done: run the command again to go on from there",
    ]
    assert list(folder.iterdir())
    with Kept(output, pytest.fail) as kept:
        assert bits(MEDIUM(checkpoint=kept)) == medium
    assert not folder.exists()


STOPS = """
import asyncio, os, signal
from pathlib import Path
from clusters import holding
import obscurance.ao.cluster.workers as workers
async def say_nothing(*_):
    await asyncio.sleep(600)
try:
    Path({stopped!r}).open("x").write(str(os.getpid()))
except FileExistsError:
    holding(0, {reported!r})()
else:
    {how}
"""
STOP, SAY_NOTHING = "os.kill(os.getpid(), signal.SIGSTOP)", "workers.declare_likeness = say_nothing"


@pytest.fixture
def starting(tmp_path, monkeypatch, impatient):
    """A function: let workers of this machine run a script as they start."""
    pytest.importorskip("distributed", reason="needs obscurance[cluster]")

    def starting(text):
        script = tmp_path / "starts.py"
        script.write_text(text)
        monkeypatch.setitem(LOCAL, "preload", [*LOCAL["preload"], str(script)])

    return starting


def test_a_worker_that_is_stopped_as_it_starts_is_not_waited_for(tmp_path, medium, starting):
    stopped = tmp_path / "stopped"
    starting(STOPS.format(stopped=str(stopped), reported=str(stopped), how=STOP))
    baked, _ = bake_on("local:2", MEDIUM, tmp_path / "w.npy", lambda _: None)
    assert bits(baked) == medium
    with pytest.raises(ProcessLookupError):
        os.kill(int(stopped.read_text()), 0)


@pytest.mark.parametrize("how", [pytest.param(STOP, marks=pytest.mark.slow), SAY_NOTHING])
def test_where_all_workers_stop_as_they_start_the_bake_ends(tmp_path, starting, monkeypatch, how):
    stopped, messages = tmp_path / "stopped", []
    starting(STOPS.format(stopped=str(stopped), reported="", how=how))
    monkeypatch.setattr("obscurance.ao.cluster.workers._START", 3.0)
    monkeypatch.setattr("obscurance.ao.cluster.workers._PATIENCE", 0.5)

    def notify(line):
        messages.append(line)
        while not stopped.exists() or not stopped.read_text():
            time.sleep(0.05)

    with pytest.raises(ClusterError, match="local: no worker has started within "):
        bake_on("local", MEDIUM, tmp_path / "w.npy", notify)
    assert messages == ["local: no workers; waiting for some to join"]
    with pytest.raises(ProcessLookupError):
        os.kill(int(stopped.read_text()), 0)


@pytest.mark.slow
def test_a_worker_that_is_lost_after_a_while_has_as_long_to_start_again_as_at_first(
    tmp_path, medium, starting, monkeypatch
):
    pid, begun, killed = tmp_path / "pid", time.monotonic(), []
    starting(f"import os; open({str(pid)!r}, 'w').write(str(os.getpid()))")

    def progress(done, total, stage):
        if not killed:
            time.sleep(10)
            monkeypatch.setattr("obscurance.ao.cluster.workers._START", time.monotonic() - begun)
            killed.append(int(pid.read_text()))
            kill(killed[0])

    baked, _ = bake_on("local", MEDIUM, tmp_path / "w.npy", lambda _: None, progress)
    assert bits(baked) == medium
    assert killed != [int(pid.read_text())]


def test_workers_that_cannot_start_end_the_bake_at_once(tmp_path, starting, capfd):
    starting("raise RuntimeError('no worker here')")
    with pytest.raises(ClusterError, match="local: no worker has started within "):
        bake_on("local", MEDIUM, tmp_path / "w.npy")
    assert capfd.readouterr().err == ""


def test_workers_started_here_let_nobody_in_without_their_credentials():
    psutil = pytest.importorskip("psutil", reason="pip install '.[cluster]'")
    from distributed import Security
    from distributed.comm import connect

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
    with Workers("local:1", pytest.fail, 1):
        until = time.monotonic() + 60
        while len(places := listening() - before) < 3:  # the scheduler's, the worker's, its nanny's
            assert time.monotonic() < until
            time.sleep(0.1)
        assert {place.ip for place in places} == {"127.0.0.1"}
        answers = asyncio.run(attack(places))
        assert [answer for answer in answers if not isinstance(answer, OSError | TimeoutError)] == []


def test_a_scheduler_without_credentials_is_warned_of(tmp_path):
    distributed = pytest.importorskip("distributed", reason="pip install '.[cluster]'")
    messages = []
    with distributed.LocalCluster(**LOCAL | {"n_workers": 1, "security": None}) as open_to_all:
        address = open_to_all.scheduler_address
        baked, _ = bake_on(address, BAKES["binary"], tmp_path / "w.npy", messages.append)
    assert bits(baked) == bits(BAKES["binary"]())
    assert messages == [
        f"{address}: whoever reaches this scheduler can run code on its workers and here; tls:// keeps others out"
    ]
