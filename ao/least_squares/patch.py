"""The faces over which w is fitted, and the gathering of their moments, block by block."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from obscurance.raytrace.embree import LANES
from obscurance.raytrace.mesh.morton import fine_morton_order
from obscurance.raytrace.mesh.normals import face_normals
from obscurance.raytrace.mesh.placement import Placement
from obscurance.raytrace.mesh.weld import CREASE
from obscurance.raytrace.sampling import hash32_array
from obscurance.raytrace.types import Bools, Float32s, Float64s, Int32s, Int64s

from ..execute.work import Outputs
from ..mu import KernelMu
from ..points.receivers import Receivers
from ..prepared import Prepared
from ..rays.ray_packet import RayPacket
from ..rays.ray_scene import RayScene
from .face_moments import HIDDEN, MOMENTS, SEEN, Samples, gather_faces, lattices
from .pattern import find_hinges

_MOST_RAYS = 32
_COARSE = 1 << 16  # faces; with more, how rectangles are cut is no longer seen
_SQUARE = 1e-4  # of a rectangle's diagonal


@dataclass(frozen=True, eq=False)
class Patch:
    """Faces in render space, in Morton order; at the end the faces of rectangles again, cut by the other diagonal.

    A fit to the two halves of a rectangle alone would raise or lower the ends of its diagonal.
    """

    corners: Float64s  # (m, 3, 3)
    normals: Float64s  # (m, 3), unit, on the faces' fronts
    areas: Float64s  # (m,), above 0
    face_points: Int32s  # (m, 3), unknowns: rows in `Receivers.points`, or behind them for vertices without a point
    axes: Float32s  # (m, 3, 3), unit axes of the corners' points, or 0
    smooth: Float32s  # (m, 3, 3), normals of the smooth surface at these, or 0
    unknowns: int  # their number
    mesh_faces: int  # number of faces that are the mesh's
    cover: Float64s  # (m,), the share of each face's area that it stands for: half in rectangles

    @classmethod
    def of(cls, placement: Placement, receivers: Receivers, requested: Bools) -> Patch:
        """The patch of all faces with a corner among the `requested` vertices, bool (n,)."""
        vertices = placement.vertices.astype(np.float64)
        rows = np.flatnonzero(requested[receivers.faces].any(axis=1))
        rows = rows[fine_morton_order(vertices[receivers.faces[rows]].mean(axis=1))]
        faces = receivers.faces[rows]
        normals_of, areas = face_normals(vertices, faces)
        normals_of[receivers.backwards[rows]] *= -1.0
        unknown = receivers.of_vertex.copy()
        normals = receivers.points.normals
        without = np.flatnonzero(unknown < 0)
        unknown[without] = len(normals) + np.arange(len(without))
        none = np.zeros((len(without), 3), np.float32)
        axes = np.concatenate([normals, none])
        points = unknown[faces]
        patch = cls(
            vertices[faces],
            normals_of,
            areas,
            points.astype(np.int32),
            axes[points],
            np.concatenate([receivers.surface_normals, none])[points],
            unknowns=len(axes),
            mesh_faces=len(faces),
            cover=np.broadcast_to(1.0, len(faces)),
        )
        return patch if len(faces) > _COARSE else patch._with_rectangles()

    def _with_rectangles(self) -> Patch:
        """The patch with the other cut of every rectangle that two faces form; each cut has half the samples."""
        # Pairs of faces at a smooth edge, their diagonal: the corners opposite to it, and its ends.
        hinges = find_hinges(self.face_points, self.normals, CREASE, self.unknowns).astype(np.int64)
        opposite, across = hinges.T
        face = opposite // 3
        start = 3 * face + (opposite + 1) % 3
        end = 3 * face + (opposite + 2) % 3
        # Those of four right angles: both diagonals have one middle and one length.
        at = self.corners.reshape(-1, 3)
        length = np.linalg.norm(at[start] - at[end], axis=1)
        other_length = np.linalg.norm(at[opposite] - at[across], axis=1)
        crooked = np.linalg.norm(at[opposite] + at[across] - at[start] - at[end], axis=1)
        is_square = np.abs(other_length - length) <= _SQUARE * length
        cut = np.flatnonzero(is_square & (crooked <= _SQUARE * length))
        # Two faces more of each, by the other diagonal.
        turned = np.stack([opposite, start, across, opposite, across, end], axis=1)[cut].reshape(-1, 3)
        face = np.repeat(face[cut], 2)
        cover = np.ones(len(self.normals) + len(face))
        cover[hinges[cut] // 3] = cover[len(self.normals) :] = 0.5
        return replace(
            self,
            corners=np.concatenate([self.corners, at[turned]]),
            normals=np.concatenate([self.normals, self.normals[face]]),
            areas=np.concatenate([self.areas, self.areas[face]]),
            face_points=np.concatenate([self.face_points, self.face_points.ravel()[turned]]),
            axes=np.concatenate([self.axes, self.axes.reshape(-1, 3)[turned]]),
            smooth=np.concatenate([self.smooth, self.smooth.reshape(-1, 3)[turned]]),
            cover=cover,
        )

    def part(self, faces: Int64s) -> Patch:
        """A patch of some faces, with unknowns of their own."""
        unknowns, renumbered = np.unique(self.face_points[faces], return_inverse=True)
        face_points = renumbered.reshape(-1, 3).astype(np.int32)
        return Patch(
            self.corners[faces],
            self.normals[faces],
            self.areas[faces],
            face_points,
            self.axes[faces],
            self.smooth[faces],
            unknowns=len(unknowns),
            mesh_faces=len(faces),
            cover=self.cover[faces],
        )


@dataclass(frozen=True, eq=False)
class Moments:
    """The moments and ray counts of faces as a `KeptRowTask`, which any process can do; see `gather_faces`."""

    faces: tuple[Float64s, Float64s, Float32s, Float32s]  # `Patch`'s corners, normals, axes and smooth normals
    samples: Samples
    points: Int32s  # (m, 3), unknowns, which identify the faces
    rays_of_sample: int
    count: int  # of samples in all
    key: np.uint32  # of the directions
    mu: KernelMu  # in render space
    reach: float  # of rays there
    block_rays: ClassVar = 1 << 19

    def __len__(self) -> int:
        return len(self.points)

    def __getitem__(self, rows: slice) -> Moments:
        start, stop, _ = rows.indices(len(self))
        corners, normals, axes, smooth = self.faces
        shift, ends, starts, weights = self.samples
        samples = Samples(shift, ends[start : stop + 1], starts[start : stop + 1], weights[rows])
        faces = corners[rows], normals[rows], axes[rows], smooth[rows]
        return replace(self, faces=faces, samples=samples, points=self.points[rows])

    @property
    def name(self) -> bytes:
        """As `KeptRowTask.name`: of the samples' count, key and places."""
        digest = hashlib.blake2b(repr((self.count, int(self.key))).encode(), digest_size=16)
        digest.update(np.ascontiguousarray(self.points).data)
        return digest.digest()

    @property
    def rays(self) -> float:
        """Rays of a face on average, as `RowTask.rays`."""
        count = int(self.samples.starts[-1] - self.samples.starts[0])
        return self.rays_of_sample * count / max(len(self), 1)

    def tables(self) -> Outputs:
        return np.zeros((len(self), MOMENTS)), np.zeros((len(self), 3), np.int64)

    def writer(self, scene: RayScene, tables: Outputs) -> Callable[[int, int], None]:
        embree = scene.embree()
        drawn = lattices(self.rays_of_sample, scene.cone), self.key, scene.cone
        moments, counts = tables

        def write(start: int, stop: int) -> None:
            faces = self[start:stop]
            packet = RayPacket.of(embree, scene.opacity)
            gather_faces(
                packet, faces.faces, faces.samples, drawn, self.mu, self.reach, moments[start:stop], counts[start:stop]
            )

        return write


