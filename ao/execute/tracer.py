"""Gathering at many points, in blocks on threads, with the same bits for any number of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from raytrace.types import Float64s

from ..mu import KernelMu
from ..points.points import Points
from ..rays.ray_scene import RayScene
from .checkpoint import NOTHING_KEPT, Checkpoint
from .hemispheres import Hemispheres

Progress = Callable[[int, int], None]


@dataclass(eq=False)
class Tracer:
    """Gathers hemispheres in a scene.

    Attributes:
        scene: what is traced. packets_below: points with fewer rays are traced by Embree, else by `ao.rays.traverse`.
        mu: the falloff, in render space. t_max: length of rays there. threads: how many.
        total_points: how many points the whole mesh has, wanted or not.
        progress: called with (rays traced, rays expected in all). checkpoint: of traced rows.
        expected: rays expected in all, 0 while none are planned. later: besides, of corners. rays: rays traced.
    """

    scene: RayScene
    packets_below: int
    mu: KernelMu
    t_max: float
    threads: int
    total_points: int
    progress: Progress | None = None
    checkpoint: Checkpoint = NOTHING_KEPT
    expected: int = 0
    later: int = 0
    rays: int = 0

    def gather(self, points: Points, samples: int, key: np.uint32) -> Float64s:
        """Rows (k, COLUMNS) of `gather_hemispheres`: of `points`, by `samples` rays each, directions drawn by `key`."""
        return self._gather(points, samples, key, 1)

    def _gather(self, points: Points, samples: int, key: np.uint32, leap: int) -> Float64s:
        """`gather` by leaped lattices, see `DirectionTable`."""
        work = Hemispheres(points, samples, key, self.total_points, self.mu, self.t_max, self.packets_below, leap)
        tables = work.tables()
        self.checkpoint.fill(work, self.scene, tables, self.threads, lambda rows: self._advance(rows * samples))
        return tables[0]

    def _advance(self, rays: int) -> None:
        self.rays += rays
        if self.progress and self.expected:
            self.progress(self.rays, max(self.rays, self.expected + self.later))
