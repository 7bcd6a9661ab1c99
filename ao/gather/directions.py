"""Tables of cosine-weighted directions, and the frames that turn them to the points of a mesh."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from raytrace.embree.packets import LANES
from raytrace.kernel.jit import inline
from raytrace.sampling.hash import mix
from raytrace.sampling.sequences import jittered_lattice
from raytrace.sampling.warps import cosine_hemisphere
from raytrace.types import Float32s, Float64s, UInt8s

BATCHES = 6  # the lattice steps by 6 × golden ratio = .708 within a part, as irrational as one can wish
_TABLE_POINTS = 1 << 18
_SHARERS = 64  # points to a set at least; they turn it each its own way
_TOGETHER = 2 * LANES  # rays that share a part of azimuth in the order of a table
SECTORS = 16  # of azimuth, in each of which a point has a horizon
_STEEPEST = 50.0  # slope from which on the sector is uncertain, and rays count as no steeper


class DirectionTable(NamedTuple):
    """Sets of directions that the points of a mesh draw from, each turned about its own normal.

    Attributes:
        directions: float32 (sets, 3, samples) about +z, ordered so that the rays of a packet run close together: by
            sectors of azimuth, then by height; the last is repeated up to a multiple of 8.
        batches: uint8 (samples,), which of the `BATCHES` interleaved parts of the lattice a direction belongs to;
            their spread carries the error estimate.
        mean: float64 (sets, 3), mean direction.
        sectors: uint8 (sets, samples), slopes: float32 (sets, samples): the part of azimuth that each is in, and
            z/√(x² + y²).
        key: uint32 from which each point draws its set and its turn.
    """

    directions: Float32s
    batches: UInt8s
    mean: Float64s
    sectors: UInt8s
    slopes: Float32s
    key: np.uint32

    @property
    def samples(self) -> int:
        return len(self.batches)

    @classmethod
    def make(cls, samples: int, points: int, key: np.uint32) -> DirectionTable:
        """A table for gathering at `points` points: so many sets that making them costs little beside that."""
        sets = min(max(_TABLE_POINTS // samples, 8), max(points // _SHARERS, 8), 256)
        u, v = jittered_lattice(sets, samples, key)
        part = np.argsort(np.argsort(v[0])) // _TOGETHER
        order = np.argsort(part, kind="stable")  # u ascends already
        u, v = u[:, order], v[:, order]
        directions = cosine_hemisphere(u, v)
        padded = np.empty((sets, 3, samples + -samples % LANES), np.float32)
        padded[:, :, :samples], padded[:, :, samples:] = directions, directions[:, :, -1:]
        sectors, slopes = (v * SECTORS).astype(np.uint8), np.minimum(np.sqrt(1 / u - 1), _STEEPEST).astype(np.float32)
        return cls(padded, (order % BATCHES).astype(np.uint8), directions.mean(axis=2), sectors, slopes, key)


@inline
def choose(number, key, sets):
    """A point's direction set and its turn in radians."""
    chance = mix(mix(number) ^ key)
    return chance % np.uint32(sets), mix(chance) * (2.0 * np.pi / 4294967296.0)


@inline
def turned_frame(n, turn):
    """Orthonormal tangents of the unit normal `n` (Duff et al. 2017), turned about it by `turn` radians."""
    x, y, z = np.float64(n[0]), np.float64(n[1]), np.float64(n[2])
    sign = 1.0 if z >= 0.0 else -1.0
    a = -1.0 / (sign + z)
    b = x * y * a
    c, s = np.cos(turn), np.sin(turn)
    tx, ty, tz = 1.0 + sign * x * x * a, sign * b, -sign * x
    bx, by, bz = b, sign + y * y * a, -y
    t = np.float32(c * tx + s * bx), np.float32(c * ty + s * by), np.float32(c * tz + s * bz)
    b2 = np.float32(c * bx - s * tx), np.float32(c * by - s * ty), np.float32(c * bz - s * tz)
    return t, b2
