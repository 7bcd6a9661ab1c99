"""The points of texels: one at the centre where that can stand for all of it, several elsewhere."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from raytrace.kernel.jit import bound, kernel
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
from .coverage import Coverage, refill
from .page_rays import DEEP
from .surface_points import Faces, centres_suffice

_PLACED = 1 << 18  # points whose origins are found together
_BLOCK, _SHARE = 1 << 11, 16  # texels, and blocks at once
_RAYS, _NOISE = 256, 0.004  # so many rays a texel, and about how much they err by
_BENT = 0.2  # by how much normals may differ within a texel: one point and several then differ by a third of the noise


@dataclass(frozen=True, eq=False)
class Texels:
    """The texels to bake, along a curve that keeps neighbours together.

    Attributes:
        texels: int64 (k,), row · width + column.
        starts: int64 (k + 1,): the points of texel i, one or several, are starts[i] to starts[i + 1].
        face: int32 (p,), the face under each point.
        points: p, numbered one by one.
        sides: float32 (p, 4), normals of the faces on the hemispheres' side, and alpha.
        shown: int32 (k,), the face on the page at each texel's first point; shown_at: float32 (k, 3), where on it.
    """

    texels: Int64s
    starts: Int64s
    face: Int32s
    points: Points
    sides: Float32s
    shown: Int32s
    shown_at: Float32s

    def __len__(self) -> int:
        return len(self.texels)

    @property
    def counts(self) -> Int64s:
        return np.diff(self.starts)

    @property
    def first_points(self) -> Points:
        """One point of each texel, for what asks where it is; numbered by the rows of the texels."""
        first = self.points[self.starts[:-1]]
        return replace(first, numbers=np.arange(len(self), dtype=np.uint32))

    def only(self, rows: Int64s) -> Texels:
        """Some of the texels, numbered anew."""
        counts = self.counts[rows]
        starts = np.concatenate([[0], np.cumsum(counts)])
        each = np.arange(starts[-1]) + np.repeat(self.starts[rows] - starts[:-1], counts)
        numbers = np.arange(len(each), dtype=np.uint32)
        points = Points(self.points.origins[each], self.points.normals[each], numbers)
        shown = self.shown[rows], self.shown_at[rows]
        return Texels(self.texels[rows], starts, self.face[each], points, self.sides[each], *shown)


def find_texels(coverage: Coverage, page: Coverage, prepared: Prepared, interior: Interior) -> tuple[Texels, int]:
    """The texels to bake, and how many are left out because all of their points are inside of solids.

    Args: coverage: on the faces of `prepared`; page: on the faces on the page, mostly the same.
    """
    placement, receivers, threads = prepared.placement, prepared.receivers, prepared.threads
    faces = Faces.of(placement.vertices.astype(np.float64), receivers)
    first = faces.points_at(coverage.face[:, 0].astype(np.int64), coverage.barycentric[:, 0], threads)[0]
    noise = prepared.options.tolerance or _NOISE * (_RAYS / prepared.options.rays) ** 0.75
    most_bent = _BENT * min(noise / _NOISE, 1.0)  # so that noise is more than what a texel's only point misses
    alone = centres_suffice(coverage, faces, receivers.tree, most_bent, threads)
    texels = _placed(coverage, page, morton_order(first), alone, faces, receivers, threads)
    inside = inside_solids(texels.points, receivers.faces[texels.face, 0], placement, receivers, interior, threads)
    if not inside.any():
        return texels, 0
    good, counts = ~inside, texels.counts
    seen = np.add.reduceat(good, texels.starts[:-1], dtype=np.int64)
    some = (seen > 0) & (seen < counts)
    for count in np.unique(counts[some]).tolist():
        each = texels.starts[:-1][some & (counts == count), None] + np.arange(count)
        for table in (texels.face, texels.points.origins, texels.points.normals, texels.sides):
            values = table[each]
            refill(good[each], values)
            table[each] = values
    rows = np.flatnonzero(seen)
    if not len(rows):  # a room whose walls face outwards, for instance
        return texels, 0
    return texels.only(rows), len(texels) - len(rows)


def _placed(
    coverage: Coverage, page: Coverage, order: Int64s, alone: Bools, faces: Faces, receivers: Receivers, threads: int
) -> Texels:
    """Points with origins from which no ray hits the faces that they lie on.

    Args: order: of the texels. alone: bool (k,), texels whose only point is that at the centre; not yet in order.
    """
    counts = np.where(alone, 1, np.where(coverage.deep, DEEP, coverage.face.shape[1]))
    starts = np.concatenate([[0], np.cumsum(counts[order])])
    count = int(starts[-1])
    face, weights = np.empty(count, np.int32), np.empty((count, 3), np.float32)
    points = coverage.face, coverage.barycentric, coverage.centre_face, coverage.centre
    layered = np.cumsum(coverage.deep) - 1, coverage.deep_face, coverage.deep_barycentric
    work = bound(_lay_out, order, starts, alone, points, layered, (face, weights))
    run_blocks(len(order), _BLOCK, work, threads, most=_SHARE)
    tree, surface = receivers.tree, faces.surface
    face_points = np.repeat(np.arange(len(surface.faces))[:, None], 3, axis=1)  # each face is by itself
    magnitude = surface.magnitudes(face_points, len(surface.faces))
    origins, normals, sides = (np.empty((count, columns), np.float32) for columns in (3, 3, 4))
    for first in range(0, count, _PLACED):
        part = slice(first, first + _PLACED)
        own = face[part].astype(np.int64)
        places, side, axis = faces.points_at(own, weights[part], threads)
        origins[part], _ = ray_origins(tree, surface, places, side, np.ones(len(own)), face_points, own, magnitude[own])
        normals[part], sides[part] = axis, with_alpha(side, receivers.opacity, own, weights[part])
    placed = Points(origins, normals, np.arange(count, dtype=np.uint32))
    shown = np.where(alone, page.centre_face, page.face[:, 0])[order]
    shown_at = np.where(alone[:, None], page.centre, page.barycentric[:, 0])[order]
    return Texels(coverage.texels[order], starts, face, placed, sides, shown, shown_at)


@kernel
def _lay_out(order, starts, alone, points, layered, out, first, last):
    """Write the face and barycentrics of each texel's points in order, from a `Coverage`, up to the texel's count."""
    each, each_at, centre, centre_at = points
    (number, deep, deep_at), (face, weights) = layered, out
    for i in range(first, last):
        row, begin = order[i], starts[i]
        count = starts[i + 1] - begin
        for k in range(count):
            if alone[row]:
                face[begin], place = centre[row], centre_at[row]
            elif count == DEEP:
                face[begin + k], place = deep[number[row], k], deep_at[number[row], k]
            else:
                face[begin + k], place = each[row, k], each_at[row, k]
            for corner in range(3):
                weights[begin + k, corner] = place[corner]
