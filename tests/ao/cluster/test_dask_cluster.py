"""Bakes by real workers of a real scheduler: the bits of one process, whoever is lost on the way."""

import asyncio
import os
import signal
import time
from contextlib import contextmanager
from functools import partial

import numpy as np
import pytest
from clusters import (
    BAKES,
    LEFT_SOCKETS,
    all_bits,
    bake_on,
    compiled_by,
    holding,
    kill,
    killed_in_mid_block,
    scheduler,
    small_blocks,
)
from meshes import hills
from parts_of_bakes import bits

import ao
import ao.cluster.session
from ao.cluster.addresses import LOCAL, local_workers
from ao.cluster.dispatch import IN_FLIGHT
from ao.cluster.session import ClusterSession
from ao.execute.checkpoint import Checkpoint
from raytrace import InputError, Mesh, OptionError
from raytrace.errors import ClusterError

__all__ = ["small_blocks"]
pytestmark = [pytest.mark.usefixtures("small_blocks"), LEFT_SOCKETS]


@pytest.mark.parametrize("name", BAKES)
def test_workers_make_the_bits_of_one_process(cluster, tmp_path, name):
    alone = BAKES[name]()  # at first: workers load its kernels
    baked, dispatch = bake_on(cluster.scheduler_address, BAKES[name], tmp_path / "w.partial")
    assert all_bits(baked) == all_bits(alone)
    assert baked.rays == alone.rays
    assert sum(dispatch.blocks.values()) > 1
    assert dispatch.again == 0
    assert not list(tmp_path.iterdir())
    assert set(compiled_by(cluster)) == {()}


MEDIUM = partial(ao.bake, Mesh(*hills(100)), samples=512)
MEDIUM_ROWS = 10_000 + 312  # some are traced twice, to calibrate errors


@contextmanager
def on_one(cluster, function, reported):
    """Run a function on one of two workers, and kill it in the end, for a new one to come.

    Gives its address, the messages of a bake, and what to tell them to: the other worker traces after the first one.
    """
    from distributed import Client

    messages = []

    def tell(line):
        messages.append(line)
        reported.touch()

    with Client(cluster, set_as_default=False) as client:
        client.wait_for_workers(2)
        odd, other = client.nthreads()
        (pid,) = client.run(os.getpid, workers=[odd]).values()
        client.run(function, workers=[odd])
        client.run(holding(0, reported), workers=[other])
        yield odd, messages, tell
        kill(pid)
        while odd in client.nthreads():
            time.sleep(0.05)


@pytest.fixture(scope="module")
def medium():
    return bits(MEDIUM())


@pytest.mark.parametrize("victims", [1, 2])
def test_killed_workers_lose_only_the_blocks_that_they_had(cluster, tmp_path, medium, victims):
    with killed_in_mid_block(cluster, tmp_path, victims):
        baked, dispatch = bake_on(cluster.scheduler_address, MEDIUM, tmp_path / "w.partial")
    assert bits(baked) == medium
    assert victims <= dispatch.again <= IN_FLIGHT * victims
    assert dispatch.rows == MEDIUM_ROWS


def test_a_worker_unlike_the_client_is_reported_in_one_line(cluster, tmp_path, medium):
    def become_another():
        import ao.cluster.worker

        was = ao.cluster.worker.machine()
        ao.cluster.worker.machine = lambda: was | {"processor": "a z80"}

    with on_one(cluster, become_another, tmp_path / "reported") as (odd, messages, tell):
        baked, dispatch = bake_on(cluster.scheduler_address, MEDIUM, tmp_path / "w.partial", tell)
    assert bits(baked) == medium
    assert odd not in dispatch.blocks
    assert len(messages) == 1
    assert messages[0].startswith(f"worker {odd} gets no work: processor: expected ")
    assert messages[0].endswith(", got a z80")


def test_a_worker_whose_disk_is_full_gets_no_more_work(cluster, tmp_path, medium):
    def fail_once_greeted():
        import ao.cluster.worker

        def full(*_):
            raise OSError(28, "No space left on device")

        ao.cluster.worker.fill = full

    with on_one(cluster, fail_once_greeted, tmp_path / "reported") as (odd, messages, tell):
        baked, dispatch = bake_on(cluster.scheduler_address, MEDIUM, tmp_path / "w.partial", tell)
    assert bits(baked) == medium
    assert odd not in dispatch.blocks
    assert messages == [f"worker {odd} gets no work: OSError: [Errno 28] No space left on device"]


