"""Render space: the float32 coordinates that Embree sees, a mesh recentred and scaled to about unit size.

Single precision is finest at the origin, and all that is reckoned in render space allows for the rounding of the
coordinates at hand. So the origin is where most of the vertices are: a few that are very far away, `FAR` times as far
as is usual, lie beyond [−1, 1] and cost what is near no digits.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..kernel.arrays import product
from ..system.threads import run_blocks, thread_count
from ..types import Float32s, Float64s
from .mesh import Mesh

ULP = 2.0**-24  # half the spacing of float32 numbers at 1
TOUCHING = 4.0  # roundings of a coordinate; the point's and the face's own make 2
FAR = 64.0  # times the median distance from the median vertex: what is farther has no say in where the origin is
NEAR = 8.0  # what coordinates count for at least where bounds of errors are cut off
_LARGEST = 36  # binary exponent of coordinates; products of three are float32 numbers
_SAMPLE = 1 << 12  # vertices that say where most are
_BLOCK = 1 << 14  # vertices
LEAST = 2.0**-16  # what coordinates count for at least: double precision rounds, too, where a mesh is placed


def contact_radius(points: Float64s) -> Float64s:
    """The distance (k,) from `points` (k, 3) in render space within which positions touch them or coincide."""
    return TOUCHING * ULP * np.maximum(product(np.abs(points), np.ones(3)), LEAST)


@dataclass(eq=False)
class RenderSpace:
    """The placement of a mesh of known bounds."""

    centre: Float64s  # (3,), mesh units
    scale: float  # what a length in mesh units is multiplied by; a power of two, so nothing is rounded by it
    diagonal: float  # no two points of the placed mesh are farther apart; a ray need not be longer

    @classmethod
    def around(cls, low: Float64s, high: Float64s, subset: Float64s) -> RenderSpace:
        """For a mesh with the bounding box from `low` (3,) to `high`, and a `subset` (k, 3) of its vertices."""
        near_low, near_high = near_box(low, high, subset)
        centre = near_low + (near_high - near_low) / 2
        extent = float((near_high / 2 - near_low / 2).max())
        exponent = min(-math.frexp(extent)[1], 1023) if extent > 0 else 0  # 2^1024 is no number
        farthest = float(np.maximum(high - centre, centre - low).max())
        scale = math.ldexp(1.0, min(exponent, _LARGEST - math.frexp(farthest)[1]) if farthest > 0 else exponent)
        least = ((low - centre) * scale).astype(np.float32)
        most = ((high - centre) * scale).astype(np.float32)
        diagonal = 1.001 * float(np.linalg.norm(most.astype(np.float64) - least))
        return cls(centre, scale, max(diagonal, 1e-30))

    def place(self, vertices: Float64s) -> Float32s:
        """Vertices (k, 3) in render space."""
        placed = np.empty(vertices.shape, np.float32)

        def place_some(start: int, stop: int) -> None:
            with np.errstate(over="ignore"):
                placed[start:stop] = to_single((vertices[start:stop] - self.centre) * self.scale)

        run_blocks(len(vertices), _BLOCK, place_some, thread_count(None))
        return placed


def to_single(placed: Float64s) -> Float32s:
    """Points (k, 3) of render space as float32, clipped: points that no face uses may be too far away."""
    return np.clip(placed, -(2.0**38), 2.0**38).astype(np.float32)


def sample(count: int) -> slice:
    """A sample of the rows of `count` vertices."""
    return slice(None, None, -(-count // _SAMPLE) or 1)


def near_box(low: Float64s, high: Float64s, subset: Float64s) -> tuple[Float64s, Float64s]:
    """The bounding box from `low` (3,) to `high`, or of the near vertices of `subset` (k, 3) if a few are far."""
    middle = np.quantile(subset, 0.5, axis=0, method="lower")
    away = np.abs(subset - middle).max(axis=1)
    apart = away[away > 0]
    limit = FAR * float(np.quantile(apart, 0.5, method="lower")) if len(apart) else np.inf
    if float((high / 2 - low / 2).max()) <= limit:
        return low, high
    near = subset[away <= limit]
    return near.min(axis=0), near.max(axis=0)


@dataclass(eq=False)
class Placement(RenderSpace):
    """A mesh in render space: recentred in float64, scaled by a power of two to about unit size, then rounded once."""

    vertices: Float32s  # (n, 3), within [−1, 1], but for a few far away

    @classmethod
    def of(cls, mesh: Mesh) -> Placement:
        """The placement of a mesh."""
        space = RenderSpace.around(*mesh.bounds, mesh.used[sample(len(mesh.used))])
        return cls(**vars(space), vertices=space.place(mesh.vertices))
