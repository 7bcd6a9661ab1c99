"""One cluster for all tests here: starting workers takes longer than what they do."""

import gc

import pytest
from clusters import MEDIUM, left_sockets, scheduler
from parts_of_bakes import bits

__all__ = ["left_sockets"]


@pytest.fixture(scope="package")
def cluster():
    with scheduler(2) as cluster:
        yield cluster
    gc.collect()


@pytest.fixture(scope="package")
def medium():
    return bits(MEDIUM())
