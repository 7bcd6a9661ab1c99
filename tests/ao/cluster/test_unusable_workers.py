"""Workers of a cluster that cannot be used: one line says why, others trace, and what they answer is never run."""

import os
import signal
from dataclasses import replace
from functools import partial

import pytest
from clusters import LEFT_SOCKETS, MEDIUM, SMALL_BLOCKS, Attack, bake_on, on_one
from meshes import hills
from parts_of_bakes import bits

import ao
from ao.execute.work import bit_environment
from raytrace import InputError, Mesh

pytestmark = LEFT_SOCKETS
IMPATIENT = replace(SMALL_BLOCKS, patience=0.5)


def test_a_worker_unlike_the_client_is_reported_in_one_line(cluster, tmp_path, medium):
    def become_another():
        import ao.cluster.worker

        was = ao.cluster.worker.bit_environment()
        ao.cluster.worker.bit_environment = lambda: was | {"processor": "a z80"}

    with on_one(cluster, become_another, tmp_path / "reported") as (odd, messages, notify):
        baked, dispatch = bake_on(cluster.scheduler_address, MEDIUM, tmp_path / "w.partial", notify)
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

    with on_one(cluster, fail_once_greeted, tmp_path / "reported") as (odd, messages, notify):
        baked, dispatch = bake_on(cluster.scheduler_address, MEDIUM, tmp_path / "w.partial", notify)
    assert bits(baked) == medium
    assert odd not in dispatch.blocks
    assert messages == [f"worker {odd} gets no work: OSError: [Errno 28] No space left on device"]


def test_where_no_worker_can_be_used_the_reason_is_named(cluster, tmp_path, monkeypatch):
    monkeypatch.setitem(bit_environment(), "Embree", "4.0.0")
    messages = []
    with pytest.raises(InputError, match=r"no worker can be used: tls://.*: Embree: expected 4.0.0, got"):
        bake_on(cluster.scheduler_address, MEDIUM, tmp_path / "w.partial", messages.append, pace=IMPATIENT)
    assert messages[0].startswith("worker tls://")


def test_a_folder_that_workers_do_not_see_is_reported(cluster, tmp_path, monkeypatch):
    written = ao.cluster.session.write_scene

    def unshared(folder, *arguments):
        file = written(folder, *arguments)
        return file._replace(path=file.path.replace(str(folder), "/nowhere"))

    monkeypatch.setattr("ao.cluster.session.write_scene", unshared)
    expected = r"no worker can be used: .*: /nowhere/.*: expected a folder that all workers share, got No such file"
    make = partial(ao.bake, Mesh(*hills(61)))
    with pytest.raises(InputError, match=expected):
        bake_on(cluster.scheduler_address, make, tmp_path / "w.partial", lambda _: None, pace=IMPATIENT)


def test_a_worker_that_stands_still_is_reported_and_others_trace_its_blocks(cluster, tmp_path, medium):
    def stop():
        import ao.cluster.worker

        ao.cluster.worker.fill = lambda *_: os.kill(os.getpid(), signal.SIGSTOP)

    with on_one(cluster, stop, tmp_path / "reported", killed=True) as (odd, messages, notify):
        baked, dispatch = bake_on(
            cluster.scheduler_address, MEDIUM, tmp_path / "w.partial", notify, pace=replace(SMALL_BLOCKS, silence=1.5)
        )
    assert bits(baked) == medium
    assert odd not in dispatch.blocks
    assert messages == [f"worker {odd} has not been heard of for 2 s; others get its blocks"]


@pytest.mark.parametrize("answer", ["code", "few"])
def test_an_answer_that_is_no_table_is_refused_and_never_run(cluster, tmp_path, medium, answer):
    def lie():
        import ao.cluster.worker

        honest = ao.cluster.worker.pack
        ao.cluster.worker.pack = {
            "code": lambda tables: (Attack(str(tmp_path / "attacked")),) * len(tables),
            "few": lambda tables: [content[:-8] for content in honest(tables)],
        }[answer]

    with on_one(cluster, lie, tmp_path / "reported") as (odd, messages, notify):
        baked, dispatch = bake_on(cluster.scheduler_address, MEDIUM, tmp_path / "w.partial", notify)
    assert bits(baked) == medium
    assert odd not in dispatch.blocks
    assert not (tmp_path / "attacked").exists()
    assert len(messages) == 1
    assert messages[0].startswith(f"worker {odd} gets no work: ")
