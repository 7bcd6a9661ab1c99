"""Moments of obscurance over each face, at samples spread evenly by area, from which values at the vertices are fitted.

At a point of a face the hemisphere is that of shading: about the normal interpolated between the vertices. Directions
below the face, in which no ray can start there, are left out or closed, see `ao.rays.below_face`.
"""

from typing import NamedTuple, Self

import numpy as np

from obscurance.raytrace.embree import DIR_X, DIR_Y, DIR_Z, LANES
from obscurance.raytrace.kernel.jit import inline, kernel
from obscurance.raytrace.kernel.vector import add, divide, dot, length, load, scale
from obscurance.raytrace.mesh.placement import ULP
from obscurance.raytrace.ray_origins.origins import OFFSET_ULPS
from obscurance.raytrace.sampling import cosine_hemisphere, hash32
from obscurance.raytrace.types import Float32Grid, Float32s, Float64Grid, Float64Rows, Float64s, Int64Rows, Int64s

from ..mu import KernelMu
from ..points.smooth_surface import leaning
from ..rays.below_face import share_below
from ..rays.directions import turned_frame
from ..rays.ray_packet import RayPacket, aim, backface_share, mu_of, new_alpha_rows, start_from, trace

HIDDEN = 1e-4  # weight of a sample that sees backs of faces; not 0, so that hidden faces have a value too
_MOSTLY = 0.5
SQUARES, MATRIX, RIGHT, HALF = 0, 1, 7, 10  # columns of either half of the samples, and their number
BENT = 2 * HALF
MOMENTS = BENT + 9
TRACED, BELOW, SEEN = 0, 1, 2

_GOLDEN = 0.6180339887498949
_EVEN = 0.2  # a fifth more samples, the same number for every face, so that small faces have some
_SHIFTS = 256
_PLASTIC = 1 / 1.324717957244746  # Roberts 2018: n·(1/p, 1/p²) mod 1, p³ = p + 1, is a sequence of low discrepancy


class Samples(NamedTuple):
    """A Fibonacci lattice laid over faces one after the other.

    Between 0 and `count`, sample k lies at k + shift, which determines its face and, within it, one coordinate; the
    other is the fractional part of k/golden ratio. So samples are evenly spread on each face, whatever their number,
    and over neighbouring faces that hold less than one each.
    """

    shift: float  # in [0, 1)
    ends: Float64s  # (m + 1,), where each face begins between 0 and `count`
    starts: Int64s  # (m + 1,), the first sample on each
    weights: Float64s  # (m,), the share of the area that a sample on each stands for

    @classmethod
    def spread(cls, areas: Float64s, count: int, shift: float) -> Self:
        """`count` samples over faces of `areas` (m,), above 0, in Morton order."""
        share = areas / areas.sum()
        ends = np.concatenate([[0.0], np.cumsum(share + _EVEN / len(share))])
        ends *= count / ends[-1]
        starts = np.clip(np.ceil(ends - shift), 0, count).astype(np.int64)
        starts[-1] = count
        return cls(shift, ends, starts, share / np.diff(ends))


def lattices(rays: int, cone: float) -> Float32s:
    """Fibonacci lattices of `rays` cosine-weighted directions about +z, shifted in height: (256, 3, rays).

    They are ordered by azimuth, which keeps a packet's rays together. Args: cone: sin² of the largest angle to +z.
    """
    number = np.arange(rays)
    azimuth = number * _GOLDEN % 1
    order = np.argsort(azimuth)
    shift = (np.arange(_SHIFTS)[:, None] + 0.5) / _SHIFTS
    heights = (number[order] + shift) / rays
    return cosine_hemisphere(heights * cone, np.broadcast_to(azimuth[order], heights.shape)).astype(np.float32)


@inline
def sample_barycentric(k, shift, begin, end):
    """Barycentric coordinates of sample `k` on the face that extends from `begin` to `end` (Turk 1990)."""
    s = np.sqrt(min(max((k + shift - begin) / (end - begin), 0.0), 1.0))
    v = (k * _GOLDEN) % 1.0
    return 1.0 - s, s * (1.0 - v), s * v


@inline
def _draw_rays(k, drawn, n):
    """Sample `k`'s lattice of directions about +z, and the frame about a normal that they are turned into.

    Neighbours complement one another, even and odd samples are independent. Args: drawn: as of `gather_faces`.
    """
    directions, key, _ = drawn
    chance = np.uint32(key + np.uint32(k & 1))
    shift_of_lattice = hash32(chance) / 4294967296.0
    shift_of_turn = hash32(hash32(chance)) / 4294967296.0
    rank = k >> 1
    lattice = int((rank * _PLASTIC + shift_of_lattice) % 1.0 * _SHIFTS)
    turn = 2.0 * np.pi * ((rank * (_PLASTIC * _PLASTIC) + shift_of_turn) % 1.0)
    t, u = turned_frame(n, turn)
    return directions[lattice], (t, u, n)


@inline
def _shading_normal(axes, b, g):
    """The unit normal interpolated between the corners' `axes` by barycentrics `b`, or the face's `g` where it is 0."""
    n = _interpolated(axes, b)
    size = length(n)
    return (g[0], g[1], g[2]) if size < 1e-6 else divide(n, size)


@inline
def _interpolated(vectors, b):
    """The vector interpolated between those of the corners (3, 3) by barycentrics `b`."""
    return add(add(scale(b[0], load(vectors, 0)), scale(b[1], load(vectors, 1))), scale(b[2], load(vectors, 2)))


