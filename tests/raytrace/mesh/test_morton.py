import numpy as np
import pytest

from obscurance.raytrace.mesh.morton import radix_order


@pytest.mark.parametrize(("bits", "dtype"), [(30, np.uint32), (63, np.uint64)])
@pytest.mark.parametrize("count", [0, 1, 1000, 200_000])
def test_a_radix_sort_is_a_stable_sort(bits, dtype, count):
    random = np.random.default_rng(bits)
    keys = random.integers(0, 1 << bits, count, dtype=np.uint64).astype(dtype)
    keys[::3] >>= dtype(bits - 7)  # of which there are many alike
    assert np.array_equal(radix_order(keys, bits), np.argsort(keys, kind="stable"))
