"""Rays that start below the face that they leave, where the hemisphere is not about its normal.

They end on that face at once. Where the axis is an interpolated normal of a smooth surface, of which the face is an
approximation, they say nothing of the surroundings: they are left out, so that convex surfaces are open, however
coarse. By as much as the axis leans away from that surface, they are closed. What share of directions is below is
known: estimates are divided by no estimate. Where the face has an alpha, that part of them ends there; the rest counts
as other rays do.
"""

import numpy as np

from obscurance.raytrace.kernel.jit import inline, kernel
from obscurance.raytrace.kernel.vector import dot
from obscurance.raytrace.types import Float32Rows, Float64Rows

from ..points.points import PointArrays
from .directions import DirectionTable, Lobe, choose, turned_frame
from .gather import BATCH_VARIANCE, BENT, COLUMNS, W

_NOTHING = 1e-9  # of the rays lost: rounding


@kernel
def leave_out_below(
    points: PointArrays, geometric_normals: Float32Rows, table: DirectionTable, lobe: Lobe, out: Float64Rows
) -> None:
    """Correct estimates for rays below the face.

    Args:
        points: PointArrays. table: DirectionTable by which `out` was gathered.
        geometric_normals: float32 (n, 5), unit normals of the faces on their fronts, alpha there, and the cosines
            between the axes and the surface's normals.
        lobe: of the table's directions.
        out: float64 (n, COLUMNS), of `Tracer.gather`, changed in place.
    """
    directions, samples = table.directions, len(table.batches)
    for i in range(len(points.normals)):
        n = points.normals[i]
        geometric_normal = geometric_normals[i]
        if n[0] == geometric_normal[0] and n[1] == geometric_normal[1] and n[2] == geometric_normal[2]:
            continue
        # The face's normal in the frame of the directions, and how many directions lie below the face.
        chosen, turn = choose(points.numbers[i], table)
        t, b = turned_frame(n, turn)
        x = dot(t, geometric_normal)
        y = dot(b, geometric_normal)
        z = dot(n, geometric_normal)
        local, below = directions[chosen], 0
        for k in range(samples):
            below += x * local[0, k] + y * local[1, k] + z * local[2, k] < 0.0
        # Rays below count as ended there, as far as the face is opaque: closed, or replaced by the mean of the others.
        alpha = np.float64(geometric_normal[3])
        closed, standing = shares_below(np.float64(z), np.float64(geometric_normal[4]), alpha, lobe)
        lost = closed + 1.0 - out[i, W] - alpha * below / samples
        if lost <= _NOTHING:
            out[i, W], out[i, BATCH_VARIANCE] = 1.0, 0.0
        else:
            out[i, W] = 1.0 - lost / standing
        for column in range(BENT, COLUMNS):
            out[i, column] /= standing


@inline
def shares_below(cosine, leaning, alpha, lobe):
    """The share of directions that a face of an alpha closes, and the share of those that are not left out.

    Args: cosine, leaning: between the axis and the normals of the face, and of the surface.
    """
    closed = alpha * share_below(leaning, lobe)
    return closed, 1.0 - max(alpha * share_below(cosine, lobe) - closed, 0.0)


@inline
def share_below(cosine, lobe):
    """The share of a lobe's directions about an axis that a plane through its apex has below.

    Weighted by their cosine, directions are even over the disk that they project to, and the plane cuts this in an
    ellipse (Nusselt's analogue): below is what of the disk of radius sin α is outside of x²/cos²θ + y² = 1, x < 0.
    Even ones fill a cap of the sphere, which a great circle cuts: 2 arccos(cos θ/sin α) − 2 cos α arccos(cot θ/tan α)
    of its 2π (1 − cos α) is beyond.

    Args: cosine: cos θ, between the axis and the plane's normal.
    """
    cone = lobe.cone
    upright = min(abs(cosine), 1.0)
    share = 0.0
    if upright**2 < cone:  # else the plane misses the cone
        half = np.arccos(min(upright * np.sqrt((1.0 - cone) / (cone * (1.0 - upright**2))), 1.0))
        if lobe.is_even:
            edge = np.sqrt(1.0 - cone)
            share = (np.arccos(min(upright / np.sqrt(cone), 1.0)) - edge * half) / (np.pi * (1.0 - edge))
        else:
            share = (half - upright * np.arctan(upright * np.tan(half)) / cone) / np.pi
    return share if cosine >= 0.0 else 1.0 - share
