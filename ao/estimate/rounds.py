"""Baking to a tolerance: rays at every site, a few at first, more where the error that is left asks for them.

Every site gets some rays, so that no jump of w stays unseen; values are denoised over all scales, and the error that
is left at each site says how many more rays it gets: rate allocation by a Lagrange multiplier (Shoham & Gersho 1988).
`Probes` measure the error by rays that are no part of any estimate. Of many sites, a pilot sample (Cochran 1977) says
how many rays all get at first, as one lattice is more even than two of half as many rays.
"""

from functools import partial
from typing import NamedTuple, Self

import numpy as np

from obscurance.raytrace.sampling import derive, stratified_rows
from obscurance.raytrace.types import AnyFloats, Bools, Float64s, Int32s, Int64s

from ..execute.tracer import Tracer
from ..rays.gather import BATCH_VARIANCE, BENT, W
from .calibration import Calibration, distribute_variance, mean_square, shrunk_to_mean
from .cells import around
from .probes import Checks, Copies, Probes
from .ray_plan import BATCH, FEW_POINTS, RATE, TYPICAL, fall_of, first_rays, rays_alone, rays_to_add
from .scales import denoise_over_scales
from .sites import ONE_PLACE, PREDICTED, Sites

_AIM = 0.83  # times the goal is aimed at: another round for few rays takes as long as many rays now
_NEARLY = 0.97  # the same where little is missing, which is foreseen well
_FARTHEST = 20.0  # times that the squared error may have to fall for the rays to be foreseen; else some come before
_NEAR, _UNEVEN = 2.0, 8.0  # the same at jumps of w, where squared errors' mean square is so many times their mean²
_ROUNDS = 8  # of adding rays, at most
_SALT = 16  # of the keys of rounds
_WORST = 8.0  # times the tolerance that a site may be expected to err
_PILOTED, _PILOT_SHARE = 1 << 17, 16  # sites that are worth a pilot sample, and one in how many is in it
_PATCH = 80  # sites of each patch of it: as wide as most of denoising reaches
_ALIKE = 40.0  # times that the squared error may have to fall for all sites to get as many rays at first
_AGAIN = 4  # times as many rays as at first are tried on the pilot sample, too
_CORRECTED = 0.5, 1.25  # times that these may become by what the try says, which is misled upwards by few large errors
_PROBED, _FEWEST, _MOST = 16, 96, 1024  # one site in how many is probed, at least and at most
_LEAST = 64  # spread probes of each of two sets, if so many are no more than half of the sites
_MORE, _AS_MANY = 0.25, 1.0  # probes of the largest errors, to the other probes; where sites have several places
_CHECKED, _CHECKED_LEAST = 64, 128  # the same where all sites have as many rays


class Estimate(NamedTuple):
    """Values of points, and their errors."""

    w: Float64s  # (k,)
    bent: AnyFloats  # (k, 3), mean of μ·direction
    variance: Float64s  # (k,), mean square error of w expected
    samples: int  # rays of the point that has most
    spared: int = 0  # rays that the other points have fewer than it, in all
    calibration: Calibration | None = None  # of the variances, at some of the points

    @property
    def mean_samples(self) -> int:
        """Rays of a point in the mean."""
        return self.samples - self.spared // max(len(self.w), 1)

    def skipped(self, hidden: int) -> dict[str, int]:
        """Rays not traced, by reason. Args: hidden: number of points inside solids."""
        return {"predicted": self.spared, "hidden": self.samples * hidden}


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
        raw = gathered[:, W]
        level = checks.level(raw, own.worth_at(sites.traced))
        if len(raw) and not gathered[:, BATCH_VARIANCE].any() and (raw == raw[0]).all():
            level = min(level, float(own.rays.sum()) ** -2.0)  # of n rays that agree, the next may not (Laplace)
        if denoise:
            w, error = denoise_over_scales(
                sites.graph, sites.traced_points, gathered, level, checks.rows, checks.mean_squared
            )
            _leave_out_harm(sites, checks, gathered, level, w, error)
            _keep_mean(sites, raw, w, error)
        else:
            w = raw.astype(np.float64)
            error = _alone(gathered, level)
        return cls(column, sites, gathered, level, w, sites.errors_at_all(error, w))

    def calibrated(self, measuring: Probes) -> Self:
        """The estimates with their errors scaled, in place, to what probes measure."""
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
        """The estimates with those of the traced sites `again` (j,), traced since, by their own rays, not denoised."""
        if not len(again):
            return self
        gathered = own.gathered[self.column][self.sites.traced]
        at_all = np.arange(len(self.sites))[self.sites.traced][again]
        self.w[again] = gathered[again, W]
        missed = np.where(self.sites.kinds[at_all] == ONE_PLACE, 0.0, gathered[again, BATCH_VARIANCE])
        self.error[at_all] = TYPICAL / own.worth_at(at_all) + missed
        return self._replace(gathered=gathered).calibrated(measuring)

    def measured(self, kind: int, probes: Probes) -> tuple[float, float]:
        """The mean square error measured at sites of a kind, and its standard error; nothing where none is probed."""
        assert self.calibration
        of_kind = self.sites.kinds[probes.rows] == kind
        squared, weight = self.calibration.measured[of_kind], self.calibration.weight[of_kind]
        total = max(float(weight.sum()), 1e-300)
        return float(weight @ squared) / total, float(np.sqrt(weight**2 @ squared**2)) / total

    def estimate(self, rays: Int32s) -> Estimate:
        """The estimates of all sites, of so many `rays` (k,)."""
        count = len(self.sites)
        w, bent = self.w, self.gathered[:, BENT:]
        if self.sites.cell is not None:
            values = self.sites.values_at(np.arange(count), np.column_stack([w, bent]))
            w, bent = values[:, 0], values[:, 1:]
        most = int(rays.max(initial=0))
        return Estimate(w, bent, self.error, most, most * count - int(rays.sum()), self.calibration)


