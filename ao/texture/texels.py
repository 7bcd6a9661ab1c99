"""The points of texels, and the tracer that gathers at a texel: the mean over its points, which share its rays."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from raytrace.kernel.jit import kernel
from raytrace.kernel.vector import dot, load, scale, store
from raytrace.mesh.normals import face_normals
from raytrace.mesh.placement import Placement
from raytrace.ray_origins.origins import ray_origins
from raytrace.ray_origins.surface import Surface
from raytrace.system.threads import run_blocks
from raytrace.types import Bools, Float32s, Float64s, Int32s, Int64s

from ..gather.directions import DirectionTable
from ..gather.estimate import COLUMNS
from ..gather.morton import morton_order
from ..gather.points import Points
from ..gather.receivers import Receivers
from ..interior.closed_parts import closed_parts, inside_boxes
from ..interior.inside import Solids, hidden_points
from ..options import Hidden
from ..trace.tracer import Tracer
from .below_face import leave_out_below
from .coverage import Coverage, refill

_LEAST_COSINE = 0.2  # between an interpolated normal and its face's; the face's stands for others
_ENOUGH = 8  # rays of a point, so that more points are worth their time
_PLACED = 1 << 18  # points whose origins are found together
_GATHERED = 1 << 18  # texels
_BLOCK = 1 << 13


@dataclass(frozen=True, eq=False)
class Texels:
    """The texels to bake, along a curve that keeps neighbours together.

    Attributes:
        texels: int64 (k,), row · width + column. face: int32 (k, slots), the face under each point.
        points: k · slots, those of a texel together, numbered one by one.
        sides: float32 (k · slots, 3), normals of the faces on the hemispheres' side.
        shown: int32 (k,), the face on the page at each texel's first point; shown_at: float32 (k, 3), where on it.
    """

    texels: Int64s
    face: Int32s
    points: Points
    sides: Float32s
    shown: Int32s
    shown_at: Float32s

    def __len__(self) -> int:
        return len(self.texels)

    @property
    def slots(self) -> int:
        """Points of a texel."""
        return self.face.shape[1]

    @property
    def first_points(self) -> Points:
        """One point of each texel, for what asks where it is; numbered by the rows of the texels."""
        first = self.points[:: self.slots]
        return replace(first, numbers=np.arange(len(self), dtype=np.uint32))

    def only(self, rows: Int64s) -> Texels:
        """Some of the texels, numbered anew."""
        each = (self.slots * rows[:, None] + np.arange(self.slots)).ravel()
        numbers = np.arange(len(each), dtype=np.uint32)
        points = Points(self.points.origins[each], self.points.normals[each], numbers)
        return Texels(
            self.texels[rows], self.face[rows], points, self.sides[each], self.shown[rows], self.shown_at[rows]
        )


@dataclass(frozen=True, eq=False)
class Faces:
    """Faces in render space: `vertices` float64 (n, 3), `axes` float64 (n, 3), unit or zero, and their surface."""

    vertices: Float64s
    axes: Float64s
    surface: Surface
    magnitude: Float64s
    own: Int64s

    @classmethod
    def of(cls, vertices: Float64s, receivers: Receivers) -> Faces:
        """The faces of `receivers` over `vertices` (n, 3)."""
        faces = receivers.faces
        axes = np.concatenate([receivers.points.normals, np.zeros((1, 3), np.float32)])[receivers.of_vertex]
        surface = Surface.of(vertices, faces, face_normals(vertices, faces)[0])
        own = np.repeat(np.arange(len(faces))[:, None], 3, axis=1)
        return cls(vertices, axes.astype(np.float64), surface, surface.magnitudes(own, len(faces)), own)


def find_texels(
    coverage: Coverage, page: Coverage, placement: Placement, receivers: Receivers, hidden: Hidden, threads: int
) -> tuple[Texels, int]:
    """The texels to bake, and how many are left out because all of their points are inside of solids.

    Args:
        coverage: on the faces of `receivers`; page: on the faces on the page, mostly the same.
    """
    faces = Faces.of(placement.vertices.astype(np.float64), receivers)
    texels = _placed(coverage, page, faces, receivers, threads)
    inside = inside_solids(texels, placement, receivers, hidden, threads).reshape(-1, texels.slots)
    good = ~inside
    if inside.any():
        arrays = texels.points.origins, texels.points.normals, texels.sides
        origins, normals, sides = (array.reshape(-1, texels.slots, 3) for array in arrays)
        refill(good, texels.face, origins, normals, sides)
    rows = np.flatnonzero(good.any(axis=1))
    if not len(rows):  # a room whose walls face outwards, for instance
        rows = np.arange(len(good))
    rows = rows[morton_order(texels.points.origins[texels.slots * rows])]
    return texels.only(rows), len(texels) - len(rows)


def _placed(coverage: Coverage, page: Coverage, faces: Faces, receivers: Receivers, threads: int) -> Texels:
    """Points with origins from which no ray hits the faces that they lie on."""
    flat, weights = coverage.face.ravel().astype(np.int64), coverage.barycentric.reshape(-1, 3)
    count = len(flat)
    origins, normals, sides = (np.empty((count, 3), np.float32) for _ in range(3))
    for first in range(0, count, _PLACED):
        part = slice(first, first + _PLACED)
        places, side, axis = points_on(flat[part], weights[part], faces, receivers.faces, threads)
        own, clearance = flat[part], np.ones(len(places))
        magnitude = faces.magnitude[own]
        origins[part] = ray_origins(receivers.tree, faces.surface, places, side, clearance, faces.own, own, magnitude)
        normals[part], sides[part] = axis, side
    points = Points(origins, normals, np.arange(count, dtype=np.uint32))
    return Texels(coverage.texels, coverage.face, points, sides, page.face[:, 0], page.barycentric[:, 0])


def points_on(
    own: Int64s, weights: Float32s, faces: Faces, corners: Int64s, threads: int
) -> tuple[Float64s, Float64s, Float64s]:
    """`_place` of points (k,) on the faces `own`: places, sides and hemispheres, float64 (k, 3)."""
    found = np.empty((3, len(own), 3))

    def work(a: int, b: int) -> None:
        places, sides, hemispheres = found[:, a:b]
        normals = faces.surface.normals
        _place(own[a:b], weights[a:b], corners, faces.vertices, faces.axes, normals, places, sides, hemispheres)

    run_blocks(len(own), _BLOCK, work, threads)
    return found[0], found[1], found[2]


@kernel
def _place(own, weights, faces, vertices, axes, normals, places, sides, hemispheres):
    """The place of each point, its face's normal on the side of the hemisphere, and the axis of that."""
    for i in range(len(own)):
        f = own[i]
        x = y = z = nx = ny = nz = 0.0
        for corner in range(3):
            weight = np.float64(weights[i, corner])
            p, n = load(vertices, faces[f, corner]), load(axes, faces[f, corner])
            x, y, z = x + weight * p[0], y + weight * p[1], z + weight * p[2]
            nx, ny, nz = nx + weight * n[0], ny + weight * n[1], nz + weight * n[2]
        places[i, 0], places[i, 1], places[i, 2] = x, y, z
        side, axis = load(normals, f), (nx, ny, nz)
        size = np.sqrt(dot(axis, axis))
        cosine = dot(axis, side)
        if cosine < 0.0:
            side, cosine = scale(-1.0, side), -cosine
        store(sides, i, side)
        flat = size < 1e-6 or cosine < _LEAST_COSINE * size or cosine > (1.0 - 1e-12) * size
        axis = side if flat else scale(1.0 / size, axis)
        store(hemispheres, i, axis)


