"""Bakes on a real Dask cluster on this machine's loopback, in blocks so small that every worker has several."""

import os
import signal
from contextlib import contextmanager

import pytest

from ao.cluster.checkpoint import ClusterCheckpoint
from ao.cluster.dask_cluster import _LOCAL


@contextmanager
def scheduler(workers):
    """A cluster that bakes join by its address."""
    distributed = pytest.importorskip("distributed", reason="needs obscurance[cluster]")
    with distributed.LocalCluster(n_workers=workers, **_LOCAL) as cluster:
        yield cluster


@pytest.fixture
def small_blocks(monkeypatch):
    monkeypatch.setattr("ao.cluster.checkpoint._FEW", 0)
    monkeypatch.setattr("ao.cluster.dispatch._FIRST_RAYS", 1 << 16)
    monkeypatch.setattr("ao.cluster.dispatch._SECONDS", 0.1)
    monkeypatch.setattr("ao.cluster.dispatch._LEAST_SECONDS", 0.02)


def bake_on(address, make, path, tell=pytest.fail, progress=None, **settings):
    """What `make` makes with a cluster, and what that handed out."""
    with ClusterCheckpoint(path, address, tell=tell, **settings) as checkpoint:
        return make(checkpoint=checkpoint, progress=progress), checkpoint.cluster.dispatch


def pids(cluster):
    return [worker.pid for worker in cluster.workers.values()]


def kill(pid):
    os.kill(pid, signal.SIGKILL)
