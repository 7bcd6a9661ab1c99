"""From a coarse mesh to a fine one: points of its faces or vertices move along smooth normals onto the fine surface.

A ray starts as far outside as the cage reaches and goes in, twice as far; what it meets first is what the point shows.
A cage that is a mesh says for each point where its ray starts, and so its direction, too.
It goes on through holes that alpha makes.
Points that meet nothing take the closest one; where that is on the ray but for a hundredth of the cage, as on a border
that both meshes have, it counts as met. Others look for it only if some points have met something.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, fields
from functools import cached_property
from typing import Any, NamedTuple, Self

import numpy as np

from obscurance.raytrace.bvh.closest import closest_points
from obscurance.raytrace.embree import intersect
from obscurance.raytrace.errors import MeshError, OptionError
from obscurance.raytrace.mesh.mesh import Mesh, mesh_of
from obscurance.raytrace.mesh.opacity import alphas
from obscurance.raytrace.mesh.placement import NEAR, Placement
from obscurance.raytrace.types import Float32s, Float64s, Int64s

from ..falloff import Length, is_length, resolve_length
from .receivers import Receivers
from .smooth_surface import SurfacePoints

Groups = tuple[Int64s, Int64s]


@dataclass(frozen=True, eq=False, repr=False)
class PlacedMesh(Mesh):
    """A mesh that is known to lie on a fine one. Attributes: places: of its vertices (n,) on the fine mesh's faces, as
    the receivers number them."""

    places: SurfacePoints = field(kw_only=True)

    @classmethod
    def of(cls, mesh: Mesh, places: SurfacePoints) -> Self:
        """The mesh with the places of its vertices."""
        return cls(**{field.name: getattr(mesh, field.name) for field in fields(Mesh)}, places=places)


_ROUNDED = 1e-6  # of coordinates, in single precision
_MOST_HOLES = 64  # that a ray goes through
_LARGER = 1e12  # how much larger one of the two meshes may be
_NOTHING = "surface", "some of it within the cage about the coarse mesh", "none"
_BESIDE = 0.01  # of the cage: how far from its ray a point that counts as met may be


class _CageRays(NamedTuple):
    """Rays from a cage inwards, through k points of the coarse mesh, in render space."""

    positions: Float64s  # (k, 3), of the points
    outwards: Float64s  # (k, 3), unit
    reach: Float64s  # (k,), from the points to where rays start


@dataclass(frozen=True, eq=False)
class FineMesh:
    """A mesh onto which points of a coarse one are projected."""

    source: str  # what messages call it
    placement: Placement
    receivers: Receivers
    threads: int
    progress: Callable[[int, int, str], None] | None = None  # called while what the cage misses is sought

    @cached_property
    def _vertices(self) -> Float64s:
        return self.placement.vertices.astype(np.float64)

    def project(
        self,
        positions: Float64s,
        normals: Float64s,
        cage: float | Float64s,
        groups: Groups | None = None,
        required: bool = True,
    ) -> tuple[SurfacePoints, Int64s]:
        """Points of the coarse mesh moved onto this one, k, and which of them the cage misses, (j,).

        Args:
            positions, normals: (k, 3), the points on the coarse mesh and its unit normals there, in render space.
            cage: how far the fine surface may be, in mesh units, or points (k, 3), which say which way, too.
            groups: of the points (k,) and of the fine mesh's vertices, the first of which says that of a face.
            required: that any point meets something.

        Raises: MeshError: no point meets anything that is to, or no face has an area. OptionError: no face has a
            point's group.
        """
        if not len(self.receivers.faces):
            raise MeshError(self.source, "faces", "some that have an area", "none")
        rays = self._cage_rays(positions, normals, cage)
        match = self._group_of_faces(groups) if groups else None
        face, barycentric = self._first_hits(rays, match)
        unmet = np.flatnonzero(face < 0)
        face[unmet], barycentric[unmet] = self._beside(rays, unmet, match)
        missed = np.flatnonzero(face < 0)
        if required and len(missed) == len(face):
            raise MeshError(self.source, *_NOTHING)
        if len(missed):
            reach = float(rays.reach.max()) or 1.0
            face[missed], barycentric[missed] = self._closest(
                rays.positions, missed, match, reach, self._watched(len(missed))
            )
        return SurfacePoints(face.astype(np.int32), barycentric), missed

    def _cage_rays(self, positions: Float64s, normals: Float64s, cage: float | Float64s) -> _CageRays:
        """Rays that reach no farther than across both meshes."""
        if isinstance(cage, float):
            reach = np.full(len(positions), cage * self.placement.scale)
        else:
            away = (cage - self.placement.centre) * self.placement.scale - positions
            reach = np.linalg.norm(away, axis=1)
            direction = away / np.where(reach > 0, reach, 1)[:, None]
            normals = np.where(reach[:, None] > 0, direction, normals)
        low = np.minimum(self._vertices.min(axis=0), positions.min(axis=0))
        high = np.maximum(self._vertices.max(axis=0), positions.max(axis=0))
        return _CageRays(positions, normals, np.minimum(reach, float(np.linalg.norm(high - low))))

    def _group_of_faces(self, groups: Groups) -> Groups:
        """Groups of the points (k,) and of the faces (m,). Raises: OptionError: a point's group has no face."""
        of_points, of_vertices = groups
        of_faces = np.asarray(of_vertices)[self.receivers.faces[:, 0]]
        lacking = np.setdiff1d(of_points, of_faces)
        if len(lacking):
            raise OptionError("groups", "faces of the fine mesh in each", f"none in {lacking[0]}", self.source)
        return of_points, of_faces

    def _first_hits(self, rays: _CageRays, match: Groups | None) -> tuple[Int64s, Float32s]:
        """The face (k,) of its group that each ray meets first, −1 for none, and where on it (k, 3); not holes."""
        scene = self.receivers.embree()
        starts = rays.positions + rays.reach[:, None] * rays.outwards
        inwards = -rays.outwards
        step = self._rounding(starts)
        hits = intersect(scene, starts, inwards, 2 * rays.reach, self.threads)
        distance = hits.distance.astype(np.float64)
        passing = np.arange(len(starts))
        for _ in range(_MOST_HOLES if self.receivers.opacity or match else 0):
            passing = passing[hits.face[passing] >= 0]
            passing = passing[self._are_holes(passing, hits.face[passing], hits.barycentric[passing], match)]
            if not len(passing):
                break
            distance[passing] += step[passing]
            behind = starts[passing] + distance[passing, None] * inwards[passing]
            left = np.maximum(2 * rays.reach[passing] - distance[passing], 0)
            farther = intersect(scene, behind, inwards[passing], left, self.threads)
            hits.face[passing], hits.barycentric[passing] = farther.face, farther.barycentric
            distance[passing] += farther.distance
        if match:
            hits.face[match[0] != match[1][hits.face]] = -1
        return hits.face, hits.barycentric

    def _are_holes(self, points: Int64s, face: Int64s, barycentric: Float32s, match: Groups | None) -> Any:
        """Whether hits of some `points` are where faces are wholly transparent, or on faces of other groups."""
        alpha = np.ones(len(points))
        if self.receivers.opacity:
            alphas(self.receivers.opacity, face, barycentric[:, 1:].astype(np.float64), alpha)
        if match:
            alpha[match[0][points] != match[1][face]] = 0
        return alpha == 0

    def _beside(self, rays: _CageRays, unmet: Int64s, match: Groups | None) -> tuple[Int64s, Float32s]:
        """The closest face to each of the points `unmet` (j,) where that is as good as on the ray, else −1, and where
        on it."""
        positions, outwards, reach = rays.positions[unmet], rays.outwards[unmet], rays.reach[unmet]
        rounding = self._rounding(positions)
        radius = (1 + _BESIDE) * float((reach + rounding).max(initial=0.0)) or 1.0
        face, barycentric = self._closest(rays.positions, unmet, match, radius)
        away = np.einsum("kc,kci->ki", barycentric, self._vertices[self.receivers.faces[face]]) - positions
        along = np.einsum("ki,ki->k", away, outwards)
        aside = np.linalg.norm(away - along[:, None] * outwards, axis=1)
        face[(np.abs(along) > reach + rounding) | (aside > _BESIDE * reach + rounding)] = -1
        return face, barycentric

    def _closest(
        self,
        positions: Float64s,
        points: Int64s,
        match: Groups | None,
        radius: float,
        farther: Callable[[int], None] | None = None,
    ) -> tuple[Int64s, Float32s]:
        """The closest face to each of some `points` (j,) of `positions` (k, 3), as `closest_points` has it."""
        of_points, of_faces = match or (
            np.zeros(len(positions), np.int64),
            np.zeros(len(self.receivers.faces), np.int64),
        )
        return closest_points(
            self.receivers.hierarchy.tree,
            (self._vertices, self.receivers.faces),
            positions[points],
            radius,
            (of_points[points], of_faces),
            self.threads,
            farther,
        )

    def _watched(self, total: int) -> Callable[[int], None]:
        """What counts points that are done, for who watches the progress."""
        done = 0

        def count(points: int) -> None:
            nonlocal done
            done += points
            if self.progress:
                self.progress(done, total, "closest points beyond the cage")

        return count

    def _rounding(self, positions: Float64s) -> Float64s:
        """How far (k,) single precision may move points beside `positions` (k, 3)."""
        most = max(float(np.abs(self._vertices).max()), float(np.abs(positions).max(initial=0.0)))
        return np.asarray(_ROUNDED * np.minimum(most, np.maximum(NEAR, np.abs(positions).max(axis=1))))


