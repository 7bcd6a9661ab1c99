"""The points of a mesh that are baked: coincident vertices once, each with a hemisphere and a safe ray origin."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import IntFlag
from functools import cache, partial
from typing import NamedTuple, Self

import numpy as np

from obscurance.raytrace.bvh.bvh16 import BVH16, Hierarchy
from obscurance.raytrace.embree import TriangleScene
from obscurance.raytrace.kernel.arrays import counting_sort
from obscurance.raytrace.kernel.jit import kernel
from obscurance.raytrace.mesh.mesh import UP, Mesh, corner_mask, up_axis
from obscurance.raytrace.mesh.morton import morton_order
from obscurance.raytrace.mesh.normals import face_areas, nonzero, normalize, own_vertex_normals, smooth_normals
from obscurance.raytrace.mesh.opacity import PackedOpacity
from obscurance.raytrace.mesh.placement import Placement
from obscurance.raytrace.mesh.weld import CREASE
from obscurance.raytrace.ray_origins.direction import least_cosines
from obscurance.raytrace.ray_origins.origins import WeldedPoints, weld_points
from obscurance.raytrace.sampling import hash32
from obscurance.raytrace.system.checks import check_memory
from obscurance.raytrace.system.parallel import each
from obscurance.raytrace.types import (
    Bools,
    Float32Rows,
    Float32s,
    Float64Rows,
    Float64s,
    Int32Rows,
    Int32s,
    Int64s,
    UInt8s,
    UInt32s,
)

from ..memory import corner_bytes
from ..options import Normals, Weighting
from .corners import CornerSamples, find_corner_samples
from .points import Points

SAME = 1.0 - 1e-9
_DISPLACED = 0.3  # error of w, root mean square over rough surfaces, of an origin one shortest edge away


class Flag(IntFlag):
    """Why a vertex is not ordinary; unreferenced and degenerate vertices get w = 1."""

    UNREFERENCED = 1  #: no face uses it
    DEGENERATE = 2  #: every face that uses it has zero area
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
        of_vertex: int32 (n,), the row of each vertex in `points`, −1 for none.
        flags: uint8 (n,), `Flag`s of each vertex.
        faces: int32 (m', 3), the faces that are not degenerate. backwards: bool (m',), those whose front is not that of
            their winding, see `wound_away`. hierarchy: over these.
        tree_seconds: how long it took to build.
        displaced: float32 (k,), standard error of w that stems from origins away from their points, in sharp folds.
        embree: the faces in Embree, built when it is first called, which must not be on two threads at once.
        opacity: of the faces, None if all are opaque.
        surface_normals: float32 (k, 3), of the smooth surface at the points; zero where none is meant, by axes that are
            up: there each face is its own surface.
    """

    points: Points
    corners: CornerSamples
    of_vertex: Int32s
    flags: UInt8s
    faces: Int32s
    backwards: Bools
    hierarchy: Hierarchy
    tree_seconds: float
    displaced: Float32s
    embree: Callable[[], TriangleScene]
    opacity: PackedOpacity | None
    surface_normals: Float32s

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
        new_rows = np.where(needed, np.cumsum(needed) - 1, -1).astype(np.int32)
        return replace(
            self,
            points=self.points[rows],
            corners=self.corners.only(rows),
            displaced=self.displaced[rows],
            surface_normals=self.surface_normals[rows],
            of_vertex=new_rows[of_vertex],
        )


class OffsetPoints(NamedTuple):
    """Points of n vertices, with ray origins, before they are numbered.

    Attributes:
        welded: the points. axes: float64 (k, 3), of hemispheres. origins: float64 (k, 3), of rays.
        usable: bool (k,), points that have a hemisphere.
        split: bool (k,), those whose faces share no hemisphere: folded or opposed.
        displaced: float32 (k,), see `Receivers`.
        flags: uint8 (n,). tree: over the faces. tree_seconds: how long it took to build.
    """

    welded: WeldedPoints
    axes: Float64s
    origins: Float64s
    usable: Bools
    split: Bools
    displaced: Float32s
    flags: UInt8s
    tree: BVH16
    tree_seconds: float


