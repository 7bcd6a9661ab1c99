"""Bakes by real workers of a real scheduler: the bits of one process, whoever is lost on the way."""

import os
import time
from contextlib import contextmanager
from functools import partial

import pytest
from clusters import BAKES, all_bits, bake_on, holding, kill, killed_in_mid_block, scheduler, small_blocks
from meshes import hills
from parts_of_bakes import bits

import ao
import ao.cluster.session
from ao.cluster.addresses import local_workers
from ao.cluster.dispatch import IN_FLIGHT
from ao.trace.checkpoint import Checkpoint
from raytrace import InputError, Mesh, OptionError
from raytrace.errors import ClusterError

__all__ = ["small_blocks"]
pytestmark = pytest.mark.usefixtures("small_blocks")


@pytest.mark.parametrize("name", BAKES)
def test_workers_make_the_bits_of_one_process(cluster, tmp_path, name):
    baked, dispatch = bake_on(cluster.scheduler_address, BAKES[name], tmp_path / "w.partial")
    assert all_bits(baked) == all_bits(BAKES[name]())
    assert baked.rays == BAKES[name]().rays
    assert sum(dispatch.blocks.values()) > 1
    assert dispatch.again == 0
    assert not list(tmp_path.iterdir())


MEDIUM = partial(ao.bake, Mesh(*hills(100)), samples=512)
MEDIUM_ROWS = 10_000 + 312  # some are traced twice, to calibrate errors


@contextmanager
def on_one(cluster, function, told):
    """Run a function on one of two workers, and kill it in the end, for a new one to come.

    Gives its address, the messages of a bake, and what to tell them to: the other worker traces after the first one.
    """
    from distributed import Client

    messages = []

    def tell(line):
        messages.append(line)
        told.touch()

    with Client(cluster, set_as_default=False) as client:
        client.wait_for_workers(2)
        odd, other = client.nthreads()
        (pid,) = client.run(os.getpid, workers=[odd]).values()
        client.run(function, workers=[odd])
        client.run(holding(0, told), workers=[other])
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


def test_of_a_worker_that_is_unlike_the_others_only_one_line_is_told(cluster, tmp_path, medium):
    def become_another():
        import ao.cluster.worker

        was = ao.cluster.worker.machine()
        ao.cluster.worker.machine = lambda: was | {"processor": "a z80"}

    with on_one(cluster, become_another, tmp_path / "told") as (odd, messages, tell):
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

    with on_one(cluster, fail_once_greeted, tmp_path / "told") as (odd, messages, tell):
        baked, dispatch = bake_on(cluster.scheduler_address, MEDIUM, tmp_path / "w.partial", tell)
    assert bits(baked) == medium
    assert odd not in dispatch.blocks
    assert messages == [f"worker {odd} gets no work: OSError: [Errno 28] No space left on device"]


def test_where_no_worker_can_be_used_the_reason_is_told(cluster, tmp_path, monkeypatch):
    monkeypatch.setattr("ao.cluster.dask_cluster._PATIENCE", 0.5)
    here = ao.cluster.session.machine()
    monkeypatch.setattr("ao.cluster.session.machine", lambda: here | {"Embree": "4.0.0"})
    messages = []
    with pytest.raises(InputError, match=r"no worker can be used: tcp://.*: Embree: expected 4.0.0, got"):
        bake_on(cluster.scheduler_address, MEDIUM, tmp_path / "w.partial", messages.append)
    assert messages[0].startswith("worker tcp://")


def test_a_folder_that_workers_do_not_see_is_told(cluster, tmp_path, monkeypatch):
    monkeypatch.setattr("ao.cluster.dask_cluster._PATIENCE", 0.5)
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

        monkeypatch.setattr("ao.cluster.dask_cluster._PATIENCE", 0.2)
        with pytest.raises(ClusterError, match=r"tcp://.*: the cluster is lost"):
            bake_on(late.scheduler_address, MEDIUM, path, tell, progress, after=0, every=0)
    assert list(dict.fromkeys(messages)) == [
        f"{late.scheduler_address}: no workers; waiting for some to join",
        f"{path} keeps the finished part; the same command with --resume continues from it",
    ]
    with Checkpoint(path, resume=True, tell=pytest.fail) as checkpoint:
        assert bits(MEDIUM(checkpoint=checkpoint)) == medium


def test_an_address_without_a_scheduler_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("ao.cluster.dask_cluster._CONNECT", 0.3)
    with pytest.raises(OptionError, match=r"cluster: expected .* got nothing that answers"):
        bake_on("tcp://127.0.0.1:1", MEDIUM, tmp_path / "w.partial")
    for address in ("local:0", "local:x", "local:", "here", "tcp://", "", "local:5000"):
        with pytest.raises(OptionError, match="cluster: expected local, local:N or the address"):
            local_workers(address)
    assert [local_workers(address) for address in ("local", "local:3", "tcp://a:1")] == [1, 3, None]
