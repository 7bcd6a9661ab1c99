"""Estimates of folded vertices, each the mean over its corner samples, among vertices that have one hemisphere."""

from typing import NamedTuple

import numpy as np

from obscurance.raytrace.types import Float64s, UInt32s

from ..points.corners import CornerSamples
from ..points.points import Points
from ..rays.gather import BATCH_VARIANCE, BENT, COLUMNS, W
from .tracer import Tracer


class FoldedMeans(NamedTuple):
    """`Means` of vertices some of which are folded: those of these are over samples in their corners."""

    corners: CornerSamples
    numbers: UInt32s  # (j,), of the folded points, ascending
    share: int  # of a vertex's rays, for each of some 18 corner samples: their mean errs as little by fewer each

    def rows(self, tracer: Tracer, points: Points, rays: int, key: np.uint32, leap: int, _: bool) -> Float64s:
        """Rows (k, …, COLUMNS); see `Tracer.gather`. The places of a vertex are all that it stands for."""
        at = np.searchsorted(self.numbers, points.numbers)
        folded = np.append(self.numbers, 0)[at] == points.numbers
        folded &= at < len(self.numbers)
        if not folded.any():
            return tracer.fill(tracer.hemispheres(points, rays, key, leap))[0]
        out = np.empty((len(points), tracer.columns, COLUMNS))
        others = tracer.fill(tracer.hemispheres(points[~folded], rays, key, leap))[0]
        out[~folded] = others.reshape(-1, tracer.columns, COLUMNS)
        # A falloff at a time: means over the samples of each vertex.
        corners = self.corners.only(self.corners.point_rows[at[folded]])
        samples = tracer.fill(tracer.hemispheres(corners.points, -(-rays // self.share), key, 1))[0]
        for column, gathered in enumerate(np.moveaxis(samples.reshape(-1, tracer.columns, COLUMNS), 1, 0)):
            means = np.empty((len(corners), COLUMNS))
            means[:, W] = corners.mean(gathered[:, :1])[:, 0]
            means[:, BATCH_VARIANCE] = corners.variance(gathered[:, BATCH_VARIANCE])
            means[:, BENT:] = corners.mean_direction(gathered[:, BENT:])
            out[folded, column] = means
        return out
