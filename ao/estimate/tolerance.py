"""Baking to a tolerance: rays at every point, a few at first, more where the error that is left asks for them.

Every point gets some rays, so that no jump of w stays unseen; values are denoised over all scales, and the error that
is left at each point says how many more rays it gets: rate allocation by a Lagrange multiplier (Shoham & Gersho 1988).
Probes, spread over the points, measure the error by rays that are no part of any estimate.
"""

import warnings
from typing import NamedTuple

import numpy as np

from raytrace.mesh.mesh import Mesh
from raytrace.mesh.solids import inward_warnings
from raytrace.types import Float32s, Float64s, Int64s

from ..execute.tracer import Tracer
from ..options import Options
from ..points.points import Points
from ..rays.gather import BATCH_VARIANCE, BENT, COLUMNS, W
from .calibration import Calibration, calibration_factor
from .inside import holes
from .one_ring import Neighbours
from .sampling_error import RATE, TYPICAL, derive, sampling_variance, stratified_rows, variance_factor
from .scales import denoise_over_scales

_AIM = 0.92  # times the goal is aimed at: a few rays more, later, are worth little
_FARTHEST = 20.0  # times that the squared error may have to fall for the rays to be foreseen; else some come before
_NEAR, _UNEVEN = 2.0, 2.5  # the same at jumps of w, where its mean square is so many times its squared mean
_FIRST, _FEWEST = 0.048, 8  # rays at first, times the tolerance, and at least: with fewer, single jumps stay unseen
_BATCH = 4  # rays are added in multiples of these
_ROUNDS = 8  # of adding rays, at most
_FEW_POINTS, _PLENTY = 1 << 15, 0.64  # all points have so many rays together at first, but a point so many / tolerance
_SHARED = 0.2  # variance of a neighbours' mean, relative to one neighbour's
_UNEXPLAINED = 0.06  # part of the squared distance from a neighbours' mean that typical predictions leave
_GAINED = 0.7  # of what shrinking all alike would gain: roughness is not the same everywhere
_FALL = 1.08  # the mean square error of denoised values falls as n^−1.08 with n rays a point, or faster
_WORK = 0.6  # the time that n rays of a point take grows as n^.6, for they share their walk
_STEPS = np.array([0, 1, *(k << power for power in range(16) for k in (2, 3))])  # batches that a round may add
_SAMPLED = 1 << 14  # points by which rays are planned
_PROBED, _FEWEST_PROBES, _MOST_PROBES = 16, 96, 1024  # one point in how many is probed, at least and at most
_SCATTER = 5.0  # variance of a squared error that two estimates with as large an error measure, relative to its square
_PRIOR = 64  # probes that what is expected of their noise is worth


class ToleranceWarning(UserWarning):
    """A bake's estimated error exceeds the tolerance asked for."""


def shortfalls(
    options: Options, rmse: float, samples: int, each: str, solid: Mesh, vertices: Float32s
) -> tuple[str, ...]:
    """How a bake with `samples` rays at `each` point falls short of what was asked for, in words, a tolerance in a
    warning, too; closed parts of the `solid` that look inwards; and what rays in one with holes mean for its thickness.

    Args: vertices: of the solid and what else occludes, in render space.
    """
    found = []
    if options.tolerance is not None and rmse > options.tolerance:
        reason = f": {samples:,} rays a {each} were allowed" if samples >= options.rays else ""
        found = [f"tolerance {options.tolerance:g} is not met, the estimated RMSE is {rmse:.3g}{reason}"]
        warnings.warn(found[0], ToleranceWarning, stacklevel=4)  # whoever called the face, which a decorator wraps
    if options.thickness:
        return (*found, *holes(solid))
    return (*found, *inward_warnings(solid, vertices[: len(solid.vertices)]))


class Estimate(NamedTuple):
    """Values of points, and their errors."""

    rows: Float64s  # (k, 4), w and the mean of μ·direction (x, y, z)
    variance: Float64s  # (k,), mean square error of w expected
    samples: int  # rays of a point, the most that one has
    spared: int = 0  # rays fewer than that at the other points
    calibration: Calibration | None = None  # of the variances, at some of the points

    def skipped(self, hidden: int) -> dict[str, int]:
        """Rays not traced, by reason. Args: hidden: number of points inside solids."""
        return {"predicted": self.spared, "hidden": self.samples * hidden}


