"""Tables of directions, cosine-weighted or even, and the frames that turn them to the points of a mesh."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from obscurance.raytrace.kernel.arrays import aligned
from obscurance.raytrace.kernel.jit import inline
from obscurance.raytrace.kernel.simd import WIDE
from obscurance.raytrace.kernel.vector import tangents
from obscurance.raytrace.sampling import GOLDEN, LEAPED, cosine_hemisphere, hash32, jittered_lattice
from obscurance.raytrace.system.threads import run_blocks, thread_count
from obscurance.raytrace.types import Float32Grid, Float32s, Float64Rows, Float64s, Int64s, UInt8s

BATCHES = 6  # the lattice steps by 6 × golden ratio = .708 within a part, as irrational as one can wish
RUN = 256  # points that share a lattice where each has few directions; see `number_in_run`
_RUN_STEP = (GOLDEN + 108) / RUN  # of that lattice; of the points of one set it is the golden ratio
_NEXT = 193  # from one set to the next; with 108 runs of 4 to 64 sets miss caps by least, found by trial
_TABLE_POINTS = 1 << 18
_SHARERS = 64  # points to a set at least; each turns it its own way
_BLOCK, _MOST = 1 << 11, 4  # directions, and blocks at once
_ROUNDED = 2.0**-20  # of the cosines and sines of cones


class Lobe(NamedTuple):
    """How directions are distributed about an axis: within a cone, like the cosine or evenly over the solid angle."""

    cone: float = 1.0  # sin² of the largest angle
    is_even: bool = False

    def squared_sines(self, u: Float64s) -> Float64s:
        """sin² of the angles to the axis for `u` in (0, 1), uniform."""
        if not self.is_even:
            return u * self.cone  # Malley's method
        cosines = 1.0 - u * (1.0 - np.sqrt(1.0 - self.cone))
        return np.asarray(1.0 - cosines**2)


COSINE = Lobe()


class DirectionTable(NamedTuple):
    """Sets of directions that the points of a mesh draw from, each turned about its own normal.

    Attributes:
        directions: float32 (sets, 3, padded) about +z, ordered in blocks of sixteen that run close together; the last
            is repeated up to a multiple of sixteen.
        batches: uint8 (samples,), which of the `BATCHES` interleaved parts of the lattice a direction belongs to;
            the error is estimated from the spread between parts. batch_sizes: float64 (BATCHES,).
        mean: float64 (sets, 3), mean direction. lowest: float32 (sets,), the least z of a direction.
        cones: float32 (sets, 5, b), cones around the blocks, padded with NaN to a multiple of sixteen: unit axes, then
            cosines and sines of half angles.
        key: uint32 from which each point draws its set and its turn.
        leap: int64: so many points that follow one another share a lattice, each taking every leap-th of its points
            (leaped lattice), so that their mean is as even as the whole lattice. step: the lattice's.
    """

    directions: Float32Grid
    batches: UInt8s
    batch_sizes: Float64s
    mean: Float64Rows
    lowest: Float32s
    cones: Float32Grid
    key: np.uint32
    leap: np.int64
    step: np.float64

    @classmethod
    def make(cls, samples: int, points: int, key: np.uint32, leap: int = 1, lobe: Lobe = COSINE) -> DirectionTable:
        """A table for gathering at `points` points: so many sets that making them costs little beside the gathering."""
        lattices = min(max(_TABLE_POINTS // (samples * leap), 8), max(points // (_SHARERS * leap), 8), 256)
        count = lattices * leap
        step = {1: GOLDEN, RUN: _RUN_STEP}.get(leap, LEAPED)

        u, v = jittered_lattice(lattices, samples * leap, key, step)
        v -= step * (np.arange(samples * leap) % leap)  # parts that are alike: `choose` turns them back

        def by_set(coordinates: Float64s) -> Float64s:
            """Coordinates (s, samples) of sets from those of their lattices, (s / leap, samples·leap)."""
            return coordinates.reshape(-1, samples, leap).swapaxes(1, 2).reshape(-1, samples)

        def directions_of(start: int, stop: int) -> Float64s:
            """The sets (s, 3, samples) of the lattices from `start` to `stop`, as the lattices order them."""
            return cosine_hemisphere(lobe.squared_sines(by_set(u[start:stop])), by_set(v[start:stop]))

        # Directions that lie together stand together, so that cones about blocks of them are narrow.
        order = _in_blocks(*directions_of(0, 1)[0, :2])
        directions = aligned((count, 3, samples + -samples % WIDE), np.float32, zeroed=False)
        blocks = directions.shape[2] // WIDE
        cones = aligned((count, 5, blocks + -blocks % WIDE), np.float32, zeroed=False)
        mean = np.empty((count, 3))
        lowest = np.empty(count, np.float32)

        def write_sets(start: int, stop: int) -> None:
            """Write the sets of the lattices from `start` to `stop`."""
            exact = directions_of(start, stop)[:, :, order]
            sets = slice(start * leap, stop * leap)
            rounded = directions[sets]
            rounded[:, :, :samples], rounded[:, :, samples:] = exact, exact[:, :, -1:]
            mean[sets] = exact.mean(axis=2)
            lowest[sets] = rounded[:, 2].min(axis=1)
            _write_cones(rounded, cones[sets])

        # All sets, and which batch each direction belongs to.
        run_blocks(lattices, max(_BLOCK // (samples * leap), 1), write_sets, thread_count(None), most=_MOST)
        batches = (order % BATCHES).astype(np.uint8)
        sizes = np.bincount(batches, minlength=BATCHES).astype(np.float64)
        return cls(directions, batches, sizes, mean, lowest, cones, key, np.int64(leap), np.float64(step))


def _in_blocks(x: Float64s, y: Float64s) -> Int64s:
    """An order of points of a disk (k,) whose sixteens lie close together: columns along x, cut along y."""
    blocks = -(-len(x) // WIDE)
    columns = max(round(np.sqrt(blocks)), 1)
    order = np.argsort(x, kind="stable")
    ends = [*(round(k * (blocks / columns)) * WIDE for k in range(columns)), blocks * WIDE]
    parts = (order[start:stop] for start, stop in pairwise(ends))
    return np.concatenate([part[np.argsort(y[part], kind="stable")] for part in parts])


def _write_cones(directions: Float32s, cones: Float32s) -> None:
    """The cones around each sixteen of directions (sets, 3, padded), see `DirectionTable`."""
    sets, _, padded = directions.shape
    blocks = directions.reshape(sets, 3, padded // WIDE, WIDE)
    axes = blocks.mean(axis=3)
    axes /= np.sqrt(np.sum(axes**2, axis=1, keepdims=True))
    cosines = np.sum(blocks * axes[..., None], axis=1).min(axis=2)
    cones[:] = np.nan
    cones[:, :3, : blocks.shape[2]] = axes
    cones[:, 3, : blocks.shape[2]] = cosines - _ROUNDED
    cones[:, 4, : blocks.shape[2]] = np.sqrt(np.maximum(1 - cosines**2, 0)) + np.sqrt(2 * _ROUNDED)


@inline
def choose(number, table):
    """A point's direction set and its turn in radians."""
    leap = np.uint32(table.leap)
    chance = hash32(hash32(number // leap) ^ table.key)
    other = hash32(chance)
    part = (number % leap + other % leap) % leap  # by chance, or each of the points would see some strata alone
    turn = other * (2.0 * np.pi / 4294967296.0) + part * (2.0 * np.pi * table.step)
    return chance % (np.uint32(len(table.directions)) // leap) * leap + part, turn


@inline
def number_in_run(rank):
    """The number of the point `rank` of many that have lattices of a leap of `RUN`, with few directions each.

    Directions of any points that follow one another are even together, not only those of whole lattices.
    """
    return np.uint32(rank - rank % RUN + rank * _NEXT % RUN)


@inline
def turned_frame(n, turn):
    """Orthonormal tangents of the unit normal `n`, turned about it by `turn` radians."""
    t, b = tangents((np.float64(n[0]), np.float64(n[1]), np.float64(n[2])))
    c = np.cos(turn)
    s = np.sin(turn)
    turned = np.float32(c * t[0] + s * b[0]), np.float32(c * t[1] + s * b[1]), np.float32(c * t[2] + s * b[2])
    across = np.float32(c * b[0] - s * t[0]), np.float32(c * b[1] - s * t[1]), np.float32(c * b[2] - s * t[2])
    return turned, across
