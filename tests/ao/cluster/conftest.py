"""One cluster for all tests here: starting workers takes longer than what they do."""

import pytest
from clusters import scheduler


@pytest.fixture(scope="session")
def cluster():
    with scheduler(2) as cluster:
        yield cluster
