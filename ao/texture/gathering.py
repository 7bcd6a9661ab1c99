"""Estimates at texels, each the mean over its points."""

import hashlib
from collections.abc import Callable
from dataclasses import KW_ONLY, dataclass

import numpy as np

from raytrace.system.threads import run_blocks
from raytrace.types import Float64s, Int64s

from ..execute.checkpoint import Checkpoint
from ..execute.tracer import Tracer
from ..points.points import Points
from ..prepared import Prepared
from ..rays.below_face import leave_out_below
from ..rays.gather import BATCH_VARIANCE, COLUMNS
from .texels import Texels

_ENOUGH = 8  # rays of a point, so that more points are worth their time
_GATHERED = 1 << 20  # points
_BLOCK, _SHARE = 1 << 9, 16  # texels, and blocks at once


@dataclass(eq=False)
class TexelTracer(Tracer):
    """A `Tracer` whose points are `texels`, by their numbers: rows are means over each texel's points."""

    _: KW_ONLY
    texels: Texels
    elsewhere: Callable[[Int64s], Texels] | None  # with other points of the texels (j,), or without any of some of them

    def gather_elsewhere(self, points: Points, samples: int, key: np.uint32, here: Float64s) -> Float64s:
        if self.elsewhere is None:
            return here
        texels, numbers, rows = self.texels, points.numbers.astype(np.int64), here.copy()
        self.texels = self.elsewhere(numbers)
        there = self.texels.counts[numbers] > 0
        rows[there] = self.gather(points[there], samples, key)
        self.texels = texels
        return rows

    def _trace(self, points: Points, samples: int, key: np.uint32, leap: int = 1) -> Float64s:
        """Rows (k, …, COLUMNS) of texels, by `samples` rays each or a few more."""
        texels = points.numbers.astype(np.int64)
        counts, layered = self.texels.counts[texels], self.texels.layered[texels]
        out = np.empty((len(points), *self.mu.shape, COLUMNS))
        fewer = np.clip(samples // _ENOUGH, 1, counts)
        slots_of = np.where(layered, counts, 2 ** np.floor(np.log2(fewer)).astype(np.int64))
        for slots in np.flatnonzero(np.bincount(slots_of)).tolist():
            rows = np.flatnonzero(slots_of == slots)
            for first in range(0, len(rows), _GATHERED // slots):
                block = rows[first : first + _GATHERED // slots]
                self._write_means(out, block, texels[block], slots, -(-samples // slots), key)
        return out

    def _write_means(self, out: Float64s, to: Int64s, rows: Int64s, slots: int, rays: int, key: np.uint32) -> None:
        """Set out[to] to means over the first `slots` points of each of the texels `rows`, with `rays` rays each."""
        every, starts, shape = self.texels.points, self.texels.starts, (slots * len(rows), 3)
        subset = Points(np.empty(shape, np.float32), np.empty(shape, np.float32), np.empty(shape[0], np.uint32))

        def pick(first: int, last: int) -> None:
            each = (starts[rows[first:last], None] + np.arange(slots)).ravel()
            block = slice(slots * first, slots * last)
            subset.origins[block] = every.origins.take(each, axis=0)
            subset.normals[block] = every.normals.take(each, axis=0)
            subset.numbers[block] = (slots * rows[first:last, None] + np.arange(slots)).ravel()

        run_blocks(len(rows), _BLOCK, pick, self.threads, most=_SHARE)
        table = self.scene.table(rays, self.total_points, key, slots)
        values = super()._trace(subset, rays, key, slots)

        def average(first: int, last: int) -> None:
            each = (starts[rows[first:last], None] + np.arange(slots)).ravel()
            block = slice(slots * first, slots * last)
            arrays, own_sides, falloffs = subset[block].arrays, sides.take(each, axis=0), by_falloff[block]
            for falloff in range(falloffs.shape[1]):
                column = np.ascontiguousarray(falloffs[:, falloff])
                leave_out_below(arrays, own_sides, table, column)
                falloffs[:, falloff] = column
            means = np.sum(values[block].reshape(-1, slots, *values.shape[1:]), axis=1) / slots
            means[..., BATCH_VARIANCE] *= slots**-1.5  # as if the batches were of all rays: they share a leaped lattice
            out[to[first:last]] = means

        sides, by_falloff = self.texels.sides, values.reshape(len(values), -1, COLUMNS)
        run_blocks(len(rows), _BLOCK, average, self.threads, most=_SHARE)


def begin_tracing(
    prepared: Prepared,
    texels: Texels,
    kind: str,
    checkpoint: Checkpoint | None,
    elsewhere: Callable[[Int64s], Texels] | None = None,
) -> TexelTracer:
    """A tracer of `texels` on the mesh of `prepared`, and the checkpoint begun. Args: kind: of bake."""
    tracer = prepared.tracer(len(texels.points))
    if checkpoint:
        digest = hashlib.blake2b(texels.points.origins.data)
        digest.update(texels.points.normals.data)
        settings = prepared.mus, kind, prepared.options.identity, digest.hexdigest()
        checkpoint.begin(prepared.placement, prepared.receivers, *settings)
        tracer.checkpoint = checkpoint
    return TexelTracer(**vars(tracer), texels=texels, elsewhere=elsewhere)