def estimate_to(
    tracer: Tracer, points: Points, neighbours: Neighbours, tolerance: float, max_samples: int, key: np.uint32
) -> Estimate:
    """Estimates whose root mean square error over all points is `tolerance`, if `max_samples` rays a point allow it.

    Of several falloffs all meet it, by the same rays.
    """
    if not tracer.planned:
        probes = _Probes(tracer, points, tolerance, max_samples, key)
        goal = tolerance**2 / (1 + probes.doubt)
        rays = np.zeros(len(points), np.int64)
        worth = np.zeros(len(points))
        more = np.full(len(points), min(_first_rays(tolerance, len(points)), max_samples))
        gathered = [np.zeros((len(points), COLUMNS)) for _ in range(tracer.columns)]
        for turn in range(_ROUNDS):
            found = list[Estimate]()  # lets go of the last ones
            tracer.stage = f"rays, round {turn + 1}"
            _add_rays(tracer, points, gathered, worth, more, derive(key, 16 + turn))
            rays += more
            worth = (worth**RATE + more**RATE) ** (1 / RATE)
            found = [
                _estimated(points, neighbours, rows, (rays, worth), probes, column)
                for column, rows in enumerate(gathered)
            ]
            means = [float(np.mean(each.variance)) for each in found]
            column = int(np.argmax(means))
            if means[column] <= goal or (rays >= max_samples).all():
                break
            relative = [each.variance / max(mean, 1e-30) for each, mean in zip(found, means, strict=True)]
            error = means[column] * np.max(relative, axis=0)
            beyond = means[column] / goal
            farthest = _FARTHEST if np.mean(error**2) < _UNEVEN * np.mean(error) ** 2 else _NEAR
            aim = goal * (_AIM if beyond < farthest else beyond ** (2 / 3))
            raw = gathered[column][:, W]
            fall = _fall(neighbours, raw, probes.level(raw, worth, column), means[column], aim)
            more = np.minimum(_rays_to_add(error, worth, max_samples, aim, fall), max_samples - rays)
        tracer.planned = found
    return tracer.planned[tracer.column]


def _first_rays(tolerance: float, count: int) -> int:
    """Rays at first: few, more where there are few points, of which some have to tell how many more are needed."""
    few = min(_FEW_POINTS / count, _PLENTY / tolerance)
    return _BATCH * max(round(max(_FIRST / tolerance, _FEWEST, few) / _BATCH), 1)


def _fall(neighbours: Neighbours, raw: Float64s, level: float, error: float, goal: float) -> float:
    """The power of the number of rays with which the mean square `error` falls to the `goal`.

    It falls about as the rays grow, while larger cells take the noise away; not slower than what one-rings leave of the
    noise, whose mean square is `level` in values `raw` (k,), where w itself is as rough as it is.
    """
    squared = (raw - neighbours.means((raw, 0.0))[0]) ** 2
    rough = max(float(np.nanmean(squared)) - (1 + _SHARED) * level, 0.0) if np.isfinite(squared).any() else np.inf
    times = np.exp2(np.arange(1, 129) / 8)
    variance = level * times**-RATE
    predicted = _UNEXPLAINED * rough + _SHARED * variance
    by_rings = variance * (1 - _GAINED * variance / (variance + predicted))
    enough = np.minimum(error / times**_FALL, by_rings) <= goal
    needed = times[np.argmax(enough)] if enough.any() else times[-1]
    return float(np.clip(np.log(error / goal) / np.log(needed), _FALL, RATE))


def _add_rays(
    tracer: Tracer, points: Points, gathered: list[Float64s], worth: Float64s, more: Int64s, key: np.uint32
) -> None:
    """Trace `more` rays (k,) at the points and put them into the rows (k, COLUMNS) of each falloff, by which the points
    have as much as one lattice of `worth` (k,) rays."""
    tracer.expected = tracer.rays + int(more.sum())
    for count in np.flatnonzero(np.bincount(more[more > 0])):  # `np.unique` would import `numpy.ma`
        which = more == count
        kept = variance_factor(worth[which], int(count))[:, None]
        subset = points[which]

        def added() -> Float64s:
            return tracer.gather(subset, int(count), key)  # noqa: B023

        for rows, new in zip(gathered, tracer.each_column(added), strict=True):
            before = rows[which]
            spread = kept[:, 0] ** 2 * before[:, BATCH_VARIANCE] + (1 - kept[:, 0]) ** 2 * new[:, BATCH_VARIANCE]
            before -= new
            before *= kept
            before += new
            before[:, BATCH_VARIANCE] = spread
            rows[which] = before


