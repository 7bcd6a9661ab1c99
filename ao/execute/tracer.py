"""Gathering at many points, in blocks on threads, with the same bits for any number of them."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np

from raytrace.types import Bools, Float64s, Int64s

from ..mu import KernelMu
from ..points.points import Points
from ..rays.estimator import COLUMNS
from ..rays.ray_scene import RayScene
from .checkpoint import NOTHING_KEPT, Checkpoint
from .hemisphere_work import Hemispheres

Progress = Callable[[int, int], None]
T = TypeVar("T")


class _Rows:
    """Rows (k, c, COLUMNS) of points by their numbers, which ascend."""

    def __init__(self) -> None:
        self._numbers, self._rows = np.zeros(0, np.int64), np.zeros((0, 0, COLUMNS))

    def _places(self, points: Points) -> Int64s:
        if np.array_equal(self._numbers, points.numbers):
            return np.arange(len(points))
        return np.searchsorted(self._numbers, points.numbers)

    def missing(self, points: Points) -> Bools:
        """Which of `points` have none, bool (k,)."""
        return np.append(self._numbers, -1)[self._places(points)] != points.numbers

    def of(self, points: Points, column: int) -> Float64s:
        """Rows (k, COLUMNS) of `points`."""
        return self._rows[self._places(points), column]

    def add(self, points: Points, rows: Float64s) -> None:
        numbers = np.append(self._numbers, points.numbers.astype(np.int64))
        rows = np.concatenate([self._rows, rows]) if len(self._rows) else rows
        order = np.argsort(numbers, kind="stable")
        kept = bool((np.diff(order) > 0).all())
        self._numbers, self._rows = (numbers, rows) if kept else (numbers[order], rows[order])


@dataclass(eq=False)
class Tracer:
    """Gathers hemispheres in a scene.

    Attributes:
        scene: what is traced. packets_below: points with fewer rays are traced by Embree, else by `ao.rays.traverse`.
        mu: the falloff, in render space. t_max: length of rays there. threads: how many.
        total_points: how many points the whole mesh has, wanted or not.
        progress: called with (rays traced, rays expected in all). checkpoint: of traced rows.
        expected: rays expected in all, 0 while none are planned. later: besides, of corners. rays: rays traced.
        column: of several falloffs the one whose rows are gathered. planned: rays a point that suit all of them.
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
    column: int = 0
    planned: int = 0
    _traced: dict[tuple[int, int], _Rows] = field(default_factory=dict)

    def gather(self, points: Points, samples: int, key: np.uint32) -> Float64s:
        """Rows (k, COLUMNS) of `gather_hemispheres`: of `points`, by `samples` rays each, directions drawn by `key`."""
        if self.mu.columns is None:
            return self._trace(points, samples, key)
        rows = self._traced.setdefault((samples, int(key)), _Rows())
        missing = rows.missing(points)
        if missing.any():
            rows.add(points[missing], self._trace(points[missing], samples, key))
        return rows.of(points, self.column)

    def each_column(self, estimate: Callable[[], T]) -> list[T]:
        """What `estimate` returns for each falloff in turn; what one of them has traced is there for the next."""
        found, before = [], self.column
        for column in range(*(self.mu.shape or (1,))):
            self.column = column
            found.append(estimate())
        self.column = before
        return found

    def _trace(self, points: Points, samples: int, key: np.uint32) -> Float64s:
        """Rows (k, COLUMNS), or with several falloffs (k, c, COLUMNS)."""
        return self._gather(points, samples, key, 1)

    def _gather(self, points: Points, samples: int, key: np.uint32, leap: int) -> Float64s:
        """`_trace` by leaped lattices, see `DirectionTable`."""
        work = Hemispheres(points, samples, key, self.total_points, self.mu, self.t_max, self.packets_below, leap)
        tables = work.tables()
        self.checkpoint.fill(work, self.scene, tables, self.threads, lambda rows: self._advance(rows * samples))
        return tables[0]

    def _advance(self, rays: int) -> None:
        self.rays += rays
        if self.progress and self.expected:
            self.progress(self.rays, max(self.rays, self.expected + self.later))