@kernel
def gather_faces(
    packet: RayPacket,
    faces: tuple[Float64Grid, Float64Rows, Float32Grid, Float32Grid],
    samples: Samples,
    drawn: tuple[Float32Grid, np.uint32, float],
    falloff: KernelMu,
    reach: float,
    moments: Float64Rows,
    counts: Int64Rows,
) -> None:
    """Gather the moments of n faces.

    Args:
        faces: `Moments.faces`. drawn: `lattices`, the key by which samples draw them, and the lattices' cone. reach:
            length of every ray.
        moments: (n, 29), added to: for the even and for the odd samples Σ y² of y = 1 − w, the upper triangle of
            Σ b bᵀ, and Σ b y; for all Σ b ȳ_x, Σ b ȳ_y, Σ b ȳ_z, with ȳ the mean of μ·direction; weighted.
        counts: (n, 3), added to: rays traced, rays below the face, samples that are not hidden.
    """
    corners, normals, axes, smooth = faces
    cone = drawn[2]
    alpha_rows = new_alpha_rows(packet.opacity)
    values = np.zeros(4)
    b = np.zeros(3)
    side = np.zeros(3)
    for f in range(len(corners)):
        g = normals[f]
        lift = _offset(corners[f], g)
        for k in range(samples.starts[f], samples.starts[f + 1]):
            # The sample's point, lifted off the face on the side of its shading normal.
            b[0], b[1], b[2] = sample_barycentric(k, samples.shift, samples.ends[f], samples.ends[f + 1])
            n = _shading_normal(axes[f], b, g)
            is_own = (axes[f] == smooth[f]).all()
            _start_on(packet.rays, corners[f], b, -1.0 if is_own and dot(n, g) < 0.0 else 1.0, g, lift, side)
            # Its rays, less those below the face.
            local, frame = _draw_rays(k, drawn, n)
            traced, behind = _trace_above(packet, alpha_rows, local, frame, (side, lift), falloff, reach, values)
            counts[f, TRACED] += traced
            counts[f, BELOW] += local.shape[1] - traced
            rays = np.float64(traced)
            if not is_own:  # those that the surface closes count, too
                closed = share_below(leaning(n, (side[0], side[1], side[2]), _interpolated(smooth[f], b)), cone)
                rays = local.shape[1] * (1.0 - max(share_below(dot(n, side), cone) - closed, 0.0))
                values[0] += local.shape[1] * closed
            if rays == 0.0:
                continue
            # What they are part of: a sample that mostly sees backs of faces is hidden, and counts for little.
            hidden = behind > _MOSTLY * traced
            counts[f, SEEN] += not hidden
            values /= rays
            weight = samples.weights[f] * HIDDEN if hidden else samples.weights[f]
            _add_moments(moments[f], (k & 1) * HALF, weight, b, values)


@inline
def _offset(corners, g):
    """How far origins are lifted off a face, along its normal `g`, so that no ray meets the face itself."""
    largest = 0.0
    for corner in range(3):
        for axis in range(3):
            largest = max(largest, abs(corners[corner, axis]))
    return OFFSET_ULPS * ULP * (abs(g[0]) + abs(g[1]) + abs(g[2])) * largest


@inline
def _start_on(rays, corners, b, front, g, lift, side):
    """Let rays start at barycentrics `b` of a face, lifted along `side`, which becomes `front` times its normal `g`."""
    for axis in range(3):
        side[axis] = front * g[axis]
    x = b[0] * corners[0, 0] + b[1] * corners[1, 0] + b[2] * corners[2, 0]
    y = b[0] * corners[0, 1] + b[1] * corners[1, 1] + b[2] * corners[2, 1]
    z = b[0] * corners[0, 2] + b[1] * corners[1, 2] + b[2] * corners[2, 2]
    start_from(rays, (x + lift * side[0], y + lift * side[1], z + lift * side[2]))


@inline
def _trace_above(packet, alpha_rows, local, frame, lifted, falloff, reach, values):
    """Trace rays above a face: how many, and how many hit backs; `values`: Σ 1 − μ, Σ μ·direction.

    Args: lifted: the face's normal on the side that it is seen from, and how far along this rays start.
    """
    rays = packet.rays
    valid = packet.valid
    t, u, n = frame
    side, away = lifted
    lift = (away * side[0], away * side[1], away * side[2])
    values[:] = 0.0
    traced = 0
    behind = 0.0
    for start in range(0, local.shape[1], LANES):
        aim(rays, local, start, t, u, n, reach)
        for lane in range(LANES):
            height = rays[DIR_X, lane] * side[0] + rays[DIR_Y, lane] * side[1] + rays[DIR_Z, lane] * side[2]
            valid[lane] = -1 if height > 0.0 else 0
            traced -= valid[lane]
        trace(packet, True, falloff, reach, lift, alpha_rows)
        for lane in range(LANES):
            if valid[lane] == 0:
                continue
            behind += backface_share(rays, lane, alpha_rows)
            mu = mu_of(rays, lane, lift, True, falloff, alpha_rows)
            values[0] += 1.0 - mu
            for axis in range(3):
                values[1 + axis] += mu * rays[DIR_X + axis, lane]
    return traced, behind


@inline
def _add_moments(row, half, weight, b, values):
    """Add a sample at barycentrics b with `values`, 1 − w and the mean of μ·direction, to a row of moments."""
    row[half + SQUARES] += weight * values[0] * values[0]
    entry = half + MATRIX
    for i in range(3):
        for j in range(i, 3):
            row[entry] += weight * b[i] * b[j]
            entry += 1
        row[half + RIGHT + i] += weight * b[i] * values[0]
        for q in range(3):
            row[BENT + 3 * q + i] += weight * b[i] * values[1 + q]
