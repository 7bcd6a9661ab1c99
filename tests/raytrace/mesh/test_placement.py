"""Placed coordinates: scaled by powers of two, rounded once."""

import numpy as np
import pytest

from obscurance.raytrace import Mesh
from obscurance.raytrace.mesh.placement import Placement


@pytest.mark.parametrize("size", [1e-30, 1e-9, 1.0, 1e9, 1e150])
@pytest.mark.parametrize("offset", [0.0, 1e3])
def test_any_size_and_offset_lands_within_unit_coordinates(size, offset):
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 0.75, 0.5]]) * size + offset * size
    placement = Placement.of(Mesh(corners, [[0, 1, 2]]))
    assert np.log2(placement.scale) == np.round(np.log2(placement.scale))
    largest = np.abs(placement.vertices).max()
    assert 0.25 <= largest <= 1
    edges = np.linalg.norm(placement.vertices[1:].astype(float) - placement.vertices[0], axis=1)
    np.testing.assert_allclose(edges / placement.scale, np.linalg.norm(corners[1:] - corners[0], axis=1), rtol=1e-6)
    assert (edges <= placement.diagonal).all()


def test_one_point_is_not_scaled():
    placement = Placement.of(Mesh([[3, 3, 3]] * 3, [[0, 1, 2]]))
    assert placement.scale == 1
    assert not placement.vertices.any()