def test_where_no_worker_can_be_used_the_reason_is_named(cluster, tmp_path, monkeypatch):
    monkeypatch.setattr("ao.cluster.session._PATIENCE", 0.5)
    here = ao.cluster.session.machine()
    monkeypatch.setattr("ao.cluster.session.machine", lambda: here | {"Embree": "4.0.0"})
    messages = []
    with pytest.raises(InputError, match=r"no worker can be used: tls://.*: Embree: expected 4.0.0, got"):
        bake_on(cluster.scheduler_address, MEDIUM, tmp_path / "w.partial", messages.append)
    assert messages[0].startswith("worker tls://")


def test_a_folder_that_workers_do_not_see_is_reported(cluster, tmp_path, monkeypatch):
    monkeypatch.setattr("ao.cluster.session._PATIENCE", 0.5)
    written = ao.cluster.session.write_scene

    def unshared(folder, *arguments):
        file = written(folder, *arguments)
        return file._replace(path=file.path.replace(str(folder), "/nowhere"))

    monkeypatch.setattr("ao.cluster.session.write_scene", unshared)
    expected = r"no worker can be used: .*: /nowhere/.*: expected a folder that all workers share, got No such file"
    with pytest.raises(InputError, match=expected):
        bake_on(cluster.scheduler_address, partial(ao.bake, Mesh(*hills(61))), tmp_path / "w.partial", lambda _: None)


def test_workers_may_come_late_and_a_lost_scheduler_leaves_a_journal_for_one_process(tmp_path, medium, monkeypatch):
    messages, path, lost, script = [], tmp_path / "w.partial", tmp_path / "lost", tmp_path / "hold.py"
    script.write_text(f"from clusters import holding\nholding(1, {str(lost)!r})()")
    with scheduler(0, [str(script)]) as late:

        def progress(done, total):
            late.sync(late.scheduler.close)
            late.shutdown_scheduler = False  # it need not be asked again
            lost.touch()

        def tell(line):
            messages.append(line)
            if len(messages) == 1:
                late.scale(1)

        monkeypatch.setattr("ao.cluster.session._PATIENCE", 0.2)
        with pytest.raises(ClusterError, match=r"tls://.*: the cluster is lost"):
            bake_on(late.scheduler_address, MEDIUM, path, tell, progress, after=0, every=0)
    assert list(dict.fromkeys(messages)) == [
        f"{late.scheduler_address}: no workers; waiting for some to join",
        f"{path} keeps the finished part; the same command with --resume continues from it",
    ]
    with Checkpoint(path, resume=True, notify=pytest.fail) as checkpoint:
        assert bits(MEDIUM(checkpoint=checkpoint)) == medium


def test_an_address_without_a_scheduler_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("ao.cluster.dask_cluster._CONNECT", 0.3)
    with pytest.raises(OptionError, match=r"cluster: expected .* got nothing that answers"):
        bake_on("tcp://127.0.0.1:1", MEDIUM, tmp_path / "w.partial")
    for address in ("local:0", "local:x", "local:", "here", "tcp://", "", "local:5000"):
        with pytest.raises(OptionError, match="cluster: expected local, local:N or the address"):
            local_workers(address)
    assert [local_workers(address) for address in ("local", "local:3", "tcp://a:1")] == [1, 3, None]


def test_a_worker_that_stands_still_is_reported_and_others_trace_its_blocks(cluster, tmp_path, medium, monkeypatch):
    monkeypatch.setattr("ao.cluster.session._SILENCE", 1.5)

    def stop():
        import ao.cluster.worker

        ao.cluster.worker.fill = lambda *_: os.kill(os.getpid(), signal.SIGSTOP)

    with on_one(cluster, stop, tmp_path / "reported") as (odd, messages, tell):
        baked, dispatch = bake_on(cluster.scheduler_address, MEDIUM, tmp_path / "w.partial", tell)
    assert bits(baked) == medium
    assert odd not in dispatch.blocks
    assert messages == [f"worker {odd} has not been heard of for 2 s; others get its blocks"]


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
def starting(tmp_path, monkeypatch):
    """A function: let workers of this machine run a script as they start, and wait for them only briefly."""
    pytest.importorskip("distributed", reason="needs obscurance[cluster]")

    def starting(text):
        script = tmp_path / "starts.py"
        script.write_text(text)
        monkeypatch.setitem(LOCAL, "preload", [*LOCAL["preload"], str(script)])
        for name, seconds in {"session._SILENCE": 3.0, "session._PATIENCE": 0.5, "dask_cluster._END": 1.0}.items():
            monkeypatch.setattr(f"ao.cluster.{name}", seconds)

    return starting


