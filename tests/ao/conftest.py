"""What several folders of tests of bakes share."""

import pytest
from shared_directions import only_w


@pytest.fixture
def set_embree_below(monkeypatch):
    """A function: let Embree trace points of fewer rays than this, or all with `traversal` "embree"."""

    def let(rays):
        monkeypatch.setattr("obscurance.ao.prepared.embree_below", lambda way, *_: 1 << 30 if way == "embree" else rays)

    return let


@pytest.fixture(scope="module")
def w_alone():
    """For modules that look at nothing between vertices, and bake by the same directions time and again."""
    with only_w():
        yield
