"""Rays for a tolerance: how many a point, planned from pilots baked twice with their neighbours, and which points next.

Points are chosen for the least work: rate allocation by a Lagrange multiplier (Shoham and Gersho, IEEE Trans. ASSP 36,
1988).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from raytrace.types import Bools, Float64s, Int32s, Int64s

from ..execute.tracer import Tracer
from ..points.points import Points
from ..rays.gather import W
from .one_ring import Neighbours

_LEAST = 16  # rays a point
RATE = 1.5  # the variance of n rays falls as n^−1.5
_WORK = 0.6  # the time that n rays of a point take grows as n^.6, for they share their walk
_TYPICAL, _PRIOR = 0.09, 8  # variance of n rays · n^1.5, and how many points that is worth: a few may agree by luck
_GAIN = 1.6  # at most what the raw error may exceed the aim by, for denoising to bring it back
_SHARED = 0.2  # variance of a neighbours' mean, relative to one neighbour's
_UNEXPLAINED = 0.06  # part of the squared distance from a neighbours' mean that typical predictions leave
_GAINED, _GAINED_APART = 0.7, 0.8  # of what shrinking all points alike would gain: roughness is not the same everywhere
_DENSE = 0.5  # squared distance from a neighbours' mean, relative to the aim's, below which few points will be baked
_APART = 1.5  # times the error of baked points, for predictions between
COARSEST = 64  # stride along the curve at first
HALVED = 1.2  # by what the error of predictions falls when the stride is halved
MET = 1.1  # times the goal is near enough
ADDED = 0.7  # of the goal at most, the squared error of points that are baked later
_BISECTIONS = 12  # of the range of multipliers
_DEEPER = np.array([0, 0.25, 0.35, 0.5, 0.7, 1, 1.4, 2, 2.8, 4, 8, 16, 32])  # rays added, times the rays so far


class Pilots(NamedTuple):
    """Points that are baked twice with few rays.

    Attributes:
        centres: int64 (j,), points spread over the mesh, whose neighbours are baked with them.
        rays: of each point, from either of two keys.
    """

    centres: Int64s
    rays: int
    keys: tuple[np.uint32, np.uint32]


def plan(tracer: Tracer, points: Points, neighbours: Neighbours, pilots: Pilots, aim: float, max_samples: int) -> int:
    """Rays a point, up to `max_samples`, for a root mean square error of `aim` once points are denoised."""
    rays, centres = pilots.rays, pilots.centres
    rows = np.union1d(centres, neighbours.of_points(centres))
    first, second = (tracer.gather(points[rows], rays, key)[:, W] for key in pilots.keys)
    noise = sampling_variance(first, second, rays)
    rough = _roughness(neighbours, rows, first, noise, centres)
    counts = np.arange(8, max_samples + 8, 8)
    variance = noise * (rays / counts) ** RATE
    if np.isinf(rough):
        error = variance
    elif rough < _DENSE * aim**2:  # baked points will lie so far apart that predictions err by about as much as they
        error = _APART * _denoised_error(variance, aim**2 / 2 + _SHARED * variance, _GAINED_APART)
    else:
        error = _denoised_error(variance, _UNEXPLAINED * rough + _SHARED * variance, _GAINED)
    enough = np.maximum(error, variance / _GAIN**2) <= aim**2
    samples = counts[np.argmax(enough)] if enough.any() else max_samples
    return int(np.clip(samples, min(_LEAST, max_samples), max_samples))


def work(rays: float) -> float:
    """Time of `rays` rays of one point, relative."""
    return float(rays**_WORK)


def sampling_variance(first: Float64s, second: Float64s, rays: int) -> float:
    """Mean square error of either of two independent estimates (k,) with `rays` rays a point."""
    halves = float(np.sum((first - second) ** 2)) / 2
    return (halves + _PRIOR * _TYPICAL * rays**-RATE) / (len(first) + _PRIOR)


def denoised_error(variance: float, error: float, lessened: float) -> float:
    """The mean square `error` of denoised estimates of `variance` after `variance` is multiplied by `lessened` < 1."""
    gained = 1 - error / variance if variance > 0 else 0.0
    if gained <= 0:
        return error * lessened
    gained_all = max(_GAINED, gained)  # more than that where predictions matter more than rays
    predicted = variance * (gained_all / gained - 1)
    return lessened * variance * (1 - gained_all * lessened * variance / (lessened * variance + predicted))


def _denoised_error(variance: Float64s, predicted: Float64s, gained: float) -> Float64s:
    """Mean square error of estimates of `variance` shrunk to predictions of mean square error `predicted`.

    Args: gained: part of what shrinking all points alike would gain.
    """
    return variance * (1 - gained * variance / (variance + predicted))


def _roughness(neighbours: Neighbours, rows: Int64s, estimate: Float64s, noise: float, centres: Int64s) -> float:
    """Mean square distance of w from its neighbours' mean at `centres`, without noise; inf if none has neighbours.

    Args: estimate: (k,), of the points `rows` (k,): the centres and all of their neighbours.
    """
    values = np.zeros(len(neighbours.starts) - 1)
    values[rows] = estimate
    residual = (values - neighbours.predict(values))[centres]
    if not np.isfinite(residual).any():
        return np.inf
    # E (y − p)² = σ² + t², and t² = s² + κ σ² where neighbours of variance σ² predict
    return max(float(np.nanmean(residual**2)) - (1 + _SHARED) * noise, 0.0)


class Cells(NamedTuple):
    """The predicted points of cells, which are the points nearest to each of b baked ones.

    Attributes: error: float64 (b,), their mean squared error. points: float64 (b,), their number.
    """

    error: Float64s
    points: Float64s

    @classmethod
    def of(cls, cell: Int32s, error: Float64s, baked: Bools) -> Cells:
        """Args: cell, error, baked: (k,), of all points."""
        count: Float64s = np.bincount(cell).astype(np.float64) - 1
        total: Float64s = np.bincount(cell, np.where(baked, 0.0, error)).astype(np.float64, copy=False)
        return cls(total / np.maximum(count, 1.0), count)


class Baked(NamedTuple):
    """The points that are baked: their number, rays of each, mean squared error by rays alone, and denoised."""

    number: int
    samples: int
    noise: float
    error: float


def halve_strides(cells: Cells, stride: Float64s, added_error: float, total: float) -> tuple[Int64s, float]:
    """How often to halve the stride in each cell, (b,), for squared errors of sum `total`; points baked by that.

    Halving a stride divides the error of predicted points by HALVED² and doubles the baked points, so that it gains
    most for a ray where error · stride is largest. Cells are halved down to one level of that, the Lagrange
    multiplier, which is bisected.

    Args: stride: (b,), mean of the predicted points'. added_error: squared error of points that are baked by this.
    """
    max_halvings = np.ceil(np.log2(stride))
    gain = np.log2(np.maximum(cells.error * stride, 1e-30)) / np.log2(2 * HALVED**2)

    def halved(level: float) -> tuple[Float64s, Float64s]:
        halvings = np.clip(np.ceil(gain - level), 0, max_halvings)
        return halvings, np.where(halvings > 0, cells.points * np.minimum(np.exp2(halvings) / stride, 1), 0.0)

    low, high = float(gain.min()) - np.log2(COARSEST), float(gain.max())
    for _ in range(_BISECTIONS):
        level = (low + high) / 2
        halvings, added = halved(level)
        predicted = (cells.points - added) * cells.error * HALVED ** (-2 * halvings)
        low, high = (level, high) if float(np.sum(predicted + added * added_error)) <= total else (low, level)
    halvings, added = halved(low)
    return halvings.astype(np.int64), float(np.sum(added))


def cheapest(cells: Cells, baked: Baked, max_samples: int, goal: float) -> tuple[float, int, Bools]:
    """The least work that reaches a mean squared error: work, rays more of every baked point, cells (b,) to bake."""
    order = np.argsort(cells.error, kind="stable")
    error, count = np.cumsum((cells.error * cells.points)[order]), np.cumsum(cells.points[order])
    best: tuple[float, int, int] = np.inf, max_samples - baked.samples, 0
    choices = np.minimum(8 * np.round(_DEEPER * baked.samples / 8), max_samples - baked.samples)
    for more in map(int, np.unique(choices)):
        baked_error = denoised_error(baked.noise, baked.error, variance_factor(baked.samples, more))
        added_error = min(baked_error, ADDED * goal)
        total = error + added_error * (count[-1] - count) + baked_error * baked.number
        enough = np.flatnonzero(total <= goal * (baked.number + count[-1]))
        kept = int(enough[-1]) + 1 if len(enough) else 0  # cells of least error that stay predicted
        added = count[-1] - (count[kept - 1] if kept else 0)
        if kept or added or baked_error <= MET * goal:
            best = min(best, (baked.number * work(more) + added * work(baked.samples + more), more, kept))
    effort, more, kept = best
    chosen = np.zeros(len(order), np.bool_)
    chosen[order[kept:]] = True
    return effort, more, chosen


def variance_factor(samples: int, more: int) -> float:
    """By what `more` rays multiply the variance of `samples`: lattices of n and m rays are worth n^1.5 + m^1.5."""
    now, added = (float(n) ** RATE for n in (samples, more))
    return now / (now + added)
