"""From the user's coordinates to the float32 ones that Embree sees, and how far off a surface a ray must begin."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ..kernel.arrays import product
from .mesh import Mesh

ULP = 2.0**-24  # half the spacing of float32 numbers at 1
OFFSET_ULPS = 16.0  # 4 were enough in 20,000 trials


@dataclass(frozen=True, eq=False)
class Placement:
    """A mesh recentred in float64, scaled by a power of two to about unit size, then rounded once.

    Attributes:
        vertices: float32 (n, 3), within [−1, 1].
        scale: what a length in mesh units is multiplied by; a power of two, so nothing is rounded by it.
        diagonal: no two points of the placed mesh are farther apart; a ray need not be longer.
    """

    vertices: npt.NDArray[np.float32]
    scale: float
    diagonal: float

    @classmethod
    def of(cls, mesh: Mesh) -> Placement:
        low, high = mesh.bounds
        extent = float((high / 2 - low / 2).max())
        exponent = min(-math.frexp(extent)[1], 1023) if extent > 0 else 0  # 2^1024 is no number
        scale = math.ldexp(1.0, exponent)
        placed, least, most = (((at - mesh.centre) * scale).astype(np.float32) for at in (mesh.vertices, low, high))
        diagonal = 1.001 * float(np.linalg.norm(most.astype(np.float64) - least))
        return cls(placed, scale, max(diagonal, 1e-30))


def ray_offset(
    normals: npt.NDArray[np.float64], magnitude: npt.NDArray[np.float64], clearance: npt.NDArray[np.float64]
) -> npt.NDArray[np.float64]:
    """Distance (n,) along unit `normals` (n, 3) at which a ray's origin is surely above the surface it starts on.

    Args:
        magnitude: (n,), the largest |coordinate| among the corners of the faces that meet there.
        clearance: (n,), the smallest cosine between the normal and those faces' normals; below .01 it counts as .01.
    """
    error = OFFSET_ULPS * ULP * product(np.abs(normals), np.ones(3)) * magnitude
    return error / np.maximum(clearance, 0.01)
