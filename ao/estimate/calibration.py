"""Calibration of a bake's errors: expected errors beside errors that independent rays measure."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from raytrace.types import Float64s


class CalibrationGroup(NamedTuple):
    """Points of about the same estimated error.

    Attributes:
        estimated, measured: root mean squares. low, high: of `measured`, one standard error below and above.
    """

    points: int
    estimated: float
    measured: float
    low: float
    high: float


@dataclass(frozen=True, eq=False)
class Calibration:
    """Squared errors of w at j points that were baked a second time.

    Attributes:
        estimated: float64 (j,), as the bake estimates them; their level is set by the measured ones.
        measured: float64 (j,), unbiased, so that some are negative.
    """

    estimated: Float64s
    measured: Float64s

    def whole(self) -> CalibrationGroup:
        return _group(self.estimated, self.measured)

    def groups(self, count: int = 5) -> list[CalibrationGroup]:
        """The points in `count` groups of one size by their estimated error, the least first; none for few points."""
        if len(self.estimated) < 8 * count:
            return []
        rows = np.array_split(np.argsort(self.estimated, kind="stable"), count)
        return [_group(self.estimated[each], self.measured[each]) for each in rows]


def _group(estimated: Float64s, measured: Float64s) -> CalibrationGroup:
    count = max(len(measured), 1)
    mean, doubt = float(np.sum(measured)) / count, float(np.sqrt(np.sum(measured**2))) / count
    squares = float(np.sum(estimated)) / count, mean, mean - doubt, mean + doubt
    return CalibrationGroup(len(measured), *(float(np.sqrt(max(square, 0.0))) for square in squares))
