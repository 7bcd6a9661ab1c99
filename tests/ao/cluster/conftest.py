"""One cluster for all tests here: starting workers takes longer than what they do."""

import gc
from pathlib import Path

import pytest
from clusters import MEDIUM, left_sockets, scheduler
from parts_of_bakes import bits

__all__ = ["left_sockets"]


def pytest_collection_modifyitems(items):
    """Pictures come last here: another process of pytest-xdist compiles the renderer meanwhile."""
    here = [item for item in items if item.path.parent == Path(__file__).parent]
    if here:
        first = items.index(here[0])
        items[first : first + len(here)] = sorted(here, key=lambda item: item.path.name == "test_pictures.py")


@pytest.fixture(scope="package")
def cluster():
    with scheduler(2) as cluster:
        yield cluster
    gc.collect()


@pytest.fixture(scope="package")
def medium():
    return bits(MEDIUM())
