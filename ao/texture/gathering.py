"""Estimates at texels, each the mean over its points."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace

import numpy as np

from raytrace.system.threads import run_blocks
from raytrace.types import Float32s, Float64s, Int64s

from ..execute.checkpoint import Checkpoint
from ..execute.tracer import Tracer
from ..points.points import Points
from ..prepared import Prepared
from ..rays.below_face import leave_out_below
from ..rays.directions import DirectionTable
from ..rays.estimate import BATCH_VARIANCE, COLUMNS
from .texels import Texels

_ENOUGH = 8  # rays of a point, so that more points are worth their time
_GATHERED = 1 << 20  # points
_BLOCK, _SHARE = 1 << 11, 16  # points, and blocks at once


@dataclass(eq=False)
class TexelTracer(Tracer):
    """A `Tracer` whose points are texels, by their numbers: rows are means over each texel's points.

    Attributes:
        texels: all of them.
    """

    texels: Texels | None = None

    def _trace(self, points: Points, samples: int, key: np.uint32) -> Float64s:
        """Rows (k, …, COLUMNS) of texels, by `samples` rays each or a few more."""
        assert self.texels is not None
        texels = points.numbers.astype(np.int64)
        counts, out = self.texels.counts[texels], np.empty((len(points), *self.mu.shape, COLUMNS))
        for count in np.unique(counts).tolist():
            rows = np.flatnonzero(counts == count)
            slots = 1 << int(np.clip(samples // _ENOUGH, 1, count)).bit_length() - 1
            for first in range(0, len(rows), _GATHERED // slots):
                block = rows[first : first + _GATHERED // slots]
                out[block] = self._means(texels[block], slots, -(-samples // slots), key)
        return out

    def _means(self, rows: Int64s, slots: int, rays: int, key: np.uint32) -> Float64s:
        """Rows (k, …, COLUMNS) of texels, means over the first `slots` points of each, with `rays` rays each."""
        assert self.texels is not None
        each = (self.texels.starts[rows, None] + np.arange(slots)).ravel()
        numbers = (slots * rows[:, None] + np.arange(slots)).ravel().astype(np.uint32)
        subset = replace(self.texels.points[each], numbers=numbers)
        table = self.scene.table(rays, self.total_points, key, slots)
        values = self._gather(subset, rays, key, slots)
        self._leave_out_below(subset, self.texels.sides[each], table, values)
        means = values.reshape(-1, slots, *values.shape[1:]).sum(axis=1) / slots
        means[..., BATCH_VARIANCE] *= slots**-1.5  # as if the batches were of all rays: they share a leaped lattice
        return means

    def _leave_out_below(self, points: Points, sides: Float32s, table: DirectionTable, found: Float64s) -> None:
        def work(first: int, last: int) -> None:
            rows = found[first:last].reshape(last - first, -1, COLUMNS)
            for falloff in range(rows.shape[1]):
                column = np.ascontiguousarray(rows[:, falloff])
                leave_out_below(points[first:last].arrays, sides[first:last], table, column)
                rows[:, falloff] = column

        run_blocks(len(points), _BLOCK, work, self.threads, most=_SHARE)


def begin_tracing(prepared: Prepared, texels: Texels, kind: str, checkpoint: Checkpoint | None) -> TexelTracer:
    """A tracer of `texels` on the mesh of `prepared`, and the checkpoint begun. Args: kind: of bake."""
    tracer = prepared.tracer(len(texels.points))
    if checkpoint:
        digest = hashlib.blake2b(texels.points.origins.data)
        digest.update(texels.points.normals.data)
        settings = prepared.mus, kind, prepared.options.identity, digest.hexdigest()
        checkpoint.begin(prepared.placement, prepared.receivers, *settings)
        tracer.checkpoint = checkpoint
    return TexelTracer(**vars(tracer), texels=texels)
