"""Sixteen numbers at once: every operation against NumPy."""

import math

import numpy as np
import pytest

from obscurance.raytrace.kernel.arrays import aligned
from obscurance.raytrace.kernel.jit import kernel
from obscurance.raytrace.kernel.simd import (
    SHORT,
    WIDE,
    bits,
    count,
    double,
    gather,
    gather3,
    highest,
    lane_numbers,
    load_row,
    load_short_row,
    lowest,
    lowest_bit,
    pick,
    replace,
    scatter4,
    select,
    single,
    some,
    store_row,
    store_short_row,
)
from obscurance.raytrace.kernel.vector import cross, dot, unit

NUMBERS = np.arange(WIDE)


@pytest.fixture
def values():
    rows = aligned((3, WIDE), np.float32)
    rows[:] = np.random.default_rng(0).normal(size=rows.shape)
    return rows


@kernel
def arithmetic(a, out):
    x, y = load_row(a, 0), load_row(a, 1)
    store_row(out, 0, 2.0 * x - y / 3.0)
    store_row(out, 1, math.sqrt(abs(min(x, 0.5))) + max(x, y))
    store_row(out, 2, max(x, 0.0) ** 2.5)
    store_row(out, 3, select((x > y) & (y <= 0.25) | (x == y), x, -1.0))
    store_row(out, 4, select(~(x < y), x, y))
    store_row(out, 5, single(double(x) * double(lane_numbers() * 3 - 1)))
    store_row(out, 6, replace(x, 3, 99.0))
    store_row(out, 7, select(2 > 1, 5.0, 6.0))


def test_arithmetic(values):
    out = aligned((8, WIDE), np.float32)
    arithmetic(values, out)
    x, y = values[0], values[1]
    expected = [
        2 * x - y / 3,
        np.sqrt(np.abs(np.minimum(x, 0.5))) + np.maximum(x, y),
        np.maximum(x, 0) ** 2.5,
        np.where((x > y) & (y <= 0.25), x, -1),
        np.where(x < y, y, x),
        x * (NUMBERS * 3 - 1),
        np.where(NUMBERS == 3, 99, x),
        np.full(WIDE, 5),
    ]
    np.testing.assert_allclose(out, expected, rtol=1e-6)


@kernel
def halved_short_row(a, out):
    store_short_row(out, 1, load_short_row(a, 2) * 0.5)


def test_short_rows():
    rows, out = np.random.default_rng(0).normal(size=(3, SHORT)).astype(np.float32), np.ones((3, SHORT), np.float32)
    halved_short_row(rows, out)
    assert (out[1] == rows[2] / 2).all()
    assert (out[[0, 2]] == 1).all()


@kernel
def vectors(a, out):
    p = load_row(a, 0), load_row(a, 1), load_row(a, 2)
    n = unit(cross(p, (1.0, 0.5, 0.0)))
    none = unit((0.0 * p[0], 0.0 * p[0], 0.0 * p[0]))
    store_row(out, 0, dot(n, p))
    store_row(out, 1, dot(n, n))
    store_row(out, 2, none[1])


def test_helpers_for_scalars_serve_lanes(values):
    out = aligned((3, WIDE), np.float32)
    vectors(values, out)
    np.testing.assert_allclose(out, np.broadcast_to([[0], [1], [0]], out.shape), atol=3e-7)


@kernel
def masks(a, out):
    x = load_row(a, 0)
    positive = x > 0.0
    store_row(out, 0, positive)
    store_row(out, 1, (lane_numbers() * 5 & 7) + (lane_numbers() >> 2))
    return (
        some(positive),
        some(x > 100.0),
        count(positive),
        lowest_bit(bits(positive)),
        pick(x, 5),
        lowest(x),
        highest(x),
    )


def test_masks_and_single_lanes(values):
    out = aligned((2, WIDE), np.int32)
    found = masks(values, out)
    x = values[0]
    np.testing.assert_array_equal(out[0], -(x > 0).astype(int))
    np.testing.assert_array_equal(out[1], (NUMBERS * 5 & 7) + NUMBERS // 4)
    assert found == (True, False, (x > 0).sum(), np.argmax(x > 0), x[5], x.min(), x.max())


@kernel
def memory(floats, whole, doubles, rows, mask, film, out, number):
    at = load_row(rows, 0)
    p, f = gather3(floats, at), gather3(whole, at)
    for c in range(3):
        store_row(out, c, p[c])
        store_row(number, c, f[c])
    store_row(out, 3, single(gather(doubles, at)))
    scatter4(film, 8, at * 4, load_row(mask, 0) > 0, (p[0], p[1], p[2], p[0] + 1.0))


def test_gathering_and_scattering():
    rng = np.random.default_rng(1)
    floats, whole = aligned((40, 3), np.float32), aligned((40, 3), np.int32)
    floats[:], whole[:] = rng.normal(size=(40, 3)), rng.integers(0, 1000, (40, 3))
    doubles = rng.normal(size=40)
    rows, mask = aligned((1, WIDE), np.int32), aligned((1, WIDE), np.int32)
    rows[0], mask[0] = rng.permutation(40)[:WIDE], rng.integers(0, 2, WIDE)
    rows[0, 7] = 39  # the last row too
    out, number = aligned((4, WIDE), np.float32), aligned((3, WIDE), np.int32)
    film = np.zeros((42, 4), np.float32)
    memory(floats, whole, doubles, rows, mask, film, out, number)
    np.testing.assert_array_equal(out[:3], floats[rows[0]].T)
    np.testing.assert_array_equal(number, whole[rows[0]].T)
    np.testing.assert_array_equal(out[3], doubles[rows[0]].astype(np.float32))
    expected = np.zeros_like(film)
    for row, wanted in zip(rows[0], mask[0], strict=True):
        if wanted:
            expected[2 + row] = *floats[row], floats[row, 0] + 1
    np.testing.assert_array_equal(film, expected)
