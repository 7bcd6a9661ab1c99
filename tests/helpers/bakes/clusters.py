"""Bakes on a real Dask cluster on this machine's loopback, in blocks so small that every worker has several."""

import gc
import importlib
import os
import signal
import time
from contextlib import contextmanager
from functools import partial
from itertools import count
from pathlib import Path
from threading import Thread

import pytest
from meshes import hills, two_boxes
from parts_of_bakes import bits, bits_of_texture
from uv_meshes import grid_charts

import ao
from ao.cluster.dask_cluster import CONFIG, LOCAL
from ao.cluster.session import ClusterSession, Pace
from ao.execute.checkpoint import Checkpoint
from raytrace import Mesh

HILLS = Mesh(*hills(60))
CHARTS = Mesh(*hills(20))
BAKES = {
    "binary": partial(ao.bake, HILLS, "binary", samples=64),
    "exponential": partial(ao.bake, HILLS, samples=64),
    "limited": partial(ao.bake, HILLS, ao.Exponential(tau=2.0, max_distance="30%"), samples=64),
    "tolerance": partial(ao.bake, HILLS, tolerance=0.01),
    "partly inside": partial(ao.bake, Mesh(*two_boxes()), tolerance=0.01),
    "surface": partial(ao.bake, HILLS, samples=64, method="surface"),
    "falloffs": partial(ao.bake, HILLS, ["binary", ao.Smooth("30%")], samples=64, profile=True),
    "texture": partial(ao.bake_texture, CHARTS, grid_charts(len(CHARTS.faces)), 64, samples=64),
    "texture to a tolerance": partial(ao.bake_texture, CHARTS, grid_charts(len(CHARTS.faces)), 64, tolerance=0.02),
}


def all_bits(baked):
    return bits(baked) if isinstance(baked, ao.Bake) else bits_of_texture(baked)


LONG = partial(ao.bake, Mesh(*hills(100)), samples=1024)
LONG_ROWS = 100**2 + 100**2 // 32  # some are traced twice, to calibrate errors


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
    settings = LOCAL | {"security": security, "preload": [*LOCAL["preload"], *preload]}
    with (
        distributed.LocalCluster(n_workers=workers, **settings) as cluster,
        config.set({f"distributed.comm.tls.{name}": value for name, value in credentials.items()}),
    ):
        yield cluster


def holding(after, until, mark=None):
    """A function for a worker: traces `after` blocks, then makes a file `mark-…`, and goes on once `until` exists."""

    def hold():
        import ao.cluster.worker

        fill, numbers = ao.cluster.worker.fill, count()

        def held(*arguments):
            if next(numbers) >= after:
                if mark:
                    Path(f"{mark}-{os.getpid()}").touch()
                while not os.path.exists(until):
                    time.sleep(0.01)
                ao.cluster.worker.fill = fill
            return fill(*arguments)

        ao.cluster.worker.fill = held

    return hold


LEFT_SOCKETS = pytest.mark.filterwarnings("ignore:unclosed <s:ResourceWarning")  # of TLS, by Dask


@pytest.fixture(autouse=True)
def left_sockets():
    """Sockets that Dask leaves to the garbage collector are closed within the test, where the filter holds.

    What is there before, all that Numba has built above all, is not looked through: a fifth of a second for each test.
    """
    gc.freeze()
    yield
    gc.collect()


SMALL_BLOCKS = Pace(few_rays=0, first_rays=1 << 12, block_seconds=0.1, least_seconds=0.02)


@pytest.fixture
def small_blocks(monkeypatch):
    """Of the sessions of commands, which do not say how far they are, however slow; others have a `pace`."""
    monkeypatch.setattr("ao.cluster.session.PACE", SMALL_BLOCKS)
    monkeypatch.setattr("scenes.show.progress._EVERY_LINE", float("inf"))


@pytest.fixture
def impatient(monkeypatch):
    """Schedulers have 0.3 s to answer, and workers of this machine a second to end."""
    for name, seconds in {"_CONNECT": 0.3, "_END": 1.0}.items():
        monkeypatch.setattr(f"ao.cluster.dask_cluster.{name}", seconds)


def bake_on(address, make, path, notify=pytest.fail, progress=None, pace=SMALL_BLOCKS, **settings):
    """What `make` makes with a cluster, and what that handed out."""
    with (
        ClusterSession(address, path.parent, path.stem, notify, pace=pace) as session,
        Checkpoint(path, notify=notify, fill_spans=session.fill_spans, status=session.status, **settings) as checkpoint,
    ):
        return make(checkpoint=checkpoint, progress=progress), session.dispatch


MEDIUM = partial(ao.bake, Mesh(*hills(100)), samples=128)
MEDIUM_ROWS = 10_000 + 312  # some are traced twice, to calibrate errors


@contextmanager
def on_one(cluster, function, reported, killed=False):
    """Run a function on one of two workers, which is as before in the end, or killed for a new one to come.

    Gives its address, the messages of a bake, and what to notify: the other worker traces after the first message.
    """
    from distributed import Client

    messages = []

    def notify(line):
        messages.append(line)
        reported.touch()

    def keep():
        import ao.cluster.worker

        ao.cluster.worker.kept = dict(vars(ao.cluster.worker))

    def restore():
        import ao.cluster.worker

        vars(ao.cluster.worker).update(ao.cluster.worker.kept)

    with Client(cluster, set_as_default=False) as client:
        client.wait_for_workers(2)
        odd, other = client.nthreads()
        (pid,) = client.run(os.getpid, workers=[odd]).values()
        client.run(keep, workers=[odd])
        client.run(function, workers=[odd])
        client.run(holding(0, reported), workers=[other])
        yield odd, messages, notify
        if not killed:
            client.run(restore, workers=[odd])
            return
        kill(pid)
        while odd in client.nthreads():
            time.sleep(0.05)


def compiled_by(cluster):
    """The kernels that each worker had to compile."""
    from distributed import Client

    def compiled():
        from raytrace.kernel import jit

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
    os.kill(pid, signal.SIGKILL)


class Attack:
    """What makes a file where it is unpickled."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return os.mkdir, (self.path,)
