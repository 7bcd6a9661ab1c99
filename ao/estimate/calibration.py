"""Expected squared errors: from the spread between batches of rays, and calibrated by errors that rays measure."""

from typing import NamedTuple

import numpy as np

from obscurance.raytrace.types import Float64s, Int64s

from ..rays.directions import BATCHES

_TYPICAL = 0.2  # part of their mean in each expected squared error
_DEVIATION = 0.3  # of the factor by which expected squared errors are off, which is usually 1
_LEAST = 0.05  # of that factor


class CalibrationGroup(NamedTuple):
    """Points of about the same estimated error; root mean squares."""

    points: int
    estimated: float
    measured: float
    low: float  # `measured` less one standard error
    high: float


class Calibration(NamedTuple):
    """Squared errors (j,) of w at points that were baked a second time."""

    estimated: Float64s  # their level is set by the measured ones
    measured: Float64s  # unbiased, so that some are negative
    weight: Float64s  # how many points of the mesh each stands for

    def whole(self) -> CalibrationGroup:
        """All the points as one group."""
        return self._group(slice(None))

    def groups(self, count: int = 5) -> list[CalibrationGroup]:
        """The points in `count` groups of one size by their estimated error, the least first; none for few points."""
        if len(self.estimated) < 8 * count:
            return []
        groups = np.array_split(np.argsort(self.estimated, kind="stable"), count)
        return [self._group(group) for group in groups]

    def _group(self, members: Int64s | slice) -> CalibrationGroup:
        """Some of the points as one group."""
        measured = self.measured[members]
        weight = self.weight[members] / max(float(np.sum(self.weight[members])), 1e-300)
        mean = float(weight @ measured)
        standard_error = float(np.sqrt(weight**2 @ measured**2))
        estimated = float(weight @ self.estimated[members])
        squares = estimated, mean, mean - standard_error, mean + standard_error
        return CalibrationGroup(len(measured), *(float(np.sqrt(max(square, 0.0))) for square in squares))


def calibration_factor(expected: float, measured: float, variance: float) -> float:
    """The factor by which squared errors of the mean `expected` are off that are `measured` in the mean.

    Args: variance: of what is measured. The more it scatters, relative to what is measured or, if that is more, to what
        is expected, the less it counts.
    """
    if expected <= 0:
        return 1.0
    scatter = variance / max(measured, expected) ** 2
    return max(1.0 + (measured / expected - 1.0) / (1.0 + scatter / _DEVIATION**2), _LEAST)


def mean_square(values: Float64s) -> float:
    return float(np.einsum("i,i", values, values)) / max(len(values), 1)


def shrunk_to_mean(squared: Float64s) -> Float64s:
    """Expected squared errors (k,) shrunk towards their mean, for they are uncertain themselves."""
    if not len(squared):
        return squared
    shrunk: Float64s = np.mean(squared) - squared
    shrunk *= _TYPICAL
    shrunk += squared
    return shrunk


def variance_line(typical: float, level: float) -> tuple[float, float]:
    """The slope and the value at 0 by which `distribute_variance` makes variances from spreads of mean `typical`."""
    freedom = BATCHES - 1 if typical else 0
    return level * freedom / (max(typical, 1e-300) * (freedom + 1)), level / (freedom + 1)


def distribute_variance(spread: Float64s, level: float) -> Float64s:
    """Variances (k,) of mean `level`, distributed as the `spread` (k,) between each point's batches.

    It is shrunk to its mean by one degree of freedom: lucky agreement never reads as certainty.
    """
    slope, at_zero = variance_line(float(np.mean(spread)) if len(spread) else 0.0, level)
    return slope * spread + at_zero
