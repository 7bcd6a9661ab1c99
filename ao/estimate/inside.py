"""Vertices inside a solid: found by the backs of faces that they see, and given the values of the nearest outside."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from raytrace.embree.packets import DIR_X, GEOM_ID, INVALID, LANES, NG_X, PRIM_ID, intersect8
from raytrace.kernel.arrays import borrow
from raytrace.kernel.jit import kernel
from raytrace.mesh.placement import Placement
from raytrace.system.threads import run_blocks
from raytrace.types import AnyInts, Bools, Float32s, Float64s, Int32s, Int64s

from ..options import Interior
from ..points.points import Points
from ..points.receivers import Receivers
from ..rays.directions import DirectionTable, choose, turned_frame
from ..rays.ray_packet import RayPacket, aim, start_from
from .closed_parts import closed_parts, inside_boxes
from .one_ring import Neighbours
from .upsampling import coarsened, nearest_baked, upsample

RAYS = 16
_KEY = np.uint32(0x51DE)
_BLOCK, _MOST = 1 << 7, 16  # points, and blocks at once
_sought: WeakKeyDictionary[Receivers, tuple[Int64s, Bools]] = WeakKeyDictionary()


class Solids(NamedTuple):
    """Faces whose backs hide points.

    Attributes:
        of_face: int64 (m,), the part of each face of the scene, −1 if its back hides nothing.
        of_point: int64 (k,), the part of each point, which does not hide it.
    """

    of_face: Int64s
    of_point: Int64s


def inside_solids(
    points: Points,
    vertex: AnyInts,
    placement: Placement,
    receivers: Receivers,
    interior: Interior,
    threads: int,
    total_points: int | None = None,
) -> Bools:
    """The points (k,) that are inside a solid as the option `interior` defines it.

    Args:
        vertex: (k,), a vertex of the part that each point belongs to.
        total_points: of the whole mesh; None: k.
    """
    inside = np.zeros(len(points), np.bool_)
    total = len(points) if total_points is None else total_points
    if interior == "ignore" or not len(points):
        return inside
    if interior != "auto":
        solids, rows = _any_back(receivers, len(points)), np.arange(len(points))
        return _hidden_points(points, rows, solids, placement, receivers, total, threads)
    part, closed = _closed_parts(placement.vertices, receivers)
    if not closed.any():
        return inside
    own = part[vertex]
    rows = inside_boxes(points.origins, own, placement.vertices, part, closed, threads)
    if len(rows):
        solids = Solids(np.where(closed[part], part, -1)[receivers.faces[:, 0]], own)
        inside[rows] = _hidden_points(points, rows, solids, placement, receivers, total, threads)
    return inside


def _any_back(receivers: Receivers, count: int) -> Solids:
    """Solids that the backs of all opaque faces bound, for `count` points."""
    of_face = np.zeros(len(receivers.faces), np.int64)
    if receivers.opacity:
        of_face[receivers.opacity.of >= 0] = -1
    return Solids(of_face, np.full(count, -1))


def _closed_parts(vertices: Float32s, receivers: Receivers) -> tuple[Int64s, Bools]:
    """`closed_parts`, sought once for the same receivers; parts that have faces with alpha are open."""
    if receivers not in _sought:
        point, rest = receivers.of_vertex, np.flatnonzero(receivers.of_vertex < 0)  # welded vertices count once
        number = point.copy()
        number[rest] = np.arange(len(receivers.points), len(receivers.points) + len(rest))
        if len(receivers.points) + len(rest) == len(number):  # no two vertices are one point
            part, closed = closed_parts(vertices, receivers.faces)
        else:
            part, closed = closed_parts(vertices[np.append(receivers.first_vertex, rest)], number[receivers.faces])
            part = part[number]
        if receivers.opacity:
            closed[part[receivers.faces[receivers.opacity.of >= 0]]] = False
        _sought[receivers] = part, closed
    return _sought[receivers]


def _hidden_points(
    points: Points,
    rows: Int64s,
    solids: Solids,
    placement: Placement,
    receivers: Receivers,
    total_points: int,
    threads: int,
) -> Bools:
    """Whether each point in `rows` (k,) is hidden: more than half of its `RAYS` rays end on the back of a face.

    Every bake of a mesh agrees, whatever its seed and whichever vertices it is asked for.
    """
    scene, reach = receivers.embree(), placement.diagonal
    table = DirectionTable.make(RAYS, total_points, _KEY)
    hidden = np.empty(len(rows), np.bool_)

    def work(first: int, last: int) -> None:
        some = rows[first:last]
        subset = Solids(solids.of_face, solids.of_point[some])
        _find_hidden(RayPacket.of(scene), points[some].arrays, table, subset, reach, hidden[first:last])

    run_blocks(len(rows), _BLOCK, work, threads, most=_MOST)
    return hidden


@kernel
def _find_hidden(packet, points, table, solids, reach, hidden):
    """Whether over half of each point's rays end on the back of a face, bool (n,); no more are traced than decide."""
    packet, points, table = borrow(packet), borrow(points), borrow(table)
    solids, hidden = borrow(solids), borrow(hidden)
    rays, directions = packet.rays, table.directions
    samples = directions.shape[2]
    ids = rays.view(np.uint32)
    for i in range(len(points.origins)):
        chosen, turn = choose(points.numbers[i], table)
        n = points.normals[i]
        t, b = turned_frame(n, turn)
        start_from(rays, points.origins[i])
        count = np.int64(0)
        for first in range(0, samples, LANES):
            if 2 * count > samples or 2 * (count + samples - first) <= samples:
                break
            aim(rays, directions[chosen], first, t, b, n, reach)
            intersect8(packet.scene, rays, packet.valid)
            for lane in range(LANES):
                if ids[GEOM_ID, lane] == INVALID:
                    continue
                part = solids.of_face[ids[PRIM_ID, lane]]
                if part >= 0 and part != solids.of_point[i]:
                    along = np.float32(0.0)
                    for axis in range(3):
                        along += rays[DIR_X + axis, lane] * rays[NG_X + axis, lane]
                    count += along > 0.0
        hidden[i] = 2 * count > samples


