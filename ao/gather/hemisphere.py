"""The estimator: w(p) = (1/π) ∫ μ(d) cosθ dω (12.71) by cosine-weighted directions, eight rays a packet.

With directions of density cosθ/π the integral is the plain mean of μ, so a fully open point is exactly 1.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from raytrace.embree.packets import (
    DIR_X,
    DIR_Y,
    DIR_Z,
    GEOM_ID,
    INVALID,
    LANES,
    ORG_X,
    ORG_Y,
    ORG_Z,
    TFAR,
    intersect8,
    new_packet,
    occluded8,
)
from raytrace.embree.scene import EmbreeScene
from raytrace.kernel.borrow import borrow
from raytrace.kernel.jit import inline, kernel
from raytrace.sampling.hash import mix
from raytrace.sampling.sequences import jittered_lattice
from raytrace.sampling.warps import cosine_hemisphere

from ..falloff import exponential_mu

BATCHES = 6  # the lattice steps by 6 × golden ratio = .708 within a part, as irrational as one can wish
_TABLE_POINTS = 1 << 18
_SHARERS = 64  # points to a set at least; they turn it each its own way
_TOGETHER = 2 * LANES  # rays that share a part of azimuth in the order of a table
SECTORS = 16  # of azimuth, in each of which a point has a horizon
_STEEPEST = 50.0  # slope from which on the sector is uncertain, and rays count as no steeper

W, BATCH_VARIANCE, BENT = (
    0,
    1,
    2,
)  # columns of what is gathered: w, the variance between batches, the mean of μ·direction
COLUMNS = BENT + 3
VALUES = [W, *range(BENT, COLUMNS)]


class RayPacket(NamedTuple):
    """Eight rays and the Embree scene that they are traced in.

    Attributes:
        scene: uint64, Embree's handle. rays: float32 (22, 8). valid: int32 (8,). See `raytrace.embree.packets`.
    """

    scene: np.uint64
    rays: npt.NDArray[np.float32]
    valid: npt.NDArray[np.int32]

    @classmethod
    def of(cls, scene: EmbreeScene) -> RayPacket:
        """A new packet, all lanes valid."""
        return cls(scene.handle, *new_packet())


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

    directions: npt.NDArray[np.float32]
    batches: npt.NDArray[np.uint8]
    mean: npt.NDArray[np.float64]
    sectors: npt.NDArray[np.uint8]
    slopes: npt.NDArray[np.float32]
    key: np.uint32

    @property
    def samples(self) -> int:
        return len(self.batches)

    @classmethod
    def make(cls, samples: int, points: int, key: np.uint32) -> DirectionTable:
        """A table for gathering at `points` points: so many sets that making them costs little beside that."""
        sets = int(np.clip(_TABLE_POINTS // samples, 8, min(max(points // _SHARERS, 8), 256)))
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


@inline
def start_from(packet, origin):
    for lane in range(LANES):
        packet[ORG_X, lane], packet[ORG_Y, lane], packet[ORG_Z, lane] = origin[0], origin[1], origin[2]


@inline
def aim(packet, local, first, t, b, n, reach):
    """Turn eight of the directions `local` about +z, (3, samples), into the frame t, b, n; rays of length `reach`."""
    for lane in range(LANES):
        x, y, z = local[0, first + lane], local[1, first + lane], local[2, first + lane]
        packet[DIR_X, lane] = x * t[0] + y * b[0] + z * n[0]
        packet[DIR_Y, lane] = x * t[1] + y * b[1] + z * n[1]
        packet[DIR_Z, lane] = x * t[2] + y * b[2] + z * n[2]
        packet[TFAR, lane] = reach


@kernel
def gather_hemispheres(packet, points, table, falloff, reach, horizons, traced, out):
    """Estimate the obscurance of n points.

    Args:
        packet: RayPacket. points: PointArrays. table: DirectionTable. falloff: KernelMu.
        reach: length of every ray, at most falloff.limit.
        horizons: float32 (n, 16), slopes above which rays are open and not traced, or (0, 16).
        traced: uint32 (n,), written: rays traced.
        out: float64 (n, COLUMNS), written.
    """
    scene, rays, valid = borrow(packet)
    origins, normals, numbers = borrow(points)
    directions, batches, mean, sectors, slopes, key = borrow(table)
    horizons, traced, out = borrow(horizons), borrow(traced), borrow(out)
    sets, samples = len(directions), len(batches)
    below, batches_below = np.zeros((3, samples + LANES), np.float32), np.zeros(samples + LANES, np.uint8)
    used = min(BATCHES, samples)
    size = np.zeros(BATCHES)
    for k in range(samples):
        size[batches[k]] += 1.0
    lost = np.zeros(BATCHES)
    exponential = falloff.tau > 0.0
    ids = rays.view(np.uint32)
    for i in range(len(origins)):
        chosen, turn = choose(numbers[i], key, sets)
        n = normals[i]
        t, b = turned_frame(n, turn)
        local, of_batch, count = directions[chosen], batches, samples
        if len(horizons):
            count = 0
            for k in range(samples):
                for axis in range(3):
                    below[axis, count] = local[axis, k]
                batches_below[count] = batches[k]
                count += slopes[chosen, k] <= horizons[i, sectors[chosen, k]]
            local, of_batch = below, batches_below
        traced[i] = count
        lost[:] = 0.0
        x = y = z = 0.0
        valid[:] = -1
        start_from(rays, origins[i])
        for first in range(0, count, LANES):
            lanes = min(LANES, count - first)
            valid[lanes:] = 0
            aim(rays, local, first, t, b, n, reach)
            if exponential:
                intersect8(scene, rays, valid)
            else:
                occluded8(scene, rays, valid)
            for lane in range(lanes):
                loss = 1.0  # 1 − μ
                if exponential:
                    if ids[GEOM_ID, lane] == INVALID:
                        continue
                    loss -= exponential_mu(rays[TFAR, lane], falloff)
                elif rays[TFAR, lane] >= 0.0:
                    continue
                lost[of_batch[first + lane]] += loss
                x += loss * local[0, first + lane]
                y += loss * local[1, first + lane]
                z += loss * local[2, first + lane]
        mean_loss = lost.sum() / samples
        spread = 0.0
        for k in range(used):
            spread += (lost[k] / size[k] - mean_loss) ** 2
        out[i, W] = min(max(1.0 - mean_loss, 0.0), 1.0)
        out[i, BATCH_VARIANCE] = spread / (used - 1) if used > 1 else 0.0
        x, y, z = mean[chosen, 0] - x / samples, mean[chosen, 1] - y / samples, mean[chosen, 2] - z / samples
        for axis in range(3):
            out[i, BENT + axis] = x * t[axis] + y * b[axis] + z * n[axis]