def _alone(gathered: AnyFloats, level: float) -> Float64s:
    """Squared errors (b,) expected of rows `gathered` (b, COLUMNS), not denoised, of the mean `level`."""
    return shrunk_to_mean(distribute_variance(gathered[:, BATCH_VARIANCE].astype(np.float64), level))


def _leave_out_harm(
    sites: Sites, checks: Checks, gathered: AnyFloats, level: float, w: Float64s, error: Float64s
) -> None:
    """Give values as `gathered` back, in place, to the kinds of sites of which denoising is measured to do no good."""
    kinds = sites.kinds[sites.traced]
    raw = gathered[checks.rows, W].astype(np.float64)
    gain = checks.weight * (checks.squared(raw) - checks.squared(w[checks.rows]))
    for kind in range(PREDICTED):
        probed = gain[kinds[checks.rows] == kind]
        if len(probed) and float(np.sum(probed)) <= 0:
            w[kinds == kind] = gathered[kinds == kind, W]
            error[kinds == kind] = _alone(gathered, level)[kinds == kind]


def _keep_mean(sites: Sites, raw: AnyFloats, w: Float64s, error: Float64s) -> None:
    """Give w (b,), denoised, the mean over all sites that the unbiased `raw` (b,) has, in place and within [0, 1]: to
    each that denoising has changed in proportion to the root of its squared error expected (b,).

    After: Wang, Fuller & Qu 2008, Small area estimation under a restriction.
    """
    np.clip(w, 0, 1, out=w)
    missing = float(np.sum(sites.counts * (raw - w)))
    share = np.sqrt(error)
    share *= w != raw
    share *= missing / max(float(np.sum(sites.counts * share)), 1e-300)
    w += share


