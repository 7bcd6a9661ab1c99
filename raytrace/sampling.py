"""Low-discrepancy points of the unit square, and a warp of them to directions.

Owen-scrambled Sobol points: Sobol 1967's first two dimensions under nested uniform scrambling (Owen 1995), exact
down to the cell that holds one point and uniform below it, every random bit a hash of (key, set, dimension, node).

Jittered golden lattice: the rank-1 lattice of the golden ratio (Kronecker 1884), each point moved at random by up to
one stratum in either coordinate. Where a function jumps, as visibility does, it needs a fifth fewer points than Sobol;
the jitter keeps smooth functions from being hit at the same places of every stratum.

Not scipy.stats.qmc: it has no such lattice, which errs by .0168 instead of Sobol's .0199 at 64 rays, and the state of
its generator would make bits depend on the order of work (evidence/experiments.md).
"""

from typing import Any

import numpy as np
import numpy.typing as npt

from .kernel.jit import inline
from .types import Float64s, Int64s, UInt32s

GOLDEN = (5**0.5 - 1) / 2
LEAPED = 0.36038
"""A step whose double and fourfold are as far from fractions as itself: q ‖q α‖ ≥ .228 of all three, for multiples up
to 1,024. The golden ratio's are .38, .22 and .11, so that every fourth point of its lattice lies on few spokes."""


def _lowbias32(x: Any) -> Any:
    """The hash of one value or an array; results are cast back, as whole numbers are 64 bits wide in kernels."""
    x = np.uint32(x)
    x = np.uint32(x ^ (x >> np.uint32(16)))
    x = np.uint32(x * np.uint32(0x7FEB352D))
    x = np.uint32(x ^ (x >> np.uint32(15)))
    x = np.uint32(x * np.uint32(0x846CA68B))
    return np.uint32(x ^ (x >> np.uint32(16)))


