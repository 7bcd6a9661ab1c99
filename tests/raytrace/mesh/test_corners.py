"""Kinds of corners, against NumPy's own."""

import numpy as np
import pytest

from obscurance.raytrace.mesh.corners import unique_rows


@pytest.mark.parametrize("width", [1, 2, 3])
@pytest.mark.parametrize("count", [0, 1, 2000])
def test_kinds_of_rows_are_numpys(width, count):
    columns = np.random.default_rng(count).choice([0, 1, 5, 2**33, 2**40], (width, count))
    first, kind = unique_rows(list(columns))
    rows, expected_first, expected = np.unique(columns.T, axis=0, return_index=True, return_inverse=True)
    assert np.array_equal(columns.T[first], rows)
    assert np.array_equal(first, expected_first)
    assert np.array_equal(kind, expected.ravel())
