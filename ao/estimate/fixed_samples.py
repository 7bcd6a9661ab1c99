"""Estimates by a given number of rays, at points and at corner samples of folded points."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from raytrace.sampling.hash import mix_array
from raytrace.types import Float64s, Int64s

from ..execute.tracer import Tracer
from ..points.corners import CornerSamples
from ..points.points import Points
from ..rays.estimator import BATCH_VARIANCE, BENT, VALUES, W
from .calibration import Calibration, calibration_factor, distribute_variance, shrunk_to_mean
from .one_ring import Neighbours
from .ray_budget import sampling_variance
from .shrinkage import denoise
from .tolerance import Estimate

_CALIBRATION_SHARE = 32
_CALIBRATION_LEAST = 128
_CORNER_SHARE = 8  # of a point's rays, for each of some 18 corner samples, whose mean errs as much as a point's w
_CORNER_SHARE_DENOISED = 3  # where the points are denoised


class TracedTwice(NamedTuple):
    """Traced points, some of them traced twice to calibrate the error.

    Attributes:
        rows: float64 (k, COLUMNS). samples: rays of each. calibration: int64 (c,), the points that were traced twice.
        again: float64 (c,), their w by independent directions. rays: traced in the bake so far.
    """

    rows: Float64s
    samples: int
    calibration: Int64s
    again: Float64s
    rays: int


def traced_twice(tracer: Tracer, points: Points, samples: int, key: np.uint32) -> TracedTwice:
    calibration = _calibration_subset(len(points))
    tracer.expected = tracer.rays + samples * (len(points) + len(calibration))
    rows = tracer.gather(points, samples, key)
    again = tracer.gather(points[calibration], samples, mix_array([key ^ np.uint32(0xA5A5A5A5)])[0])[:, W]
    return TracedTwice(rows, samples, calibration, again, tracer.rays)


def estimated(traced: TracedTwice, points: Points, neighbours: Neighbours | None) -> Estimate:
    """Estimates at points that were traced; denoised if `neighbours` are given."""
    rows, samples, calibration, again, rays = traced
    w = rows[:, W]
    level = sampling_variance(w[calibration], again, samples)
    spread = rows[:, BATCH_VARIANCE]
    if len(points) and not spread.any() and (w == w[0]).all():  # of n rays that agree, the next may not (Laplace)
        level = min(level, rays**-2.0)
    variance, before = shrunk_to_mean(distribute_variance(spread, level)), (w[calibration] - again) ** 2
    checked = Calibration(variance[calibration], before / 2)
    raw = Estimate(rows[:, VALUES], variance, samples, 0, calibration=checked)
    if neighbours is None:
        return raw
    denoised, error = denoise(neighbours, points, rows, level)
    after = (denoised[calibration] - again) ** 2
    if float(np.sum(after - before)) >= 0:
        return raw
    error *= calibration_factor(error[calibration], after - before / 2, error)
    checked = Calibration(error[calibration], after - before / 2)
    return Estimate(np.column_stack([denoised, rows[:, BENT:]]), error, samples, 0, calibration=checked)


def sampled(tracer: Tracer, points: Points, samples: int, key: np.uint32) -> Estimate:
    """Every point with `samples` rays, as they come."""
    return estimated(traced_twice(tracer, points, samples, key), points, None)


def rays_per_corner_sample(samples: int, denoised: bool) -> int:
    """Rays of each corner sample where ordinary points get `samples` rays."""
    return -(-samples // (_CORNER_SHARE_DENOISED if denoised else _CORNER_SHARE))


def count_corner_rays(corners: CornerSamples, samples: int) -> int:
    """Rays that corner samples take with `samples` rays each."""
    return samples * (len(corners.points) + len(_calibration_subset(len(corners.points))))


def with_corner_means(estimate: Estimate, rows: Int64s, samples: Estimate, corners: CornerSamples) -> Estimate:
    """Estimates of all points: `estimate` of the points `rows` (i,), and means of `samples`, of the corner samples."""
    values, variance = np.empty((len(rows) + len(corners), 4)), np.empty(len(rows) + len(corners))
    values[rows], variance[rows] = estimate.rows, estimate.variance
    values[corners.rows, :1] = corners.mean(samples.rows[:, :1])
    values[corners.rows, 1:] = corners.mean_direction(samples.rows[:, 1:])
    variance[corners.rows] = corners.variance(samples.variance)
    return replace(estimate, rows=values, variance=variance)


def _calibration_subset(count: int) -> Int64s:
    """Evenly spread points to bake a second time with independent directions: one in 32, 128 at least."""
    wanted = min(count, max(_CALIBRATION_LEAST, count // _CALIBRATION_SHARE))
    return np.arange(wanted) * count // max(wanted, 1)
