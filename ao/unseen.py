"""Faces that nothing outside sees, which a program can drop."""

from typing import Any, NamedTuple

import numpy as np

from obscurance.raytrace.embree import intersect
from obscurance.raytrace.errors import OptionError
from obscurance.raytrace.mesh.mesh import TO_Y_UP, Mesh, mesh_of, up_axis
from obscurance.raytrace.mesh.normals import face_areas
from obscurance.raytrace.mesh.opacity import alphas
from obscurance.raytrace.mesh.weld import join, renumber_components
from obscurance.raytrace.ray_origins.surface import Surface
from obscurance.raytrace.system.threads import thread_count
from obscurance.raytrace.types import Bools, Float32Rows, Float64s, Int64s

from .execute.tracer import Progress
from .points.smooth_surface import PointGroups, SmoothSurface, VertexAxes
from .points.surface_samples import SurfaceSamples
from .prepared import PreparedMesh, prepare

_ROUNDS = 16, 16, 32, 64, 128, 256, 512, 1024, 2048  # rays of faces of which none has left so far
_ENOUGH = 1 << 18  # rays of a room of which none has left, after which it is closed
_BLOCK = 1 << 17  # rays traced at once
_NEVER = 1 << 30  # bounces, of a side from which no ray was seen to leave
_DOUBT = 3.0  # of n rays that none has hit what has a share of 3/n of them is the chance e⁻³, 5 %
_AHEAD = 2.0**-20  # in render space, behind what lets light through, where a ray goes on


class Unseen(NamedTuple):
    """Faces that are unseen, as `unseen_faces` finds them.

    Attributes:
        faces: bool (m,), faces that are not seen.
        rays: int64 (m,), how many were traced from each face, in random directions; of those of `faces` none has left.
    """

    faces: Bools
    rays: Int64s

    def share(self, faces: Bools) -> float:
        """The most that may yet be open of what some of the faces, bool (m,), look at together, with 95 % confidence.

        By the rule of three (Hanley & Lippman-Hand 1983).
        """
        return min(_DOUBT / max(int(self.rays[faces].sum()), 1), 1.0)


