"""Morton order (Z-order curve): neighbours in space become neighbours in memory.

Morton 1966, A computer oriented geodetic data base and a new technique in file sequencing.
"""

import numpy as np

from ..kernel.jit import inline, kernel
from ..system.parallel import each
from ..types import AnyFloats, Float32Rows, Float64Rows, Float64s, Int64Rows, Int64s, UInt32s, UInt64s
from .placement import NEAR

_COARSE, _FINE = 10, 21  # bits an axis
_DIGIT = 11  # bits that a pass of sorting looks at
_BLOCK = 1 << 16  # keys


def morton_order(points: AnyFloats) -> Int64s:
    """Rows of `points` (n, 3), finite, by 2^10 cells a side of their bounding cube; stable."""
    if not len(points):
        return np.zeros(0, np.int64)
    low = np.array([column.min() for column in points.T], np.float64)
    high = np.array([column.max() for column in points.T], np.float64)
    return radix_order(morton_codes(points, low, high), 3 * _COARSE)


def morton_codes(points: AnyFloats, low: Float64s, high: Float64s) -> UInt32s:
    """Keys (n,) of `morton_order`. Args: low, high: (3,), bounds of all points, clipped to `NEAR`."""
    low = np.clip(low, -NEAR, NEAR)
    high = np.clip(high, -NEAR, NEAR)
    extent = float((high - low).max())
    codes = np.empty(len(points), np.uint32)
    _codes(points, low, (2.0**_COARSE - 1.0) / extent if extent > 0 else 0.0, codes)
    return codes


def fine_morton_order(points: AnyFloats) -> Int64s:
    """`morton_order` of points in [−1, 1], with 2^21 cells a side of that cube."""
    codes = np.empty(len(points), np.uint64)
    _codes(np.ascontiguousarray(points[:, ::-1]), np.full(3, -1.0), 2.0 ** (_FINE - 1), codes)
    return radix_order(codes, 3 * _FINE)


@inline
def _interleaved(x):
    """The 21 lowest bits of `x`, each followed by two zeros."""
    x = (x | (x << np.uint64(32))) & np.uint64(0x1F00000000FFFF)
    x = (x | (x << np.uint64(16))) & np.uint64(0x1F0000FF0000FF)
    x = (x | (x << np.uint64(8))) & np.uint64(0x100F00F00F00F00F)
    x = (x | (x << np.uint64(4))) & np.uint64(0x10C30C30C30C30C3)
    return (x | (x << np.uint64(2))) & np.uint64(0x1249249249249249)


@kernel
def _codes(points: Float32Rows | Float64Rows, low: Float64s, scale: float, codes: UInt32s | UInt64s) -> None:
    """Write Morton codes of 3 × 21 bits (n,) of `points` (n, 3), in cells of 1/scale from `low` on."""
    for i in range(len(points)):
        code = np.uint64(0)
        for axis in range(3):
            cell = min(max((points[i, axis] - low[axis]) * scale, 0.0), 2.0**_FINE - 1.0)
            code = (code << np.uint64(1)) | _interleaved(np.uint64(cell))
        codes[i] = code


def radix_order(keys: UInt32s | UInt64s, bits: int) -> Int64s:
    """The order (n,) that sorts unsigned `keys` (n,) of so many bits, stable (radix sort from the last digit)."""
    count = len(keys)
    order = np.arange(count)
    sorted_ = np.empty(count, np.int64)
    digit_counts = np.empty((-(-count // _BLOCK), 1 << _DIGIT), np.int64)
    for shift in range(0, bits, _DIGIT):
        _count_digits(keys, order, shift, digit_counts)
        before = np.cumsum(digit_counts.T).reshape(digit_counts.T.shape) - digit_counts.T
        digit_counts[:] = before.T
        _place_by_digit(keys, order, shift, digit_counts, sorted_)
        order, sorted_ = sorted_, order
    return order


@each("digit_counts", 1)
def _count_digits(block: int, keys: UInt32s | UInt64s, order: Int64s, shift: int, digit_counts: Int64Rows) -> None:
    """Count the digits of keys in a block, in `digit_counts` (blocks, radix)."""
    counts = digit_counts[block]
    counts[:] = 0
    for k in range(block * _BLOCK, min((block + 1) * _BLOCK, len(keys))):
        counts[np.int64(keys[order[k]] >> shift) & (len(counts) - 1)] += 1


@each("digit_counts", 1)
def _place_by_digit(
    block: int, keys: UInt32s | UInt64s, order: Int64s, shift: int, digit_counts: Int64Rows, out: Int64s
) -> None:
    """Write a block's rows to where its keys' digits belong, and move these places on in `digit_counts`."""
    next_slots = digit_counts[block]
    for k in range(block * _BLOCK, min((block + 1) * _BLOCK, len(keys))):
        digit = np.int64(keys[order[k]] >> shift) & (len(next_slots) - 1)
        out[next_slots[digit]] = order[k]
        next_slots[digit] += 1
