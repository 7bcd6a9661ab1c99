"""Gathering at many points, in blocks on threads, with the same bits for any number of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from raytrace.embree.scene import TriangleScene
from raytrace.mesh.placement import Placement
from raytrace.system.threads import run_blocks
from raytrace.types import Float64s

from ..falloff import Mu
from ..gather.directions import DirectionTable
from ..gather.hemisphere import COLUMNS, gather_hemispheres
from ..gather.points import Points
from ..gather.ray_packet import RayPacket
from ..skip.horizon import NO_HORIZONS, Horizons
from .checkpoint import Checkpoint

_BLOCK_RAYS, _LEAST_RAYS = 1 << 19, 1 << 13  # of a block of work
_BLOCKS = 32  # at least, if they are not too small: for threads to share evenly

Progress = Callable[[int, int], None]


@dataclass(eq=False)
class Tracer:
    """A scene in which hemispheres are gathered.

    Attributes:
        scene, placement: the mesh in Embree and where it is. mu: the falloff, in mesh units. threads: how many.
        total_points: how many points the whole mesh has, wanted or not.
        horizons: finds rays that need no tracing, or None.
        progress: called with (rays traced, rays expected in all). checkpoint: keeps traced rows, or None.
        expected: rays expected in all, 0 while none are planned. later: besides, of corners. rays: rays asked
            for. skipped: those of them that were not traced, now or by the run whose rows were copied.
    """

    scene: TriangleScene
    placement: Placement
    mu: Mu
    threads: int
    total_points: int
    horizons: Horizons | None = None
    progress: Progress | None = None
    checkpoint: Checkpoint | None = None
    expected: int = 0
    later: int = 0
    rays: int = 0
    skipped: int = 0
    _last: DirectionTable | None = None

    def gather(self, points: Points, samples: int, key: np.uint32) -> Float64s:
        """Rows (k, COLUMNS) of `gather_hemispheres`: of `points`, by `samples` rays each, directions drawn by `key`."""
        table = self._table(samples, key)
        out, traced = np.empty((len(points), COLUMNS)), np.empty(len(points), np.uint32)
        mu = self.mu.in_render_space(self.placement.scale)
        reach = min(mu.limit, self.placement.diagonal)
        horizons = self.horizons if self.horizons and self.horizons.pay(points, table) else None
        checkpoint = self.checkpoint
        call = checkpoint.call(points.numbers, samples, key) if checkpoint else b""

        def work(first: int, last: int) -> None:
            if checkpoint and checkpoint.copy(call, first, out[first:last], traced[first:last]):
                return
            some = points[first:last]
            slopes = horizons.above(some, table) if horizons else NO_HORIZONS
            packet = RayPacket.of(self.scene)
            gather_hemispheres(packet, some.arrays, table, mu, reach, slopes, traced[first:last], out[first:last])
            if checkpoint:
                checkpoint.add(call, first, out[first:last], traced[first:last])

        rays = min(max(len(points) * samples // _BLOCKS, _LEAST_RAYS), _BLOCK_RAYS)  # whatever the number of threads
        run_blocks(len(out), max(rays // samples, 1), work, self.threads, lambda n: self._advance(n * samples))
        self.skipped += len(points) * samples - int(np.sum(traced, dtype=np.int64))
        return out

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
