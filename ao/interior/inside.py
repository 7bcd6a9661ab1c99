"""Vertices inside a solid: those that see the backs of faces, where the faces of closed solids look outwards."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from raytrace.embree.packets import (
    DIR_X,
    DIR_Y,
    DIR_Z,
    GEOM_ID,
    INVALID,
    LANES,
    NG_X,
    NG_Y,
    NG_Z,
    PRIM_ID,
    intersect8,
    new_packet,
)
from raytrace.embree.scene import TriangleScene
from raytrace.kernel.borrow import borrow
from raytrace.kernel.jit import kernel
from raytrace.system.threads import run_blocks

from ..denoise.one_ring import Neighbours
from ..denoise.upsampling import coarsened, nearest_baked, upsample
from ..gather.directions import DirectionTable, choose, turned_frame
from ..gather.ray_packet import aim, start_from
from ..gather.receivers import Points, Receivers
from .closed_parts import closed_parts, inside_boxes

RAYS = 32
_KEY = np.uint32(0x51DE)
_BLOCK = 1 << 8  # points


def inside_other_parts(
    receivers: Receivers, vertices: npt.NDArray[np.float32], reach: float, crowd: int, threads: int
) -> npt.NDArray[np.bool_]:
    """Whether each of the receivers' points is hidden (k,) in a closed part that it does not belong to.

    Args: vertices: float32 (n, 3), placed. reach, crowd: as `hidden_points`.
    """
    points, faces = receivers.points, receivers.faces
    inside = np.zeros(len(points), np.bool_)
    part, closed = closed_parts(vertices, faces)
    if not closed.any() or not len(points):
        return inside
    own = part[receivers.first_vertex]
    rows = inside_boxes(points.origins, own, vertices, part, closed)
    if len(rows):
        solid = np.where(closed[part], part, -1)[faces[:, 0]]
        inside[rows] = hidden_points(receivers.scene, points[rows], reach, crowd, threads, solid, own[rows])
    return inside


def hidden_points(
    scene: TriangleScene,
    points: Points,
    reach: float,
    crowd: int,
    threads: int,
    part: npt.NDArray[np.int64],
    own: npt.NDArray[np.int64],
) -> npt.NDArray[np.bool_]:
    """Whether each point is hidden (k,): more than half of its `RAYS` rays end on the back of a face.

    Every bake of a mesh says the same, whatever its seed and whichever vertices it is asked for.

    Args:
        reach: length of the rays, in placed units. crowd: points of the whole mesh.
        part: (m,), the part of each face of the scene, −1 if its back hides nothing. own: (k,), that of each point,
            whose backs don't hide it.
    """
    table = DirectionTable.make(RAYS, crowd, _KEY)
    hidden = np.empty(len(points), np.bool_)

    def work(first: int, last: int) -> None:
        some = points[first:last]
        _look(
            scene.handle, *new_packet(), some.origins, some.normals, some.numbers, table.directions, table.key, reach,
            part, own[first:last], hidden[first:last],
        )  # fmt: skip

    run_blocks(len(points), _BLOCK, work, threads)
    return hidden


@dataclass(frozen=True, eq=False)
class Fill:
    """How points that are not traced get values from those nearest along the surface that are.

    Attributes:
        traced: bool (k,). points: all of them. near, cell: `ao.denoise.upsampling.coarsened` of the traced ones.
    """

    traced: npt.NDArray[np.bool_]
    points: Points
    near: Neighbours
    cell: npt.NDArray[np.int32]

    @classmethod
    def of(cls, points: Points, neighbours: Neighbours, inside: npt.NDArray[np.bool_]) -> Fill:
        """Those `inside` (k,) are not traced, unless no path of edges leads out."""
        owner = nearest_baked(neighbours, ~inside)
        alone = owner < 0
        owner[alone] = np.flatnonzero(alone)
        near, _, cell = coarsened(neighbours, owner, points.normals)
        return cls(~inside | alone, points, near, cell)

    @property
    def sources(self) -> npt.NDArray[np.bool_]:
        """The traced points (b,) from which others are upsampled: their nearest, and the neighbours of these."""
        owning = np.zeros(len(self.near.starts) - 1, np.bool_)
        owning[self.cell[~self.traced]] = True
        sources = owning.copy()
        sources[self.near.others[np.repeat(owning, np.diff(self.near.starts))]] = True
        return sources

    def extrapolate(self, known: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """Rows (k, c) of all points, by planes that are followed for about one edge: farther on, noise would grow.

        Args: known: (b, c), the rows of the traced points, the last column their variance.
        """
        traced, valence = np.flatnonzero(self.traced), np.diff(self.near.starts)
        places = self.points.origins.astype(np.float64)
        here = np.repeat(np.arange(len(traced)), valence)
        lengths = np.linalg.norm(places[traced[self.near.others]] - places[traced[here]], axis=1)
        edge = np.bincount(here, lengths, len(traced)) / np.maximum(valence, 1)
        owner = places[traced[self.cell]]
        away = places - owner
        distance = np.maximum(np.linalg.norm(away, axis=1), 1e-30)
        away *= np.minimum(1.0, edge[self.cell] / distance)[:, None]
        moved = replace(self.points, origins=(owner + away).astype(np.float32))
        every = np.arange(len(places))
        return upsample(moved, every, self.near, traced, self.cell, np.ascontiguousarray(known), variances=1)


@kernel
def _look(scene, packet, valid, origins, normals, numbers, directions, key, reach, part, own, hidden):
    """Whether over half of each point's rays end on the back of a face, bool (n,); no more are traced than decide."""
    packet, valid, origins, normals = borrow(packet), borrow(valid), borrow(origins), borrow(normals)
    directions, part, own, hidden = borrow(directions), borrow(part), borrow(own), borrow(hidden)
    sets, _, samples = directions.shape
    ids = packet.view(np.uint32)
    for i in range(len(origins)):
        chosen, turn = choose(numbers[i], key, sets)
        n = normals[i]
        t, b = turned_frame(n, turn)
        local = directions[chosen]
        start_from(packet, origins[i])
        count = 0
        for first in range(0, samples, LANES):
            if 2 * count > samples or 2 * (count + samples - first) <= samples:
                break
            aim(packet, local, first, t, b, n, reach)
            intersect8(scene, packet, valid)
            for lane in range(LANES):
                if ids[GEOM_ID, lane] == INVALID:
                    continue
                solid = part[ids[PRIM_ID, lane]]
                if solid >= 0 and solid != own[i]:
                    along = packet[DIR_X, lane] * packet[NG_X, lane] + packet[DIR_Y, lane] * packet[NG_Y, lane]
                    count += along + packet[DIR_Z, lane] * packet[NG_Z, lane] > 0.0
        hidden[i] = 2 * count > samples
