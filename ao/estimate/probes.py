"""Sites at which the error of a bake is measured, by rays that are no part of any estimate.

Each has two estimates a and b, independent of the result and of each other, at places drawn from all of the site:
(w − a)(w − b) is an unbiased squared error of w, whatever made it. Where w jumps, few sites have most of the squared
error. So probes are a stratified sample with optimum allocation (Neyman 1934): some are spread over all sites, the
others over those where the largest errors are expected.
"""

from typing import Any, NamedTuple, Self

import numpy as np

from obscurance.raytrace.kernel.jit import kernel
from obscurance.raytrace.sampling import derive, stratified_rows
from obscurance.raytrace.system.parallel import each
from obscurance.raytrace.types import AnyFloats, Float32Rows, Float32s, Float64Rows, Float64s, Int32s, Int64s

from ..execute.tracer import Tracer
from ..points.points import Points
from ..rays.gather import BATCH_VARIANCE, COLUMNS, W
from .calibration import Calibration, calibration_factor, mean_square
from .ray_plan import BATCH, RATE, sampling_variance
from .sites import KINDS, Sites

_LARGEST = 0.05  # part of the sites that count as largest errors
_SAMPLED = 1 << 14  # sites by which the largest errors are found
_MARGIN = 10.0  # times one by the number of probes
_PRIOR = 64  # probes that what is expected of their noise is worth
_GROWN = 1.25  # times as many rays a site must have as its probe for the probe to get more
_SHARERS = 4  # of many points, so many share a lattice at first, so that denoising averages what is even
_ENOUGH = 32  # rays from which each point has a lattice of its own, which is more even than a share of a larger one


class Copies:
    """Estimates of j sites by rays of their own, with the number of rays of each and what they are worth.

    Attributes:
        points: of the sites. elsewhere: whether their places are drawn from all of each site.
        gathered: (j, COLUMNS) by each falloff, float32, or float64 of one round that is not denoised.
    """

    def __init__(
        self, tracer: Tracer, points: Points, elsewhere: bool = False, dtype: type[np.floating[Any]] = np.float32
    ) -> None:
        self.tracer = tracer
        self.points = points
        self.elsewhere = elsewhere
        self._amount = np.zeros(len(points), np.int32)  # which of these each site has
        self._rays = np.zeros(1, np.int32)
        self._worth = np.zeros(1)
        self.gathered: list[AnyFloats] = [np.zeros((len(points), COLUMNS), dtype) for _ in range(tracer.columns)]

    @classmethod
    def of_one_round(
        cls, tracer: Tracer, points: Points, rays: int, key: np.uint32, dtype: type[np.floating[Any]]
    ) -> Self:
        """Copies of one round, with as many `rays` at every site. Args: dtype: of `gathered`."""
        copies = cls(tracer, points, dtype=dtype)
        for part, rows in tracer.gather_in_parts(points, rays, key):
            for column, gathered in enumerate(copies.gathered):
                gathered[part] = rows[:, column]
        copies._rays[0], copies._worth[0] = rays, float(rays) ** RATE
        return copies

    @property
    def rays(self) -> Int32s:
        """The number of rays (j,) of each."""
        return self.rays_at(slice(None))

    def rays_at(self, rows: Int64s | slice) -> Int32s:
        """The number of rays (i,) of some of the sites."""
        return self._rays[self._amount[rows]]

    def worth_at(self, rows: Int64s | slice) -> Float64s:
        """What the rays of some of the sites are worth (i,): n^RATE of n rays in one lattice."""
        return self._worth[self._amount[rows]]

    def add(self, more: Int32s, key: np.uint32, shared: bool = False) -> None:
        """Trace `more` rays (j,) at the sites.

        Args: shared: neighbours share lattices; most of them are to get as many rays.
        """
        tracer = self.tracer
        if not self.elsewhere:  # probes' rays are few
            tracer.expected = tracer.rays + int(more.sum())
        numbers = np.bincount(more)
        for count in (np.flatnonzero(numbers[1:]) + 1).tolist():
            leap = _SHARERS if shared and count < _ENOUGH else 1
            which = np.empty(numbers[count], np.int32)
            _find(more, count, which)
            self._trace(which, count, key, leap)

    def _trace(self, which: Int32s, count: int, key: np.uint32, leap: int) -> None:
        """Trace so many rays more at each of the sites `which` (i,)."""
        tracer = self.tracer
        some = None if len(which) == len(self.points) else which
        for part, rows in tracer.gather_in_parts(self.points, count, key, leap, self.elsewhere, some):
            have = self._amount, self._worth
            for column, gathered in enumerate(self.gathered):
                new = np.ascontiguousarray(rows[:, column], np.float64)
                _combine.on(tracer.threads)(which[part], have, float(count) ** RATE, new, gathered)
            self._count(which[part], count)
            del rows, new  # before there are others

    def _count(self, which: Int32s, more: int) -> None:
        """Count so many `more` rays at sites `which` (i,)."""
        had = self._amount[which]
        amounts = np.flatnonzero(np.bincount(had))
        number = np.zeros(len(self._rays), np.int32)
        number[amounts] = len(self._rays) + np.arange(len(amounts))
        self._amount[which] = number[had]
        self._rays = np.append(self._rays, self._rays[amounts] + np.int32(more))
        self._worth = np.append(self._worth, self._worth[amounts] + float(more) ** RATE)


