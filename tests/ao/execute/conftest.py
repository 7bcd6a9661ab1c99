"""Where an interrupted bake keeps its rows."""

import pytest


@pytest.fixture
def output(tmp_path):
    return tmp_path / "w.npy"