def offset_points(
    placed: Float32s, faces: Int32s, weighting: Weighting, own_axes: Float64s | None, apart: bool = True
) -> OffsetPoints:
    """Weld vertices `placed` (n, 3) in render space; the points' axes, and origins offset from the surface.

    Args: weighting: of the faces' normals. own_axes: (n, 3), axes of any length, zero where faces' normals give them.
        apart: whether vertices at a place are different points by their `own_axes`; else by the faces around them.
    """
    if own_axes is not None:
        axes = normalize(own_axes)
        is_own = nonzero(axes)
        if not is_own.all():
            axes = np.where(is_own[:, None], axes, smooth_normals(placed, faces, weighting))
        welded = weld_points(placed, faces, weighting, axes, SAME if apart else CREASE, by_means=not apart)
        is_own = is_own[welded.first_vertex]
        axes = np.where(is_own[:, None], axes[welded.first_vertex], welded.axes)
        behind_some = welded.clearance <= 0
        of_one_side = welded.clearance > -1  # of a sheet's sides, an axis has chosen one
        folded = np.where(is_own, behind_some & of_one_side, behind_some | welded.moved)
    else:
        welded = weld_points(placed, faces, weighting)
        is_own = np.zeros(len(welded.moved), np.bool_)
        axes = welded.axes
        folded = (welded.clearance <= 0) | welded.moved
    # Where rays start: beside the faces, and on which side of those that the point touches.
    start = time.perf_counter()
    tree = BVH16.of(placed, welded.surface.faces)
    tree_seconds = time.perf_counter() - start
    origins, ambiguous = welded.ray_origins(tree)

    # What is special about points, and about vertices of no face.
    usable = nonzero(welded.directions) & nonzero(axes)
    # A hemisphere that is asked for is baked, folded or not.
    split = np.where(welded.clearance <= 0, np.uint8(Flag.OPPOSED), np.uint8(Flag.FOLDED) * (folded & ~is_own))
    special = np.where(usable, split | np.uint8(Flag.CONTACT) * ambiguous, np.uint8(Flag.DEGENERATE))
    flags = special[welded.group]
    flags[~corner_mask(faces, len(placed))] = Flag.UNREFERENCED
    is_split = usable & folded
    displaced = np.minimum(np.float32(_DISPLACED) * welded.displacement(origins), np.float32(0.5))
    displaced[is_split] = 0.0
    return OffsetPoints(welded, axes, origins, usable, is_split, displaced, flags, tree, tree_seconds)


def find_receivers(mesh: Mesh, placement: Placement, normals: Normals = "file") -> Receivers:
    """The points of the vertices of `mesh`.

    Raises:
        InputError: an image of its alpha cannot be read.
        MemoryLimitError: the corners of folded vertices would not fit into memory.
    """
    curve = _Curve.through(placement.vertices, mesh.faces)
    own_axes, weighting = _given_axes(mesh, normals, curve.vertices)
    offset = offset_points(placement.vertices[curve.vertices], curve.faces, weighting, own_axes, normals == "file")
    usable = _usable_rows(offset)
    met = _FacesMet.of(mesh, placement, curve.order, offset.welded.surface.backwards)
    # What is known of points beside their places, and of vertices.
    fronts = np.zeros((0, 3), np.float32)
    surface_normals = None
    if own_axes is not None:
        found = _fronts(offset, None if met.opacity is None else met.opacity.of[met.number] >= 0)[usable]
        fronts = found if found.any() else fronts
    if normals == "up":
        surface_normals = np.zeros((len(usable), 3), np.float32)
    elif normals == "file" and own_axes is not None:
        surface_normals = offset.welded.axes[usable].astype(np.float32)
    displaced = np.broadcast_to(np.float32(0.0), len(usable))
    if offset.displaced.any():
        displaced = offset.displaced[usable]
    flags = offset.flags[curve.place]
    corners = _corner_samples(mesh, offset, usable, own_axes is not None)
    # What points were found by is let go before they are copied.
    places, of_all = (offset.welded.surface.vertices, offset.welded.first_vertex), (offset.origins, offset.axes)
    group, place, tree, tree_seconds = offset.welded.group, curve.place, offset.tree, offset.tree_seconds
    del curve, own_axes, offset
    points = replace(_compacted(usable, places, of_all), fronts=fronts)
    count = len(of_all[0])
    del places, of_all
    index = _numbers(usable, count)
    del usable
    of_vertex = index[group][place]
    del group, place, index
    tree = tree._replace(leaf_faces=np.append(met.number, -1).astype(np.int32)[tree.leaf_faces])
    hierarchy = Hierarchy(tree, placement.vertices, met.faces)
    return Receivers(
        points, corners, of_vertex, flags, met.faces, met.backwards, hierarchy, tree_seconds, displaced,
        cache(partial(TriangleScene, placement.vertices, met.faces)), met.opacity,
        points.normals if surface_normals is None else surface_normals,
    )  # fmt: skip