def gather_moments(prepared: Prepared, patch: Patch, total: int) -> tuple[Float64s, Int64s]:
    """Moments (m, 29) and counts (m, 3) of the faces of `patch` from `total` rays, see `gather_faces`.

    Hidden samples count next to nothing beside visible ones of the same vertex, but fully on faces of which no vertex
    has one: a room whose walls face outwards has none but hidden ones.
    """
    placement = prepared.placement
    key = prepared.key
    progress = prepared.progress
    if not len(patch.face_points):
        return np.zeros((0, MOMENTS)), np.zeros((0, 3), np.int64)
    # Many samples of few rays each, spread evenly over the faces.
    rays = int(np.clip(prepared.options.rays // 2 // LANES * LANES, LANES, _MOST_RAYS))
    count = max(total // rays, 1)
    shift = float(np.ldexp(hash32_array([key])[0], -32))
    faces = patch.corners, patch.normals, patch.axes, patch.smooth
    mu = prepared.mu.in_render_space(placement.scale)
    samples = Samples.spread(patch.areas * patch.cover, count, shift)
    work = Moments(faces, samples, patch.face_points, rays, count, key, mu, placement.diagonal)
    done = 0

    def advance(finished: int) -> None:
        nonlocal done
        done += finished
        if progress:
            progress(count * rays * done // len(work), count * rays, "rays")

    moments, counts = prepared.checkpoint.fill(work, prepared.scene, prepared.threads, advance)
    # Faces of which no vertex is seen keep what hidden samples say.
    seen = np.zeros(patch.unknowns, np.bool_)
    seen[patch.face_points[counts[:, SEEN] > 0]] = True
    moments[~seen[patch.face_points].any(axis=1)] /= HIDDEN
    return moments, counts
