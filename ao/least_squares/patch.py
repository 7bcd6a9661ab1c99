"""The faces over which w is fitted, and the gathering of their moments, block by block."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from raytrace.embree.packets import LANES
from raytrace.mesh.normals import face_normals
from raytrace.mesh.placement import Placement
from raytrace.sampling.hash import mix_array
from raytrace.types import Bools, Float32s, Float64s, Int32s, Int64s

from ..gather.morton import fine_morton_order
from ..gather.ray_packet import RayPacket
from ..gather.receivers import Receivers
from ..mu import KernelMu
from ..prepared import Prepared
from ..trace.ray_scene import RayScene
from ..trace.work import Tables, fill
from .face_moments import HIDDEN, MOMENTS, SEEN, FaceArrays, Lattices, gather_faces
from .samples import Samples

_MOST_RAYS = 32
_BLOCK_RAYS = 1 << 19


@dataclass(frozen=True, eq=False)
class Patch:
    """Faces in render space, in Morton order.

    Attributes:
        corners: float64 (m, 3, 3). normals: float64 (m, 3), unit. areas: float64 (m,), above 0.
        face_points: int32 (m, 3), the unknown at each corner: its row in `Receivers.points`, or one behind those for a
            vertex without a point.
        axes: float32 (m, 3, 3), unit normals of the corners' points, or 0.
        unknowns: how many there are.
    """

    corners: Float64s
    normals: Float64s
    areas: Float64s
    face_points: Int32s
    axes: Float32s
    unknowns: int

    @classmethod
    def of(cls, placement: Placement, receivers: Receivers, wanted: Bools) -> Patch:
        """The patch of all faces that have a corner among the `wanted` vertices, bool (n,)."""
        vertices = placement.vertices.astype(np.float64)
        faces = receivers.faces[wanted[receivers.faces].any(axis=1)]
        faces = faces[fine_morton_order(vertices[faces].mean(axis=1))]
        unknown, normals = receivers.of_vertex.copy(), receivers.points.normals
        without = np.flatnonzero(unknown < 0)
        unknown[without] = len(normals) + np.arange(len(without))
        axes = np.concatenate([normals, np.zeros((len(without), 3), np.float32)])
        points = unknown[faces]
        return cls(vertices[faces], *face_normals(vertices, faces), points.astype(np.int32), axes[points], len(axes))

    def part(self, faces: Int64s) -> Patch:
        """Some of the faces, with unknowns of their own."""
        own, face_points = np.unique(self.face_points[faces], return_inverse=True)
        local = face_points.reshape(-1, 3).astype(np.int32)
        return Patch(self.corners[faces], self.normals[faces], self.areas[faces], local, self.axes[faces], len(own))


@dataclass(frozen=True, eq=False)
class Moments:
    """Moments and counts of faces, as work that any process can do; see `gather_faces`.

    Attributes:
        faces: FaceArrays (m). samples: on these. points: int32 (m, 3), what tells these faces from others.
        rays: of a sample. asked: samples asked for at a vertex. key: of the directions. mu: in render space.
        reach: length of rays there.
    """

    faces: FaceArrays
    samples: Samples
    points: Int32s
    rays_of_sample: int
    asked: int
    key: np.uint32
    mu: KernelMu
    reach: float

    def __len__(self) -> int:
        return len(self.points)

    def __getitem__(self, rows: slice) -> Moments:
        first, last, _ = rows.indices(len(self))
        corners, normals, axes = self.faces
        faces = FaceArrays(corners[rows], normals[rows], axes[rows])
        return replace(self, faces=faces, samples=self.samples.of_faces(first, last), points=self.points[rows])

    @property
    def name(self) -> bytes:
        digest = hashlib.blake2b(repr((self.asked, int(self.key))).encode(), digest_size=16)
        digest.update(np.ascontiguousarray(self.points).data)
        return digest.digest()

    @property
    def rays(self) -> float:
        count = int(self.samples.starts[-1] - self.samples.starts[0])
        return self.rays_of_sample * count / max(len(self), 1)

    @property
    def block(self) -> int:
        return max(int(_BLOCK_RAYS / max(self.rays, 1e-9)), 1)

    def tables(self) -> Tables:
        return np.zeros((len(self), MOMENTS)), np.zeros((len(self), 3), np.int64)

    def writer(self, scene: RayScene, tables: Tables) -> Callable[[int, int], None]:
        embree, lattices = scene.embree(), Lattices.of(self.rays_of_sample, self.key)
        moments, counts = tables

        def write(first: int, last: int) -> None:
            some = self[first:last]
            packet, found = RayPacket.of(embree, scene.opacity), (moments[first:last], counts[first:last])
            gather_faces(packet, some.faces, some.samples, lattices, self.mu, self.reach, *found)

        return write


def gather_moments(prepared: Prepared, patch: Patch) -> tuple[Float64s, Int64s]:
    """Moments (m, 29) and counts (m, 3) of the faces of `patch`, see `gather_faces`."""
    placement, checkpoint = prepared.placement, prepared.checkpoint
    samples, key, progress = prepared.options.rays, prepared.key, prepared.progress
    if not len(patch.face_points):
        return np.zeros((0, MOMENTS)), np.zeros((0, 3), np.int64)
    rays = int(np.clip(samples // 2 // LANES * LANES, LANES, _MOST_RAYS))
    count = max(samples * len(np.unique(patch.face_points)) // rays, 1)
    shift = float(np.ldexp(mix_array([key])[0], -32))
    faces = FaceArrays(patch.corners, patch.normals, patch.axes)
    mu = prepared.mu.in_render_space(placement.scale)
    spread = Samples.spread(patch.areas, count, shift)
    work = Moments(faces, spread, patch.face_points, rays, samples, key, mu, placement.diagonal)
    tables = work.tables()
    done = 0

    def advance(finished: int) -> None:
        nonlocal done
        done += finished
        if progress:
            progress(count * rays * done // len(work), count * rays)

    (checkpoint.fill if checkpoint else fill)(work, prepared.scene, tables, prepared.threads, advance)
    if checkpoint:
        checkpoint.all_traced()
    moments, counts = tables
    return moments, counts


def reveal_interiors(patch: Patch, moments: Float64s, counts: Int64s) -> None:
    """Give samples their full weight again, in place, on faces of which no vertex has a visible sample.

    Elsewhere hidden samples count next to nothing beside the visible ones of the same vertex. A room whose walls face
    outwards has none but hidden ones.
    """
    seen, face_points = np.zeros(patch.unknowns, np.bool_), patch.face_points
    seen[face_points[counts[:, SEEN] > 0]] = True
    interior = ~(seen[face_points[:, 0]] | seen[face_points[:, 1]] | seen[face_points[:, 2]])
    moments[interior] /= HIDDEN
