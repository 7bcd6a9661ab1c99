"""Cuts of faces until w interpolated between vertices errs by less than is asked for, with few vertices.

Adaptive refinement by error: w is traced at points all over the faces, and the faces between whose corners
interpolation errs most are halved at their longest edges, with those that keep edges shared (Rivara 1984), until the
root mean square over the area is small enough.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple, Self

import numpy as np
import numpy.typing as npt

from obscurance.raytrace.errors import OptionError
from obscurance.raytrace.mesh.mesh import mesh_of
from obscurance.raytrace.mesh.normals import face_areas
from obscurance.raytrace.mesh.weld import first_alike
from obscurance.raytrace.sampling import derive, hash32_array, in_triangle
from obscurance.raytrace.system.checks import check_memory
from obscurance.raytrace.types import AnyInts, Bools, Float64s, Int64s

from .baking import VertexArguments
from .execute.sample_means import SampleMeans
from .points.occluders import occluding
from .points.smooth_surface import PointGroups, SmoothSurface, SurfacePoints
from .points.surface_samples import SurfaceSamples
from .prepared import Prepared
from .rays.gather import W

_RAYS = 128  # of each of two estimates, at vertices and probes
_PROBES = 1 << 13  # of a measurement, by area
_FEWEST = 2  # probes of a face
_AT_ONCE = 0.7  # of the squared error that is too much is taken away in a round, before it is looked at again
_SAFE = 0.9  # of the squared error asked for, that faces are cut down to
_FACE_BYTES = 1000  # of all arrays while faces are cut, a face
_MOST_VERTICES = 1 << 22


class Cuts(NamedTuple):
    """Which edges of m faces are cut in the middle; each face's own `longest` is, where any is.

    Attributes: marked: bool (m, 3), the edges opposite to each corner. longest: (m,), 0, 1 or 2.
    """

    marked: Bools
    longest: Int64s

    @property
    def pieces(self) -> Int64s:
        """How many faces (m,) each becomes."""
        return np.asarray(1 + np.count_nonzero(self.marked, axis=1))


class Refined(NamedTuple):
    """A mesh's refinement.

    Attributes:
        cuts: one after the other. error: RMS over the area of interpolated w after them, as measured.
        own: (m',), of each face then, the row of the one that it lies on, among those with an area; −1 on others.
        corners: (m', 3, 3), barycentric, where its corners are on that.
    """

    cuts: tuple[Cuts, ...]
    error: float
    own: Int64s
    corners: Float64s

    def places(self, faces: AnyInts, count: int) -> SurfacePoints:
        """Where `count` vertices of `faces` (m', 3) lie on the mesh; those of faces without area at its first face."""
        on_area = np.flatnonzero(self.own >= 0)
        vertices, at = np.unique(faces[on_area], return_index=True)
        face = on_area[at // 3]
        rows = np.zeros(count, np.int32)
        weights = np.tile(np.array([1, 0, 0], np.float32), (count, 1))
        rows[vertices] = self.own[face]
        weights[vertices] = self.corners[face, at % 3]
        return SurfacePoints(rows, weights)


class Halved(NamedTuple):
    """Faces after cuts, of rows of values that are k more than before.

    Attributes: ends: (k, 2), the rows between which each new one lies. corners: (m', 3), rows, face by face.
    """

    ends: Int64s
    corners: Int64s

    @classmethod
    def of(cls, corners: AnyInts, count: int, cuts: Cuts) -> Self:
        """Cut faces, of corners (m, 3) in `count` rows: first the longest edge, then the others of its halves."""
        faces = np.arange(len(corners))
        turned = (cuts.longest[:, None] + np.arange(1, 4)) % 3  # the longest edge is from the first to the second
        a, b, c = np.take_along_axis(np.asarray(corners, np.int64), turned, axis=1).T
        opposite = np.take_along_axis(cuts.marked, turned, axis=1)  # edges b c, c a, a b
        # A row for each pair of rows between which an edge is cut.
        edges = np.stack([np.stack([b, c], -1), np.stack([c, a], -1), np.stack([a, b], -1)], axis=1)
        pairs = np.sort(edges[opposite], axis=1)
        _, first, inverse = np.unique(pairs @ (count, 1), return_index=True, return_inverse=True)
        middle = np.full(opposite.shape, -1)
        middle[opposite] = count + inverse.reshape(-1)
        bc, ca, ab = middle.T
        # Up to four faces for each.
        whole, cut_bc, cut_ca = ab < 0, bc >= 0, ca >= 0
        pieces = (
            (whole, tuple(corners.T)),
            (~whole & ~cut_bc, (ab, b, c)),
            (~whole & cut_bc, (ab, b, bc)),
            (~whole & cut_bc, (ab, bc, c)),
            (~whole & ~cut_ca, (a, ab, c)),
            (~whole & cut_ca, (a, ab, ca)),
            (~whole & cut_ca, (ca, ab, c)),
        )
        parent = np.concatenate([faces[some] for some, _ in pieces])
        made = np.concatenate([np.stack(rows, axis=-1)[some] for some, rows in pieces])
        order = np.argsort(parent, kind="stable")
        return cls(pairs[first], made[order].astype(np.int64))

    def extended(self, values: npt.NDArray[Any]) -> npt.NDArray[Any]:
        """Values (n, …) and behind them those of the new rows, means of two; of whole numbers the nearest."""
        means = values[self.ends].mean(axis=1)
        return np.concatenate([values, (means if values.dtype.kind == "f" else np.rint(means)).astype(values.dtype)])


class Probes(NamedTuple):
    """Points on faces with two independent estimates of w.

    Attributes: face: (k,). weights: (k, 3), barycentric. estimates: (k, 2), NaN inside of solids.
    """

    face: Int64s
    weights: Float64s
    estimates: Float64s

    def followed_by(self, others: Self) -> Self:
        """Two sets of probes one after the other."""
        return type(self)(*(np.concatenate(both) for both in zip(self, others, strict=True)))


class Refinement:
    """A mesh and its w, whose faces are cut."""

    def __init__(self, arguments: VertexArguments) -> None:
        mesh = mesh_of(arguments.mesh, "bake")
        options = replace(arguments, falloff=arguments.falloffs[0], profile=False)
        self.prepared = Prepared.of(mesh, options, None, None, occluding(arguments.occluders, None), mesh.radius)
        vertices = self.prepared.placement.vertices.astype(np.float64)
        self.surface = SmoothSurface.of(vertices, self.prepared.receivers)
        # The mesh as it is cut: vertices, faces, the mesh's own face of each, and its corners on that.
        self.positions = vertices[: len(mesh.vertices)]
        self.faces = mesh.faces.astype(np.int64)
        self.own = np.arange(len(self.faces))
        self.corners = np.broadcast_to(np.eye(3), (len(self.faces), 3, 3))
        # Faces with an area have a row among those of the receivers.
        has_area = face_areas(vertices, self.prepared.mesh.faces) > 0
        self.row = np.where(has_area, np.cumsum(has_area) - 1, -1)
        self.areas = face_areas(self.positions, self.faces)
        # Two estimates of w at the vertices, NaN where there are none, and the probes.
        self.keys = 0
        self.w = np.zeros((0, 2))
        self._trace_vertices()
        self.area_outside = self.areas.sum()  # of solids, as far as it was measured
        nothing = np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros((0, 2))
        self.probes = Probes(*nothing)

    def errors(self) -> Float64s:
        """The integral of the squared error of w over each face (m,), from probes, of which each gets a few."""
        check_memory(self.prepared.mesh.source, _FACE_BYTES * len(self.faces), f"to cut {len(self.faces):,} faces")
        lacking = np.maximum(_FEWEST - np.bincount(self.probes.face, minlength=len(self.faces)), 0)
        self.probes = self.probes.followed_by(self.draw(np.where(self.areas > 0, lacking, 0)))
        face = self.probes.face
        sums = np.bincount(face, self._squares(self.probes), len(self.faces))
        return np.asarray(self.areas * sums / np.maximum(np.bincount(face, minlength=len(self.faces)), 1))

    def measure(self) -> float:
        """The mean squared error of w over the area outside of solids, from probes that have decided nothing, and
        decide from now on."""
        fresh = self.draw(_PROBES * self.areas / self.areas.sum())
        self.probes = self.probes.followed_by(fresh)
        outside = max(np.count_nonzero(~np.isnan(fresh.estimates[:, 0])), 1)
        self.area_outside = self.areas.sum() * outside / max(len(fresh.face), 1)
        return float(self._squares(fresh).sum() / outside)

    def _squares(self, probes: Probes) -> Float64s:
        """Squared errors (k,) of interpolated w at probes, without bias, 0 where nothing is outside of solids."""
        corners = self.faces[probes.face]
        weights = np.where(np.isnan(self.w[corners, 0]), 0.0, probes.weights)
        with np.errstate(invalid="ignore"):  # of corners that are all inside
            weights /= weights.sum(axis=1, keepdims=True)
        between = np.einsum("kc,kct->kt", weights, np.nan_to_num(self.w[corners]))
        return np.asarray(np.nan_to_num((between - probes.estimates).prod(axis=1)))

    def cut(self, chosen: Int64s) -> Cuts:
        """Cut some faces at their longest edges, and what else has to be so that edges stay shared."""
        cuts = self._cuts(chosen)
        halved = Halved.of(self.faces, len(self.w), cuts)
        of_corners = Halved.of(np.arange(self.faces.size).reshape(-1, 3), self.faces.size, cuts)
        self.corners = of_corners.extended(self.corners.reshape(-1, 3))[of_corners.corners]
        self.positions = halved.extended(self.positions)
        self.faces = halved.corners
        self.own = np.repeat(self.own, cuts.pieces)
        self.areas = np.where(np.repeat(self.areas, cuts.pieces) > 0, face_areas(self.positions, self.faces), 0.0)
        self._trace_vertices()
        # The probes of faces that are whole stay.
        face, weights, estimates = self.probes
        stays = cuts.pieces[face] == 1
        now = np.cumsum(cuts.pieces) - 1
        self.probes = Probes(now[face[stays]], weights[stays], estimates[stays])
        return cuts

    def _cuts(self, chosen: Int64s) -> Cuts:
        """The edges to cut: the longest of the chosen faces, and of each that then has any cut (Rivara 1984)."""
        place = first_alike(self.positions + 0.0)[self.faces]  # −0 becomes 0
        pairs = np.sort(np.stack([place[:, [1, 2]], place[:, [2, 0]], place[:, [0, 1]]], axis=1), axis=2)
        _, first, edge = np.unique(pairs @ (len(self.w), 1), return_index=True, return_inverse=True)
        edge = edge.reshape(-1, 3)
        ends = self.positions[pairs.reshape(-1, 2)[first]]
        lengths = np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1)
        order = np.argsort(lengths, kind="stable")
        rank = np.empty_like(order)
        rank[order] = np.arange(len(order))  # so that of equal edges all faces take the same
        longest = np.argmax(rank[edge], axis=1)
        own = np.take_along_axis(edge, longest[:, None], axis=1)[:, 0]
        is_cut = np.zeros(len(first), np.bool_)
        more = own[chosen]
        while len(more):
            is_cut[more] = True
            more = own[is_cut[edge].any(axis=1) & ~is_cut[own]]
        return Cuts(is_cut[edge], longest)

    def refined(self, cuts: Sequence[Cuts], error: float) -> Refined:
        """The mesh as it is cut. Args: cuts: that were made. error: as measured."""
        return Refined(tuple(cuts), error, self.row[self.own], self.corners)

    def _trace_vertices(self) -> None:
        """w of the vertices that have none yet."""
        old, count = len(self.w), len(self.positions)
        has_area = np.zeros(count, np.bool_)
        has_area[self.faces[self.row[self.own] >= 0]] = True
        new = old + np.flatnonzero(has_area[old:])
        places = self.refined((), 0.0).places(self.faces, count)
        self.w = np.concatenate([self.w, np.full((count - old, 2), np.nan)])
        self.w[new] = self._trace(SurfacePoints(places.face[new], places.barycentric[new]))

    def draw(self, counts: npt.NDArray[Any]) -> Probes:
        """New probes, `counts` (m,) in the mean on each face."""
        key = self._next_key()
        chance = np.ldexp(hash32_array(np.arange(len(counts)) ^ key), -32)
        face = np.repeat(np.arange(len(counts)), np.floor(counts + chance).astype(np.int64))
        u, v = np.ldexp(hash32_array(hash32_array(np.arange(2 * len(face))) ^ key), -32).reshape(2, -1)
        weights = in_triangle(u, v)
        places = np.einsum("kc,kcb->kb", weights, self.corners[face])
        on_faces = SurfacePoints(self.row[self.own[face]].astype(np.int32), places.astype(np.float32))
        return Probes(face, weights, self._trace(on_faces))

    def _trace(self, places: SurfacePoints) -> Float64s:
        """Two independent estimates of w (k, 2) at places on the mesh's own faces, NaN inside of solids."""
        prepared = self.prepared
        count = len(places.face)
        on_faces = PointGroups(np.arange(count + 1), *places)
        one_each = np.zeros(count, np.bool_)
        samples = SurfaceSamples.place(on_faces, one_each, self.surface, prepared.receivers, prepared.threads)
        tracer = prepared.sample_tracer(SampleMeans(samples), "refinement", None)
        estimates = [tracer.gather(samples.points, _RAYS, self._next_key())[:, 0, W] for _ in range(2)]
        return np.where(prepared.inside(samples)[:, None], np.nan, np.stack(estimates, axis=1))

    def _next_key(self) -> np.uint32:
        """A key of random choices that no other call gets."""
        self.keys += 1
        return derive(derive(self.prepared.key, 12), self.keys)


def refine(arguments: VertexArguments, error: float) -> Refined:
    """Cut the faces of a mesh until interpolated w has an RMS error of at most `error` over its area.

    Args: arguments: of the bake, whose first falloff counts.

    Raises: as `ao.bake`; MemoryLimitError; OptionError: it would take more than 4,194,304 vertices.
    """
    refinement = Refinement(arguments)
    made: list[Cuts] = []
    while (measured := refinement.measure()) > error**2:
        allowed = _SAFE * error**2 * refinement.area_outside
        while (too_much := np.sum(errors := refinement.errors()) - allowed) > 0:
            largest = np.argsort(-errors)
            enough = np.searchsorted(np.cumsum(errors[largest]), _AT_ONCE * too_much) + 1
            made.append(refinement.cut(largest[:enough]))
            if len(refinement.w) > _MOST_VERTICES:
                raise OptionError("between", f"an error that {_MOST_VERTICES:,} vertices can have", error)
    return refinement.refined(made, math.sqrt(max(measured, 0.0)))
