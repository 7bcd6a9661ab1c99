"""Gathering hemispheres at many points, in blocks on threads or by other processes, with the same bits for any."""

import hashlib
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Protocol, Self, TypeVar

import numpy as np

from obscurance.raytrace.types import Float64s, Int64s

from ..mu import KernelMu
from ..points.points import Points
from ..rays.directions import DirectionTable
from ..rays.gather import COLUMNS, gather_hemispheres
from ..rays.layers import AlphaHits
from ..rays.ray_blocks import Rays
from ..rays.ray_scene import RayScene
from ..rays.traverse import TraversalState
from .kept import NOTHING_KEPT, Kept
from .work import KeptRowTask, Outputs

Progress = Callable[[int, int, str], None]
T = TypeVar("T")


@dataclass(eq=False)
class Hemispheres:
    """Hemispheres to be gathered at points; see `Tracer`."""

    points: Points
    samples: int
    key: np.uint32
    total_points: int
    mu: KernelMu
    t_max: float
    leap: int = 1  # how many points share a lattice of directions
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

    def tables(self) -> Outputs:
        return (np.zeros((len(self), *self.mu.shape, COLUMNS)),)

    def directions(self, scene: RayScene) -> DirectionTable:
        return scene.table(self.samples, self.total_points, self.key, self.leap)

    def writer(self, scene: RayScene, tables: Outputs) -> Callable[[int, int], None]:
        gather, out = self.gatherer(scene), tables[0].reshape(-1, *(self.mu.shape or (1,)), COLUMNS)

        def write(start: int, stop: int) -> None:
            gather(self.points[start:stop], out[start:stop])

        return write

    def gatherer(self, scene: RayScene) -> Callable[[Points, Float64s], None]:
        """A function that gathers the hemispheres at some of the points into rows (k, c, COLUMNS), from any thread."""
        table, mu, t_max = self.directions(scene), self.mu, self.t_max
        tree, idle = scene.tree, deque[tuple[Rays, TraversalState]]()  # as many at most as threads

        def gather(points: Points, out: Float64s) -> None:
            try:
                rays, state = idle.pop()
            except IndexError:
                rays = Rays.of(table)
                state = TraversalState.of(tree, AlphaHits.of(scene.opacity, rays.t_hit.size, mu))
            gather_hemispheres(tree, rays, state, points.arrays, table, mu, t_max, out)
            idle.append((rays, state))

        return gather


class Means(Protocol):
    """What points stand for that are traced by samples elsewhere; see `SampleMeans`."""

    def rows(self, tracer: "Tracer", points: Points, rays: int, key: np.uint32) -> Float64s:
        """Rows (k, …, COLUMNS) of what the points stand for, by about so many `rays` each."""

    def resampled(self, points: Points, key: np.uint32) -> "Means | None":
        """The same with other samples of what some `points` stand for, if there are others, chosen by a key."""


@dataclass(eq=False)
class Tracer:
    """Gathers hemispheres in a scene."""

    scene: RayScene
    mu: KernelMu
    t_max: float  # length of rays, in render space
    threads: int
    total_points: int  # of the whole mesh, wanted or not
    progress: Progress | None = None  # called with (rays traced, rays expected in all, stage)
    checkpoint: Kept = NOTHING_KEPT
    expected: int = 0  # rays in all, 0 while none are planned
    stage: str = "rays"  # of the work, for who watches its progress
    rays: int = 0  # traced
    column: int = 0  # of several falloffs the one whose rows are gathered
    means: Means | None = None  # over samples; None: hemispheres at the points themselves
    planned: list[Any] = field(default_factory=list)  # estimates to a tolerance, of each falloff
    _traced: dict[tuple[int, int], tuple[Int64s, Float64s]] = field(default_factory=dict)

    def gather(self, points: Points, samples: int, key: np.uint32, leap: int = 1) -> Float64s:
        """Rows (k, COLUMNS) of `gather_hemispheres`: of `points`, by `samples` rays each, directions drawn by `key`.

        Args: leap: see `DirectionTable`; samples of texels have a lattice for each texel.
        """
        if self.mu.columns is None:
            return self._rows(points, samples, key, leap)
        nothing = np.zeros(0, np.int64), np.zeros((0, *self.mu.shape, COLUMNS))
        numbers, values = self._traced.get((samples, int(key)), nothing)  # by number, ascending
        if np.array_equal(numbers, points.numbers):
            return np.ascontiguousarray(values[:, self.column])
        missing = np.append(numbers, -1)[np.searchsorted(numbers, points.numbers)] != points.numbers
        if missing.any():
            numbers = np.append(numbers, points.numbers[missing].astype(np.int64))
            traced = self._rows(points[missing], samples, key, leap)
            values = np.concatenate([values, traced]) if len(values) else traced
            if (np.diff(numbers) < 0).any():
                order = np.argsort(numbers, kind="stable")
                numbers = numbers[order]
                values = values[order]
            self._traced[samples, int(key)] = numbers, values
        return np.asarray(values[np.searchsorted(numbers, points.numbers), self.column])

    def gather_elsewhere(self, points: Points, samples: int, key: np.uint32, here: Float64s) -> Float64s:
        """`gather` elsewhere in what each of the `points` stands for, by a `key` that no other rows have.

        Args: here: rows of the points themselves by independent rays, which are what vertices have elsewhere, too.
        """
        means = self.means
        resampled = means and means.resampled(points, key)
        if resampled is None:
            return here
        self.means = resampled
        values = self.gather(points, samples, key)
        self.means = means
        return values

    @property
    def columns(self) -> int:
        """How many falloffs are gathered for."""
        return self.mu.shape[0] if self.mu.shape else 1

    def each_column(self, estimate: Callable[[], T]) -> list[T]:
        """What `estimate` returns for each falloff in turn; what one of them has traced is there for the next."""
        results, before = [], self.column
        for column in range(self.columns):
            self.column = column
            results.append(estimate())
        self.column = before
        return results

    def _rows(self, points: Points, samples: int, key: np.uint32, leap: int) -> Float64s:
        """Rows (k, COLUMNS), or with several falloffs (k, c, COLUMNS)."""
        if self.means:
            return self.means.rows(self, points, samples, key)
        return self.fill(self.hemispheres(points, samples, key, leap))[0]

    def hemispheres(self, points: Points, samples: int, key: np.uint32, leap: int) -> Hemispheres:
        """Work for `fill`. Args: leap: see `DirectionTable`."""
        return Hemispheres(points, samples, key, self.total_points, self.mu, self.t_max, leap)

    def fill(self, work: KeptRowTask) -> Outputs:
        """The rows of `work`, with progress."""

        def advance(finished: int) -> None:
            self.rays += round(finished * work.rays)
            if self.progress and self.expected:
                self.progress(self.rays, max(self.rays, self.expected), self.stage)

        return self.checkpoint.fill(work, self.scene, self.threads, advance)
