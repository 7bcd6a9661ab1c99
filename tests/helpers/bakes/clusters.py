"""Bakes on a real Dask cluster on this machine's loopback, in blocks so small that every worker has several."""

import gc
import importlib
import os
import signal
import time
from contextlib import contextmanager, suppress
from functools import partial
from itertools import count
from pathlib import Path
from threading import Thread
from unittest.mock import patch

import pytest
from interrupted_bakes import SMALL_BLOCKS
from meshes import hills, two_boxes
from uv_meshes import grid_charts

from obscurance import ao
from obscurance.ao.cluster.workers import CONFIG, LOCAL, Workers
from obscurance.ao.execute.kept import Kept
from obscurance.ao.execute.work import bit_environment
from obscurance.raytrace import Mesh

HILLS = Mesh(*hills(60))
CHARTS = Mesh(*hills(20))
BAKES = {
    "binary": partial(ao.bake, HILLS, "binary", samples=64),
    "exponential": partial(ao.bake, HILLS, samples=64),
    "limited": partial(ao.bake, HILLS, ao.Exponential(tau=2.0, max_distance="30%"), samples=64),
    "tolerance": partial(ao.bake, HILLS, tolerance=0.01),
    "partly inside": partial(ao.bake, Mesh(*two_boxes()), tolerance=0.01),
    "faces": partial(ao.bake, CHARTS, samples=64, at="faces"),
    "surface": partial(ao.bake, HILLS, samples=64, method="surface"),
    "falloffs": partial(ao.bake, HILLS, ["binary", ao.Smooth("30%")], samples=64, profile=True),
    "texture": partial(ao.bake_texture, CHARTS, grid_charts(len(CHARTS.faces)), 64, samples=64),
    "texture to a tolerance": partial(ao.bake_texture, CHARTS, grid_charts(len(CHARTS.faces)), 64, tolerance=0.02),
}


LONG = partial(ao.bake, Mesh(*hills(100)), samples=1024)
MEDIUM = partial(ao.bake, Mesh(*hills(100)), samples=128)
BLOCKS = 10_000 * 128 // SMALL_BLOCKS[1]  # of `MEDIUM`, or a few more


@contextmanager
def scheduler(workers, preload=()):
    """A cluster that bakes join by its address, with credentials by Dask's configuration.

    Args: preload: scripts that each worker runs first.
    """
    distributed = pytest.importorskip("distributed", reason="pip install '.[cluster]'")
    security = distributed.Security.temporary()
    credentials = {"ca-file": security.tls_ca_file, "client.key": security.tls_client_key}
    credentials["client.cert"] = security.tls_client_cert
    config = importlib.import_module("dask").config
    config.set(CONFIG)
    settings = LOCAL | {"n_workers": workers, "security": security, "preload": [*LOCAL["preload"], *preload]}
    with (
        distributed.LocalCluster(**settings) as cluster,
        config.set({f"distributed.comm.tls.{name}": value for name, value in credentials.items()}),
    ):
        yield cluster


def holding(after, until, mark=None):
    """A function for a worker: makes `after` blocks, then a file `mark-…`, and goes on once `until` exists."""

    def hold():
        import obscurance.ao.cluster.workers

        make, numbers = obscurance.ao.cluster.workers.make_on_threads, count()

        def held(*arguments):
            if next(numbers) >= after:
                if mark:
                    Path(f"{mark}-{os.getpid()}").touch()
                while not os.path.exists(until):
                    time.sleep(0.01)
                obscurance.ao.cluster.workers.make_on_threads = make
            return make(*arguments)

        obscurance.ao.cluster.workers.make_on_threads = held

    return hold


def is_first(path):
    """Whether this process is the first one that asks; of scripts that workers run first, each of them twice."""
    with suppress(FileExistsError), open(path, "x") as file:
        file.write(str(os.getpid()))
    return Path(path).read_text() == str(os.getpid())


LEFT_SOCKETS = pytest.mark.filterwarnings("ignore:unclosed <s:ResourceWarning")  # of TLS, by Dask


@pytest.fixture(autouse=True)
def left_sockets():
    """Sockets that Dask leaves to the garbage collector are closed within the test, where the filter holds.

    What is there before, all that Numba has built above all, is not looked through: a fifth of a second for each test.
    """
    gc.freeze()
    yield
    gc.collect()


