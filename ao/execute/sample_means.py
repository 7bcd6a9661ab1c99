"""Estimates at groups of samples on faces, each the mean over its samples, less rays that start below the face."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import ClassVar, NamedTuple, Self

import numpy as np

from obscurance.raytrace.kernel.jit import bind, kernel
from obscurance.raytrace.system.threads import run_blocks
from obscurance.raytrace.types import Float32s, Float64Rows, Float64s, Int64s, UInt32s

from ..points.points import Points
from ..points.surface_samples import SurfaceSamples
from ..rays.below_face import leave_out_below
from ..rays.gather import BATCH_VARIANCE, COLUMNS
from ..rays.ray_scene import RayScene
from .tracer import Hemispheres, Tracer
from .work import Outputs

_GATHERED = 1 << 20  # samples
_BLOCK, _SHARE = 1 << 9, 16  # groups, and blocks at once


class SampleMeans(NamedTuple):
    """What makes a `Tracer` one of groups of samples: its points stand for the groups, by their numbers."""

    samples: SurfaceSamples
    elsewhere: Callable[[Int64s, np.uint32], SurfaceSamples] | None = None  # of some groups (j,) others, by a key
    enough: int = 8  # rays of a sample, so that more samples are worth their time; less where w varies among them

    def resampled(self, points: Points, key: np.uint32) -> SampleMeans | None:
        """The same groups with other samples, for a second estimate at some `points`; None if groups have no others."""
        if self.elsewhere is None:
            return None
        return self._replace(samples=self.elsewhere(points.numbers.astype(np.int64), key))

    def rows(self, tracer: Tracer, points: Points, rays: int, key: np.uint32) -> Float64s:
        """Rows (k, …, COLUMNS) of groups, by so many `rays` each or a few more."""
        groups = points.numbers.astype(np.int64)
        counts = self.samples.counts[groups]
        fewer = np.clip(rays // self.enough, 1, counts)
        samples_of = np.where(self.samples.all_count[groups], counts, 2 ** np.floor(np.log2(fewer)).astype(np.int64))
        out = np.empty((len(points), *tracer.mu.shape, COLUMNS))
        for samples in np.flatnonzero(np.bincount(samples_of)).tolist():
            alike = np.flatnonzero(samples_of == samples)
            step = _GATHERED // samples
            for begin in range(0, len(alike), step):
                block = alike[begin : begin + step]
                work = self._work(tracer, groups[block], samples, (-(-rays // samples), key))
                (out[block],) = tracer.fill(work)
        return out

    def _work(self, tracer: Tracer, groups: Int64s, samples: int, rays: tuple[int, np.uint32]) -> MeansOfGroups:
        """Means over so many `samples` of each of the `groups`. Args: rays: of a sample, and their directions' key."""
        source = np.empty(samples * len(groups), np.int64)
        numbers = np.empty(len(source), np.uint32)
        pick = bind(_pick, groups, samples, self.samples.starts, int(rays[1]), source, numbers)
        run_blocks(len(groups), _BLOCK, pick, tracer.threads, most=_SHARE)
        points = replace(self.samples.points[source], numbers=numbers)
        normals = self.samples.geometric_normals.take(source, axis=0)
        return MeansOfGroups(tracer.hemispheres(points, *rays, leap=samples), samples, normals)


@dataclass(eq=False)
class MeansOfGroups:
    """Means over groups of equally many samples, to be traced; rows are as of `Hemispheres`.

    Those of several falloffs are float32, as all of them are kept on disk.
    """

    hemispheres: Hemispheres  # at the samples, group after group
    samples: int  # of a group
    geometric_normals: Float32s  # (p, 4), of the faces under the samples
    block_rays: ClassVar = 1 << 14

    def __len__(self) -> int:
        return len(self.hemispheres) // self.samples

    def __getitem__(self, rows: slice) -> Self:
        start, stop, _ = rows.indices(len(self))
        part = slice(self.samples * start, self.samples * stop)
        return replace(self, hemispheres=self.hemispheres[part], geometric_normals=self.geometric_normals[part])

    @property
    def name(self) -> bytes:
        return self.hemispheres.name

    @property
    def rays(self) -> float:
        return self.samples * self.hemispheres.rays

    def tables(self) -> Outputs:
        columns = self.hemispheres.mu.shape
        return (np.zeros((len(self), *columns, COLUMNS), np.float32 if columns else np.float64),)

    def writer(self, scene: RayScene, tables: Outputs) -> Callable[[int, int], None]:
        table, gather = self.hemispheres.directions(scene), self.hemispheres.gatherer(scene)
        out = tables[0].reshape(-1, *(self.hemispheres.mu.shape or (1,)), COLUMNS)

        def write(start: int, stop: int) -> None:
            part = slice(self.samples * start, self.samples * stop)
            points, normals = self.hemispheres.points[part], self.geometric_normals[part]
            gathered = np.empty((len(points), *out.shape[1:]))
            gather(points, gathered)
            means = np.empty((stop - start, COLUMNS))
            for falloff in range(out.shape[1]):
                column = np.ascontiguousarray(gathered[:, falloff])
                leave_out_below(points.arrays, normals, table, scene.cone, column)
                _average(column, self.samples, means)
                out[start:stop, falloff] = means

        return write


@kernel
def _pick(
    groups: Int64s, samples: int, starts: Int64s, chance: int, source: Int64s, numbers: UInt32s, start: int, stop: int
) -> None:
    """Write which samples of each group are taken, one of its runs of so many by `chance`, and their numbers."""
    for i in range(start, stop):
        begin = starts[groups[i]]
        runs = (starts[groups[i] + 1] - begin) // samples
        begin += samples * (chance % runs)
        for k in range(samples):
            source[samples * i + k] = begin + k
            numbers[samples * i + k] = samples * groups[i] + k


@kernel
def _average(values: Float64Rows, samples: int, out: Float64Rows) -> None:
    """Write means of every `samples` consecutive `values` (k, COLUMNS) to the rows of `out`."""
    for i in range(len(out)):
        for column in range(COLUMNS):
            total = 0.0
            for k in range(samples):
                total += values[samples * i + k, column]
            out[i, column] = total / samples
        out[i, BATCH_VARIANCE] *= samples**-1.5  # as if of all rays at once: they share a leaped lattice