@kernel
def _find(more: Int32s, count: int, which: Int32s) -> None:
    """Write the rows of `more` that are `count`."""
    found = 0
    for i in range(len(more)):
        if more[i] == count:
            which[found] = i
            found += 1


@each("which")
def _combine(
    k: int, which: Int32s, have: tuple[Int32s, Float64s], more: float, new: Float64Rows, gathered: Float32Rows
) -> None:
    """Average what is `gathered` with `new` values, worth `more`, in proportion to what both are worth.

    Args: have: which amount of rays each site has, and what these are worth.
    """
    i = which[k]
    amount, worth = have
    kept = worth[amount[i]] / (worth[amount[i]] + more)
    for column in range(COLUMNS):
        if column == BATCH_VARIANCE:
            gathered[i, column] = kept**2 * gathered[i, column] + (1.0 - kept) ** 2 * new[k, column]
        else:
            gathered[i, column] = new[k, column] + kept * (gathered[i, column] - new[k, column])


class Checks(NamedTuple):
    """Two estimates, by one falloff, of each of some traced sites."""

    rows: Int64s  # (j,), of the traced sites
    one: Float64s
    other: Float64s
    weight: Float64s  # of sum 1
    rays: Int32s  # (j,), of each estimate
    spread: int  # so many first ones are spread evenly

    def squared(self, w: Float64s) -> Float64s:
        """Unbiased squared errors (j,) of `w` (j,)."""
        return (w - self.one) * (w - self.other)

    def mean_squared(self, w: Float64s) -> float:
        """The mean squared error over all traced sites, of which `w` (j,) is given."""
        return float(self.weight @ self.squared(w))

    def level(self, raw: Float32s, worth: Float64s) -> float:
        """Mean square error of values `raw` (b,) by rays alone, which are `worth` (b,): as measured, and, where there
        are few probes, as the noise of the probes' own rays lets expect."""
        even = slice(self.spread)
        one, other = self.one[even], self.other[even]
        rays = max(int(np.mean(self.rays[even])), 1) if self.spread else 1
        expected = sampling_variance(one, other, rays) * float(rays**RATE * np.mean(1 / worth))
        here = raw[self.rows[even]]
        measured = max(float(np.sum((here - one) * (here - other))), 0.0)
        return (measured + _PRIOR * expected) / (len(here) + _PRIOR)


