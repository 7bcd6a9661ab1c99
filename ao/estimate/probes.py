"""Points at which the error of a bake is measured, by rays that are no part of any estimate.

Where w jumps, few points have most of the squared error. So the points are a stratified sample with optimum allocation
(Neyman 1934): most are spread over all points, the others over those where the largest errors are expected.
"""

from copy import copy
from typing import Self

import numpy as np

from obscurance.raytrace.types import Float32s, Float64s, Int64s

from ..execute.tracer import Tracer
from ..points.points import Points
from ..rays.gather import W
from .calibration import Calibration, calibration_factor
from .sampling_error import BATCH, RATE, derive, rays_alone, sampling_variance, stratified_rows

_PROBED, _FEWEST, _MOST = 16, 96, 1024  # one point in how many is probed, at least and at most
_LARGEST, _MORE = 0.05, 0.25  # part of the points that count as largest errors; probes among them, to the other probes
_EXPECTED = 16  # probes that the expected largest errors are worth
_SAMPLED = 1 << 14  # points by which the largest errors are told from others
_MARGIN = 10.0  # times one by the number of probes
_PRIOR = 64  # probes that what is expected of their noise is worth


class Probes:
    """Points at which the error is measured: `point_rows` (j,), each by two independent estimates for every falloff."""

    def __init__(self, tracer: Tracer, points: Points, tolerance: float, max_samples: int, key: np.uint32) -> None:
        self._tracer = tracer
        self._points = points
        self._key = key
        # More rays would not make up for fewer probes: both err by as much.
        self._samples = min(rays_alone(tolerance), max(max_samples, BATCH))
        self.point_rows = stratified_rows(len(points), int(np.clip(len(points) // _PROBED, _FEWEST, _MOST)))
        self._spread_count = len(self.point_rows)  # so many are over all points; others follow
        self._has_large_error = np.zeros(len(points), np.bool_)
        self._weights = np.full(self._spread_count, 1 / max(self._spread_count, 1))
        traced = self._trace(self.point_rows)
        self._at_points = [(one[0], other[0]) for one, other in traced]
        self._references = [(one[1], other[1]) for one, other in traced]

    def _trace(self, point_rows: Int64s) -> list[tuple[tuple[Float64s, Float64s], tuple[Float64s, Float64s]]]:
        """For each falloff two independent estimates at points, and elsewhere in what the points stand for."""
        probed = self._points[point_rows]

        def traced(salt: int) -> tuple[Float64s, Float64s]:
            here = self._tracer.gather(probed, self._samples, derive(self._key, salt))
            elsewhere = self._tracer.gather_elsewhere(probed, self._samples, derive(self._key, salt + 2), here)
            return here[:, W], elsewhere[:, W]

        return self._tracer.each_column(lambda: (traced(4), traced(5)))

    def only(self, probed_rows: Int64s, kept_rows: Int64s) -> Self:
        """Those of the first probes that are at points `probed_rows` (i,), where points `kept_rows` (k,) are the only
        ones; both ascending."""
        kept = np.searchsorted(self.point_rows, probed_rows)
        some = copy(self)
        some.point_rows = np.searchsorted(kept_rows, probed_rows)
        some._spread_count = len(kept)
        some._weights = np.full(len(kept), 1 / len(kept))
        some._at_points = [(one[kept], other[kept]) for one, other in self._at_points]
        some._references = [(one[kept], other[kept]) for one, other in self._references]
        return some

    def add_where_error_is_largest(self, error: Float64s) -> None:
        """Once, probe points of the largest squared errors (k,) expected, too."""
        if len(self.point_rows) > self._spread_count:
            return
        step = max(len(error) // _SAMPLED, 1)
        largest = error > np.quantile(error[::step], 1 - _LARGEST, method="lower")  # the others import numpy.ma
        unprobed = largest.copy()
        unprobed[self.point_rows] = False
        candidates = np.flatnonzero(unprobed)
        if not len(candidates):
            return
        added = candidates[stratified_rows(len(candidates), round(_MORE * self._spread_count))]
        for column, (one, other) in enumerate(self._trace(added)):
            before = self._references[column]
            self._references[column] = np.append(before[0], one[1]), np.append(before[1], other[1])
        self._has_large_error = largest
        self.point_rows = np.append(self.point_rows, added)
        is_largest = largest[self.point_rows]
        share = float(np.mean(largest))
        count = int(np.count_nonzero(is_largest))
        self._weights = np.where(is_largest, share / count, (1 - share) / max(len(self.point_rows) - count, 1))

    @property
    def margin(self) -> float:
        """By how much less than the squared tolerance is to be measured, relative to what is: a bake may end because
        too little is measured by chance, the more so the fewer probes there are."""
        return _MARGIN / len(self.point_rows)

    def mean_squared(self, w: Float64s, column: int) -> float:
        """The mean squared error over all points, measured at the probes, of which `w` (j,) is given."""
        return float(self._weights @ self._squared(w, column))

    def _squared(self, w: Float64s, column: int) -> Float64s:
        """Unbiased squared errors (j,) of `w` (j,) at the probes, as the estimates are independent."""
        one, other = self._references[column]
        return (w - one) * (w - other)

    def calibrate(self, error: Float64s, w: Float64s, column: int) -> Calibration:
        """Scale the squared errors (k,) expected of `w` (k,) to what is measured, the largest by themselves."""
        measured = self._squared(w[self.point_rows], column)
        largest = self._has_large_error
        probed = largest[self.point_rows]
        if probed.any():
            expected = float(np.mean(error[self.point_rows[probed]]))
            total = float(np.sum(measured[probed])) + _EXPECTED * expected
            mean = total / (np.count_nonzero(probed) + _EXPECTED)
            error[largest] *= max(mean / max(expected, 1e-300), 1 / 3)
        others = ~largest
        error[others] *= calibration_factor(error[self.point_rows[~probed]], measured[~probed], error[others])
        return Calibration(error[self.point_rows], measured, len(error) * self._weights)

    def level(self, raw: Float32s, worth: Float64s, column: int) -> float:
        """Mean square error of values `raw` (k,) by rays alone, which are `worth` (k,): as measured, and, where there
        are few probes, as the noise of the probes' own rays lets expect."""
        one, other = self._at_points[column]
        probe_noise = sampling_variance(one, other, self._samples)
        expected = probe_noise * float(self._samples**RATE * np.mean(1 / worth))
        here = raw[self.point_rows[: self._spread_count]]
        measured = max(float(np.sum((here - one) * (here - other))), 0.0)
        return (measured + _PRIOR * expected) / (len(here) + _PRIOR)