def _splitmix64(x: Any) -> Any:
    """A bijective hash of one value, uint64 (Steele, Lea & Flood 2014, SplitMix)."""
    x = (x ^ (x >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    x = (x ^ (x >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return x ^ (x >> np.uint64(31))


hash32 = inline(_lowbias32)  # of one value, in kernels
hash64 = inline(_splitmix64)


def hash32_array(values: npt.ArrayLike) -> UInt32s:
    """Bijective hash of whole numbers below 2^32, of one dimension or more, so that counters become random bits."""
    return np.asarray(_lowbias32(np.asarray(values, np.uint32)))


def seed_key(seed: int) -> np.uint32:
    """A 32-bit key from a seed of up to 64 bits."""
    low = hash32_array([seed & 0xFFFFFFFF])
    high = np.uint32(seed >> 32)
    return np.uint32(hash32_array(low ^ high)[0])


def derive(key: np.uint32, salt: int) -> np.uint32:
    """A key of directions that are independent of the directions of `key`."""
    return np.uint32(hash32_array(hash32_array([salt]) ^ key)[0])


def in_triangle(u: Float64s, v: Float64s) -> Float64s:
    """Barycentric coordinates (…, 3) of points that are uniform in a triangle, of u and v (…) uniform in [0, 1) (Turk
    1990)."""
    root = np.sqrt(u)
    return np.stack([1 - root, root * (1 - v), root * v], axis=-1)


def stratified_rows(count: int, wanted: int, salt: int = 0) -> Int64s:
    """`wanted` of `count` rows, one from each equal stretch of Morton order, all if there are no more; ascending.

    Args: salt: of the choice in each stretch.
    """
    wanted = min(count, wanted)
    bounds = np.arange(wanted + 1) * count // max(wanted, 1)
    chance = np.ldexp(hash32_array(np.arange(wanted, dtype=np.uint32) ^ np.uint32(salt)).astype(np.float64), -32)
    return bounds[:-1] + (chance * np.diff(bounds)).astype(np.int64)


def sobol(count: int) -> UInt32s:
    """The first `count` Sobol points in two dimensions as 32-bit fractions: (2, count)."""
    index = np.arange(count, dtype=np.uint32)
    points = np.zeros((2, count), np.uint32)
    column = np.uint32(1 << 31)
    for bit in range(32):
        on = (index >> np.uint32(bit)) & np.uint32(1)
        points ^= on * np.array([[1 << (31 - bit)], [column]], np.uint32)
        column ^= column >> np.uint32(1)  # the Pascal matrix, direction numbers of the polynomial x + 1
    return points


def owen_scramble(points: UInt32s, keys: UInt32s, levels: int) -> UInt32s:
    """Nested uniform scrambling of `points` (n,), once for each of `keys` (k,): (k, n) fractions.

    Each of the top `levels` bits is flipped by a random bit of its node in the binary tree; what lies below is
    drawn uniformly in the cell, which equals full scrambling while a cell holds at most one point.
    """
    key = keys[:, None]

    def of_node(level: int, key: UInt32s) -> UInt32s:
        node = (points.astype(np.uint64) >> np.uint64(32 - level)).astype(np.uint32) | np.uint32(1 << level)
        return hash32_array(hash32_array(node) ^ key)

    scrambled = np.broadcast_to(points, (len(keys), len(points))).copy()
    for level in range(levels):
        scrambled ^= (of_node(level, key) & np.uint32(1)) << np.uint32(31 - level)
    below = np.uint32((1 << (32 - levels)) - 1)
    return (scrambled & ~below) | (of_node(levels, key ^ np.uint32(0x9E3779B9)) & below)


def _keys(sets: int, key: np.uint32) -> UInt32s:
    """Of each dimension and set: (2, sets)."""
    return hash32_array(hash32_array(np.arange(2 * sets, dtype=np.uint32)) ^ key).reshape(2, sets)


def owen_sobol(sets: int, count: int, key: np.uint32) -> tuple[Float64s, Float64s]:
    """`sets` independently scrambled Sobol sets of `count` points: two arrays (sets, count) in (0, 1)."""
    levels = max(count - 1, 1).bit_length()
    points = sobol(count)
    keys = _keys(sets, key)
    u = owen_scramble(points[0], keys[0], levels)
    v = owen_scramble(points[1], keys[1], levels)
    return np.ldexp(u + np.float64(0.5), -32), np.ldexp(v + np.float64(0.5), -32)


def shuffled_owen_sobol(sets: int, count: int, key: np.uint32) -> tuple[Float64s, Float64s]:
    """As `owen_sobol`, in an order that has nothing to do with that of sets of another key (Burley 2020, "Practical
    Hash-based Owen Scrambling"): pairs of points of the two then fill four dimensions, and aligned runs of 2^k points
    stay as even as before."""
    levels = max(count - 1, 1).bit_length()
    u, v = owen_sobol(sets, 1 << levels, key)
    index = np.arange(count, dtype=np.uint32) << np.uint32(32 - levels)
    order = owen_scramble(index, _keys(sets, hash32_array([key])[0])[0], levels) >> np.uint32(32 - levels)
    return np.take_along_axis(u, order, axis=1), np.take_along_axis(v, order, axis=1)


def jittered_lattice(sets: int, count: int, key: np.uint32, step: float = GOLDEN) -> tuple[Float64s, Float64s]:
    """`sets` lattices of `count` points, ordered by u: two arrays (sets, count) in (0, 1).

    The jitter of each stratum of u is stratified over the sets (Latin hypercube sampling, McKay, Beckman & Conover
    1979), so that means over many sets are even. The v of a whole set are to be turned (mod 1) by a random amount, as
    directions are about their axis.
    """
    rank = np.arange(count)
    hashed = hash32_array(hash32_array(rank.astype(np.uint32)) ^ _keys(sets, key)[:, :, None])
    stratum = np.argsort(hashed[0], axis=0)  # a permutation by chance: of one rank all hashes are different
    within = np.ldexp(hash32_array(hashed[0]) + 0.5, -32)
    u = (rank + (stratum + within) / sets) / count
    v = (rank * step + np.ldexp(hashed[1] + 0.5, -32) / count) % 1.0
    return u, v


def cosine_hemisphere(u: Float64s, v: Float64s) -> Float64s:
    """Directions about +z with density cosθ/π from `u`, `v` in (0, 1), by Malley's method: (…, 3, n)."""
    radius = np.sqrt(u)
    azimuth = 2 * np.pi * v
    return np.stack([radius * np.cos(azimuth), radius * np.sin(azimuth), np.sqrt(1 - u)], axis=-2)