def test_a_worker_that_is_stopped_as_it_starts_is_reported_and_others_trace(tmp_path, medium, starting, monkeypatch):
    stopped, reported, messages = tmp_path / "stopped", tmp_path / "reported", []
    starting(STOPS.format(stopped=str(stopped), reported=str(reported)))

    def tell(line):
        messages.append(line)
        if "have started" in line:
            reported.touch()

    baked, dispatch = bake_on("local:2", MEDIUM, tmp_path / "w.partial", tell)
    assert bits(baked) == medium
    assert len(dispatch.blocks) == 1
    assert "local:2: 1 of 2 workers have started within 3 s; going on without the rest" in messages
    with pytest.raises(ProcessLookupError):
        os.kill(int(stopped.read_text()), 0)


def test_where_all_workers_are_stopped_as_they_start_the_bake_ends(tmp_path, starting, monkeypatch):
    stopped, messages = tmp_path / "stopped", []
    starting(STOPS.format(stopped=str(stopped), reported=""))

    def tell(line):
        messages.append(line)
        while not stopped.exists() or not stopped.read_text():
            time.sleep(0.05)
        monkeypatch.setattr("ao.cluster.session._START", 0.0)

    with pytest.raises(ClusterError, match="local: no worker has started within "):
        bake_on("local", MEDIUM, tmp_path / "w.partial", tell)
    assert messages == ["local: no workers; waiting for some to join"]
    with pytest.raises(ProcessLookupError):
        os.kill(int(stopped.read_text()), 0)


def test_workers_that_cannot_start_end_the_bake_at_once(tmp_path, starting, monkeypatch, capfd):
    starting("raise RuntimeError('no worker here')")
    monkeypatch.setattr("ao.cluster.session._SILENCE", 60.0)
    with pytest.raises(ClusterError, match="local: no worker has started within "):
        bake_on("local", MEDIUM, tmp_path / "w.partial")
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
    baked, _ = bake_on("local:2", MEDIUM, tmp_path / "w.partial", messages.append)
    assert bits(baked) == medium
    assert any("has not been heard of for 3 s" in line for line in messages)
    with pytest.raises(ProcessLookupError):
        os.kill(int(stopped.read_text()), 0)


class Attack:
    """What makes a file where it is unpickled."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return os.mkdir, (self.path,)


@pytest.mark.parametrize("answer", ["code", "few", "many", "numbers"])
def test_what_a_worker_answers_is_no_code_and_of_the_length_that_was_asked_for(cluster, tmp_path, medium, answer):
    def lie():
        import ao.cluster.worker

        honest = ao.cluster.worker.pack
        ao.cluster.worker.pack = {
            "code": lambda tables: (Attack(str(tmp_path / "attacked")),) * len(tables),
            "few": lambda tables: [content[:-8] for content in honest(tables)],
            "many": lambda tables: [*honest(tables), b""],
            "numbers": lambda tables: [1] * len(tables),
        }[answer]

    with on_one(cluster, lie, tmp_path / "reported") as (odd, messages, tell):
        baked, dispatch = bake_on(cluster.scheduler_address, MEDIUM, tmp_path / "w.partial", tell)
    assert bits(baked) == medium
    assert odd not in dispatch.blocks
    assert not (tmp_path / "attacked").exists()
    assert len(messages) == 1
    assert messages[0].startswith(f"worker {odd} gets no work: ")


def numbered(first, fails=-1):
    """Work of eight rows: numbers from `first` on, in some time; row `fails` of the whole cannot be made."""

    class Numbered:
        name, rays, block = b"numbered" * 2, float(1 << 20), 1

        def __init__(self, numbers):
            self.numbers = numbers

        def __len__(self):
            return len(self.numbers)

        def __getitem__(self, rows):
            return Numbered(self.numbers[rows])

        def tables(self):
            return (np.empty(len(self)),)

        def writer(self, scene, tables):
            def write(start, stop):
                time.sleep(0.05)
                if first + fails in self.numbers[start:stop]:
                    raise InputError("mesh", "row", "one that can be made", fails)
                tables[0][start:stop] = self.numbers[start:stop]

            return write

    return Numbered(np.arange(first, first + 8))


def test_blocks_of_a_work_that_has_failed_are_no_blocks_of_the_next(cluster, tmp_path):
    scene, rows = np.zeros(1), np.zeros(8)
    with ClusterSession(cluster.scheduler_address, tmp_path, "w", pytest.fail) as session:
        with pytest.raises(InputError, match="mesh: row: expected one that can be made, got 1"):
            list(session.trace(numbered(0, fails=1), scene, [(0, 8)]))
        for first, last, (found,) in session.trace(numbered(100), scene, [(0, 8)]):
            rows[first:last] = found
    assert rows.tolist() == list(range(100, 108))


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
