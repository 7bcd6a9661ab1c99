"""Rays that start below the face that they leave, where the hemisphere is about an interpolated normal.

They end on that face at once and say nothing of the surroundings: estimates are made of the other rays alone, as by
the surface method (`ao.least_squares.face_moments`). So convex surfaces are open, however coarse. Where the face has an
alpha, that part of them ends there; the rest counts as other rays do.
"""

import numpy as np

from raytrace.kernel.jit import kernel
from raytrace.kernel.vector import dot
from raytrace.types import Float32Rows, Float64Rows

from ..points.points import PointArrays
from .directions import DirectionTable, choose, turned_frame
from .gather import BATCH_VARIANCE, BENT, COLUMNS, W

_NOTHING = 1e-9  # of the rays lost: rounding


@kernel
def leave_out_below(
    points: PointArrays, geometric_normals: Float32Rows, table: DirectionTable, out: Float64Rows
) -> None:
    """Correct estimates for rays below the face.

    Args:
        points: PointArrays. table: DirectionTable by which `out` was gathered.
        geometric_normals: float32 (n, 4), unit normals of the faces, on the side of the hemispheres, and alpha there.
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
        if below == 0 or below == samples:
            continue
        # Rays below count as ended there, as far as the face is opaque; the others stand for all.
        ended = below * np.float64(geometric_normal[3])
        above = samples - ended
        lost = (1.0 - out[i, W]) * samples - ended
        if lost <= _NOTHING * samples:
            out[i, W], out[i, BATCH_VARIANCE] = 1.0, 0.0
        else:
            out[i, W] = max(1.0 - lost / above, 0.0)
        for column in range(BENT, COLUMNS):
            out[i, column] *= samples / above