class Probes:
    """A set of probes: `rows` (j,) of sites, each with two estimates for every falloff."""

    def __init__(
        self, tracer: Tracer, sites: Sites, counts: tuple[int, float], rays: int, key: np.uint32, salt: int
    ) -> None:
        """Args: counts: how many are spread over all sites, and how many times as many more are put where errors are
        largest, with so many `rays` each. salt: of this set."""
        wanted, self._more = counts
        self._tracer = tracer
        self._rays = rays
        self._keys = derive(key, 4 + salt), derive(key, 5 + salt)
        self._spread = stratified_rows(len(sites), wanted, salt)  # other rows, and other rays, than another set's
        self._has_large_error = np.zeros(len(sites), np.bool_)
        self._turn = 0
        self.rows = self._spread
        self._weights = np.full(len(self.rows), 1 / max(len(self.rows), 1))
        self._copies = [self._traced(sites, self.rows)]

    def _traced(self, sites: Sites, rows: Int64s) -> tuple[Copies, Copies]:
        """Two estimates of sites `rows` (i,)."""
        pair = Copies(self._tracer, sites.points[rows], True), Copies(self._tracer, sites.points[rows], True)
        for copies, key in zip(pair, self._keys, strict=True):
            copies.add(np.full(len(rows), self._rays, np.int32), key)
        return pair

    def grow(self, sites: Sites, own: Copies) -> None:
        """Trace as many rays at each probe as its site has, where places count, not rays alone: with fewer places than
        the site a probe errs by more than what it measures. Args: own: estimates of all sites (k,)."""
        self._turn += 1
        have_places = sites.have_places
        begin = 0
        for pair in self._copies:
            rows = self.rows[begin : begin + len(pair[0].rays)]
            begin += len(rows)
            have = pair[0].rays
            wanted = np.where(have_places[rows], own.rays_at(rows), 0)
            batches = 2.0 ** np.rint(np.log2(np.maximum(wanted - have, BATCH) / BATCH))
            more = np.where(wanted > _GROWN * have, BATCH * batches, 0).astype(np.int32)
            for copies, key in zip(pair, self._keys, strict=True):
                copies.add(more, derive(key, self._turn))

    def add_where_error_is_largest(self, sites: Sites, error: Float64s) -> None:
        """Once, probe sites of the largest squared errors (k,) expected, too."""
        if len(self._copies) > 1 or not self._more:
            return
        step = max(len(error) // _SAMPLED, 1)
        largest = error > np.quantile(error[::step], 1 - _LARGEST, method="lower")  # the others import numpy.ma
        unprobed = largest.copy()
        unprobed[self.rows] = False
        candidates = np.flatnonzero(unprobed)
        if not len(candidates):
            return
        added = candidates[stratified_rows(len(candidates), round(self._more * len(self._spread)))]
        del unprobed, candidates
        self._copies.append(self._traced(sites, added))
        self._has_large_error = largest
        self.rows = np.append(self.rows, added)
        is_largest = largest[self.rows]
        part = float(np.mean(largest))
        count = int(np.count_nonzero(is_largest))
        self._weights = np.where(is_largest, part / count, (1 - part) / max(len(self.rows) - count, 1))

    @property
    def margin(self) -> float:
        """The safety margin of the squared tolerance, relative: few probes may measure too small an error by chance,
        and the bake would end too early."""
        return _MARGIN / len(self.rows)

    def spread_over_traced(self, sites: Sites) -> Int64s:
        """The rows of the probes that are spread over all sites, those that are traced."""
        return self._spread[sites.is_traced(self._spread)]

    def _estimates(self, column: int) -> tuple[Float64s, Float64s]:
        """Both estimates (j,) of w at the probes."""
        one, other = zip(*self._copies, strict=True)
        return _joined(one, column), _joined(other, column)

    def checks(self, sites: Sites, column: int, some: Int64s | None = None) -> Checks:
        """The probes at traced sites. Args: some: only those of rows (i,), ascending, of probes that are spread."""
        at = np.flatnonzero(sites.is_traced(self.rows))
        spread = int(np.count_nonzero(at < len(self._spread)))
        if some is not None:
            at = np.searchsorted(self._spread, some)
            spread = len(at)
        one, other = self._estimates(column)
        rays = np.concatenate([pair[0].rays for pair in self._copies])
        weight = self._weights[at] if some is None else np.full(len(at), 1.0)
        return Checks(
            sites.traced_of(self.rows[at]), one[at], other[at], weight / max(weight.sum(), 1e-300), rays[at], spread
        )

    def calibrate(self, sites: Sites, error: Float64s, w: Float64s, column: int) -> Calibration:
        """Scale the squared errors (k,) expected to what is measured of `w` (j,) at the probes: their mean, and how
        much of it each kind of site has, and the largest of a kind."""
        one, other = self._estimates(column)
        measured = (w - one) * (w - other)
        mean = float(self._weights @ measured)
        # Few sites may have most of the error, and be missed.
        variance = float(self._weights**2 @ ((measured - mean) ** 2 + 2 * mean_square(error)))
        expected_mean = float(np.mean(error))
        calibrated = expected_mean * calibration_factor(expected_mean, mean, variance)
        group = sites.kinds + np.uint8(KINDS) * self._has_large_error
        for number in np.flatnonzero(np.bincount(group[self.rows])).tolist():
            members = group == number
            probed = members[self.rows]
            expected = error[self.rows[probed]]
            if len(expected) > 1:
                among = error[members]
                scatter = float(np.var(measured[probed])) + 2 * mean_square(among)
                del among  # to make room
                factor = calibration_factor(
                    float(np.mean(expected)), float(np.mean(measured[probed])), scatter / len(expected)
                )
                np.multiply(error, factor, out=error, where=members)
        error *= calibrated / max(float(np.mean(error)), 1e-300)
        return Calibration(error[self.rows], measured, len(error) * self._weights)


def _joined(copies: tuple[Copies, ...], column: int) -> Float64s:
    """w of several copies, one after another."""
    return np.concatenate([each.gathered[column][:, W] for each in copies]).astype(np.float64)
