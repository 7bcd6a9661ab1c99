"""Render space: the float32 coordinates that Embree sees, a mesh recentred and scaled to about unit size."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..types import Float32s
from .mesh import Mesh

ULP = 2.0**-24  # half the spacing of float32 numbers at 1


@dataclass(frozen=True, eq=False)
class Placement:
    """A mesh in render space: recentred in float64, scaled by a power of two to about unit size, then rounded once.

    Attributes:
        vertices: float32 (n, 3), within [−1, 1].
        scale: what a length in mesh units is multiplied by; a power of two, so nothing is rounded by it.
        diagonal: no two points of the placed mesh are farther apart; a ray need not be longer.
    """

    vertices: Float32s
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
