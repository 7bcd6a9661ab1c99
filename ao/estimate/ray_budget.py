"""Rays a point for a tolerance, planned from pilots: points that are baked twice with their neighbours."""

from typing import NamedTuple

import numpy as np

from raytrace.types import Float64s, Int64s

from ..execute.tracer import Tracer
from ..points.points import Points
from ..rays.estimator import W
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
