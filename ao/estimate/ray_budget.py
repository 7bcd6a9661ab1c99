"""Rays for a tolerance: how many a point, which points next, and probes by which the error is measured.

Rays are planned from pilots, points baked twice with their neighbours. Points are chosen for the least work: rate
allocation by a Lagrange multiplier (Shoham and Gersho, IEEE Trans. ASSP 36, 1988).

Probes, spread over the mesh, are baked twice with independent directions, as a and b. Where w is made of other rays,
(w − a)(w − b) is an unbiased measure of its squared error; once the probe is baked, a is part of w and
(w − b)² − (a − b)²/2 is.
"""

import numpy as np

from raytrace.sampling.sequences import hash32_array
from raytrace.types import Bools, Float64s, Int64s

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
# pilots besides their neighbours, their rays; one point in how many is probed, at least and at most
_SMALL = 48, 32, 8, 128, 768  # below _ALL points
_LARGE = 160, 64, 32, 512, 1536
_ALL = 16384  # points, of which fewer are all baked


class Probes:
    """The points `rows` (j,) at which the error is measured, by two estimates with `samples` rays each.

    Attributes: raw: (j, COLUMNS), one, that of the bake if the point is baked. other: (j,), an independent one.
        variance: mean square error of either. all_baked: whether the mesh is so small that all points are baked.
    """

    def __init__(
        self, tracer: Tracer, points: Points, neighbours: Neighbours, aim: float, max_samples: int, key: np.uint32
    ) -> None:
        self.all_baked = len(points) < _ALL
        tracer.planned = tracer.planned or max(
            tracer.each_column(lambda: _plan(tracer, points, neighbours, aim, max_samples, key))
        )
        self.samples = tracer.planned
        _, _, share, fewest, probes = _SMALL if self.all_baked else _LARGE
        self.rows = _stratified_rows(len(points), int(np.clip(len(points) // share, fewest, probes)))
        probed = points[self.rows]
        self.other = tracer.gather(probed, self.samples, derive(key, 4))[:, W]
        self.raw = tracer.gather(probed, self.samples, key)
        self.variance = sampling_variance(self.raw[:, W], self.other, self.samples)

    def squared(self, w: Float64s, baked: Bools) -> Float64s:
        """Unbiased squared error (j,) of `w` (j,) at the probes. Args: baked: (j,), whether their own is part of it."""
        own = (w - self.other) ** 2 - (self.raw[:, W] - self.other) ** 2 / 2
        return np.where(baked, own, (w - self.raw[:, W]) * (w - self.other))


def _plan(tracer: Tracer, points: Points, neighbours: Neighbours, aim: float, max_samples: int, key: np.uint32) -> int:
    """Rays a point, up to `max_samples`, for a root mean square error of `aim` once points are denoised."""
    pilots, rays, share, *_ = _SMALL if len(points) < _ALL else _LARGE
    rays, keys = min(rays, max_samples), (derive(key, 1), derive(key, 2))
    centres = _stratified_rows(len(points), min(pilots, max(len(points) // (4 * share), 16)))
    ends = [neighbours.indices[neighbours.starts[i] : neighbours.starts[i + 1]] for i in centres]
    rows = np.union1d(centres, np.concatenate(ends))
    first, second = (tracer.gather(points[rows], rays, key)[:, W] for key in keys)
    noise = sampling_variance(first, second, rays)
    w = np.zeros(len(points))
    w[rows] = first
    residual = (w - neighbours.means((w, 0.0))[0])[centres]
    known = np.isfinite(residual).any()
    # E (y − p)² = σ² + t², and t² = s² + κ σ² where neighbours of variance σ² predict
    rough = max(float(np.nanmean(residual**2)) - (1 + _SHARED) * noise, 0.0) if known else np.inf
    counts = np.arange(8, max_samples + 8, 8)
    variance = noise * (rays / counts) ** RATE
    if not known:
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


def _lessened(variance: float, error: float, lessened: float) -> float:
    """The mean square `error` of denoised estimates of `variance` after `variance` is multiplied by `lessened` < 1."""
    gained = 1 - error / variance if variance > 0 else 0.0
    if gained <= 0:
        return error * lessened
    gained_all = max(_GAINED, gained)  # more than that where predictions matter more than rays
    predicted = variance * (gained_all / gained - 1)
    return lessened * variance * (1 - gained_all * lessened * variance / (lessened * variance + predicted))


def _denoised_error(variance: Float64s, predicted: Float64s, gained: float) -> Float64s:
    """Mean square error of estimates shrunk to predictions; `gained`: part of what shrinking all alike would gain."""
    return variance * (1 - gained * variance / (variance + predicted))


def halve_strides(
    error: Float64s, count: Float64s, stride: Float64s, added_error: float, total: float
) -> tuple[Int64s, float]:
    """How often to halve the stride in each cell, (b,), of the points nearest to a baked one, for squared errors of sum
    `total`; points baked by that.

    Halving a stride divides the error of predicted points by HALVED² and doubles the baked points, so that it gains
    most for a ray where error · stride is largest. Cells are halved down to one level of that, the Lagrange
    multiplier, which is bisected.

    Args: error, count, stride: (b,), mean squared error of the predicted points in each cell, their number, and their
        mean stride. added_error: squared error of points that are baked by this.
    """
    max_halvings = np.ceil(np.log2(stride))
    gain = np.log2(np.maximum(error * stride, 1e-30)) / np.log2(2 * HALVED**2)

    def halved(level: float) -> tuple[Float64s, Float64s]:
        halvings = np.clip(np.ceil(gain - level), 0, max_halvings)
        return halvings, np.where(halvings > 0, count * np.minimum(np.exp2(halvings) / stride, 1), 0.0)

    low, high = float(gain.min()) - np.log2(COARSEST), float(gain.max())
    for _ in range(_BISECTIONS):
        level = (low + high) / 2
        halvings, added = halved(level)
        predicted = (count - added) * error * HALVED ** (-2 * halvings)
        low, high = (level, high) if float(np.sum(predicted + added * added_error)) <= total else (low, level)
    halvings, added = halved(low)
    return halvings.astype(np.int64), float(np.sum(added))


def cheapest(
    error: Float64s, count: Float64s, baked: int, samples: int, errors: tuple[float, float], most: int, goal: float
) -> tuple[float, int, Bools]:
    """The least work that reaches a mean squared error: work, rays more of every baked point, cells (b,) to bake.

    Args: error, count: as of `halve_strides`. baked: number of baked points. samples: rays of each, `most` at most.
        errors: their mean squared errors by rays alone, and denoised.
    """
    order = np.argsort(error, kind="stable")
    error, count = np.cumsum((error * count)[order]), np.cumsum(count[order])
    best: tuple[float, int, int] = np.inf, most - samples, 0
    choices = np.minimum(8 * np.round(_DEEPER * samples / 8), most - samples)
    for more in map(int, np.unique(choices)):
        baked_error = _lessened(*errors, variance_factor(samples, more))
        added_error = min(baked_error, ADDED * goal)
        total = error + added_error * (count[-1] - count) + baked_error * baked
        enough = np.flatnonzero(total <= goal * (baked + count[-1]))
        kept = int(enough[-1]) + 1 if len(enough) else 0  # cells of least error that stay predicted
        added = count[-1] - (count[kept - 1] if kept else 0)
        if kept or added or baked_error <= MET * goal:
            best = min(best, (baked * work(more) + added * work(samples + more), more, kept))
    effort, more, kept = best
    chosen = np.zeros(len(order), np.bool_)
    chosen[order[kept:]] = True
    return effort, more, chosen


def variance_factor(samples: int, more: int) -> float:
    """By what `more` rays multiply the variance of `samples`: lattices of n and m rays are worth n^1.5 + m^1.5."""
    now, added = (float(n) ** RATE for n in (samples, more))
    return now / (now + added)


def derive(key: np.uint32, salt: int) -> np.uint32:
    """A key of directions that are independent of the directions of `key`."""
    return hash32_array(hash32_array([salt]) ^ key)[0]


def _stratified_rows(count: int, wanted: int) -> Int64s:
    """`wanted` of `count` rows, one from each equal stretch of Morton order, all if there are no more."""
    wanted = min(count, wanted)
    chance = np.ldexp(hash32_array(np.arange(wanted, dtype=np.uint32)).astype(np.float64), -32)
    return ((np.arange(wanted) + chance) * (count / max(wanted, 1))).astype(np.int64)