def inside_solids(texels: Texels, placement: Placement, receivers: Receivers, hidden: Hidden, threads: int) -> Bools:
    """The points that are inside a solid, as the option `hidden` defines it."""
    points, reach = texels.points, placement.diagonal
    inside = np.zeros(len(points), np.bool_)
    if hidden == "ignore":
        return inside
    if hidden in ("fill", "mark"):
        any_back = Solids(np.zeros(len(receivers.faces), np.int64), np.full(len(points), -1))
        return hidden_points(receivers.embree(), points, any_back, reach, len(points), threads)
    part, closed = closed_parts(placement.vertices, receivers.faces)
    if not closed.any():
        return inside
    own = part[receivers.faces[texels.face.ravel(), 0]]
    rows = inside_boxes(points.origins, own, placement.vertices, part, closed)
    if len(rows):
        solids = Solids(np.where(closed[part], part, -1)[receivers.faces[:, 0]], own[rows])
        inside[rows] = hidden_points(receivers.embree(), points[rows], solids, reach, len(points), threads)
    return inside


@dataclass(eq=False)
class TexelTracer(Tracer):
    """A `Tracer` whose points are texels, by their numbers: rows are means over each texel's points.

    Attributes:
        texels: all of them.
    """

    texels: Texels | None = None

    def gather(self, points: Points, samples: int, key: np.uint32) -> Float64s:
        """Rows (k, COLUMNS) of texels, by `samples` rays each or a few more."""
        assert self.texels is not None
        slots = 1 << int(np.clip(samples // _ENOUGH, 1, self.texels.slots)).bit_length() - 1
        rays = -(-samples // slots)
        out = np.empty((len(points), COLUMNS))
        table = self.scene.table(rays, self.total_points, key, slots)
        for first in range(0, len(points), _GATHERED):
            rows = points.numbers[first : first + _GATHERED].astype(np.int64)
            each, numbers = ((count * rows[:, None] + np.arange(slots)).ravel() for count in (self.texels.slots, slots))
            some = replace(self.texels.points[each], numbers=numbers.astype(np.uint32))
            found = self._gather(some, rays, key, slots)
            self._leave_out_below(some, self.texels.sides[each], table, found)
            out[first : first + _GATHERED] = found.reshape(-1, slots, COLUMNS).sum(axis=1) / slots
        return out

    def _leave_out_below(self, points: Points, sides: Float32s, table: DirectionTable, found: Float64s) -> None:
        def work(first: int, last: int) -> None:
            leave_out_below(points[first:last].arrays, sides[first:last], table, found[first:last])

        run_blocks(len(points), _BLOCK, work, self.threads)
