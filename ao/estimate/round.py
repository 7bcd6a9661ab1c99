"""The estimate that a bake has by the rays so far: denoised, and its errors scaled to what is measured."""

from typing import NamedTuple, Self

import numpy as np

from obscurance.raytrace.types import AnyFloats, Bools, Float64s, Int64s

from ..rays.gather import BATCH_VARIANCE, BENT, W
from .calibration import Calibration, distribute_variance, shrunk_to_mean
from .copies import Copies
from .probes import Checks, Probes
from .sampling_error import TYPICAL
from .scales import denoise_over_scales
from .sites import KINDS, ONE_PLACE, PREDICTED, Sites
from .tolerance import Estimate


class Round(NamedTuple):
    """Estimates of k sites, of which b are traced, by one falloff."""

    column: int  # which falloff
    sites: Sites
    gathered: AnyFloats  # (b, COLUMNS), by the rays alone
    level: float  # mean square error of w in it
    w: Float64s  # (b,), denoised
    error: Float64s  # (k,), squared, expected
    calibration: Calibration | None = None

    @classmethod
    def of(cls, own: Copies, sites: Sites, deciding: Probes, column: int, denoise: bool) -> Self:
        """The estimate by the rays of `own` (k,), its errors not yet scaled. Args: deciding: how much is denoised."""
        gathered = own.gathered[column][sites.traced]
        checks = deciding.checks(sites, column)
        raw = gathered[:, W].astype(np.float64)
        level = checks.level(gathered[:, W], own.worth[sites.traced])
        if len(raw) and not gathered[:, BATCH_VARIANCE].any() and (raw == raw[0]).all():
            level = min(level, float(own.rays.sum()) ** -2.0)  # of n rays that agree, the next may not (Laplace)
        variance = shrunk_to_mean(distribute_variance(gathered[:, BATCH_VARIANCE].astype(np.float64), level))
        w, error = raw, variance
        if denoise:
            single = gathered.astype(np.float32, copy=False)
            w, error = denoise_over_scales(
                sites.graph, sites.traced_points, single, level, checks.rows, checks.mean_squared
            )
            _leave_out_harm(sites, checks, raw, variance, w, error)
        return cls(column, sites, gathered, level, w, sites.errors_at_all(error, w))

    def told(self, measuring: Probes) -> Self:
        """The same with its errors scaled, in place, to what probes measure."""
        at_probes = self.sites.values_at(measuring.rows, self.w[:, None])[:, 0]
        return self._replace(calibration=measuring.calibrate(self.sites, self.error, at_probes, self.column))

    @property
    def mean(self) -> float:
        """The mean square error expected."""
        return float(np.mean(self.error))

    def errs_by_more(self, limit: float) -> Bools:
        """The traced sites (b,) expected to err by more; where w differs by more from the neighbours', by their own
        rays."""
        unlike = (self.w - self.sites.graph.means(self.w.astype(np.float32), 0.0)) ** 2
        variance = distribute_variance(self.gathered[:, BATCH_VARIANCE].astype(np.float64), self.level)
        return np.asarray((self.error[self.sites.traced] > limit**2) | (np.minimum(variance, unlike) > limit**2))

    def by_own_rays(self, again: Int64s, own: Copies, measuring: Probes) -> Self:
        """The same with the traced sites `again` (j,), traced since, as their own rays say, without denoising."""
        if not len(again):
            return self
        gathered = own.gathered[self.column][self.sites.traced]
        at_all = np.arange(len(self.sites))[self.sites.traced][again]
        self.w[again] = gathered[again, W]
        missed = np.where(self.sites.kinds[at_all] == ONE_PLACE, 0.0, gathered[again, BATCH_VARIANCE])
        self.error[at_all] = TYPICAL / own.worth[at_all] + missed
        return self._replace(gathered=gathered).told(measuring)

    def measured(self, kind: int, probes: Probes) -> tuple[float, float]:
        """The mean square error measured at sites of a kind, and its standard error; nothing where none is probed."""
        assert self.calibration
        of_kind = self.sites.kinds[probes.rows] == kind
        squared, weight = self.calibration.measured[of_kind], self.calibration.weight[of_kind]
        total = max(float(weight.sum()), 1e-300)
        return float(weight @ squared) / total, float(np.sqrt(weight**2 @ squared**2)) / total

    def share(self, kind: int) -> float:
        """The part of the squared error that sites of a kind have."""
        return float(self.error[self.sites.kinds == kind].sum()) / max(float(self.error.sum()), 1e-300)

    def estimate(self, rays: Int64s) -> Estimate:
        """The estimates of all sites, of so many `rays` (k,)."""
        count = len(self.sites)
        values = np.column_stack([self.w, self.gathered[:, BENT:]])
        if self.sites.cell is not None:
            values = self.sites.values_at(np.arange(count), values)
        most = int(rays.max(initial=0))
        worst = max(range(len(KINDS)), key=self.share)
        return Estimate(values, self.error, most, most * count - int(rays.sum()), self.calibration, KINDS[worst])


def _leave_out_harm(
    sites: Sites, checks: Checks, raw: Float64s, variance: Float64s, w: Float64s, error: Float64s
) -> None:
    """Give raw values back, in place, to the kinds of sites of which denoising is measured to do harm."""
    kinds = sites.kinds[sites.traced]
    gain = checks.weight * (checks.squared(raw[checks.rows]) - checks.squared(w[checks.rows]))
    for kind in range(PREDICTED):
        if float(np.sum(gain[kinds[checks.rows] == kind])) < 0:
            w[kinds == kind], error[kinds == kind] = raw[kinds == kind], variance[kinds == kind]
