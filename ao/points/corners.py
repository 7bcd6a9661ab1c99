"""Vertices whose faces share no hemisphere, because the surface folds there: w as the mean over their corners.

Where the average normal of a vertex lies behind one of its own faces, no hemisphere about one axis stands for what the
faces see. There w(p) is the mean of w over the directions in which the surface leaves the vertex: each incident face
counts by its angle there, and is looked at close to the vertex with its own normal.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from raytrace.bvh.bvh16 import BVH16
from raytrace.mesh.placement import NEAR
from raytrace.ray_origins.offset import ray_offset
from raytrace.ray_origins.origins import ray_origins
from raytrace.ray_origins.surface import Surface
from raytrace.types import Bools, Float64s, Int64s

from .points import Points

SPREAD = 3  # points to a corner, in the middles of equal parts of its angle
_INSIDE = 1.0 / 32.0  # of the way to the opposite edge; from 1/16 to 1/64 w hardly changes
_FARTHEST = 0.25
_OFFSETS = 32.0  # ray offsets that a point is away from the vertex if that is no farther
_CANCELLED = 0.2  # length of a mean direction, relative to those it is the mean of, that means nothing


@dataclass(frozen=True, eq=False)
class Corners:
    """What some points of a mesh are the means of.

    Attributes:
        rows: int64 (j,), ascending: the points.
        starts: int64 (j + 1,): the i-th has starts[i] to starts[i + 1] of the k places.
        places: k points near it, in its faces. weights: float64 (k,), of sum 1 for each point.
    """

    rows: Int64s
    starts: Int64s
    places: Points
    weights: Float64s

    @classmethod
    def none(cls) -> Corners:
        nothing = np.zeros((0, 3), np.float32)
        return cls(np.zeros(0, np.int64), np.zeros(1, np.int64), Points(nothing, nothing, np.zeros(0, np.uint32)),
                   np.zeros(0))  # fmt: skip

    def __len__(self) -> int:
        return len(self.rows)

    def only(self, kept: Int64s) -> Corners:
        """Those of the points `kept`, ascending rows, which are numbered anew in that order."""
        rows = np.searchsorted(kept, self.rows)
        found = np.append(kept, -1)[rows] == self.rows
        if not found.any():
            return Corners.none()
        counts = np.diff(self.starts)
        which = np.repeat(found, counts)
        starts = np.concatenate([[0], np.cumsum(counts[found])])
        return Corners(rows[found], starts, self.places[which], self.weights[which])

    def mean(self, values: Float64s) -> Float64s:
        """Means (j, c) of `values` (k, c); equal values keep every bit."""
        first = values[self.starts[:-1]]
        apart = (values - np.repeat(first, np.diff(self.starts), axis=0)) * self.weights[:, None]
        return first + np.add.reduceat(apart, self.starts[:-1], axis=0)

    def variance(self, values: Float64s) -> Float64s:
        """Variance (j,) of means of independent values of variances `values` (k,)."""
        return np.add.reduceat(self.weights**2 * values, self.starts[:-1])

    def mean_direction(self, vectors: Float64s) -> Float64s:
        """Means (j, 3) of `vectors` (k, 3); zero where they cancel out, as those of the two sides of a sheet."""
        mean, lengths = self.mean(vectors), self.mean(np.linalg.norm(vectors, axis=1)[:, None])
        return np.where(np.linalg.norm(mean, axis=1)[:, None] > _CANCELLED * lengths, mean, 0.0)


def find_corners(
    tree: BVH16, surface: Surface, corners: Int64s, points: Int64s, first: int, flattest: float | None = None
) -> Corners:
    """The corners of points.

    Args:
        tree: over the faces of `surface`.
        corners: (c,), ascending: all face corners that are one of the points, at least one; 3 f + k is face f's k-th.
        points: (c,), which point each of them is. first: what places are numbered from.
        flattest: `flattest_elsewhere` of the whole mesh, of which `surface` may be a part.
    """
    vertices, faces = surface.vertices, surface.faces
    order = np.argsort(points, kind="stable")
    face, corner = np.divmod(corners[order], 3)
    rows, starts = np.unique(points[order], return_index=True)
    starts = np.append(starts, len(face))
    here, ahead, behind = (vertices[faces[face, (corner + step) % 3]] for step in range(3))
    normal = surface.normals[face]
    one, other = ahead - here, behind - here
    a, b = np.linalg.norm(one, axis=1), np.linalg.norm(other, axis=1)
    double = np.linalg.norm(np.cross(one, other), axis=1)
    angle = np.arctan2(double, np.einsum("ij,ij->i", one, other))

    extent = np.abs(np.stack([here, ahead, behind])).max(axis=(0, 2))
    height = double / np.linalg.norm(other - one, axis=1)
    inside = np.clip(_OFFSETS * ray_offset(normal, extent, np.ones(len(face))) / height, _INSIDE, _FARTHEST)
    theta = (np.arange(SPREAD) + 0.5) / SPREAD * angle[:, None]
    s, t = np.sin(angle[:, None] - theta) / a[:, None], np.sin(theta) / b[:, None]
    along = (s[:, :, None] * one[:, None] + t[:, :, None] * other[:, None]) / (s + t)[:, :, None]
    places = (here[:, None] + inside[:, None, None] * along).reshape(-1, 3)

    turn = np.full(faces.shape, len(face))
    turn[face, corner] = np.arange(len(face))
    number = np.repeat(np.arange(len(face)), SPREAD)
    lift, clearance = normal[number], np.ones(len(number))
    if flattest is None:
        flattest = flattest_elsewhere(surface, turn == len(face))
    beside = (turn[face] == len(face)).any(axis=1)
    extents = surface.extent[face]
    others = np.where(beside, np.minimum(flattest, np.maximum(NEAR, extents)), 0.0)
    magnitude = np.maximum(np.maximum(extents, surface.flat[face]), others)[number]
    origins, _ = ray_origins(tree, surface, places, lift, clearance, turn, number, magnitude)
    total = np.add.reduceat(angle, starts[:-1])
    weights = angle / np.repeat(total, np.diff(starts)) / SPREAD
    numbers = first + np.arange(SPREAD * len(face), dtype=np.uint32)
    return Corners(
        rows,
        SPREAD * starts,
        Points(origins.astype(np.float32), lift.astype(np.float32), numbers),
        np.repeat(weights, SPREAD),
    )


def flattest_elsewhere(surface: Surface, elsewhere: Bools) -> float:
    """How flat faces are that have corners of points without corners (`Surface.flat`), at most.

    Args: elsewhere: bool (m, 3), which are these.
    """
    return float(surface.flat[elsewhere.any(axis=1)].max(initial=0.0))
