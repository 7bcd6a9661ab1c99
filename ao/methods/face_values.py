"""w of faces: the mean over samples spread over each, whose hemispheres are about the face's own normal, or `up`."""

from functools import partial
from typing import NamedTuple, Self

import numpy as np

from obscurance.raytrace.errors import MeshError
from obscurance.raytrace.mesh.morton import morton_order
from obscurance.raytrace.mesh.normals import face_areas
from obscurance.raytrace.sampling import derive, hash32_array, in_triangle
from obscurance.raytrace.types import AnyInts, Bools, Float32s, Float64s, Int64s, UInt32s

from ..estimate.estimate import estimate_outside
from ..estimate.inside import OutsideSampler
from ..estimate.one_ring import Neighbours
from ..estimate.sites import CUT_BY_SOLIDS, SEVERAL_PLACES, Sites
from ..execute.kept import Kept
from ..execute.sample_means import SampleMeans
from ..points.points import Points
from ..points.receivers import Flag
from ..points.smooth_surface import PointGroups, SmoothSurface, VertexAxes
from ..points.surface_samples import SurfaceSamples
from ..prepared import Prepared
from ..result import BakedElements, PointValues

_SAMPLES = 1 << 16  # of all faces together, by area, where there are few
_LEAST, _MOST = 1, 6  # subdivisions of a face into four, with a sample in each triangle
_RAYS = 2  # of a sample, as w varies within long faces
_PLACES, _JITTER = 11, 13  # salts of keys


def sample_faces(prepared: Prepared, count: int, checkpoint: Kept | None) -> tuple[BakedElements, PointValues]:
    """Estimate w at the first `count` faces of the mesh of `prepared`: those of which all vertices are wanted.

    By a binary falloff it is 1 − Σ F, F the form factors to all other faces.

    Raises: MeshError: no face has an area.
    """
    receivers, options, threads = prepared.receivers, prepared.options, prepared.threads
    vertices = prepared.placement.vertices.astype(np.float64)
    wanted = _WantedFaces.of(prepared, count, vertices)
    faces, corners = wanted.faces, wanted.corners
    areas = face_areas(vertices, receivers.faces[faces])
    surface = SmoothSurface.of(vertices, receivers)
    if options.normals != "up":
        nothing = np.zeros_like(vertices)
        surface = surface._replace(axes=VertexAxes(nothing, nothing))

    def draw(numbers: Int64s, parts: Int64s, key: np.uint32) -> tuple[SurfaceSamples, Int64s]:
        """Jittered samples on the faces `numbers` (n,), more on larger ones, others in each of some `parts` (n,)."""
        on_faces = _spread(faces[numbers], parts, areas[numbers] / areas.sum(), key)
        all_count = np.zeros(len(numbers), np.bool_)
        return SurfaceSamples.place(on_faces, all_count, surface, receivers, threads), np.arange(len(numbers))

    # Their samples, out of solids, but of those that are inside.
    outside = OutsideSampler(draw, prepared.inside, prepared.near_solids)
    everything, key = np.arange(len(faces)), derive(prepared.key, _PLACES)
    samples, _ = draw(everything, 0 * everything, key)
    samples, cut, hidden = outside.settle(everything, samples, key)

    def elsewhere(numbers: Int64s, parts: Int64s, key: np.uint32) -> SurfaceSamples:
        return outside.elsewhere(numbers, parts, key, cut[numbers], hidden[numbers])[0]

    # Their estimates, by each falloff.
    tracer = prepared.sample_tracer(SampleMeans(samples, elsewhere, _RAYS), "faces", checkpoint)
    middle = surface.points_at(faces, np.full((len(faces), 3), 1 / 3, np.float32), threads)
    points = Points.lifted(middle.positions, middle.positions, middle.axes)
    kinds = np.where(cut, CUT_BY_SOLIDS, SEVERAL_PLACES).astype(np.uint8)
    sites = Sites(points, partial(_neighbours, corners, points.normals, threads), kinds)
    filled = hidden & (options.interior != "mark")
    values = PointValues.of(*estimate_outside(tracer, sites, filled, options), tracer.rays)

    normals = np.ascontiguousarray(samples.geometric_normals[samples.starts[:-1], :3])
    return wanted.elements(hidden, normals, count), values


