"""Render space: the float32 coordinates that Embree sees, a mesh recentred and scaled to about unit size."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..kernel.arrays import product
from ..types import Float32s, Float64s
from .mesh import Mesh

ULP = 2.0**-24  # half the spacing of float32 numbers at 1
TOUCHING = 4.0  # roundings of a coordinate; the point's and the face's own make 2
_LEAST = 2.0**-16  # what coordinates count for at least: double precision rounds, too, where a mesh is placed


def contact_radius(points: Float64s) -> Float64s:
    """How far (k,) from `points` (k, 3) in render space something may be that touches them, or is them."""
    return TOUCHING * ULP * np.maximum(product(np.abs(points), np.ones(3)), _LEAST)


class RenderSpace(NamedTuple):
    """Where a mesh of known bounds is placed.

    Attributes:
        centre: float64 (3,), in mesh units. scale, diagonal: as of `Placement`.
    """

    centre: Float64s
    scale: float
    diagonal: float

    @classmethod
    def of(cls, low: Float64s, high: Float64s) -> RenderSpace:
        """For a mesh with the bounding box from `low` (3,) to `high`."""
        centre = low + (high - low) / 2
        extent = float((high / 2 - low / 2).max())
        exponent = min(-math.frexp(extent)[1], 1023) if extent > 0 else 0  # 2^1024 is no number
        scale = math.ldexp(1.0, exponent)
        least, most = (((at - centre) * scale).astype(np.float32) for at in (low, high))
        diagonal = 1.001 * float(np.linalg.norm(most.astype(np.float64) - least))
        return cls(centre, scale, max(diagonal, 1e-30))

    def place(self, vertices: Float64s) -> Float32s:
        """Vertices (k, 3) in render space."""
        return ((vertices - self.centre) * self.scale).astype(np.float32)


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
        space = RenderSpace.of(*mesh.bounds)
        return cls(space.place(mesh.vertices), space.scale, space.diagonal)
