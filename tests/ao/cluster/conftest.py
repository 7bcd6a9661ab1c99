"""One cluster for all tests here: starting workers takes longer than what they do."""

import gc

import pytest
from clusters import left_sockets, scheduler

__all__ = ["left_sockets"]


@pytest.fixture(scope="package")
def cluster():
    with scheduler(2) as cluster:
        yield cluster
    gc.collect()
