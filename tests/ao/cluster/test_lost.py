"""Workers and coordinators killed at random moments: the same bits, and only lost blocks are traced again."""

import random
import subprocess
import sys
import time
from dataclasses import replace

import pytest
from ao.cluster.session import IN_FLIGHT
from ao.execute.checkpoint import Checkpoint
from ao.execute.journal import Journal
from clusters import BAKES, LEFT_SOCKETS, LONG, LONG_ROWS, SMALL_BLOCKS, all_bits, bake_on, kill, scheduler, victims_of
from command import started
from project import environment

from raytrace.errors import ClusterError

pytestmark = LEFT_SOCKETS

COORDINATOR = """
import sys, logging
from dataclasses import replace
from pathlib import Path
from clusters import LONG, SMALL_BLOCKS, bake_on

def progress(done, total, stage):
    print(f"{done / total:.3f}", flush=True)

if __name__ == "__main__":
    pace = replace(SMALL_BLOCKS, first_rays=1 << 16, least_seconds=0.1)
    bake_on("local:2", LONG, Path(sys.argv[1]), print, progress, pace, after=0, every=0)
"""


@pytest.mark.slow
@pytest.mark.parametrize("workers", [1, 2, 3])
def test_any_number_of_local_workers_makes_the_bits_of_one_process(tmp_path, workers):
    for name, make in BAKES.items():
        baked, _ = bake_on(f"local:{workers}", make, tmp_path / f"{name}.partial")
        assert all_bits(baked) == all_bits(make()), name


@pytest.mark.slow
@pytest.mark.parametrize("victims", [1, 2])
def test_workers_killed_at_random_moments(tmp_path, victims):
    chance, whole = random.Random(victims), all_bits(LONG())
    with scheduler(2) as cluster:
        for _ in range(20 // victims):
            moment, killed = chance.uniform(0, 0.95), []
            with victims_of(cluster, 2) as workers:

                def progress(done, total, stage, moment=moment, killed=killed, workers=workers):
                    if not killed and done >= moment * total:
                        time.sleep(chance.uniform(0, 0.1))
                        killed.extend(chance.sample(workers, victims))
                        for pid in killed:
                            kill(pid)

                address, path = cluster.scheduler_address, tmp_path / "w.partial"
                baked, dispatch = bake_on(address, LONG, path, lambda _: None, progress=progress)
            assert killed
            assert all_bits(baked) == whole
            assert dispatch.again <= IN_FLIGHT * victims
            assert dispatch.rows_traced == LONG_ROWS  # came back; what was lost did not


@pytest.mark.slow
def test_a_block_that_ends_every_worker_ends_the_bake(tmp_path):
    crash = tmp_path / "crash.py"
    crash.write_text("import os, ao.cluster.worker\nao.cluster.worker.fill = lambda *_: os._exit(1)\n")
    pace = replace(SMALL_BLOCKS, losses=3)
    with scheduler(1, [str(crash)]) as cluster, pytest.raises(ClusterError, match="3 workers have ended with the same"):
        bake_on(cluster.scheduler_address, LONG, tmp_path / "w.partial", lambda _: None, pace=pace)


@pytest.mark.slow
def test_a_coordinator_killed_at_random_moments_is_resumed(tmp_path):
    chance, path, whole = random.Random(3), tmp_path / "w.partial", all_bits(LONG())
    for resumed_on in ("local:2", None) * 3:
        script = tmp_path / "coordinator.py"
        script.write_text(COORDINATOR)
        moment = chance.uniform(0, 0.8)
        with started([sys.executable, script, path], env=environment(), stdout=subprocess.PIPE, text=True) as running:
            for line in running.stdout:
                if float(line) >= moment:
                    break
            kill(running.pid)
        journal = Journal(path, create=False)
        kept = sum(last - first for _, first, last in journal.blocks)
        journal.close()
        assert kept > 0
        if resumed_on:
            baked, dispatch = bake_on(resumed_on, LONG, path, resume=True)
            assert dispatch.rows_traced == LONG_ROWS - kept
        else:
            with Checkpoint(path, resume=True, notify=pytest.fail) as checkpoint:
                baked = LONG(checkpoint=checkpoint)
        assert all_bits(baked) == whole
        assert not path.exists()
