"""The points of a mesh that are baked: coincident vertices once, each with a hemisphere and a safe ray origin."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import IntFlag
from functools import cache, partial
from typing import NamedTuple

import numpy as np

from raytrace.bvh.bvh16 import BVH16
from raytrace.embree.scene import TriangleScene
from raytrace.errors import MeshError
from raytrace.kernel.jit import bind, kernel
from raytrace.mesh.mesh import Mesh, corner_mask
from raytrace.mesh.morton import morton_order
from raytrace.mesh.normals import face_normals, nonzero, normalize
from raytrace.mesh.opacity import PackedOpacity
from raytrace.mesh.placement import Placement
from raytrace.mesh.up import UP, up_axis
from raytrace.ray_origins.origins import WeldedPoints, weld_points
from raytrace.ray_origins.surface import Surface
from raytrace.system.checks import check_memory
from raytrace.system.threads import run_blocks, thread_count
from raytrace.types import Bools, Float32s, Float64s, Int64s, UInt8s

from ..memory import corner_bytes
from ..options import Normals, Weighting
from .corners import CornerSamples, find_corner_samples
from .points import Points

SAME = 1.0 - 1e-9
_BLOCK = 1 << 12  # points
_DISPLACED = 0.3  # error of w, root mean square over rough surfaces, of an origin one shortest edge away


class Flag(IntFlag):
    """Why a vertex is not ordinary; unreferenced and degenerate vertices get w = 1."""

    UNREFERENCED = 1  #: no face uses it
    DEGENERATE = 2  #: every face that uses it has zero area, or its own normal was asked for and is missing
    OPPOSED = 4  #: no direction sees the front of all its faces; w is the mean over corner samples
    HIDDEN = 8  #: it is inside a solid, as most of what it sees is backs of faces
    FOLDED = 16  #: its normal lies behind one of its faces; w is the mean over corner samples
    MISSED = 32  #: nothing of the fine mesh is within the cage; w is that of the closest point
    CONTACT = 64  #: w depends on rounding, or on a choice of side, beside a face of which it is no corner


@dataclass(eq=False)
class Receivers:
    """The points to bake, and the vertices they belong to.

    Attributes:
        points: one for every group of coincident vertices, numbered along a curve that keeps neighbours together; those
            with corner samples are the last.
        corners: corner samples of points that are folded or opposed.
        of_vertex: int64 (n,), the row of each vertex in `points`, −1 for none.
        flags: uint8 (n,), `Flag`s of each vertex.
        faces: int64 (m', 3), the faces that are not degenerate. tree: over these.
        tree_seconds: how long it took to build.
        displaced: float32 (k,), standard error of w that stems from origins away from their points, in sharp folds.
        embree: the faces in Embree, built when it is first called, which must not be on two threads at once.
        opacity: of the faces, None if all are opaque.
    """

    points: Points
    corners: CornerSamples
    of_vertex: Int64s
    flags: UInt8s
    faces: Int64s
    tree: BVH16
    tree_seconds: float
    displaced: Float32s
    embree: Callable[[], TriangleScene]
    opacity: PackedOpacity | None

    @property
    def first_vertex(self) -> Int64s:
        """The first vertex (k,) of each point."""
        vertices = np.flatnonzero(self.of_vertex >= 0)[::-1]
        first_vertex = np.empty(len(self.points), np.int64)
        first_vertex[self.of_vertex[vertices]] = vertices
        return first_vertex

    def only(self, requested: Bools) -> Receivers:
        """The receivers of the `requested` vertices, bool (n,), alone."""
        of_vertex = np.where(requested, self.of_vertex, -1)
        needed = np.zeros(len(self.points) + 1, np.bool_)
        needed[of_vertex] = True
        needed[-1] = False  # what −1 has set
        rows = np.flatnonzero(needed)
        new_rows = np.where(needed, np.cumsum(needed) - 1, -1)
        subset = self.points[rows], self.corners.only(rows), self.displaced[rows]
        return replace(self, points=subset[0], corners=subset[1], displaced=subset[2], of_vertex=new_rows[of_vertex])


class OffsetPoints(NamedTuple):
    """Points of n vertices, with ray origins, before they are numbered.

    Attributes:
        welded: the points, their axes those of hemispheres. origins: float64 (k, 3), of rays.
        usable: bool (k,), points that have a hemisphere.
        split: bool (k,), those whose faces share no hemisphere: folded or opposed.
        flags: uint8 (n,). tree: over the faces of `surface`. tree_seconds: how long it took to build.
    """

    welded: WeldedPoints
    surface: Surface
    origins: Float64s
    usable: Bools
    split: Bools
    flags: UInt8s
    tree: BVH16
    tree_seconds: float


def offset_points(placed: Float32s, faces: Int64s, weighting: Weighting, own_axes: Float64s | None) -> OffsetPoints:
    """Weld vertices `placed` (n, 3) in render space; the points' axes, and origins offset from the surface.

    Args: weighting: of the faces' normals. own_axes: (n, 3), axes of any length in the place of these.
    """
    vertices = placed.astype(np.float64)
    if own_axes is not None:
        axes = normalize(own_axes)
        welded = weld_points(vertices, faces, weighting, axes, SAME)
        folded = np.zeros(len(welded.first_vertex), np.bool_)
        welded = welded._replace(axes=axes[welded.first_vertex])
    else:
        welded = weld_points(vertices, faces, weighting)
        folded = (welded.clearance <= 0) | nonzero(welded.axes != welded.normals)
    # Where rays start: beside the faces, and on which side of those that the point touches.
    surface = welded.surface(vertices)
    start = time.perf_counter()
    tree = BVH16.of(placed, welded.faces)
    tree_seconds = time.perf_counter() - start
    origins, ambiguous = welded.ray_origins(tree, surface)

    # What is special about points, and about vertices of no face.
    usable = nonzero(welded.directions) & nonzero(welded.axes)
    split = np.where(welded.clearance <= 0, np.uint8(Flag.OPPOSED), np.uint8(Flag.FOLDED) * folded)
    special = np.where(usable, split | np.uint8(Flag.CONTACT) * ambiguous, np.uint8(Flag.DEGENERATE))
    flags = special[welded.group]
    flags[~corner_mask(faces, len(vertices))] = Flag.UNREFERENCED
    return OffsetPoints(welded, surface, origins, usable, usable & folded, flags, tree, tree_seconds)


def find_receivers(mesh: Mesh, placement: Placement, normals: Normals = "angle") -> Receivers:
    """The points of the vertices of `mesh`.

    Raises:
        InputError: an image of its alpha cannot be read.
        MeshError: `normals` is "file" for a mesh that has none.
        MemoryLimitError: the corners of folded vertices would not fit into memory.
    """
    own_axes = None
    weighting: Weighting = "angle"
    if normals == "file":
        own_axes = mesh.normals
        if own_axes is None:
            raise MeshError(mesh.source, "normals", "vertex normals in the mesh", "none")
    elif normals == "up":
        own_axes = np.tile(np.asarray(UP[up_axis(mesh)], np.float64), (len(mesh.vertices), 1))
    else:
        weighting = normals
    offset = offset_points(placement.vertices, mesh.faces, weighting, own_axes)
    points, usable, index = _compacted(offset)
    # How far rays start from the surface.
    welded, surface, tree = offset.welded, offset.surface, offset.tree
    displaced = np.minimum(_DISPLACED * welded.displacement(surface, offset.origins), 0.5).astype(np.float32)
    displaced[offset.split] = 0.0
    displaced = displaced[usable]
    # Samples of corners where faces share no hemisphere, once what points were found by is let go.
    of_vertex, flags, tree_seconds = index[welded.group], offset.flags, offset.tree_seconds
    faces, face_points = welded.faces, welded.face_points
    split = np.flatnonzero(offset.split[face_points]) if offset.split.any() else np.zeros(0, np.int64)
    del offset, welded, usable
    corners = CornerSamples.none()
    if len(split):
        needed = corner_bytes(len(split))
        check_memory(mesh.source, needed, f"for the {len(split):,} corners of folded vertices")
        corners = find_corner_samples(tree, surface, split, index[face_points.ravel()[split]], len(points))
    # What rays meet.
    embree = cache(partial(TriangleScene, placement.vertices, faces))
    opacity = mesh.opacity.packed() if mesh.opacity else None
    if opacity:
        opacity = opacity.only(face_normals(placement.vertices.astype(np.float64), mesh.faces)[1] > 0)
    return Receivers(points, corners, of_vertex, flags, faces, tree, tree_seconds, displaced, embree, opacity)


def _compacted(offset: OffsetPoints) -> tuple[Points, Int64s, Int64s]:
    """The points that have a hemisphere, in Morton order, split ones last; which these are, and where each point is."""
    usable = np.flatnonzero(offset.usable)
    few = len(usable) < len(offset.usable)
    order = morton_order(offset.origins.take(usable, axis=0) if few else offset.origins)
    usable = usable[order] if few else order
    if offset.split.any():
        usable = usable[np.argsort(offset.split[usable], kind="stable")]
    index = np.full(len(offset.usable), -1)
    origins = np.empty((len(usable), 3), np.float32)
    axes = np.empty((len(usable), 3), np.float32)
    take = bind(_compact, usable, offset.origins, offset.welded.axes, origins, axes, index)
    run_blocks(len(usable), _BLOCK, take, thread_count(None))
    return Points(origins, axes, np.arange(len(usable), dtype=np.uint32)), usable, index


@kernel
def _compact(usable, origins, axes, own_origins, own_axes, index, start, stop):
    """Write the origins and axes of usable points one after another, and where each point's are into `index`."""
    for k in range(start, stop):
        index[usable[k]] = k
        for axis in range(3):
            own_origins[k, axis] = origins[usable[k], axis]
            own_axes[k, axis] = axes[usable[k], axis]
