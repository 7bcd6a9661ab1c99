"""Screening: a few rays at every point that is not baked, so that no prediction stands unchecked.

A prediction p of w from other points' rays cannot know of a jump of w between them: a contact, a fold, the foot of a
post. An estimate y by a few rays of the point's own can: it is independent of p, so y − p has mean w − p and mean
square σ² + (w − p)², with the variance σ² of y known. What the residuals y − p around a point have in common corrects
its prediction; what they have beyond σ² is its error; and a point whose own residual is an outlier is baked.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ..denoise.one_ring import Neighbours
from ..denoise.shrinkage import distribute_variance, shrunk_to_mean
from ..gather.hemisphere import BATCH_VARIANCE, W
from ..gather.points import Points
from ..trace.tracer import Tracer
from .probes import Probes
from .ray_budget import RATE

Floats = npt.NDArray[np.float64]
Bools = npt.NDArray[np.bool_]

_RAYS = 0.16  # times 1/tolerance: a prediction that is 20 tolerances off differs by 4 to 6 standard deviations
_OUTLIER, _JUMP = 2.25, 3.25  # standard deviations
_SPREAD_REACH = 3  # edges over which the spread between batches is averaged
_REACH = 4  # and residuals; see `Neighbours.own_share`
_MOST = 0.36  # variance of n rays · n^RATE, where w is about one half and all of it is edges
_TYPICAL = 0.4  # of the mean of expected squared errors in each: few rays cannot tell that there is none
_CERTAIN = 1.0  # standard deviations of the excess over σ² that may be chance


class Screening:
    """Few rays at many points.

    Attributes:
        samples: rays a point. screened: bool (k,), which points have them. estimate: float64 (k,), w by them;
        variance: (k,), its mean square error.
    """

    def __init__(
        self, tracer: Tracer, points: Points, neighbours: Neighbours, which: Bools, tolerance: float, probes: Probes,
        key: np.uint32,
    ) -> None:  # fmt: skip
        self.samples = min(8 * max(round(_RAYS / tolerance / 8), 1), probes.samples)
        rows = tracer.gather(points[which], self.samples, key)
        self.estimate = np.zeros(len(points))
        self.screened = which
        self.estimate[which] = rows[:, W]
        spread = np.full(len(points), np.mean(rows[:, BATCH_VARIANCE]))
        spread[which] = rows[:, BATCH_VARIANCE]
        known = which[probes.rows]
        off = self.estimate[probes.rows] - (probes.raw[:, W] + probes.other) / 2
        level = float(np.mean(off[known] ** 2)) - probes.variance / 2 if known.any() else 0.0
        usual = probes.variance * (probes.samples / self.samples) ** RATE
        variance = distribute_variance(neighbours.smooth(spread, _SPREAD_REACH), max(level, usual / 4))
        self.variance = np.minimum(variance, _MOST * self.samples**-RATE)
        self._neighbours = neighbours
        self._own = neighbours.own_share()

    def correct(self, predicted: Floats, error: Floats, free: Bools) -> Floats:
        """Correct the `predicted` w (k,) of points that are not baked, `free` (k,), by what residuals share.

        Their expected squared `error` (k,) is raised in place where residuals show more than it.
        """
        smooth, variance, own = self._neighbours.smooth, self.variance, self._own
        residual = np.where(free, self.estimate - predicted, 0.0).astype(np.float32)
        shared = smooth(residual, _REACH)
        products = np.column_stack([residual * shared - own * variance * free, shared**2])
        moments = smooth(products.astype(np.float32), _REACH)
        part = np.clip(moments[:, 0] / np.maximum(moments[:, 1], 1e-12), 0.0, 1.0)  # least squares
        corrected = predicted + np.where(free, part * shared, 0.0)
        squared = (self.estimate - corrected) ** 2
        excess = smooth(np.where(free, squared - variance * (1 - 2 * part * own), 0.0).astype(np.float32), _REACH)
        excess -= _CERTAIN * np.sqrt(2 * own) * variance
        error[free] = np.maximum(shrunk_to_mean(error[free], _TYPICAL), excess[free])
        return corrected

    def outliers(self, predicted: Floats) -> Bools:
        """Where estimates (k,) differ from the `predicted` w (k,) by more than chance, and who is joined to a jump."""
        squared = (self.estimate - predicted) ** 2 / np.maximum(self.variance, 1e-30)
        jumps = np.where(self.screened & (squared > _JUMP**2), np.float32(1), np.float32(0))
        return (squared > _OUTLIER**2) | (self._neighbours.smooth(jumps, 1) > 0)
