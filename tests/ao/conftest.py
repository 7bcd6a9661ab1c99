"""What several folders of tests of bakes share."""

import pytest
from shared_directions import only_w


@pytest.fixture(scope="module")
def w_alone():
    """For modules that look at nothing between vertices, and bake by the same directions time and again."""
    with only_w():
        yield
