"""Gathering at many points: blocks of work on threads, the same bits for any number of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from raytrace.embree import TriangleScene, new_packet
from raytrace.parallel import run_blocks
from raytrace.placement import Placement

from .falloff import Mu
from .hemisphere import DirectionTable, gather
from .receivers import Points

_BLOCK_RAYS = 1 << 19

Progress = Callable[[int, int], None]


@dataclass(eq=False)
class Tracer:
    """A scene to gather in.

    Attributes:
        scene, placement: the mesh in Embree and where it is. mu: the falloff, in mesh units. threads: how many.
        crowd: points of the whole mesh, wanted or not.
        progress: called with (rays traced, rays expected in all).
        expected: rays expected in all; whoever plans the work adds to it. rays: rays traced.
    """

    scene: TriangleScene
    placement: Placement
    mu: Mu
    threads: int
    crowd: int
    progress: Progress | None = None
    expected: int = 0
    rays: int = 0

    def gather(self, points: Points, samples: int, key: np.uint32) -> npt.NDArray[np.float64]:
        """Rows (k, 5) of `ao.hemisphere.gather` for `points` with `samples` rays each, directions drawn by `key`."""
        table = DirectionTable.make(samples, self.crowd, key)
        out = np.empty((len(points), 5))
        tau = (self.mu.tau or 0.0) / self.placement.scale
        limit = self.mu.max_distance * self.placement.scale
        reach = min(limit, self.placement.diagonal)

        def work(first: int, last: int) -> None:
            some = points[first:last]
            gather(
                self.scene.handle, *new_packet(), some.origins, some.normals, some.numbers,
                table.directions, table.batches, table.mean, table.key, tau, reach, limit, out[first:last],
            )  # fmt: skip

        run_blocks(len(out), max(_BLOCK_RAYS // samples, 1), work, self.threads, lambda n: self._advance(n * samples))
        return out

    def _advance(self, rays: int) -> None:
        self.rays += rays
        if self.progress:
            self.progress(self.rays, max(self.rays, self.expected))