def _given_axes(mesh: Mesh, normals: Normals, order: Int32s) -> tuple[Float64s | None, Weighting]:
    """The axes (n, 3) that are given for vertices in some `order` (n,), None if the faces' normals are to give them,
    and how these are weighted."""
    if normals == "file":
        own = own_vertex_normals(mesh)
        return None if own is None else own[order], "angle"
    if normals == "up":
        return np.tile(np.asarray(UP[up_axis(mesh)], np.float64), (len(order), 1)), "angle"
    return None, normals


class _FacesMet(NamedTuple):
    """The m' faces that rays meet, those of a mesh that are not degenerate, in its order."""

    faces: Int32s  # (m', 3)
    backwards: Bools  # (m',)
    opacity: PackedOpacity | None
    number: Int64s | Int32s  # (m',), which of them each face of the points is

    @classmethod
    def of(cls, mesh: Mesh, placement: Placement, order: Int32s, backwards: Bools) -> Self:
        """Args: order: (m,), of the faces along the curve. backwards: (m',), of those of the points."""
        faces, number = mesh.faces, order
        opacity = mesh.opacity.packed() if mesh.opacity else None
        if len(backwards) < len(faces):
            with_area = face_areas(placement.vertices, faces) > 0
            faces = faces[with_area]
            number = (np.cumsum(with_area) - 1)[order[with_area[order]]]
            opacity = opacity and opacity.only(with_area)
        is_backwards = np.zeros(len(faces), np.bool_)
        is_backwards[number[backwards]] = True
        return cls(faces, is_backwards, opacity, number)


def _corner_samples(mesh: Mesh, offset: OffsetPoints, usable: Int32s, own_axes: bool) -> CornerSamples:
    """Samples of corners where faces share no hemisphere. Args: usable: `_usable_rows`. own_axes: whether axes
    are given. Raises: MemoryLimitError."""
    if not offset.split.any():
        return CornerSamples.none()
    face_points = offset.welded.face_points
    corners = np.flatnonzero(offset.split[face_points])
    points = face_points.ravel()[corners]
    check_memory(mesh.source, corner_bytes(len(corners)), f"for the {len(corners):,} corners of folded vertices")
    axes = offset.axes[points] if own_axes else None
    rows = _numbers(usable, len(offset.usable))[points].astype(np.int64)
    return find_corner_samples(offset.tree, offset.welded.surface, corners, rows, len(usable), axes)


def _fronts(offset: OffsetPoints, has_alpha: Bools | None) -> Float32s:
    """Normals (k, 3) of the surface at points on its border whose axes are given: rays below it end on the faces that
    hold the point, which they would pass beside. Zero elsewhere, across hard edges, and where a face has alpha.

    Args: has_alpha: bool (m,), the points' faces that are not opaque; None: none.
    """
    welded = offset.welded
    fronts = welded.axes.astype(np.float32)
    unmatched = np.zeros(len(fronts), np.uint32)
    _match_neighbours(welded.face_points, unmatched)
    is_smooth = least_cosines(welded.axes, welded.face_points, welded.surface) >= CREASE
    fronts[(unmatched == 0) | ~is_smooth] = 0.0
    if has_alpha is not None:
        fronts[welded.face_points[has_alpha]] = 0.0
    return fronts