def cage_of(cage: Length | Mesh | Any, mesh: Mesh, fine: Mesh) -> float | Mesh:
    """A cage about the coarse `mesh` in mesh units: a distance, or its own mesh.

    Raises: MeshError: it is none, or has not the vertices and faces of `mesh`, or this and the `fine` one differ in
    size by more than single precision holds, or are farther apart than the cage reaches; OptionError: it is no length.
    """
    across = np.ptp(mesh.bounds, axis=0).max()
    fine_across = np.ptp(fine.bounds, axis=0).max()
    if not across / _LARGER <= fine_across <= across * _LARGER:
        sizes = f"from {1 / _LARGER:g} to {_LARGER:g} times that of {mesh.source}"
        raise MeshError(fine.source, "size", sizes, f"{fine_across:.3g}, beside {across:.3g}")
    if is_length(cage):
        reach = resolve_length("cage", cage, mesh.radius or 1.0)
        _check_meet(mesh, fine, reach)
        return reach
    cage_mesh = mesh_of(cage, "cage")
    for name in ("vertices", "faces"):
        expected = len(getattr(mesh, name))
        got = len(getattr(cage_mesh, name))
        if expected != got:
            raise MeshError(cage_mesh.source, name, f"{expected:,}, as {mesh.source} has", f"{got:,}")
    _check_meet(mesh, fine, float(np.linalg.norm(cage_mesh.vertices - mesh.vertices, axis=1).max()))
    return cage_mesh


def _check_meet(mesh: Mesh, fine: Mesh, reach: float) -> None:
    """Check that the box about the fine mesh is within a cage's reach of the coarse one's. Raises: MeshError."""
    gap = np.maximum(fine.bounds[0] - mesh.bounds[1], mesh.bounds[0] - fine.bounds[1]).max()
    if gap > (1 + _BESIDE) * reach + _ROUNDED * float(np.abs([mesh.bounds, fine.bounds]).max()):
        raise MeshError(fine.source, *_NOTHING)
