"""The one way from points to their values: vertices, texels, points of a fine mesh alike.

Points with a hemisphere of their own are traced, folded points get the mean over their `CornerSamples`, and points
inside solids the values of the nearest points outside.
"""

import hashlib
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from raytrace.sampling.sequences import mix_array
from raytrace.types import Bools, Float64s, Int64s

from ..execute.tracer import Tracer
from ..points.corners import CornerSamples
from ..points.points import Points
from ..rays.gather import BATCH_VARIANCE, BENT, VALUES, W
from .calibration import Calibration, calibration_factor, distribute_variance, shrunk_to_mean
from .inside import Extrapolation
from .one_ring import Neighbours
from .probes import derive
from .ray_budget import sampling_variance
from .shrinkage import denoise
from .tolerance import Estimate, estimate_to

_CALIBRATION_SHARE = 32
_CALIBRATION_LEAST = 128
_CORNER_SHARE = 8  # of a point's rays, for each of some 18 corner samples, whose mean errs as much as a point's w
_CORNER_SHARE_DENOISED = 3  # where the points are denoised
NeighboursOf = Callable[[Int64s], Neighbours]
"""From rows of points (k,), ascending, their neighbours among each other, numbered in that order."""


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


class Target(NamedTuple):
    """What a bake asks for.

    Attributes:
        samples: rays a point; with a tolerance the most. tolerance: root mean square error of w, or None.
        denoise: whether estimates are shrunk towards predictions from neighbours. key: of the directions.
    """

    samples: int
    tolerance: float | None
    denoise: bool
    key: np.uint32


def edges_of(points: Points, faces: Int64s, tracer: Tracer) -> NeighboursOf:
    """Neighbours along the edges of `faces` (m, 3), rows of `points` or −1; kept where several falloffs need them."""
    threads, kept = tracer.threads, dict[bytes, Neighbours]()

    def among(rows: Int64s) -> Neighbours:
        if not tracer.mu.columns:
            return made(rows)
        digest = hashlib.blake2b(rows.data).digest()
        return kept.get(digest) or kept.setdefault(digest, made(rows))

    def made(rows: Int64s) -> Neighbours:
        if len(rows) == len(points):
            return Neighbours.of(faces, points.normals, threads)
        return Neighbours.of(_renumbering(rows, len(points))[faces], points.normals[rows], threads)

    return among


def estimate(
    tracer: Tracer, points: Points, corners: CornerSamples, neighbours_of: NeighboursOf, target: Target
) -> Estimate:
    """Estimates at all `points` (k,), with a number of rays each that is given or meets the tolerance."""
    rows = np.delete(np.arange(len(points)), corners.rows)
    ordinary = points[rows] if len(corners) else points
    max_samples, tolerance, denoise, key = target
    if tolerance is None or not len(points):
        samples = rays_per_corner_sample(max_samples, False)
        tracer.later = count_corner_rays(corners, samples)
        traced = traced_twice(tracer, ordinary, max_samples, key)
        tracer.later = 0
        if len(corners) and max_samples >= tracer.packets_below:
            tracer.packets_below = 0  # Embree's hierarchy is not worth building for corner samples alone
        at_corners = traced_twice(tracer, corners.points, samples, key) if len(corners) else None
        tracer.checkpoint.all_traced()
        tracer.scene.embree.cache_clear()  # type: ignore[attr-defined]  # who needs it afterwards builds it anew
        values = estimated(traced, ordinary, neighbours_of(rows) if denoise else None)
        if at_corners is None:
            return values
        return with_corner_means(values, rows, estimated(at_corners, corners.points, None), corners)
    if not len(rows):  # rays can be planned by corner samples alone, of which the mean of some 18 is asked for
        alone = Neighbours.of(np.zeros((0, 3), np.int64), corners.points.normals, tracer.threads)
        sampled_corners = estimate_to(tracer, corners.points, alone, min(2 * tolerance, 1.0), max_samples, key)
        nothing = Estimate(np.zeros((0, 4)), np.zeros(0), sampled_corners.samples, 0)
        return with_corner_means(nothing, rows, sampled_corners, corners)
    values = estimate_to(tracer, ordinary, neighbours_of(rows), tolerance, max_samples, key)
    if not len(corners):
        return values
    samples = rays_per_corner_sample(values.samples, True)
    return with_corner_means(values, rows, sampled(tracer, corners.points, samples, key), corners)


def estimate_outside(
    tracer: Tracer, points: Points, corners: CornerSamples, neighbours_of: NeighboursOf, inside: Bools, target: Target
) -> tuple[Estimate, int]:
    """`estimate` where points `inside` (k,) are filled from the nearest points outside; how many were not traced."""
    if not inside.any():
        return estimate(tracer, points, corners, neighbours_of, target), 0
    extrapolation = Extrapolation.of(points, neighbours_of(np.arange(len(points))), inside)
    kept = np.flatnonzero(extrapolation.traced)
    traced, subset = points[kept], corners.only(kept)
    values = estimate(tracer, traced, subset, lambda rows: neighbours_of(kept[rows]), target)
    known = np.column_stack([values.rows, values.variance])
    if target.tolerance is not None:  # an error at the edge of the hidden points stands for many
        edge = extrapolation.sources
        edge[subset.rows] = False
        again = sampled(tracer, traced[edge], min(4 * values.samples, target.samples), derive(target.key, 6))
        known[edge] = np.column_stack([again.rows, again.variance])
    rows = extrapolation.extrapolate(known)
    return replace(values, rows=rows[:, :4], variance=rows[:, 4]), len(points) - len(kept)


def _renumbering(rows: Int64s, count: int) -> Int64s:
    """The place of each of `count` points, and of −1, in `rows`; −1 for points that are not in them."""
    place = np.full(count + 1, -1)
    place[rows] = np.arange(len(rows))
    return place
