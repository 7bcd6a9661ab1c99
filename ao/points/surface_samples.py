"""Samples on faces, in groups, each of which has one value: the mean over its samples.

The samples of a texel are a group; a vertex of a coarse mesh that is projected onto a fine one is a group of one.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from obscurance.raytrace.mesh.opacity import PackedOpacity, alphas
from obscurance.raytrace.ray_origins.origins import ray_origins
from obscurance.raytrace.system.threads import run_blocks
from obscurance.raytrace.types import Bools, Float32s, Int32s, Int64s

from .points import Points
from .receivers import Receivers
from .smooth_surface import LocatedPoints, PointGroups, SmoothSurface

_PLACED = 1 << 14  # samples whose origins are found together, and at most
_MOST_PLACED = 1 << 18
_FEW = 1 << 16  # faces, of which every thread may make tables


@dataclass(eq=False)
class SurfaceSamples:
    """Groups of samples on faces, with ray origins from which no ray meets the face under the sample."""

    starts: Int64s  # (k + 1,): the samples of group i are starts[i] to starts[i + 1]
    face: Int32s  # (p,), under each sample
    points: Points  # p, numbered one by one
    geometric_normals: Float32s  # (p, 5), of the faces, on their fronts, alpha, and `LocatedPoints.cosines`
    all_count: Bools  # (k,), whether all samples of a group are needed, however few the rays

    @classmethod
    def place(
        cls,
        on_faces: PointGroups,
        all_count: Bools,
        surface: SmoothSurface,
        receivers: Receivers,
        threads: int,
    ) -> SurfaceSamples:
        """Samples at points on the faces of `receivers`, which are the faces of `surface`."""
        count = len(on_faces.face)
        origins = np.empty((count, 3), np.float32)
        axes = np.empty((count, 3), np.float32)
        lifts = np.empty((count, 3), np.float32)
        geometric_normals = np.empty((count, 5), np.float32)
        faces = surface.surface
        tree = receivers.hierarchy.tree
        numbers = np.arange(len(faces.faces), dtype=np.int32)
        face_points = np.repeat(numbers[:, None], 3, axis=1)  # each face is by itself
        magnitude = faces.magnitudes(face_points, len(faces.faces))

        def place_some(start: int, stop: int) -> None:
            part = slice(start, stop)
            under = on_faces.face[part].astype(np.int64)
            weights = on_faces.barycentric[part]
            located = surface.points_at(under, weights, threads)
            clear = np.ones(len(under))
            origins[part], _ = ray_origins(
                tree, faces, located.positions, located.normals, clear, face_points, under, magnitude[under]
            )
            axes[part] = located.axes
            lifts[part] = origins[part] - located.positions
            geometric_normals[part] = with_alpha(located, receivers.opacity, under, weights)

        if len(faces.faces) <= _FEW:
            run_blocks(count, max(_PLACED, len(faces.faces)), place_some, threads)
        else:  # one block after another, whose stages all threads share
            run_blocks(count, _MOST_PLACED, place_some, 1)
        points = Points(origins, axes, np.arange(count, dtype=np.uint32), lifts)
        return cls(on_faces.starts, on_faces.face, points, geometric_normals, all_count)

    def __len__(self) -> int:
        return len(self.starts) - 1

    @property
    def counts(self) -> Int64s:
        return np.diff(self.starts)

    @cached_property
    def first_points(self) -> Points:
        """One point of each group, for what asks where it is; numbered by the groups."""
        return replace(self.points[self.starts[:-1]], numbers=np.arange(len(self), dtype=np.uint32))

    def groups_with(self, marked: Bools) -> Int64s:
        """Which groups have a sample that is `marked` (p,), ascending."""
        return np.flatnonzero(np.add.reduceat(marked, self.starts[:-1], dtype=np.int64))

    def put(self, rows: Int64s, others: SurfaceSamples, source: Int64s) -> None:
        """Replace the samples `rows` (q,) by the samples `source` (q,) of others; their numbers stay."""
        self.face[rows] = others.face[source]
        self.geometric_normals[rows] = others.geometric_normals[source]
        mine, given = self.points, others.points
        for to, values in zip(
            (mine.origins, mine.normals, mine.lifts), (given.origins, given.normals, given.lifts), strict=True
        ):
            to[rows] = values[source]

    def rearranged(self, starts: Int64s, source: Int64s, all_count: Bools) -> SurfaceSamples:
        """Groups made of the samples `source` (q,), group i of those from starts[i] on, numbered anew."""
        points = replace(self.points[source], numbers=np.arange(len(source), dtype=np.uint32))
        return SurfaceSamples(starts, self.face[source], points, self.geometric_normals[source], all_count)

    def only(self, groups: Int64s) -> SurfaceSamples:
        """Some `groups` (j,) in their order."""
        counts = self.counts[groups]
        starts = np.concatenate([[0], np.cumsum(counts)])
        source = np.arange(starts[-1]) + np.repeat(self.starts[groups] - starts[:-1], counts)
        return self.rearranged(starts, source, self.all_count[groups])

    def resized(self, groups: Int64s, counts: Int64s) -> SurfaceSamples:
        """Groups of which some, `groups` (j,), have so many samples, `counts` (j,): the last of each over and over."""
        new_counts = self.counts
        new_counts[groups] = counts
        starts = np.concatenate([[0], np.cumsum(new_counts)])
        rank = np.arange(starts[-1]) - np.repeat(starts[:-1], new_counts)
        last = np.repeat(self.counts - 1, new_counts)
        source = np.repeat(self.starts[:-1], new_counts) + np.minimum(rank, last)
        return self.rearranged(starts, source, self.all_count.copy())

    def followed_by(self, others: SurfaceSamples) -> SurfaceSamples:
        """Two sets of groups one after the other."""
        points = self.points.followed_by(others.points)
        return SurfaceSamples(
            np.append(self.starts, self.starts[-1] + others.starts[1:]),
            np.append(self.face, others.face),
            points,
            np.concatenate([self.geometric_normals, others.geometric_normals]),
            np.append(self.all_count, others.all_count),
        )


def with_alpha(located: LocatedPoints, opacity: PackedOpacity | None, face: Int64s, barycentric: Float32s) -> Float32s:
    """Rows (k, 5) for `leave_out_below` of points at `barycentric` (k, 3) on faces (k,): normals, alpha, cosines."""
    packed = np.empty((len(face), 5), np.float32)
    packed[:, :3] = located.normals
    packed[:, 3] = 1.0
    packed[:, 4] = located.cosines
    if opacity is not None:
        alpha = np.ones(len(face))
        alphas(opacity, face, barycentric[:, 1:].astype(np.float64), alpha)
        packed[:, 3] = alpha
    return packed
