"""Corner samples: w of vertices whose faces share no hemisphere, because the surface folds there.

Where the average normal of a vertex lies behind one of its own faces, no hemisphere about one axis stands for what the
faces see. There w(p) is the mean of w over the directions in which the surface leaves the vertex: each incident face
counts by its angle there, and is sampled close to the vertex with its own normal.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from obscurance.raytrace.bvh.bvh16 import BVH16
from obscurance.raytrace.mesh.placement import NEAR
from obscurance.raytrace.ray_origins.origins import ray_offset, ray_origins
from obscurance.raytrace.ray_origins.surface import Surface
from obscurance.raytrace.types import Float64s, Int64s

from .points import Points

SPREAD = 3  # samples to a corner, in the middles of equal parts of its angle
_INSIDE = 1.0 / 32.0  # of the way to the opposite edge; from 1/16 to 1/64 w hardly changes
_FARTHEST = 0.25
_OFFSETS = 32.0  # ray offsets that a sample is away from the vertex if that is no farther
_CANCELLED = 0.2  # length of a mean direction, relative to the mean length, that means nothing


@dataclass(eq=False)
class CornerSamples:
    """Corner samples of folded vertices; such a vertex's w is their mean.

    Attributes:
        point_rows: int64 (j,), ascending: the vertices' points, the last of all.
        starts: int64 (j + 1,): the samples of point point_rows[i] are starts[i] to starts[i + 1] of k.
        points: the k samples, near the vertices, in their faces. weights: float64 (k,), of sum 1 for each of the rows.
    """

    point_rows: Int64s
    starts: Int64s
    points: Points
    weights: Float64s

    @classmethod
    def none(cls) -> CornerSamples:
        """No samples, of a mesh without folded vertices."""
        nothing = np.zeros((0, 3), np.float32)
        return cls(np.zeros(0, np.int64), np.zeros(1, np.int64), Points.lifted(nothing, nothing, nothing),
                   np.zeros(0))  # fmt: skip

    def __len__(self) -> int:
        return len(self.point_rows)

    def only(self, rows: Int64s) -> CornerSamples:
        """The samples of some rows, ascending, which become rows 0, 1, …"""
        new_rows = np.searchsorted(rows, self.point_rows)
        is_kept = np.append(rows, -1)[new_rows] == self.point_rows
        if not is_kept.any():
            return CornerSamples.none()
        counts = np.diff(self.starts)
        sample_mask = np.repeat(is_kept, counts)
        starts = np.concatenate([[0], np.cumsum(counts[is_kept])])
        return CornerSamples(new_rows[is_kept], starts, self.points[sample_mask], self.weights[sample_mask])

    def mean(self, values: Float64s) -> Float64s:
        """Means (j, c) of `values` (k, c); equal values keep every bit."""
        at_first = values[self.starts[:-1]]
        apart = (values - np.repeat(at_first, np.diff(self.starts), axis=0)) * self.weights[:, None]
        return at_first + np.add.reduceat(apart, self.starts[:-1], axis=0)

    def variance(self, values: Float64s) -> Float64s:
        """Variance (j,) of means of independent values of variances `values` (k,)."""
        return np.add.reduceat(self.weights**2 * values, self.starts[:-1])

    def mean_direction(self, vectors: Float64s) -> Float64s:
        """Means (j, 3) of `vectors` (k, 3); zero where they cancel out, as on the two sides of a sheet."""
        mean = self.mean(vectors)
        lengths = self.mean(np.linalg.norm(vectors, axis=1)[:, None])
        return np.where(np.linalg.norm(mean, axis=1)[:, None] > _CANCELLED * lengths, mean, 0.0)


def find_corner_samples(
    tree: BVH16, surface: Surface, corners: Int64s, points: Int64s, first_number: int, axes: Float64s | None
) -> CornerSamples:
    """Sample the face corners of folded vertices.

    Args:
        tree: over the faces of `surface`.
        corners: (c,), ascending: all face corners at the points, at least one; 3 f + k is face f's k-th.
        points: (c,), the point of each corner. first_number: of the first sample.
        axes: (c, 3), of the hemispheres at each corner; None: the faces' normals.
    """
    order = np.argsort(points, kind="stable")
    face, corner = np.divmod(corners[order], 3)
    point_rows, starts = np.unique(points[order], return_index=True)
    starts = np.append(starts, len(face))
    positions, angle = _spread_over_corners(surface, face, corner)

    number = np.full(surface.faces.shape, len(face), np.int32)
    number[face, corner] = np.arange(len(face))
    extents, flat = surface.extents()
    flattest = flat[(number == len(face)).any(axis=1)].max(initial=0.0)  # of faces not all sampled
    extent = extents[face].astype(np.float64)
    has_whole = (number[face] == len(face)).any(axis=1)  # beside the sampled corner, a corner that is not sampled
    least = np.where(has_whole, np.minimum(flattest, np.maximum(NEAR, extent)), 0.0)
    magnitude = np.maximum(np.maximum(extent, flat[face]), least)
    of = np.repeat(np.arange(len(face)), SPREAD)
    normals = surface.normals(face)[of]
    origins, _ = ray_origins(tree, surface, positions, normals, np.ones(len(of)), number, of, magnitude[of])
    weights = angle / np.repeat(np.add.reduceat(angle, starts[:-1]), np.diff(starts)) / SPREAD
    hemispheres = normals if axes is None else axes[order][of]
    samples = Points.lifted(positions, origins, hemispheres)
    samples = replace(samples, numbers=first_number + samples.numbers)
    return CornerSamples(point_rows, SPREAD * starts, samples, np.repeat(weights, SPREAD))


def _spread_over_corners(surface: Surface, face: Int64s, corner: Int64s) -> tuple[Float64s, Float64s]:
    """Positions (SPREAD c, 3) of samples in c face corners, spread over each corner's angle; the angles (c,)."""
    here, ahead, behind = (
        surface.vertices[surface.faces[face, (corner + step) % 3]].astype(np.float64) for step in range(3)
    )
    # The two edges of each corner, and the angle between them.
    edge_ahead = ahead - here
    edge_behind = behind - here
    a = np.linalg.norm(edge_ahead, axis=1)
    b = np.linalg.norm(edge_behind, axis=1)
    double = np.linalg.norm(np.cross(edge_ahead, edge_behind), axis=1)
    angle = np.arctan2(double, np.einsum("ij,ij->i", edge_ahead, edge_behind))
    # How far into the face: some offsets of a ray, but within its height over the corner.
    extent = np.abs(np.stack([here, ahead, behind])).max(axis=(0, 2))
    height = double / np.linalg.norm(edge_behind - edge_ahead, axis=1)
    offset = ray_offset(surface.normals(face), extent, np.ones(len(face)))
    inside = np.clip(_OFFSETS * offset / height, _INSIDE, _FARTHEST)
    # Points of the opposite edge at equal steps of the angle, and samples on the way there.
    theta = (np.arange(SPREAD) + 0.5) / SPREAD * angle[:, None]
    s = np.sin(angle[:, None] - theta) / a[:, None]
    t = np.sin(theta) / b[:, None]
    along = (s[:, :, None] * edge_ahead[:, None] + t[:, :, None] * edge_behind[:, None]) / (s + t)[:, :, None]
    return (here[:, None] + inside[:, None, None] * along).reshape(-1, 3), angle
