"""The faces over which w is fitted, and the gathering of their moments, block by block."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from raytrace.embree.packets import LANES
from raytrace.mesh.normals import face_normals
from raytrace.mesh.placement import Placement
from raytrace.sampling.hash import mix_array
from raytrace.system.threads import run_blocks
from raytrace.types import Bools, Float32s, Float64s, Int32s, Int64s

from ..gather.morton import fine_morton_order
from ..gather.ray_packet import RayPacket
from ..gather.receivers import Receivers
from ..prepared import Prepared
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


def gather_moments(prepared: Prepared, patch: Patch) -> tuple[Float64s, Int64s]:
    """Moments (m, 29) and counts (m, 3) of the faces of `patch`, see `gather_faces`."""
    placement, checkpoint = prepared.placement, prepared.checkpoint
    samples, key, progress = prepared.options.rays, prepared.key, prepared.progress
    moments, counts = np.zeros((len(patch.face_points), MOMENTS)), np.zeros((len(patch.face_points), 3), np.int64)
    if not len(patch.face_points):
        return moments, counts
    rays = int(np.clip(samples // 2 // LANES * LANES, LANES, _MOST_RAYS))
    count = max(samples * len(np.unique(patch.face_points)) // rays, 1)
    spread = Samples.spread(patch.areas, count, float(np.ldexp(mix_array([key])[0], -32)))
    lattices = Lattices.of(rays, key)
    mu = prepared.mu.in_render_space(placement.scale)
    call = checkpoint.call(patch.face_points, samples, key) if checkpoint else b""
    scene = prepared.receivers.embree()
    done = 0

    def work(a: int, b: int) -> None:
        if checkpoint and checkpoint.copy(call, a, moments[a:b], counts[a:b]):
            return
        packet = RayPacket.of(scene)
        faces = FaceArrays(patch.corners[a:b], patch.normals[a:b], patch.axes[a:b])
        reach = placement.diagonal
        gather_faces(packet, faces, spread.of_faces(a, b), lattices, mu, reach, moments[a:b], counts[a:b])
        if checkpoint:
            checkpoint.add(call, a, moments[a:b], counts[a:b])

    def advance(faces: int) -> None:
        nonlocal done
        done += faces
        if checkpoint:
            checkpoint.save()
        if progress:
            progress(count * rays * done // len(moments), count * rays)

    run_blocks(len(moments), max(len(moments) * _BLOCK_RAYS // (count * rays), 1), work, prepared.threads, advance)
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
