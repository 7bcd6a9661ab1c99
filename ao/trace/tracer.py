"""Gathering at many points, in blocks on threads, with the same bits for any number of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from raytrace.bvh.bvh16 import BVH16
from raytrace.embree.scene import TriangleScene
from raytrace.mesh.placement import Placement
from raytrace.system.threads import run_blocks
from raytrace.types import Float64s

from ..falloff import Mu
from ..gather.directions import DirectionTable
from ..gather.estimate import COLUMNS
from ..gather.hemisphere import gather_hemispheres
from ..gather.points import Points
from ..gather.ray_packet import RayPacket
from ..stream.gather_streams import gather_streams
from ..stream.rays import Rays
from ..stream.walk import Walk
from .checkpoint import Checkpoint

_BLOCK_RAYS, _LEAST_RAYS = 1 << 19, 1 << 13  # of a block of work
_BLOCKS = 32  # at least, if they are not too small: for threads to share evenly

Progress = Callable[[int, int], None]


@dataclass(eq=False)
class Tracer:
    """A scene in which hemispheres are gathered.

    Attributes:
        embree: builds the mesh in Embree. tree: over the mesh. packets_below: fewer rays a point than this are traced
            by Embree, others walk the tree.
        placement: where it is. mu: the falloff, in mesh units. threads: how many.
        total_points: how many points the whole mesh has, wanted or not.
        progress: called with (rays traced, rays expected in all). checkpoint: keeps traced rows, or None.
        expected: rays expected in all, 0 while none are planned. later: besides, of corners. rays: rays traced.
    """

    embree: Callable[[], TriangleScene]
    tree: BVH16
    packets_below: int
    placement: Placement
    mu: Mu
    threads: int
    total_points: int
    progress: Progress | None = None
    checkpoint: Checkpoint | None = None
    expected: int = 0
    later: int = 0
    rays: int = 0
    _last: DirectionTable | None = None

    def gather(self, points: Points, samples: int, key: np.uint32) -> Float64s:
        """Rows (k, COLUMNS) of `gather_hemispheres`: of `points`, by `samples` rays each, directions drawn by `key`."""
        return self._gather(points, self._table(samples, key))

    def _gather(self, points: Points, table: DirectionTable) -> Float64s:
        samples, key = table.samples, table.key
        out = np.empty((len(points), COLUMNS))
        gather = self._gatherer(table)
        checkpoint = self.checkpoint
        call = checkpoint.call(points.numbers, samples, key) if checkpoint else b""

        def work(first: int, last: int) -> None:
            if checkpoint and checkpoint.copy(call, first, out[first:last]):
                return
            gather(points[first:last], out[first:last])
            if checkpoint:
                checkpoint.add(call, first, out[first:last])

        rays = min(max(len(points) * samples // _BLOCKS, _LEAST_RAYS), _BLOCK_RAYS)  # whatever the number of threads
        run_blocks(len(out), max(rays // samples, 1), work, self.threads, lambda n: self._advance(n * samples))
        return out

    def _gatherer(self, table: DirectionTable) -> Callable[[Points, Float64s], None]:
        """A function that writes the rows of points, to be called from any thread."""
        mu = self.mu.in_render_space(self.placement.scale)
        reach = min(mu.limit, self.placement.diagonal)
        if table.samples < self.packets_below:
            scene = self.embree()

            def by_packets(points: Points, out: Float64s) -> None:
                gather_hemispheres(RayPacket.of(scene), points.arrays, table, mu, reach, out)

            return by_packets
        tree = self.tree

        def by_streams(points: Points, out: Float64s) -> None:
            gather_streams(tree, Rays.of(table), Walk.of(tree), points.arrays, table, mu, reach, out)

        return by_streams

    def _table(self, samples: int, key: np.uint32) -> DirectionTable:
        """The last table again if it is the same."""
        if self._last is None or (self._last.samples, self._last.key) != (samples, key):
            self._last = DirectionTable.make(samples, self.total_points, key)
        return self._last

    def _advance(self, rays: int) -> None:
        self.rays += rays
        if self.checkpoint:
            self.checkpoint.save()
        if self.progress and self.expected:
            self.progress(self.rays, max(self.rays, self.expected + self.later))