def unseen_faces(
    mesh: Mesh | Any,
    seed: int = 0,
    threads: int | None = None,
    progress: Progress | None = None,
    *,
    above: bool = False,
    depth: int = 0,
) -> Unseen:
    """Faces of `mesh` that cannot be seen from outside: no straight line leads from them to infinity.

    Rays start at points spread over a face, on the side that their direction is on, and go through what is not opaque.
    Most faces are seen by their first few; those that are not get up to 4,096. Sides that rays lead from one to the
    other make a room: where none of its first 262,144 leaves, it is closed. Faces without area count as seen.

    Args:
        progress: called as that of `ao.bake`, in rounds.
        above: only lines that rise lead outside, by `mesh.up`.
        depth: bounces by which cavities are kept: of 1, also faces that a side sees which is seen, and so on.

    Raises: OptionError, MeshError, MemoryLimitError: as `ao.bake`.
    """
    if depth < 0:
        raise OptionError("depth", "a number of bounces from 0 on", depth)
    prepared = prepare(mesh_of(mesh, "unseen_faces"))
    rays = _Rays(prepared, above, thread_count(threads))
    count = len(prepared.receivers.faces)
    # Of each face's two sides: bounces from there to outside, a side of the same room, and rays.
    bounces = np.full((count, 2), _NEVER)
    forest = np.arange(2 * count)
    traced = np.zeros((count, 2), np.int64)
    active = np.arange(count)
    for turn, samples in enumerate(_ROUNDS):
        for start in range(0, len(active), _BLOCK // samples):
            faces = np.repeat(active[start : start + _BLOCK // samples], samples)
            side, hit = rays.trace(faces, np.random.default_rng([seed, turn, start]))
            traced += np.bincount(side, minlength=2 * count).reshape(count, 2)
            bounces.ravel()[side[hit < 0]] = 0
            links = np.stack([side, hit], axis=1)[hit >= 0]
            np.minimum.at(bounces.ravel(), links[:, 0], bounces.ravel()[links[:, 1]] + 1)
            join(links, forest)
            if progress:
                progress(start + len(faces) // samples, len(active), f"faces, round {turn + 1}")
        # Unseen faces go on, and all of a room with one until enough rays say that it is closed.
        numbers = forest.copy()
        renumber_components(numbers)
        room = numbers.reshape(count, 2)
        is_seen = np.any(bounces <= depth, axis=1)
        is_open, has_unseen = np.zeros((2, 2 * count), np.bool_)
        is_open[room[bounces == 0]] = True
        has_unseen[room[~is_seen]] = True
        of_room = np.bincount(room.ravel(), traced.ravel(), 2 * count)[room]
        goes_on = np.where(is_open[room], ~is_seen[:, None], has_unseen[room] & (of_room > 0) & (of_room < _ENOUGH))
        active = np.flatnonzero(np.any(goes_on, axis=1))
    is_unseen = np.zeros(len(prepared.faces), np.bool_)
    counts = np.zeros(len(prepared.faces), np.int64)
    has_area = face_areas(prepared.placement.vertices, prepared.faces) > 0
    is_unseen[has_area] = ~is_seen
    counts[has_area] = traced.sum(axis=1)
    return Unseen(is_unseen, counts)


class _Rays:
    """Rays from the faces of a mesh in random directions; a face of number i has the sides 2 i, its front, and 2 i + 1.

    Args: above: whether the directions rise, else they are even over the sphere.
    """

    def __init__(self, mesh: PreparedMesh, above: bool, threads: int) -> None:
        self._receivers = mesh.receivers
        self._axes = np.array(TO_Y_UP[up_axis(mesh)], np.float64)
        self._above = above
        self._threads = threads
        vertices = mesh.placement.vertices.astype(np.float64)
        front = Surface.of(vertices, mesh.receivers.faces, mesh.receivers.backwards)
        axes = VertexAxes(0 * vertices, 0 * vertices)
        self._surfaces = SmoothSurface(axes, front), SmoothSurface(axes, front.reversed())
        self._normals = front.normals(np.arange(len(front.faces)))

    def trace(self, faces: Int64s, random: np.random.Generator) -> tuple[Int64s, Int64s]:
        """The side (k,) where a ray from each of some faces (k,) starts, and the side that it hits, −1: it leaves."""
        height, turn, first, second = random.random((4, len(faces)))
        height = height if self._above else 2 * height - 1  # even over the sphere (Archimedes)
        angle = 2 * np.pi * turn
        flat = np.sqrt(1 - height**2)
        directions = np.stack([flat * np.cos(angle), height, flat * np.sin(angle)], axis=1) @ self._axes
        root = np.sqrt(first)
        weights = np.stack([1 - root, root * (1 - second), root * second], axis=1).astype(np.float32)
        behind = self._is_along(faces, directions) < 0
        origins = np.empty((len(faces), 3), np.float32)
        for surface, rows in zip(self._surfaces, (np.flatnonzero(~behind), np.flatnonzero(behind)), strict=True):
            points = PointGroups(np.arange(len(rows) + 1), faces[rows].astype(np.int32), weights[rows])
            alone = np.zeros(len(rows), np.bool_)
            origins[rows] = SurfaceSamples.place(points, alone, surface, self._receivers, self._threads).points.origins
        hit = self._closest(origins, directions)
        return 2 * faces + behind, np.where(hit < 0, -1, 2 * hit + (self._is_along(hit, directions) > 0))

    def _is_along(self, faces: Int64s, directions: Float64s) -> Float64s:
        """The cosine (k,) between directions and the fronts of faces."""
        cosines: Float64s = np.einsum("kc,kc->k", directions, self._normals[faces])
        return cosines

    def _closest(self, origins: Float32Rows, directions: Float64s) -> Int64s:
        """The face (k,) that each ray hits first of those that are opaque there, −1 for none."""
        face = np.full(len(origins), -1)
        rows = np.arange(len(origins))
        opacity = self._receivers.opacity
        while len(rows):
            hits = intersect(self._receivers.embree(), origins[rows], directions[rows], threads=self._threads)
            face[rows] = hits.face
            alpha = np.ones(len(rows))
            if opacity:
                alphas(opacity, hits.face, hits.barycentric[:, 1:].astype(np.float64), alpha)
            passes = (hits.face >= 0) & (alpha < 1)
            rows = rows[passes]
            origins[rows] += (hits.distance[passes, None] + _AHEAD) * directions[rows]
        return face
