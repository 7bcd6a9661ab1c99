"""Arrays of kernels; counting sort: the order of a stable sort."""

import numpy as np

from obscurance.raytrace.kernel.arrays import counting_sort


def test_order_is_that_of_a_stable_sort():
    keys = np.random.default_rng(1).integers(0, 7, (40, 3))
    places, starts = counting_sort(keys, 9)
    np.testing.assert_array_equal(places, np.argsort(keys.ravel(), kind="stable"))
    np.testing.assert_array_equal(starts, np.searchsorted(np.sort(keys.ravel()), np.arange(10)))


def test_negative_keys_are_left_out():
    places, starts = counting_sort(np.array([1, -1, 0, 1], np.int32), 2)
    assert places.tolist() == [2, 0, 3]
    assert starts.tolist() == [0, 1, 3]


def test_nothing_to_sort():
    places, starts = counting_sort(np.zeros((0, 3), np.int64), 2)
    assert places.tolist() == []
    assert starts.tolist() == [0, 0, 0]
