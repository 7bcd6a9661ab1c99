"""Ray allocation: rays of points at first, then by the error that is left, for the least work; errors by rays alone."""

import numpy as np

from obscurance.raytrace.system.parallel import each
from obscurance.raytrace.types import Float32s, Float64s, Int32s, Int64s

from .one_ring import Neighbours

BATCH = 4  # rays are added in multiples of it
RATE = 1.5  # the variance of n rays falls as n^−1.5
TYPICAL, PRIOR = 0.09, 8  # variance of n rays · n^1.5, and how many points this prior is worth: a few may agree by luck
_FIRST, _FEWEST = 0.048, 8  # rays at first, times the tolerance, and at least: with fewer, single jumps stay unseen
FEW_POINTS, _PLENTY = 1 << 15, 0.64  # rays of few points together at first, but of each at most so many / tolerance
_SHARED = 0.2  # variance of a neighbours' mean, relative to one neighbour's
_UNEXPLAINED = 0.06  # part of the squared distance from a neighbours' mean that typical predictions leave
_GAINED = 0.7  # of what shrinking all alike would gain: roughness is not the same everywhere
_FALL = 0.97  # the mean square error of denoised values falls as n^−.97 with n rays a point, or faster
_WORK = 0.6  # the time that n rays of a point take grows as n^.6, for the rays share their walk
_STEPS = np.array([0, 1, *(k << power for power in range(16) for k in (2, 3))])  # batches that a round may add
_SAMPLED = 1 << 14  # points by which rays are planned
_LEAST = 1e-12  # of squared errors that rays are planned for


def sampling_variance(one: Float64s, other: Float64s, rays: int) -> float:
    """Mean square error of either of two independent estimates (k,) with `rays` rays a point."""
    halves = float(np.sum((one - other) ** 2)) / 2
    return float((halves + PRIOR * TYPICAL * rays**-RATE) / (len(one) + PRIOR))


def rays_alone(tolerance: float) -> int:
    """Rays by which a point errs by the `tolerance` without help from other points'."""
    enough = float(TYPICAL / tolerance**2) ** (1 / RATE)
    return int(BATCH * max(round(enough / BATCH), 1))


def first_rays(tolerance: float, count: int) -> int:
    """Rays of a point at first: more where there are few points, which have to tell how many rays are needed."""
    few = min(FEW_POINTS / count, _PLENTY / tolerance)
    return BATCH * max(round(max(_FIRST / tolerance, _FEWEST, few) / BATCH), 1)


def fall_of(neighbours: Neighbours, raw: Float32s, level: float, error: float, goal: float) -> float:
    """The power of the number of rays with which the mean square `error` falls to the `goal`.

    It falls about as the rays grow, while larger cells take the noise away; not slower than what one-rings leave of the
    noise, whose mean square is `level` in values `raw` (k,), where w itself is as rough as it is.
    """
    squared = (raw - neighbours.means(raw, 0.0)) ** 2
    rough = max(float(np.nanmean(squared)) - (1 + _SHARED) * level, 0.0) if np.isfinite(squared).any() else np.inf
    times = np.exp2(np.arange(1, 129) / 8)
    variance = level * times**-RATE
    predicted = _UNEXPLAINED * rough + _SHARED * variance
    by_rings = variance * (1 - _GAINED * variance / (variance + predicted))
    enough = np.minimum(error / times**_FALL, by_rings) <= goal
    needed = times[np.argmax(enough)] if enough.any() else times[-1]
    return float(np.clip(np.log(error / goal) / np.log(needed), _FALL, RATE))


def rays_to_add(error: Float64s, worth: Float64s, most: int, goal: float, fall: float, threads: int) -> Int32s:
    """Rays (k,) to add for squared errors (k,) of mean `goal`, by the least work.

    With n' rays in the place of n, e (n / n')^f is expected of an error e, for work n'^g. The sum of work is least
    where n'^(f + g) is proportional to e n^f; the factor is bisected. Args: worth: n^RATE (k,), of one lattice. most:
    n' at most. fall: f.
    """
    step = max(len(worth) // _SAMPLED, 1)
    some = np.maximum(error[::step], _LEAST)
    now = worth[::step] ** (1 / RATE)
    wish = (some * now**fall) ** (1 / (fall + _WORK))
    low, high = 0.0, most / float(wish.min())
    for _ in range(40):
        factor = (low + high) / 2
        wanted = np.clip(factor * wish, now, most)
        enough = float(np.mean(some * (now / wanted) ** fall)) <= goal
        low, high = (low, factor) if enough else (factor, high)
    more = np.empty(len(worth), np.int32)
    limits = (BATCH * (_STEPS[1:] + _STEPS[:-1]) / 2) ** RATE
    powers = fall / RATE, RATE / (fall + _WORK), high**RATE
    _plan.on(threads)(error, worth, powers, limits, BATCH * _STEPS, more)
    return more


@each("worth")
def _plan(
    i: int,
    error: Float64s,
    worth: Float64s,
    powers: tuple[float, float, float],
    limits: Float64s,
    steps: Int64s,
    more: Int32s,
) -> None:
    """The rays of `steps`, as `more`, by which what each point's rays are worth comes nearest to what is wanted."""
    fall, rate, factor = powers
    wanted = factor * (max(error[i], _LEAST) * worth[i] ** fall) ** rate - worth[i]
    more[i] = steps[np.searchsorted(limits, wanted)]
