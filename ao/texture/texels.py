"""The points of texels: one at the centre where that can stand for all of it, several elsewhere."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from raytrace.kernel.jit import bind, kernel
from raytrace.mesh.morton import morton_order
from raytrace.ray_origins.origins import ray_origins
from raytrace.system.threads import run_blocks
from raytrace.types import Bools, Float32s, Int32s, Int64s

from ..estimate.inside import inside_solids
from ..options import Interior
from ..points.points import Points
from ..points.receivers import Receivers
from ..prepared import Prepared
from ..rays.below_face import with_alpha
from .coverage import Coverage
from .surface_points import Faces, centres_suffice

_PLACED, _MOST_PLACED = 1 << 14, 1 << 18  # points whose origins are found together
_FEW = 1 << 16  # faces, of which every thread may make tables
_BLOCK, _SHARE = 1 << 11, 16  # texels, and blocks at once
_RAYS, _NOISE = 256, 0.004  # so many rays a texel, and about how much they err by
_BENT = 0.2  # by how much normals may differ within a texel: one point and several then differ by a third of the noise


@dataclass(frozen=True, eq=False)
class Texels:
    """The texels to bake, along a curve that keeps neighbours together; each with one point or several."""

    texels: Int64s  # (k,), row · width + column
    starts: Int64s  # (k + 1,): the points of texel i are starts[i] to starts[i + 1]
    face: Int32s  # (p,), under each point
    points: Points  # p, numbered one by one
    sides: Float32s  # (p, 4), normals of the faces on the hemispheres' side, and alpha
    shown: Int32s  # (k,), the face on the page at each texel's first point
    shown_at: Float32s  # (k, 3), where on it, barycentric
    layered: Bools  # (k,), whether all points count alike, however few the rays

    def __len__(self) -> int:
        return len(self.texels)

    @property
    def counts(self) -> Int64s:
        return np.diff(self.starts)

    @cached_property
    def first_points(self) -> Points:
        """One point of each texel, for what asks where it is; numbered by the rows of the texels."""
        return replace(self.points[self.starts[:-1]], numbers=np.arange(len(self), dtype=np.uint32))

    def without(self, hidden: Bools, threads: int) -> Texels:
        """The texels with a point that is not `hidden` (p,), numbered anew; such points take the places of others."""
        rows = np.flatnonzero(np.add.reduceat(~hidden, self.starts[:-1], dtype=np.int64))
        starts = np.concatenate([[0], np.cumsum(self.counts[rows])])
        count = int(starts[-1])
        face, origins, normals, sides = _empty(count)
        of, to = (self.face, self.points.origins, self.points.normals, self.sides), (face, origins, normals, sides)
        run_blocks(len(rows), _BLOCK, bind(_keep, rows, self.starts, hidden, of, starts, to), threads, most=_SHARE)
        points = Points(origins, normals, np.arange(count, dtype=np.uint32))
        on_page = self.shown[rows], self.shown_at[rows], self.layered[rows]
        return Texels(self.texels[rows], starts, face, points, sides, *on_page)


def _empty(count: int) -> tuple[Int32s, Float32s, Float32s, Float32s]:
    """Room for faces, origins, axes and sides of so many points."""
    origins, normals, sides = (np.empty((count, columns), np.float32) for columns in (3, 3, 4))
    return np.empty(count, np.int32), origins, normals, sides


def find_texels(coverage: Coverage, page: Coverage, prepared: Prepared, interior: Interior) -> tuple[Texels, int]:
    """The texels to bake, and how many are left out, whose points are all inside of solids.

    Args: coverage: on the faces of `prepared`. page: on those on the page, mostly the same.
    """
    placement, receivers, threads = prepared.placement, prepared.receivers, prepared.threads
    faces = Faces.of(placement.vertices.astype(np.float64), receivers)
    first = faces.points_at(coverage.face[:, 0].astype(np.int64), coverage.barycentric[:, 0], threads)[0]
    noise = prepared.options.tolerance or _NOISE * (_RAYS / prepared.options.rays) ** 0.75
    most_bent = _BENT * min(noise / _NOISE, 1.0)  # so that noise is more than what a texel's only point misses
    alone = centres_suffice(coverage, faces, receivers.tree, most_bent, threads)
    texels = _placed(coverage, page, morton_order(first), alone, faces, receivers, threads)
    inside = inside_solids(texels.points, receivers.faces[texels.face, 0], placement, receivers, interior, threads)
    if not inside.any() or inside.all():  # all: a room whose walls face outwards, for instance
        return texels, 0
    kept = texels.without(inside, threads)
    return kept, len(texels) - len(kept)


def points_elsewhere(
    texels: Texels, rows: Int64s, coverage: Coverage, prepared: Prepared, interior: Interior
) -> Texels:
    """`texels` with the points of a `coverage` of `rows` (j,) in place of their own, none of others and in solids."""
    placement, receivers, threads = prepared.placement, prepared.receivers, prepared.threads
    faces = Faces.of(placement.vertices.astype(np.float64), receivers)
    row_of = rows[np.argsort(texels.texels[rows])][np.searchsorted(np.sort(texels.texels[rows]), coverage.texels)]
    order = np.argsort(row_of)
    placed = _placed(coverage, coverage, order, np.zeros(len(order), np.bool_), faces, receivers, threads)
    inside = inside_solids(placed.points, receivers.faces[placed.face, 0], placement, receivers, interior, threads)
    counts, layered = np.zeros((2, len(texels)), np.int64)
    if inside.any() and not inside.all():
        kept = np.add.reduceat(~inside, placed.starts[:-1], dtype=np.int64) > 0
        placed, order = placed.without(inside, threads), order[kept]
    counts[row_of[order]], layered[row_of[order]] = placed.counts, placed.layered
    starts, of_points = np.concatenate([[0], np.cumsum(counts)]), (placed.face, placed.points, placed.sides)
    return Texels(texels.texels, starts, *of_points, texels.shown, texels.shown_at, layered > 0)


def _placed(
    coverage: Coverage, page: Coverage, order: Int64s, alone: Bools, faces: Faces, receivers: Receivers, threads: int
) -> Texels:
    """Texels in `order`, `alone` (k,) those of one point; no ray from a point's origin hits the face under it."""
    counts = np.where(alone, 1, np.where(coverage.layers, coverage.layers, coverage.face.shape[1]))
    starts = np.concatenate([[0], np.cumsum(counts[order])])
    count = int(starts[-1])
    face, origins, normals, sides = _empty(count)
    weights, shown_at = (np.empty((rows, 3), np.float32) for rows in (count, len(order)))
    shown = np.empty(len(order), np.int32)
    points = coverage.face, coverage.barycentric, coverage.centre_face, coverage.centre
    on_page = page.face, page.barycentric, page.centre_face, page.centre
    begins = np.cumsum(coverage.layers) - coverage.layers
    layered = coverage.layers, begins, coverage.layer_face, coverage.layer_barycentric
    work = bind(_lay_out, (order, starts, alone), points, layered, on_page, (face, weights, shown, shown_at))
    run_blocks(len(order), _BLOCK, work, threads, most=_SHARE)
    tree, surface = receivers.tree, faces.surface
    face_points = np.repeat(np.arange(len(surface.faces))[:, None], 3, axis=1)  # each face is by itself
    magnitude = surface.magnitudes(face_points, len(surface.faces))

    def place(first: int, last: int) -> None:
        part = slice(first, last)
        own = face[part].astype(np.int64)
        places, side, axis = faces.points_at(own, weights[part], threads)
        origins[part], _ = ray_origins(tree, surface, places, side, np.ones(len(own)), face_points, own, magnitude[own])
        normals[part], sides[part] = axis, with_alpha(side, receivers.opacity, own, weights[part])

    if len(surface.faces) <= _FEW:
        run_blocks(count, max(_PLACED, len(surface.faces)), place, threads)
    else:  # one block after another, whose stages all threads share
        run_blocks(count, _MOST_PLACED, place, 1)
    placed = Points(origins, normals, np.arange(count, dtype=np.uint32))
    return Texels(coverage.texels[order], starts, face, placed, sides, shown, shown_at, coverage.layers[order] > 0)