@kernel
def _match_neighbours(face_points: Int32Rows, unmatched: UInt32s) -> None:
    """Write a sum without carry of hashes to each point: 0 where faces are all around, each of whose neighbours is then
    of two of them."""
    for f in range(len(face_points)):
        for corner in range(3):
            ahead = hash32(np.uint32(face_points[f, (corner + 1) % 3]))
            behind = hash32(np.uint32(face_points[f, (corner + 2) % 3]))
            unmatched[face_points[f, corner]] ^= ahead ^ behind


class _Curve(NamedTuple):
    """A mesh of n vertices and m faces along a curve, so that what meets in space lies together in memory."""

    vertices: Int32s  # (n,), in Morton order, those that no face uses at the end
    place: Int32s  # (n,), of each vertex among these
    order: Int32s  # (m,), the faces, by the place of their first corners
    faces: Int32s  # (m, 3), in this order, of places

    @classmethod
    def through(cls, placed: Float32s, faces: Int32s) -> Self:
        """Args: placed: (n, 3), in render space."""
        is_used = corner_mask(faces, len(placed))
        used = np.flatnonzero(is_used)
        along_curve = used[morton_order(placed.take(used, axis=0))]
        vertices = np.append(along_curve, np.flatnonzero(~is_used)).astype(np.int32)
        place = np.empty(len(placed), np.int32)
        place[vertices] = np.arange(len(placed), dtype=np.int32)
        order = counting_sort(place[faces[:, 0]], len(placed))[0].astype(np.int32)
        along = np.empty(faces.shape, np.int32)
        _renumber(faces, order, place, along)
        return cls(vertices, place, order, along)


@each("along")
def _renumber(k: int, faces: Int32Rows, order: Int32s, place: Int32s, along: Int32Rows) -> None:
    """Write the faces in an order, their corners being places."""
    for corner in range(3):
        along[k, corner] = place[faces[order[k], corner]]


def _usable_rows(offset: OffsetPoints) -> Int32s:
    """The rows (k',) of points that have a hemisphere, split ones last."""
    usable = np.arange(len(offset.usable), dtype=np.int32)
    if not offset.usable.all():
        usable = usable[offset.usable]
    return usable[np.argsort(offset.split[usable], kind="stable")] if offset.split.any() else usable


def _numbers(usable: Int32s, count: int) -> Int32s:
    """Where each of so many points (k,) is among the `usable`, −1 for none."""
    index = np.full(count, -1, np.int32)
    index[usable] = np.arange(len(usable), dtype=np.int32)
    return index


def _compacted(usable: Int32s, places: tuple[Float32s | Float64s, Int64s], of_all: tuple[Float64s, Float64s]) -> Points:
    """The usable points one after another. Arguments as of `_compact`."""
    origins = np.empty((len(usable), 3), np.float32)
    axes = np.empty((len(usable), 3), np.float32)
    lifts = np.empty((len(usable), 3), np.float32)
    _compact(usable, places, of_all, (origins, axes, lifts))
    return Points(origins, axes, np.arange(len(usable), dtype=np.uint32), lifts)


@each("usable")
def _compact(
    k: int,
    usable: Int32s,
    places: tuple[Float32Rows | Float64Rows, Int64s],
    of_all: tuple[Float64Rows, Float64Rows],
    out: tuple[Float32Rows, Float32Rows, Float32Rows],
) -> None:
    """Write the origins, axes and lifts of usable points one after another.

    Args: places: vertices (n, 3), and the first vertex (k,) of each point. of_all: origins and axes (k, 3).
    """
    (vertices, first_vertex), (all_origins, all_axes), (origins, axes, lifts) = places, of_all, out
    point = usable[k]
    for axis in range(3):
        origins[k, axis] = all_origins[point, axis]
        axes[k, axis] = all_axes[point, axis]
        lifts[k, axis] = origins[k, axis] - np.float64(vertices[first_vertex[point], axis])