def by_rays(tracer: Tracer, sites: Sites, rays: int, denoise: bool, key: np.uint32) -> tuple[list[Round], Int32s]:
    """The estimates by so many `rays` of every site, one for each falloff; and the rays of each."""
    wanted = min(len(sites), max(_CHECKED_LEAST, len(sites) // _CHECKED))
    tracer.expected = tracer.rays + rays * (len(sites) + 2 * wanted)
    own = Copies.of_one_round(tracer, sites.points, rays, key, np.float32 if denoise else np.float64)
    sets = _sets_of_probes(tracer, sites, (wanted, 0.0), rays, key)
    return _rounds(own, sites, sets, denoise, range(tracer.columns)), own.rays


def to_tolerance(
    tracer: Tracer, sites: Sites, tolerance: float, max_samples: int, denoise: bool, key: np.uint32, asked: int
) -> tuple[list[Round], Int32s]:
    """The estimates whose root mean square error over all sites is `tolerance`, if `max_samples` rays a site allow it;
    and the rays of each.

    All of the `asked` falloffs, the first ones, meet it, by the same rays; further ones err by what these rays give.
    """
    wanted = int(np.clip(len(sites) // _PROBED, _FEWEST, _MOST))
    # More rays would not make up for fewer probes: both err by as much.
    probe_rays = min(rays_alone(tolerance), max(max_samples, BATCH))
    sets = _sets_of_probes(tracer, sites, (wanted, _MORE), probe_rays, key)
    deciding, measuring = sets
    goal = tolerance**2 / (1 + measuring.margin)
    own = Copies(tracer, sites.points)
    few = min(first_rays(tolerance, len(sites.traced_points)), max_samples)
    first = few
    if denoise and len(sites.traced_points) >= _PILOTED:
        first = _rays_by_pilot(own, sites, deciding, few, goal, max_samples, key, range(asked))
    more = np.zeros(len(sites), np.int32)
    more[sites.traced] = np.maximum(first - own.rays[sites.traced], 0)
    salt = _SALT if first == few else _SALT + 1  # `few` rays of all sites are lattices together with the pilot's
    for turn in range(_ROUNDS):
        rounds = list[Round]()  # lets go of the last round's arrays
        tracer.stage = f"rays, round {turn + 1}"
        own.add(more, derive(key, salt + turn), shared=turn == 0 and len(sites.traced_points) >= FEW_POINTS)
        more = np.zeros(len(sites), np.int32)  # takes no memory yet
        for probes in sets:
            probes.grow(sites, own)
        rounds = _rounds(own, sites, sets, denoise, range(asked))
        again = np.zeros(0, np.int64)
        if max(round_.mean for round_ in rounds) <= goal:  # sites expected to be far off get rays of their own
            worst = np.any([round_.errs_by_more(_WORST * tolerance) for round_ in rounds], axis=0)
            have = own.rays[sites.traced]
            more[sites.traced] = np.where(worst, np.clip(rays_alone(tolerance), have, max_samples) - have, 0)
            again = np.flatnonzero(more[sites.traced])
            own.add(more, derive(key, 3 * _SALT + turn))
            tracer.scene.hierarchy.release()
            rounds = [round_.by_own_rays(again, own, measuring) for round_ in rounds]
        more[:] = 0
        if max(round_.mean for round_ in rounds) <= goal or (own.rays[sites.traced] >= max_samples).all():
            break
        sites, broken = _with_more_traced(rounds, measuring, goal)
        more[rounds[0].sites.traced] = _more_rays(rounds, own, goal, max_samples, denoise)
        more[broken] = few
    further = _rounds(own, rounds[0].sites, sets, denoise, range(asked, tracer.columns))
    return rounds + [round_.by_own_rays(again, own, measuring) for round_ in further], own.rays


def _sets_of_probes(
    tracer: Tracer, sites: Sites, counts: tuple[int, float], rays: int, key: np.uint32
) -> tuple[Probes, Probes]:
    """Probes that decide, and probes that measure the errors of the result.

    One set is both where sites have one place each: what is decided by it then gains little by chance.

    Args: counts: of `Probes`, for both together.
    """
    if not sites.have_places.any():
        return (Probes(tracer, sites, counts, rays, key, 0),) * 2
    counts = min(max(counts[0] // 2, _LEAST), -(-len(sites) // 2)), _AS_MANY
    return Probes(tracer, sites, counts, rays, key, 0), Probes(tracer, sites, counts, rays, key, 2)


def _rounds(own: Copies, sites: Sites, sets: tuple[Probes, Probes], denoise: bool, columns: range) -> list[Round]:
    """The estimates by some of the falloffs, `columns`, from the rays so far; the first time more probes are put where
    errors are largest."""
    if not columns:
        return []
    deciding, measuring = sets
    own.tracer.scene.hierarchy.release()  # until more is traced
    rounds = [Round.of(own, sites, deciding, column, denoise) for column in columns]
    for probes in sets:
        probes.add_where_error_is_largest(sites, _of_all(rounds))
    own.tracer.scene.hierarchy.release()
    return [round_.calibrated(measuring) for round_ in rounds]


def _of_all(rounds: list[Round]) -> Float64s:
    """The squared errors (k,) of the falloff that errs most, or what others err by at a site, relative to their mean,
    if that is more."""
    most = max(rounds, key=lambda round_: round_.mean)
    error = most.error
    for round_ in rounds:
        if round_ is not most:
            error = np.maximum(error, round_.error * (most.mean / max(round_.mean, 1e-30)))
    return error


def _rays_by_pilot(
    own: Copies, sites: Sites, probes: Probes, few: int, goal: float, max_samples: int, key: np.uint32, columns: range
) -> int:
    """Rays of each site by which the mean square error should become the `goal`: `few` or more.

    The pilot sample is patches around some of the probes, denoised alone; its error is measured at these probes, by
    `few` rays and, if many more seem to be needed, by as many.
    """
    own.tracer.scene.hierarchy.release()  # while neighbours are found
    count = len(sites.traced_points)
    probed = probes.spread_over_traced(sites)
    probed = probed[stratified_rows(len(probed), count // (_PILOT_SHARE * _PATCH))]
    rows = around(sites.graph, sites.traced_of(probed), count // _PILOT_SHARE)
    patch = Sites.alike(sites.traced_points[rows], partial(sites.graph.among, rows), ONE_PLACE)
    at_all = np.arange(len(sites))[sites.traced][rows]
    own.tracer.stage = "rays, pilot sample"

    def measured(rays: int, salt: int) -> tuple[float, float]:
        """The mean square error by `rays`, and how uneven it is, of the falloff that errs most."""
        more = np.zeros(len(sites), np.int32)
        more[at_all] = rays - own.rays_at(at_all)
        own.add(more, derive(key, salt), shared=True)
        checks = [probes.checks(sites, column, probed) for column in columns]
        placed = [each._replace(rows=np.searchsorted(rows, each.rows)) for each in checks]
        return max(_pilot_error(own, at_all, patch, placed[column], column) for column in columns)

    def needed(rays: int, times: float) -> int:
        return min(BATCH * round(rays * times / BATCH), max_samples)

    error, unevenness = measured(few, _SALT)
    if not goal < error < _ALIKE * goal or unevenness > _UNEVEN:
        return few
    rays = needed(few, error / (_AIM * goal))
    if rays < _AGAIN * few:
        return rays
    error, _ = measured(rays, 2 * _SALT)
    return needed(rays, float(np.clip(error / (_AIM * goal), *_CORRECTED)))


def _pilot_error(own: Copies, rows: Int64s, patch: Sites, checks: Checks, column: int) -> tuple[float, float]:
    """The mean square error of a pilot sample by one falloff, and its expected errors' mean square to mean²."""
    gathered = own.gathered[column][rows]
    level = checks.level(gathered[:, 0], own.worth_at(rows))
    w, error = denoise_over_scales(patch.graph, patch.points, gathered, level, checks.rows, checks.mean_squared)
    return checks.mean_squared(w[checks.rows]), mean_square(error) / float(np.mean(error)) ** 2


def _with_more_traced(rounds: list[Round], measuring: Probes, goal: float) -> tuple[Sites, Int64s]:
    """The sites with those traced whose predictions by the falloff that errs most err by too much as measured, and
    which these are.

    What the sites err by from which they are predicted is not the predictions' fault: more rays bring it down.
    """
    round_ = max(rounds, key=lambda each: each.mean)
    sites = round_.sites
    squared, deviation = round_.measured(PREDICTED, measuring)
    of_centres, their_deviation = round_.measured(ONE_PLACE, measuring)
    excess = squared - max(of_centres, 0.0)
    if excess < max(goal / 2, np.hypot(deviation, their_deviation)):
        return sites, np.zeros(0, np.int64)
    predicted = np.flatnonzero(sites.kinds == PREDICTED)
    if excess < _WORST * goal:
        error = round_.error[predicted]
        predicted = predicted[error >= np.median(error)]
    return sites.broken(predicted)


def _more_rays(rounds: list[Round], own: Copies, goal: float, max_samples: int, denoise: bool) -> Int32s:
    """Rays (b,) to add at the traced sites so that the mean square error of the falloff that errs most becomes the
    `goal`, or nearer."""
    most = max(rounds, key=lambda round_: round_.mean)
    sites, error = most.sites, _of_all(rounds)
    traced_error = error[sites.traced]
    beyond = most.mean / goal
    farthest = _FARTHEST if mean_square(error) < _UNEVEN * np.mean(error) ** 2 else _NEAR
    aim = goal * (max(_AIM, _NEARLY / np.sqrt(beyond)) if beyond < farthest else beyond ** (2 / 3))
    if sites.cell is not None:  # rays change nothing of what predicted sites err by more than those that predict them
        excess = max(float(np.sum(most.error - most.error[sites.cell])), 0.0) / len(sites)
        aim = float(np.mean(traced_error)) * min(max(aim - excess, aim / 4) / max(most.mean - excess, 1e-300), 1.0)
    fall = RATE
    if denoise:
        missing = max(most.mean if sites.cell is None else float(np.mean(traced_error)), aim)
        fall = fall_of(sites.graph, np.ascontiguousarray(most.gathered[:, 0]), most.level, missing, aim)
    worth, rays = own.worth_at(sites.traced), own.rays[sites.traced]
    wanted_by = _of_neighbours(sites, traced_error, worth ** (fall / RATE))
    more = rays_to_add(wanted_by, worth, max_samples, aim, fall, sites.graph.threads)
    return np.minimum(more, max_samples - rays)


def _of_neighbours(sites: Sites, error: Float64s, fallen: Float64s) -> Float64s:
    """Squared errors (b,) of the traced sites as their neighbours let expect them, with the mean of their own `error`.

    The rays that a site gets must not depend on what its rays have met: corrected would be those alone that met
    something by chance, and w would be too large in the mean. At sites of several places, across which edges run that
    neighbours know nothing of, their own errors count as much. Args: fallen: (b,), what the errors fall by with the
    rays that each site has.
    """
    own = (error * fallen).astype(np.float32)
    around = sites.graph.means(own, 0.0)
    around[np.isnan(around)] = own[np.isnan(around)]
    own_share = np.where(sites.have_places[sites.traced], 0.5, 0.0)
    expected = (around + own_share * (own - around)) / fallen
    return np.asarray(expected * (np.mean(error) / max(float(np.mean(expected)), 1e-300)))
