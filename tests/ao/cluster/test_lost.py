"""Workers and coordinators killed at random moments, and clusters of separate processes: the same bits."""

import os
import random
import subprocess
import sys
import time

import pytest
from clusters import BAKES, LEFT_SOCKETS, LONG, bake_on, kill, scheduler, victims_of
from command import started
from interrupted_bakes import bits, folders
from mesh_files import ply
from meshes import hills
from project import environment

from obscurance.ao.execute.kept import Kept
from obscurance.raytrace.errors import ClusterError

pytestmark = [LEFT_SOCKETS, pytest.mark.slow]

COORDINATOR = """
import sys
from pathlib import Path
from clusters import LONG, bake_on

def progress(done, total, stage):
    print(f"{done / total:.3f}", flush=True)

if __name__ == "__main__":
    bake_on("local:2", LONG, Path(sys.argv[1]), print, progress, after=0)
"""


@pytest.mark.parametrize("workers", [1, 2, 3])
def test_any_number_of_local_workers_makes_the_bits_of_one_process(tmp_path, workers):
    for name, make in BAKES.items():
        baked, _ = bake_on(f"local:{workers}", make, tmp_path / name)
        assert bits(baked) == bits(make()), name


def test_six_workers_killed_in_turn(tmp_path):
    chance, whole = random.Random(1), bits(LONG())
    with scheduler(2) as cluster:
        killed = []

        def progress(done, total, stage):
            if len(killed) < 6 and done > total * (len(killed) + chance.random()) / 7:
                with victims_of(cluster, 1) as pids:
                    killed.append(chance.choice(pids))
                    kill(killed[-1])

        baked, _ = bake_on(cluster.scheduler_address, LONG, tmp_path / "w.npy", lambda _: None, progress)
    assert len(killed) == 6
    assert bits(baked) == whole


def test_a_block_that_ends_every_worker_ends_the_bake(tmp_path):
    crash = tmp_path / "crash.py"
    code = "import os, obscurance.ao.cluster.workers as workers\nworkers.make_on_threads = lambda *_: os._exit(1)\n"
    crash.write_text(code)
    with scheduler(1, [str(crash)]) as cluster, pytest.raises(ClusterError, match="workers have ended with it"):
        bake_on(cluster.scheduler_address, LONG, tmp_path / "w.npy", lambda _: None)


def test_a_coordinator_killed_at_random_moments_is_continued(tmp_path):
    chance, output, whole = random.Random(3), tmp_path / "w.npy", bits(LONG())
    script = tmp_path / "coordinator.py"
    script.write_text(COORDINATOR)
    for continued_on in ("local:2", None) * 3:
        moment = chance.uniform(0, 0.8)
        with started([sys.executable, script, output], env=environment(), stdout=subprocess.PIPE, text=True) as running:
            for line in running.stdout:
                if float(line) >= moment:
                    break
            kill(running.pid)
        (folder,) = folders(output)
        kept = len(list(folder.glob("?*.?*")))
        assert kept > 0
        if continued_on:
            baked, blocks = bake_on(continued_on, LONG, output)
            assert blocks < 10_000 * 1024 / (1 << 14) + 30 - kept
        else:
            with Kept(output, pytest.fail) as rows:
                baked = LONG(checkpoint=rows)
        assert bits(baked) == whole
        assert not folders(output)


def test_three_processes_with_a_key_of_their_own(tmp_path):
    """What docs/cluster.md tells to do on three machines; two of three workers are killed on the way."""
    run = {"cwd": tmp_path, "env": environment(DASK_CONFIG=str(tmp_path))}
    key = "openssl req -x509 -newkey rsa:2048 -nodes -days 2 -subj /CN=obscurance -keyout key.pem -out cert.pem"
    subprocess.run(key.split(), cwd=tmp_path, check=True, capture_output=True)
    pair = f"{{cert: {tmp_path}/cert.pem, key: {tmp_path}/key.pem}}"
    tls = f"{{ca-file: {tmp_path}/cert.pem, scheduler: {pair}, worker: {pair}, client: {pair}}}"
    (tmp_path / "dask.yaml").write_text(
        f"distributed: {{scheduler: {{worker-ttl: 30s}}, comm: {{require-encryption: true, tls: {tls}}}}}"
    )
    (tmp_path / "hills.ply").write_bytes(ply(*hills(150)))
    dask = [sys.executable, "-m", "dask"]
    bake = [sys.executable, "-m", "cli", "bake", "hills.ply", "--samples", "1024", "--quiet", "-o"]
    subprocess.run([*bake, "whole.npy"], check=True, **run)
    address = "tls://127.0.0.1:8793"
    at = ["--host", "127.0.0.1", "--port", "8793", "--protocol", "tls", "--no-dashboard"]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    with started([*dask, "scheduler", *at], **run, **quiet) as head:
        workers = [
            subprocess.Popen([*dask, "worker", address, "--no-nanny", "--no-dashboard"], **run, **quiet) for _ in "abc"
        ]
        try:
            with started([*bake, "w.npy", "--cluster", address], stderr=subprocess.PIPE, text=True, **run) as baking:
                time.sleep(8)
                for worker in workers[:2]:
                    kill(worker.pid)
                errors = baking.communicate(timeout=300)[1]
            assert (baking.returncode, errors) == (0, "")
        finally:
            for worker in workers:
                worker.kill()
                worker.wait()
            head.terminate()
    assert (tmp_path / "w.npy").read_bytes() == (tmp_path / "whole.npy").read_bytes()
    assert not [name for name in os.listdir(tmp_path) if ".partial-" in name]