class _WantedFaces(NamedTuple):
    """The faces that get w, along a curve, of those that coincide the first one alone."""

    faces: Int64s  # (k,), of `Receivers`, which lack those without area
    corners: AnyInts  # (k, 3), their points
    with_area: Int64s  # the mesh's faces that are those of `Receivers`
    wanted: Int64s  # (j,), of `Receivers`, all that get w
    row: Int64s  # (j,), which of `faces` each of these is or coincides with

    @classmethod
    def of(cls, prepared: Prepared, count: int, vertices: Float64s) -> Self:
        """The faces among the first `count` of which all vertices are wanted. Raises: MeshError: none has an area."""
        receivers = prepared.receivers
        with_area = np.flatnonzero(face_areas(vertices, prepared.mesh.faces) > 0)
        is_wanted = with_area < count
        if prepared.requested is not None:
            is_wanted &= prepared.requested[prepared.mesh.faces[with_area]].all(axis=1)
        wanted = np.flatnonzero(is_wanted)
        if not len(wanted):
            raise MeshError(prepared.mesh.source, "faces", "some that have an area", "none")
        wanted = wanted[morton_order(vertices[receivers.faces[wanted]].mean(axis=1).astype(np.float32))]
        corners = receivers.of_vertex[receivers.faces[wanted]]
        first, row = _coincident(corners) if receivers.opacity is None else (np.arange(len(wanted)),) * 2
        return cls(wanted[first], corners[first], with_area, wanted, row)

    def elements(self, hidden: Bools, normals: Float32s, count: int) -> BakedElements:
        """Rows of the estimates, and flags, of all `count` faces of the mesh. Args: hidden, normals: of `faces`."""
        row = np.full(count, -1)
        row[self.with_area[self.wanted]] = self.row
        flags = np.full(count, Flag.DEGENERATE, np.uint8)
        flags[self.with_area[self.with_area < count]] = 0
        flags[self.with_area[self.wanted[hidden[self.row]]]] = Flag.HIDDEN
        return BakedElements(row, flags, normals, len(self.wanted))


def _coincident(corners: AnyInts) -> tuple[Int64s, Int64s]:
    """The first (j,) of all faces with the same corners, ascending, and which of these each face (k,) is like.

    Args: corners: (k, 3), the points of each face, one way round.
    """
    least = np.argmin(corners, axis=1)[:, None]
    turned = np.take_along_axis(corners, (least + np.arange(3)) % 3, axis=1)
    order = np.lexsort(turned.T)
    is_new = np.ones(len(order), np.bool_)
    is_new[1:] = (turned[order[1:]] != turned[order[:-1]]).any(axis=1)
    group = np.empty(len(order), np.int64)
    group[order] = np.cumsum(is_new) - 1
    first = order[is_new]  # of each group, as sorting is stable
    by_place = np.argsort(first)
    return first[by_place], np.argsort(by_place)[group]


def _spread(faces: Int64s, parts: Int64s, shares: Float64s, key: np.uint32) -> PointGroups:
    """Jittered samples of each face, one in each of its 4, 16, … congruent parts.

    Args: parts: (k,), other samples for other numbers. shares: (k,), of the area.

    However few of the first ones are taken, their mean is unbiased: the parts are in the order of a van der Corput
    sequence in base 4, whose digits are turned at random for each face (Basu & Owen 2015, triangular van der Corput).
    """
    wanted = np.log(np.maximum(_SAMPLES * shares, 1e-300)) / np.log(4)
    depth = np.clip(np.rint(wanted), _LEAST, _MOST).astype(np.int64)
    starts = np.concatenate([[0], np.cumsum(4**depth)])
    barycentric = np.empty((starts[-1], 3), np.float32)
    triangles = np.eye(3)[None]
    for k in range(1, depth.max(initial=0) + 1):
        triangles = _quartered(triangles)
        of_depth = np.flatnonzero(depth == k)
        turns = hash32_array(hash32_array(faces[of_depth]) ^ hash32_array(parts[of_depth]) ^ key)[:, None]
        number = np.arange(4**k)
        part = np.zeros((len(of_depth), len(number)), np.int64)
        for digit in range(k):
            part += (number // 4**digit + (turns >> np.uint32(2 * digit))) % 4 * 4**digit
        sample = starts[of_depth][:, None] + number
        within = _uniform(turns + number.astype(np.uint32), derive(key, _JITTER))
        barycentric[sample] = np.einsum("rsc,rscb->rsb", within, triangles[part])
    return PointGroups(starts, np.repeat(faces, 4**depth).astype(np.int32), barycentric)


def _quartered(triangles: Float64s) -> Float64s:
    """Four congruent parts (4 t, 3, 3) of each triangle (t, 3, 3), first one of all."""
    opposite = (triangles.sum(axis=1, keepdims=True) - triangles) / 2  # midpoints of edges
    corners = [(triangles + triangles[:, corner : corner + 1]) / 2 for corner in range(3)]
    return np.concatenate([opposite, *corners])


def _uniform(numbers: UInt32s, key: np.uint32) -> Float32s:
    """Barycentric coordinates (…, 3) of points that are uniform in a triangle."""
    random = hash32_array(numbers) ^ key
    u, v = np.ldexp(hash32_array(np.stack([random, ~random])), -32)
    return in_triangle(u, v).astype(np.float32)


def _neighbours(corners: AnyInts, normals: Float32s, threads: int) -> Neighbours:
    """The faces across the edges of each face, as estimates take neighbours.

    Args:
        corners: (k, 3), the points of each face.
    """
    edges = np.sort(np.stack([corners, np.roll(corners, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)
    order = np.lexsort(edges.T)
    is_same = (edges[order[1:]] == edges[order[:-1]]).all(axis=1)
    return Neighbours.linked(order[:-1][is_same] // 3, order[1:][is_same] // 3, normals, threads)