@kernel
def _lay_out(texels, points, layered, on_page, out, first, last):
    """Write the face and barycentrics of each texel's points in order, from a `Coverage`, up to the texel's count.

    Args: texels: their order, starts, and which are alone. on_page: as `points`, for where each texel is shown.
    """
    (order, starts, alone), (each, each_at, centre, centre_at) = texels, points
    (layers, begins, layer, layer_at), (face, weights, shown, shown_at) = layered, out
    page_each, page_at, page_centre, page_centre_at = on_page
    for i in range(first, last):
        row, begin = order[i], starts[i]
        count = starts[i + 1] - begin
        if alone[row]:
            shown[i], place = page_centre[row], page_centre_at[row]
        else:
            shown[i], place = page_each[row, 0], page_at[row, 0]
        for corner in range(3):
            shown_at[i, corner] = place[corner]
        for k in range(count):
            if alone[row]:
                face[begin + k], place = centre[row], centre_at[row]
            elif layers[row] > 0:
                face[begin + k], place = layer[begins[row] + k], layer_at[begins[row] + k]
            else:
                face[begin + k], place = each[row, k], each_at[row, k]
            for corner in range(3):
                weights[begin + k, corner] = place[corner]


@kernel
def _keep(rows, starts, hidden, of, new_starts, to, first, last):
    """Write the points of the texels `rows` that are not `hidden`, over and over, until each texel has all its points.

    Args: of, to: faces, origins, axes and sides of the points, from `starts` and to `new_starts`.
    """
    (face, origins, normals, sides), (new_face, new_origins, new_normals, new_sides) = of, to
    for i in range(first, last):
        begin, end = starts[rows[i]], starts[rows[i] + 1]
        source = begin
        for k in range(new_starts[i], new_starts[i + 1]):
            while hidden[source]:
                source = source + 1 if source + 1 < end else begin
            new_face[k] = face[source]
            for axis in range(3):
                new_origins[k, axis], new_normals[k, axis] = origins[source, axis], normals[source, axis]
            for column in range(4):
                new_sides[k, column] = sides[source, column]
            source = source + 1 if source + 1 < end else begin