@pytest.fixture
def small_blocks(monkeypatch):
    """Of commands, which do not say how far they are, however slow."""
    monkeypatch.setattr(*SMALL_BLOCKS)
    monkeypatch.setattr("obscurance.ao.cluster.workers._FEW_RAYS", 0)
    monkeypatch.setattr("obscurance.scenes.show.progress._EVERY_LINE", 1e6)


@pytest.fixture
def impatient(monkeypatch):
    """Schedulers have 0.3 s to answer, and workers of this machine a second to end."""
    for name, seconds in {"_CONNECT": 0.3, "_END": 1.0, "_LOOK": 0.2}.items():
        monkeypatch.setattr(f"obscurance.ao.cluster.workers.{name}", seconds)


@contextmanager
def workers_at(address, notify=pytest.fail, block_rays=SMALL_BLOCKS[1]):
    """Workers that get every block, however small."""
    with (
        patch(SMALL_BLOCKS[0], block_rays),
        patch("obscurance.ao.cluster.workers._FEW_RAYS", 0),
        patch("obscurance.ao.cluster.workers._LOOK", 0.2),
        Workers(address, notify) as workers,
    ):
        yield workers


def bake_on(address, make, output, notify=pytest.fail, progress=None, **settings):
    """What `make` makes with a cluster, and how many blocks workers have made."""
    with (
        workers_at(address, notify) as workers,
        Kept(output, notify, make=workers.make, status=workers.status, **settings) as kept,
    ):
        return make(checkpoint=kept, progress=progress), workers.blocks


@contextmanager
def on_one(cluster, function, reported, monkeypatch):
    """Run a function on one of two workers, none of which has been asked yet what it is like; both are as before in
    the end.

    Gives its address, the messages of a bake, and what to notify: the other worker traces after the first message.
    """
    from distributed import Client

    messages = []
    monkeypatch.setitem(bit_environment(), "test", str(reported))

    def notify(line):
        messages.append(line)
        reported.touch()

    def keep(name):
        import obscurance.ao.cluster.workers
        from obscurance.ao.execute.work import bit_environment

        bit_environment()["test"] = name
        obscurance.ao.cluster.workers.kept = dict(vars(ao.cluster.workers))

    def restore():
        import sys

        module = sys.modules.pop("test.hidden", None) or sys.modules["obscurance.ao.cluster.workers"]
        sys.modules["obscurance.ao.cluster.workers"] = module
        vars(module).update(module.kept)
        from obscurance.ao.execute.work import bit_environment

        bit_environment().pop("test", None)  # or the worker is unlike all later bakes

    with Client(cluster, set_as_default=False) as client:
        client.wait_for_workers(2)
        odd, other = client.nthreads()
        client.run(keep, str(reported))
        client.run(function, workers=[odd])
        client.run(holding(0, reported), workers=[other])
        yield odd, messages, notify
        client.run(restore)


def compiled_by(cluster):
    """The kernels that each worker had to compile."""
    from distributed import Client

    def compiled():
        from obscurance.raytrace.kernel import jit

        return tuple(jit.compiled)

    with Client(cluster, set_as_default=False) as client:
        return list(client.run(compiled).values())


@contextmanager
def victims_of(cluster, workers, prepare=None):
    """The process ids of all workers, once there are so many; one that is killed as it starts does not come again.

    Args: prepare: gives, for the number of each, a function that it runs first.
    """
    from distributed import Client

    with Client(cluster, set_as_default=False) as client:
        client.wait_for_workers(workers, timeout=60)
        addresses = list(client.nthreads())
        for number, address in enumerate(addresses if prepare else ()):
            client.run(prepare(number), workers=[address])
        pids = client.run(os.getpid)
        yield [pids[address] for address in addresses]


@contextmanager
def killed_in_mid_block(cluster, folder, victims):
    """Kill `victims` of two workers when each has made a block and is at the next; the others begin after that.

    There must be more blocks than the others are given at once.
    """
    held, killed = folder / "held", folder / "killed"

    def prepare(number):
        return holding(1, "never", held) if number < victims else holding(0, killed)

    def kill_once_held(pids):
        while len(list(folder.glob("held-*"))) < victims:
            time.sleep(0.01)
        for pid in pids:
            kill(pid)
        killed.touch()

    with victims_of(cluster, 2, prepare) as pids:
        killer = Thread(target=kill_once_held, args=[pids[:victims]], daemon=True)
        killer.start()
        yield
        killer.join()


def kill(pid):
    with suppress(ProcessLookupError):  # its nanny may have ended it
        os.kill(pid, signal.SIGKILL)


class Attack:
    """What makes a file where it is unpickled."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return os.mkdir, (self.path,)