@dataclass(frozen=True, eq=False)
class Extrapolation:
    """Extrapolates the values of points that are not traced from the traced points nearest along the surface.

    Attributes:
        traced: bool (k,). points: all points. graph, cell: `ao.estimate.upsampling.coarsened` of the traced points.
    """

    traced: Bools
    points: Points
    graph: Neighbours
    cell: Int32s

    @classmethod
    def of(cls, points: Points, neighbours: Neighbours, inside: Bools) -> Extrapolation:
        """Points `inside` (k,) are not traced, unless no path of edges leads out."""
        nearest = nearest_baked(neighbours, ~inside)
        alone = nearest < 0
        nearest[alone] = np.flatnonzero(alone)
        graph, _, cell = coarsened(neighbours, nearest, points.normals)
        return cls(~inside | alone, points, graph, cell)

    @property
    def sources(self) -> Bools:
        """The traced points (b,) that values are extrapolated from: the nearest ones, and their neighbours."""
        nearest = np.zeros(len(self.graph.starts) - 1, np.bool_)
        nearest[self.cell[~self.traced]] = True
        sources = nearest.copy()
        sources[self.graph.indices[np.repeat(nearest, np.diff(self.graph.starts))]] = True
        return sources

    def extrapolate(self, known: Float64s) -> Float64s:
        """Rows (k, c) of all points, by planes that are extrapolated one edge at most: farther on, noise would grow.

        Args: known: (b, c), the rows of the traced points, the last column their variance.
        """
        traced, filled = np.flatnonzero(self.traced), np.flatnonzero(~self.traced)
        positions, valence = self.points.origins.astype(np.float64), np.diff(self.graph.starts)
        cell, needed = self.cell[filled], np.zeros(len(traced), np.bool_)
        needed[cell] = True
        here, ends = np.repeat(np.flatnonzero(needed), valence[needed]), self.graph.indices[np.repeat(needed, valence)]
        lengths = np.linalg.norm(positions[traced[ends]] - positions[traced[here]], axis=1)
        edge = np.bincount(here, lengths, len(traced)) / np.maximum(valence, 1)
        nearest = positions[traced[cell]]
        away = positions[filled] - nearest
        distance = np.maximum(np.linalg.norm(away, axis=1), 1e-30)
        away *= np.minimum(1.0, edge[cell] / distance)[:, None]
        moved = replace(self.points, origins=self.points.origins.copy())
        moved.origins[filled] = nearest + away
        rows, known = np.empty((len(positions), known.shape[1])), np.ascontiguousarray(known)
        rows[traced], rows[filled] = known, upsample(moved, filled, self.graph, traced, self.cell, known, variances=1)
        return rows
