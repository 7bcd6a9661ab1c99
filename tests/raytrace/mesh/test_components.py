"""Connected components are those of SciPy, numbered alike."""

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components as components_by_scipy

from obscurance.raytrace.mesh.weld import connected_components


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("width", [2, 3])
@pytest.mark.parametrize("count", [300, 60_000])  # the second on several threads
def test_components_are_those_of_scipy(seed, width, count):
    rng = np.random.default_rng(seed)
    links = rng.integers(0, count, (rng.integers(count // 15, 2 * count // 3), width))
    ends = np.repeat(links[:, 0], width), links.ravel()
    graph = coo_array((np.ones(links.size, bool), ends), shape=(count, count))
    np.testing.assert_array_equal(connected_components(links, count), components_by_scipy(graph, directed=False)[1])


def test_without_links_each_is_its_own():
    np.testing.assert_array_equal(connected_components(np.zeros((0, 3), np.int64), 4), range(4))
    assert len(connected_components(np.zeros((0, 3), np.int64), 0)) == 0
