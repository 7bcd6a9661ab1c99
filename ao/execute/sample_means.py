"""Estimates at groups of samples on faces, each the mean over its samples, less rays that start below the face."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from raytrace.kernel.jit import bind, kernel
from raytrace.system.threads import run_blocks
from raytrace.types import Float64s, Int64s

from ..points.points import Points
from ..points.surface_samples import SurfaceSamples
from ..rays.below_face import leave_out_below
from ..rays.gather import BATCH_VARIANCE, COLUMNS
from .tracer import Tracer

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
                self._write_means(tracer, groups[block], samples, (-(-rays // samples), key), (out, block))
        return out

    def _write_means(
        self, tracer: Tracer, groups: Int64s, samples: int, rays: tuple[int, np.uint32], to: tuple[Float64s, Int64s]
    ) -> None:
        """Set rows of an array, `to`, to means over so many `samples` of each of the `groups`.

        Args: rays: of a sample, and the key of their directions.
        """
        samples_each, key = rays
        # The samples taken of each group, as points.
        source = np.empty(samples * len(groups), np.int64)
        numbers = np.empty(len(source), np.uint32)
        pick = bind(_pick, groups, samples, self.samples.starts, int(key), source, numbers)
        run_blocks(len(groups), _BLOCK, pick, tracer.threads, most=_SHARE)
        points = replace(self.samples.points[source], numbers=numbers)
        # Their estimates, and means over each group.
        table = tracer.scene.table(samples_each, tracer.total_points, key, samples)
        values = tracer.trace(points, samples_each, key, samples)
        by_falloff = values.reshape(len(values), -1, COLUMNS)
        out = to[0].reshape(len(to[0]), -1, COLUMNS)

        def average(start: int, stop: int) -> None:
            block = slice(samples * start, samples * stop)
            arrays = points[block].arrays
            normals = self.samples.geometric_normals.take(source[block], axis=0)
            for falloff in range(by_falloff.shape[1]):
                column = np.ascontiguousarray(by_falloff[block, falloff])
                leave_out_below(arrays, normals, table, tracer.scene.cone, column)
                _average(column, samples, to[1][start:stop], out[:, falloff])

        run_blocks(len(groups), _BLOCK, average, tracer.threads, most=_SHARE)


@kernel
def _pick(groups, samples, starts, chance, source, numbers, start, stop):
    """Write which samples of each group are taken, one of its runs of so many by `chance`, and their numbers."""
    for i in range(start, stop):
        begin = starts[groups[i]]
        runs = (starts[groups[i] + 1] - begin) // samples
        begin += samples * (chance % runs)
        for k in range(samples):
            source[samples * i + k] = begin + k
            numbers[samples * i + k] = samples * groups[i] + k


@kernel
def _average(values, samples, point_rows, out):
    """Write means of every `samples` consecutive `values` (k, COLUMNS) to the rows `point_rows` of `out`."""
    for i in range(len(point_rows)):
        for column in range(COLUMNS):
            total = 0.0
            for k in range(samples):
                total += values[samples * i + k, column]
            out[point_rows[i], column] = total / samples
        out[point_rows[i], BATCH_VARIANCE] *= samples**-1.5  # as if of all rays at once: they share a leaped lattice