def _estimated(
    points: Points,
    neighbours: Neighbours,
    rows: Float64s,
    rays: tuple[Int64s, Float64s],
    probes: "_Probes",
    column: int,
) -> Estimate:
    """The estimate by what is gathered, its errors scaled to what the probes measure. Args: rays: (k,), and what they
    are worth, (k,)."""
    traced, worth = rays
    level = probes.level(rows[:, W], worth, column)

    def risk(w: Float64s) -> float:
        return float(np.mean(probes.squared(w, column)))

    w, error = denoise_over_scales(neighbours, points, rows, level, probes.rows, risk)
    measured = probes.squared(w[probes.rows], column)
    error = error * calibration_factor(error[probes.rows], measured, error)
    calibration = Calibration(error[probes.rows], measured)
    values = np.column_stack([w, rows[:, BENT:]])
    most = int(traced.max())
    return Estimate(values, error, most, most * len(traced) - int(traced.sum()), calibration)


def _rays_to_add(error: Float64s, worth: Float64s, most: int, goal: float, fall: float) -> Int64s:
    """Rays (k,) to add for squared errors (k,) of mean `goal`, by the least work.

    With n' rays in the place of n, e (n / n')^f is expected of an error e, for work n'^g. Their sum is least where
    n'^(f + g) is proportional to e n^f; the factor is bisected. Args: worth: n (k,), of one lattice. most: n' at most.
    fall: f.
    """
    step = max(len(worth) // _SAMPLED, 1)
    some = np.maximum(error[::step], 1e-12)
    now = worth[::step]
    wish = (some * now**fall) ** (1 / (fall + _WORK))
    low, high = 0.0, most / float(wish.min())
    for _ in range(40):
        factor = (low + high) / 2
        wanted = np.clip(factor * wish, now, most)
        enough = float(np.mean(some * (now / wanted) ** fall)) <= goal
        low, high = (low, factor) if enough else (factor, high)
    wanted = np.maximum(high * (np.maximum(error, 1e-12) * worth**fall) ** (1 / (fall + _WORK)), worth)
    batches = (wanted**RATE - worth**RATE) ** (1 / RATE) / _BATCH
    return _BATCH * _STEPS[np.searchsorted((_STEPS[1:] + _STEPS[:-1]) / 2, batches)]


class _Probes:
    """Points at which the error is measured: `rows` (j,), each by two independent estimates for every falloff."""

    def __init__(self, tracer: Tracer, points: Points, tolerance: float, max_samples: int, key: np.uint32) -> None:
        count = int(np.clip(len(points) // _PROBED, _FEWEST_PROBES, _MOST_PROBES))
        self.rows = stratified_rows(len(points), count)
        enough = (TYPICAL / tolerance**2) ** (1 / RATE)  # more would not make up for fewer probes: both err by as much
        self._samples = int(min(_BATCH * max(round(enough / _BATCH), 1), max(max_samples, _BATCH)))
        probed = points[self.rows]

        def traced(salt: int) -> tuple[Float64s, Float64s]:
            here = tracer.gather(probed, self._samples, derive(key, salt))
            elsewhere = tracer.gather_elsewhere(probed, self._samples, derive(key, salt + 2), here)
            return here[:, W], elsewhere[:, W]

        pairs = tracer.each_column(lambda: (traced(4), traced(5)))
        self._here = [(first[0], second[0]) for first, second in pairs]
        self._elsewhere = [(first[1], second[1]) for first, second in pairs]

    @property
    def doubt(self) -> float:
        """Standard error of the mean square error that is measured, relative to it."""
        return float(np.sqrt(_SCATTER / len(self.rows)))

    def squared(self, w: Float64s, column: int) -> Float64s:
        """Unbiased squared errors (j,) of `w` (j,) at the probes, as the estimates are independent."""
        first, second = self._elsewhere[column]
        return (w - first) * (w - second)

    def level(self, raw: Float64s, worth: Float64s, column: int) -> float:
        """Mean square error of values `raw` (k,) by rays alone, `worth` (k,) of them: as measured, and, where there are
        few probes, as the noise of the probes' own rays lets expect."""
        first, second = self._here[column]
        own = sampling_variance(first, second, self._samples)
        expected = own * float(np.mean((self._samples / worth) ** RATE))
        measured = max(float(np.sum((raw[self.rows] - first) * (raw[self.rows] - second))), 0.0)
        return (measured + _PRIOR * expected) / (len(self.rows) + _PRIOR)
