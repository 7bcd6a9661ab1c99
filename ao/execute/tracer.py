"""Gathering hemispheres at many points, in blocks on threads or by other processes, with the same bits for any."""

import hashlib
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import ClassVar, Protocol, Self

import numpy as np

from obscurance.raytrace.types import AnyInts, Float64s

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

_AT_ONCE = 1 << 19  # points
Progress = Callable[[int, int, str], None]


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
    sides: bool = False  # whether rows are `WIDER`
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
        tree, idle = scene.hierarchy.tree, deque[tuple[Rays, TraversalState]]()  # as many at most as threads

        def gather(points: Points, out: Float64s) -> None:
            try:
                rays, state = idle.pop()
            except IndexError:
                rays = Rays.of(table, self.sides)
                state = TraversalState.of(tree, AlphaHits.of(scene.opacity, rays.t_hit.size, mu))
            gather_hemispheres(tree, rays, state, points.arrays, table, mu, t_max, out)
            idle.append((rays, state))

        return gather


class Means(Protocol):
    """Makes the rows of sites of several places; see `SampleMeans` and `FoldedMeans`."""

    @property
    def by_blocks(self) -> bool:
        """Whether rows depend on which others are made with them."""

    def rows(self, tracer: "Tracer", points: Points, rays: int, key: np.uint32, leap: int, elsewhere: bool) -> Float64s:
        """Rows (k, …, COLUMNS) of the sites that `points` stand for, by about so many `rays` each; see `gather`."""


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
    means: Means | None = None  # over several places of each site; None: hemispheres at the points themselves

    def gather(self, points: Points, samples: int, key: np.uint32, leap: int = 1, elsewhere: bool = False) -> Float64s:
        """Rows (k, c, COLUMNS) by c falloffs: of `points`, by `samples` rays each, directions drawn by `key`.

        Args: leap: see `DirectionTable`; places of a texel have a lattice together. elsewhere: at places drawn by `key`
            from all of what each point stands for; those of a vertex are its own.
        """
        if self.means:
            rows = self.means.rows(self, points, samples, key, leap, elsewhere)
        else:
            rows = self.fill(self.hemispheres(points, samples, key, leap))[0]
        return rows.reshape(-1, self.columns, COLUMNS)

    def gather_in_parts(
        self,
        points: Points,
        samples: int,
        key: np.uint32,
        leap: int = 1,
        elsewhere: bool = False,
        rows: AnyInts | None = None,
    ) -> Iterator[tuple[slice, Float64s]]:
        """Parts of the points, so many that their rows fit into memory, and `gather` of each.

        Args: rows: (j,), which of the points; None: all.
        """
        count = len(points if rows is None else rows)
        step = count if self.means and self.means.by_blocks else _AT_ONCE
        for start in range(0, count, step or 1):
            part = slice(start, start + step)
            yield part, self.gather(points[part if rows is None else rows[part]], samples, key, leap, elsewhere)

    @property
    def columns(self) -> int:
        """How many falloffs are gathered for."""
        return self.mu.shape[0] if self.mu.shape else 1

    def hemispheres(
        self, points: Points, samples: int, key: np.uint32, leap: int, total: int | None = None
    ) -> Hemispheres:
        """Work for `fill`. Args: leap: see `DirectionTable`. total: of points that draw from its sets."""
        total = self.total_points if total is None else min(total, self.total_points)
        return Hemispheres(points, samples, key, total, self.mu, self.t_max, leap)

    def fill(self, work: KeptRowTask) -> Outputs:
        """The rows of `work`, with progress."""

        def advance(finished: int) -> None:
            self.rays += round(finished * work.rays)
            if self.progress and self.expected:
                self.progress(self.rays, max(self.rays, self.expected), self.stage)

        return self.checkpoint.fill(work, self.scene, self.threads, advance)
