"""Moments of obscurance over each face, at samples spread evenly by area, from which values at the vertices are fitted.

At a point of a face the hemisphere is that of shading: about the normal interpolated between the vertices. Directions
below the face, in which no ray can start there, are left out or closed, see `ao.rays.below_face`.
"""

from typing import NamedTuple, Self

import numpy as np

from obscurance.raytrace.kernel.jit import inline, kernel
from obscurance.raytrace.kernel.vector import add, divide, dot, length, load, scale, store, subtract
from obscurance.raytrace.mesh.placement import ULP
from obscurance.raytrace.ray_origins.origins import OFFSET_ULPS
from obscurance.raytrace.sampling import hash32
from obscurance.raytrace.types import Float32Grid, Float64Grid, Float64Rows, Float64s, Int64Rows, Int64s

from ..points.points import PointArrays
from ..points.smooth_surface import leaning
from ..rays.below_face import shares_below
from ..rays.directions import BATCHES, Lobe, number_in_run
from ..rays.gather import BATCH_VARIANCE, BEHIND, BELOW, BENT, W

MATRIX, OPEN, FALLOFF = 6, 12, 21  # columns: of each half of the samples, of all, and where those by falloffs begin
SQUARES, RIGHT, HALF = 0, 1, 4  # of these, for each half
NOISE, EACH = 2 * HALF, 2 * HALF + 3  # behind both halves, and columns by a falloff
TRACED, BELOW_FACE, SEEN = 0, 1, 2

_MOSTLY = 0.5
_OF_PARTS = BATCHES**1.5 - 1  # by how much the variance between parts of a lattice exceeds that of the whole
_ODD = np.uint32(1 << 31)
_GOLDEN = 0.6180339887498949
_EVEN = 0.2  # a fifth more samples, the same number for every face, so that small faces have some


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


class Faces(NamedTuple):
    """m faces on which samples lie; see `Patch`."""

    corners: Float64Grid
    normals: Float64Rows
    axes: Float32Grid
    smooth: Float32Grid


def columns(falloffs: int) -> int:
    """Columns of the moments by so many falloffs; see `add_moments`."""
    return FALLOFF + EACH * falloffs


@inline
def sample_barycentric(k, shift, begin, end):
    """Barycentric coordinates of sample `k` on the face that extends from `begin` to `end` (Turk 1990)."""
    s = np.sqrt(min(max((k + shift - begin) / (end - begin), 0.0), 1.0))
    v = (k * _GOLDEN) % 1.0
    return 1.0 - s, s * (1.0 - v), s * v


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
def place_samples(
    first: int, stop: int, faces: Faces, samples: Samples, points: PointArrays, cosines: Float64Rows
) -> None:
    """Place the samples from `first` to `stop`, of the faces that `samples` are spread over, lifted off these.

    Even and odd samples are numbered by themselves, so that their directions are independent.

    Args: points: written. cosines: (n, 2), written: between the axis of each sample and its face's normal, and between
        the axis and the surface's normal, below which directions are closed.
    """
    f = 0
    for k in range(first, stop):
        while samples.starts[f + 1] <= k:
            f += 1
        i = k - first
        # The sample's point, lifted off the face on the side of its shading normal.
        b = sample_barycentric(k, samples.shift, samples.ends[f], samples.ends[f + 1])
        n = _shading_normal(faces.axes[f], b, faces.normals[f])
        is_own = (faces.axes[f] == faces.smooth[f]).all()
        side = load(faces.normals, f)
        if is_own and dot(n, side) < 0.0:
            side = scale(-1.0, side)
        place = _interpolated(faces.corners[f], b)
        store(points.origins, i, add(place, scale(_offset(faces.corners[f], side), side)))
        store(points.lifts, i, subtract(load(points.origins, i), place))
        store(points.normals, i, n)
        store(points.fronts, i, side)
        points.numbers[i] = number_in_run(k >> 1) | _ODD * np.uint32(k & 1)
        cosines[i, 0] = dot(n, side)
        cosines[i, 1] = 1.0 if is_own else leaning(n, side, _interpolated(faces.smooth[f], b))


@inline
def _offset(corners, g):
    """How far origins are lifted off a face, along its normal `g`, so that no ray meets the face itself."""
    largest = 0.0
    for corner in range(3):
        for axis in range(3):
            largest = max(largest, abs(corners[corner, axis]))
    return OFFSET_ULPS * ULP * (abs(g[0]) + abs(g[1]) + abs(g[2])) * largest


@kernel
def add_moments(
    first: int,
    samples: Samples,
    gathered: Float64Grid,
    cosines: Float64Rows,
    directions: tuple[int, Lobe],
    hidden_weight: float,
    moments: Float64Rows,
    counts: Int64Rows,
) -> None:
    """Add samples from `first` on to the moments of their faces.

    Args:
        gathered: (n, k, WIDER), rows of the samples by k falloffs. cosines: of `place_samples`.
        directions: how many each sample has, and how they are distributed. hidden_weight: of samples more
            than half of whose rays end on backs of faces.
        moments: (m, columns), added to: for the even and for the odd samples the upper triangle of Σ b bᵀ, b being
            barycentric coordinates; Σ b · (mean of μ·direction) by the first falloff, axis by axis; then for each
            falloff, for the even and for the odd samples, Σ y² and Σ b y of y = 1 − w; and for all Σ ±b σ, σ the
            standard error of y by its rays, of a random sign; all weighted by area.
        counts: (m, 3), added to: rays traced, rays left out below the face, samples that are not hidden.
    """
    rays, lobe = directions
    f = 0
    for i in range(len(gathered)):
        k = first + i
        while samples.starts[f + 1] <= k:
            f += 1
        b = sample_barycentric(k, samples.shift, samples.ends[f], samples.ends[f + 1])
        below = gathered[i, 0, BELOW]
        hidden = gathered[i, 0, BEHIND] > _MOSTLY * (rays - below)
        weight = samples.weights[f] * (hidden_weight if hidden else 1.0)
        counts[f, TRACED] += rays - below
        counts[f, BELOW_FACE] += below
        counts[f, SEEN] += not hidden
        # Rays below the face are left out, or closed.
        closed, standing = shares_below(cosines[i, 0], cosines[i, 1], 1.0, lobe)
        sign = 1.0 if hash32(np.uint32(k)) & np.uint32(1) else -1.0
        entry = (k & 1) * MATRIX
        for p in range(3):
            for q in range(p, 3):
                moments[f, entry] += weight * b[p] * b[q]
                entry += 1
            for q in range(3):
                moments[f, OPEN + 3 * q + p] += weight * b[p] * gathered[i, 0, BENT + q] / standing
        for c in range(gathered.shape[1]):
            y = max(closed + 1.0 - gathered[i, c, W] - below / rays, 0.0) / standing
            column = FALLOFF + EACH * c
            noise = weight * sign * np.sqrt(gathered[i, c, BATCH_VARIANCE] / _OF_PARTS) / standing
            entry = column + HALF * (k & 1)
            moments[f, entry + SQUARES] += weight * y * y
            for p in range(3):
                moments[f, entry + RIGHT + p] += weight * b[p] * y
                moments[f, column + NOISE + p] += b[p] * noise
