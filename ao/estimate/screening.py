"""Screening: a few rays at every point that is not baked, so that no prediction stands unchecked.

A prediction p of w from other points' rays cannot know of a jump of w between them: a contact, a fold, the foot of a
post. An estimate y by a few rays of the point's own can: it is independent of p, so y − p has mean w − p and mean
square σ² + (w − p)², with the variance σ² of y known. What the residuals y − p around a point have in common corrects
its prediction; what they have beyond σ² is its error; and a point whose own residual is an outlier is baked.
"""

import numpy as np

from raytrace.types import AnyFloats, Bools, Float64s

from ..execute.tracer import Tracer
from ..points.points import Points
from ..rays.gather import BATCH_VARIANCE, W
from .calibration import distribute_variance, shrunk_to_mean
from .one_ring import Neighbours
from .ray_budget import RATE, Probes
from .shrinkage import shape_of
from .upsampling import coarsened, nearest_baked

_RAYS = 0.16  # times 1/tolerance: a prediction that is 20 tolerances off differs by 4 to 6 standard deviations
_OUTLIER, _JUMP = 2.25, 3.25  # standard deviations
_REACH = 4  # edges over which residuals are averaged
_GROUP = 8  # points, about, whose squares are summed, and averaged with the sums of neighbouring groups
_MOST = 0.36  # variance of n rays · n^RATE, where w is about one half and all of it is edges
_TYPICAL = 0.4  # of the mean of expected squared errors in each: few rays cannot show that an error is 0
_CERTAIN = 1.0  # standard deviations of the excess over σ² that may be chance


def screening_samples(tolerance: float, max_samples: int) -> int:
    """Screening rays a point, `max_samples` at most."""
    return min(8 * max(round(_RAYS / tolerance / 8), 1), max_samples)


class Screening:
    """Estimates of w by a few rays, `samples`, at the `screened` points (k,), and their mean square errors (k,)."""

    def __init__(
        self, tracer: Tracer, points: Points, neighbours: Neighbours, which: Bools, tolerance: float, probes: Probes,
        key: np.uint32,
    ) -> None:  # fmt: skip
        self.samples = screening_samples(tolerance, probes.samples)
        rows = tracer.gather(points[which], self.samples, key)
        self.estimate = np.zeros(len(points))
        self.screened = which
        self.estimate[which] = rows[:, W]
        self._neighbours = neighbours
        weight = shape_of(neighbours, points).self_weight
        self._self_weights = weight * (1 + weight) / 2  # about, of four rounds of `smooth`, for valences from 1 to 8
        every = np.arange(len(points))
        nearest = nearest_baked(neighbours, every % _GROUP == 0)
        self._groups, _, self._group = coarsened(neighbours, np.where(nearest < 0, every, nearest), points.normals)
        spread = np.zeros(len(points))
        spread[which] = rows[:, BATCH_VARIANCE]
        spread, count = self._sums(spread, which)
        spread = np.where(count > 0, spread / np.maximum(count, 1e-30), np.mean(rows[:, BATCH_VARIANCE]))
        known = which[probes.rows]
        off = self.estimate[probes.rows] - (probes.raw[:, W] + probes.other) / 2
        level = float(np.mean(off[known] ** 2)) - probes.variance / 2 if known.any() else 0.0
        usual = probes.variance * (probes.samples / self.samples) ** RATE
        variance = distribute_variance(spread, max(level, usual / 4))
        self.variance = np.minimum(variance, _MOST * self.samples**-RATE)[self._group]
        (self._count,) = self._sums(np.ones(len(points)))

    def _sums(self, *columns: AnyFloats | Bools) -> Float64s:
        """Sums (c, g) of values (k,) over each group, averaged with the sums of neighbouring groups."""
        sums = (np.bincount(self._group, values, len(self._groups.starts) - 1).astype(np.float64) for values in columns)
        return np.array([self._groups.smooth(each, 1) for each in sums])

    def correct(self, predicted: Float64s, error: Float64s, free: Bools) -> Float64s:
        """Correct the `predicted` w (k,) of points that are not baked, `free` (k,), by what residuals share.

        Their expected squared `error` (k,) is raised where residuals show more than it.
        """
        residual = np.where(free, self.estimate - predicted, 0.0).astype(np.float32)
        shared = self._neighbours.smooth(residual, _REACH)
        noise = np.where(free, self.variance, 0.0)
        product, square = self._sums(residual * shared - self._self_weights * noise, shared**2)
        part = np.clip(product / np.maximum(square, 1e-12), 0.0, 1.0)[self._group]  # least squares
        change = np.where(free, part * shared, 0.0)
        beyond = (residual - change) ** 2 - noise * (1 - 2 * part * self._self_weights)
        excess, chance = self._sums(beyond, self._self_weights * noise**2) / self._count
        excess -= _CERTAIN * np.sqrt(2 * chance)
        error[free] = np.maximum(shrunk_to_mean(error[free], _TYPICAL), excess[self._group[free]])
        return predicted + change

    def outliers(self, predicted: Float64s) -> Bools:
        """Points (k,) where estimates and `predicted` w (k,) differ by more than chance, and neighbours of jumps."""
        squared = (self.estimate - predicted) ** 2 / np.maximum(self.variance, 1e-30)
        jumps = np.where(self.screened & (squared > _JUMP**2), np.float32(1), np.float32(0))
        return (squared > _OUTLIER**2) | (self._neighbours.smooth(jumps, 1) > 0)

    def combined(self, predicted: Float64s, error: Float64s, free: Bools) -> Float64s:
        """The `predicted` w (k,), where `free` (k,) averaged with the estimates, each weighted by its precision.

        Empirical Bayes (Efron and Morris, JASA 68, 1973): the expected squared `error` (k,) of predictions is itself
        estimated, too roughly to say that the mean is better than they are.
        """
        gain = np.where(free, error / np.maximum(error + self.variance, 1e-30), 0.0)
        return predicted + gain * (self.estimate - predicted)
