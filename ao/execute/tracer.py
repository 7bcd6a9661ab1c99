"""Gathering hemispheres at many points, in blocks on threads or by other processes, with the same bits for any."""

import hashlib
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import ClassVar, Self, TypeVar

import numpy as np

from raytrace.types import Bools, Float64s, Int64s

from ..mu import KernelMu
from ..points.points import Points
from ..rays.gather import COLUMNS, gather_hemispheres, gather_streams
from ..rays.layers import Layers
from ..rays.ray_blocks import Rays
from ..rays.ray_packet import RayPacket
from ..rays.ray_scene import RayScene
from ..rays.traverse import TraversalState
from .checkpoint import NOTHING_KEPT, Checkpoint
from .work import Tables

Progress = Callable[[int, int], None]
T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class Hemispheres:
    """Hemispheres to be gathered.

    Attributes:
        points: where. samples: rays of each. key: by which directions are drawn.
        total_points: how many points the whole mesh has, wanted or not.
        mu: the falloff, in render space. t_max: length of rays there.
        packets_below: points with fewer rays are traced by Embree, else by `ao.rays.traverse`.
        leap: how many points share a lattice of directions.
    """

    points: Points
    samples: int
    key: np.uint32
    total_points: int
    mu: KernelMu
    t_max: float
    packets_below: int
    leap: int = 1
    block_rays: ClassVar = 1 << 11

    def __len__(self) -> int:
        return len(self.points)

    def __getitem__(self, rows: slice) -> Self:
        return replace(self, points=self.points[rows])

    @property
    def name(self) -> bytes:
        digest = hashlib.blake2b(repr((self.samples, int(self.key), self.leap)).encode(), digest_size=16)
        digest.update(np.ascontiguousarray(self.points.numbers).data)
        return digest.digest()

    @property
    def rays(self) -> float:
        return self.samples

    def tables(self) -> Tables:
        return (np.zeros((len(self), *self.mu.shape, COLUMNS)),)

    def writer(self, scene: RayScene, tables: Tables) -> Callable[[int, int], None]:
        table = scene.table(self.samples, self.total_points, self.key, self.leap)
        points, mu, t_max = self.points, self.mu, self.t_max
        out = tables[0].reshape(-1, *(mu.shape or (1,)), COLUMNS)
        if self.samples < self.packets_below:
            embree = scene.embree()

            def by_packets(first: int, last: int) -> None:
                packet, subset = RayPacket.of(embree, scene.opacity), points[first:last].arrays
                if mu.columns is None or scene.opacity is None:
                    gather_hemispheres(packet, subset, table, mu, t_max, out[first:last])
                else:  # to check the other traversal, without haste
                    for column, each in enumerate(mu.columns.each()):
                        rows = np.empty((last - first, 1, COLUMNS))
                        gather_hemispheres(packet, subset, table, each, min(t_max, each.limit), rows)
                        out[first:last, column] = rows[:, 0]

            return by_packets
        tree, idle = scene.tree, deque[tuple[Rays, TraversalState]]()  # as many at most as threads

        def by_streams(first: int, last: int) -> None:
            subset = points[first:last].arrays
            try:
                rays, state = idle.pop()
            except IndexError:
                rays = Rays.of(table)
                state = TraversalState.of(tree, Layers.of(scene.opacity, rays.t_hit.size, mu))
            gather_streams(tree, rays, state, subset, table, mu, t_max, out[first:last])
            idle.append((rays, state))

        return by_streams


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
