"""One cluster for all tests here: starting workers takes longer than what they do."""

import gc
import os
from pathlib import Path

import pytest
from clusters import MEDIUM, left_sockets, scheduler
from interrupted_bakes import bits

__all__ = ["left_sockets"]


def pytest_collection_modifyitems(items):
    """These are the last tests of `ao`: another process of pytest-xdist compiles the renderer meanwhile."""
    folder = Path(__file__).parent
    beside = {path for path in {item.path for item in items} if folder.parent in path.parents}
    here = {path for path in beside if path.parent == folder}
    places = [place for place, item in enumerate(items) if item.path in beside]
    ordered = sorted((items[place] for place in places), key=lambda item: item.path in here)
    for place, item in zip(places, ordered, strict=True):
        items[place] = item


@pytest.fixture(scope="package", autouse=True)
def forked_workers():
    """Workers are forks of one process that has done what is the same in each."""
    if os.name == "nt":
        yield
        return
    from multiprocessing import forkserver

    config = pytest.importorskip("dask", reason="pip install '.[cluster]'").config
    utils = pytest.importorskip("distributed.utils")
    with config.set({"distributed.worker.multiprocessing-method": "forkserver"}):
        utils.get_mp_context()  # sets modules of its own
        forkserver.set_forkserver_preload(["tests.helpers.bakes.forked_workers"])  # by the current folder
        yield
    forkserver._forkserver._stop()  # and with it the processor time of what it has forked is known


@pytest.fixture(scope="package")
def cluster():
    with scheduler(2) as cluster:
        yield cluster
    gc.unfreeze()
    gc.collect()


@pytest.fixture(scope="package")
def medium():
    return bits(MEDIUM())
