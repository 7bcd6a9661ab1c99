"""Where an interrupted bake keeps its journal."""

import pytest


@pytest.fixture
def path(tmp_path):
    return tmp_path / "w.npy.partial"
