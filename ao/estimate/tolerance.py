"""Baking to a tolerance: rays at every point, a few at first, more where the error that is left asks for them.

Every point gets some rays, so that no jump of w stays unseen; values are denoised over all scales, and the error that
is left at each point says how many more rays it gets: rate allocation by a Lagrange multiplier (Shoham & Gersho 1988).
`Probes` measure the error by rays that are no part of any estimate. Of many points, a pilot sample (Cochran 1977) says
how many rays all get at first, as one lattice is more even than two of half as many rays.
"""

import warnings
from functools import partial
from typing import NamedTuple, Self

import numpy as np

from obscurance.raytrace.mesh.mesh import Mesh
from obscurance.raytrace.mesh.solids import inward_warnings
from obscurance.raytrace.system.parallel import each
from obscurance.raytrace.types import Bools, Float32Rows, Float32s, Float64Rows, Float64s, Int64s

from ..execute.tracer import Tracer
from ..options import Options
from ..points.points import Points
from ..rays.gather import BATCH_VARIANCE, BENT, COLUMNS, W
from .calibration import Calibration, distribute_variance, mean_square
from .cells import around
from .inside import holes
from .one_ring import Neighbours
from .probes import Probes
from .ray_plan import FEW_POINTS, fall_of, first_rays, rays_to_add
from .sampling_error import BATCH, RATE, TYPICAL, derive, rays_alone, stratified_rows
from .scales import denoise_over_scales

_AIM = 0.83  # times the goal is aimed at: another round for few rays takes as long as many rays now
_NEARLY = 0.97  # the same where little is missing, which is foreseen well
_FARTHEST = 20.0  # times that the squared error may have to fall for the rays to be foreseen; else some come before
_NEAR, _UNEVEN = 2.0, 8.0  # the same at jumps of w, where squared errors' mean square is so many times their mean²
_ROUNDS = 8  # of adding rays, at most
_SALT = 16  # of the keys of rounds
_WORST = 8.0  # times the tolerance that a point may be expected to err
_SHARERS = 4  # of many points, so many share a lattice at first, so that denoising averages what is even
_ENOUGH = 32  # rays from which each point has a lattice of its own, which is more even than a share of a larger one
_PILOTED, _PILOT_SHARE = 1 << 17, 16  # points that are worth a pilot sample, and one in how many is in it
_PATCH = 80  # points of each patch of it: as wide as most of denoising reaches
_ALIKE = 40.0  # times that the squared error may have to fall for all points to get as many rays at first
_AGAIN = 4  # times as many rays as at first are tried on the pilot sample, too
_CORRECTED = 0.5, 1.25  # times that these may become by what the try says, which is misled upwards by few large errors


class ToleranceWarning(UserWarning):
    """A bake's estimated error exceeds the tolerance asked for."""


def shortfalls(
    options: Options, rmse: float, samples: int, kind: str, solid: Mesh, vertices: Float32s
) -> tuple[str, ...]:
    """How a bake with `samples` rays a point falls short of what was asked for, in words, of a tolerance in a warning,
    too; closed parts of the `solid` that look inwards; and what rays in a `solid` with holes mean for its thickness.

    Args: kind: of the points, in a word. vertices: of the solid and what else occludes, in render space.
    """
    texts = []
    if options.tolerance is not None and rmse > options.tolerance:
        reason = f": {samples:,} rays a {kind} were allowed" if samples >= options.rays else ""
        texts = [f"tolerance {options.tolerance:g} is not met, the estimated RMSE is {rmse:.3g}{reason}"]
        warnings.warn(texts[0], ToleranceWarning, stacklevel=4)  # whoever called `ao.bake`
    if options.thickness:
        return (*texts, *holes(solid))
    return (*texts, *inward_warnings(solid, vertices[: len(solid.vertices)]))


class Estimate(NamedTuple):
    """Values of points, and their errors."""

    values: Float64s  # (k, 4), w and the mean of μ·direction (x, y, z)
    variance: Float64s  # (k,), mean square error of w expected
    samples: int  # rays of the point that has most
    spared: int = 0  # rays that the other points have fewer than it, in all
    calibration: Calibration | None = None  # of the variances, at some of the points

    @property
    def mean_samples(self) -> int:
        """Rays of a point in the mean."""
        return self.samples - self.spared // max(len(self.values), 1)

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
        probes = Probes(tracer, points, tolerance, max_samples, key)
        goal = tolerance**2 / (1 + probes.margin)
        traced = _Traced(tracer, points)
        few = min(first_rays(tolerance, len(points)), max_samples)
        first = few
        if len(points) >= _PILOTED:
            first = _rays_by_pilot(traced, neighbours, probes, few, goal, max_samples, key)
        more = np.maximum(first - traced.rays, 0)
        salt = _SALT if first == few else _SALT + 1  # `few` rays of all points are lattices together with the pilot's
        for turn in range(_ROUNDS):
            rounds = list[_Round]()  # lets go of the last round's arrays
            tracer.stage = f"rays, round {turn + 1}"
            traced.add(more, derive(key, salt + turn), shared=turn == 0 and len(points) >= FEW_POINTS)
            rounds = [_Round.of(traced, neighbours, probes, column) for column in range(tracer.columns)]
            if max(round_.mean for round_ in rounds) <= goal:  # points expected to be far off get rays of their own
                worst = [round_.errs_by_more(_WORST * tolerance, neighbours) for round_ in rounds]
                enough = np.clip(rays_alone(tolerance), traced.rays, max_samples)
                more = np.where(np.any(worst, axis=0), enough - traced.rays, 0)
                traced.add(more, derive(key, 3 * _SALT + turn), shared=False)
                rounds = [round_.by_own_rays(np.flatnonzero(more), traced, probes) for round_ in rounds]
            if max(round_.mean for round_ in rounds) <= goal or (traced.rays >= max_samples).all():
                break
            more = _more_rays(rounds, traced, neighbours, goal, max_samples)
        most = int(traced.rays.max())
        spared = most * len(points) - int(traced.rays.sum())
        tracer.planned = [
            Estimate(
                np.column_stack([round_.w, round_.gathered[:, BENT:]]), round_.error, most, spared, round_.calibration
            )
            for round_ in rounds
        ]
    planned: list[Estimate] = tracer.planned
    return planned[tracer.column]


def _rays_by_pilot(
    traced: "_Traced",
    neighbours: Neighbours,
    probes: Probes,
    few: int,
    goal: float,
    max_samples: int,
    key: np.uint32,
) -> int:
    """Rays of each point by which the mean square error should become the `goal`: `few` or more.

    The pilot sample is patches around some of the probes, denoised alone; its error is measured at these probes, by
    `few` rays and, if many more seem to be needed, by as many.
    """
    count = len(traced.points)
    centres = probes.point_rows[stratified_rows(len(probes.point_rows), count // (_PILOT_SHARE * _PATCH))]
    point_rows = around(neighbours, centres, count // _PILOT_SHARE)
    patches = neighbours.among(point_rows)
    probed = probes.only(centres, point_rows)
    traced.tracer.stage = "rays, pilot sample"

    def measured(rays: int, salt: int) -> tuple[float, float]:
        """The mean square error by `rays`, and how uneven it is, of the falloff that errs most."""
        more = np.zeros(count, np.int64)
        more[point_rows] = rays - traced.rays[point_rows]
        traced.add(more, derive(key, salt), shared=True)
        return max(_pilot_error(traced, point_rows, patches, probed, c) for c in range(len(traced.gathered)))

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


def _pilot_error(
    traced: "_Traced", point_rows: Int64s, patches: Neighbours, probed: Probes, column: int
) -> tuple[float, float]:
    """The mean square error of a pilot sample by one falloff, and its expected errors' mean square to mean²."""
    gathered = traced.gathered[column][point_rows]
    level = probed.level(gathered[:, W], traced.worth[point_rows], column)
    risk = partial(probed.mean_squared, column=column)
    w, error = denoise_over_scales(patches, traced.points[point_rows], gathered, level, probed.point_rows, risk)
    return risk(w[probed.point_rows]), mean_square(error) / float(np.mean(error)) ** 2


class _Traced:
    """Rays traced at k points: how many each has, what they are worth, and what is gathered by each falloff."""

    def __init__(self, tracer: Tracer, points: Points) -> None:
        self.tracer = tracer
        self.points = points
        self.rays = np.zeros(len(points), np.int64)
        self.worth = np.zeros(len(points))
        self.gathered = [np.zeros((len(points), COLUMNS), np.float32) for _ in range(tracer.columns)]

    def add(self, more: Int64s, key: np.uint32, shared: bool) -> None:
        """Trace `more` rays (k,) at the points.

        Args: shared: neighbours share lattices; most of them are to get as many rays.
        """
        tracer = self.tracer
        tracer.expected = tracer.rays + int(more.sum())
        for count in (np.flatnonzero(np.bincount(more)[1:]) + 1).tolist():
            which = np.flatnonzero(more == count)
            is_all = len(which) == len(self.points)
            leap = _SHARERS if shared and count < _ENOUGH else 1
            subset = self.points if is_all else self.points[which]

            def added() -> Float64s:
                return tracer.gather(subset, count, key, leap)  # noqa: B023

            for gathered, new in zip(self.gathered, tracer.each_column(added), strict=True):
                _combine.on(tracer.threads)(which, self.worth, float(count) ** RATE, new, gathered)
            self.rays[which] += count
            self.worth[which] += float(count) ** RATE


@each("which")
def _combine(k: int, which: Int64s, worth: Float64s, more: float, new: Float64Rows, gathered: Float32Rows) -> None:
    """Average what is `gathered` with `new` values, worth `more`, in proportion to what both are worth."""
    i = which[k]
    kept = worth[i] / (worth[i] + more)
    for column in range(COLUMNS):
        if column == BATCH_VARIANCE:
            gathered[i, column] = kept**2 * gathered[i, column] + (1.0 - kept) ** 2 * new[k, column]
        else:
            gathered[i, column] = new[k, column] + kept * (gathered[i, column] - new[k, column])


class _Round(NamedTuple):
    """The estimate by the rays of one falloff so far, its errors scaled to what the probes measure."""

    column: int  # which falloff
    gathered: Float32s  # (k, COLUMNS), by the rays alone
    level: float  # mean square error of w in it
    w: Float64s  # (k,), denoised
    error: Float64s  # (k,), squared, expected
    calibration: Calibration

    @classmethod
    def of(cls, traced: _Traced, neighbours: Neighbours, probes: Probes, column: int) -> Self:
        gathered = traced.gathered[column]
        level = probes.level(gathered[:, W], traced.worth, column)

        def risk(w: Float64s) -> float:
            return probes.mean_squared(w, column)

        w, error = denoise_over_scales(neighbours, traced.points, gathered, level, probes.point_rows, risk)
        probes.add_where_error_is_largest(error)
        return cls(column, gathered, level, w, error, probes.calibrate(error, w, column))

    @property
    def mean(self) -> float:
        """The mean square error expected."""
        return float(np.mean(self.error))

    def errs_by_more(self, limit: float, neighbours: Neighbours) -> Bools:
        """The points (k,) expected to err by more; where w differs by more from the neighbours', by their own rays."""
        unlike = (self.w - neighbours.means(self.w.astype(np.float32), 0.0)) ** 2
        variance = distribute_variance(self.gathered[:, BATCH_VARIANCE].astype(np.float64), self.level)
        return np.asarray((self.error > limit**2) | (np.minimum(variance, unlike) > limit**2))

    def by_own_rays(self, again: Int64s, traced: _Traced, probes: Probes) -> Self:
        """The same with the points `again` (j,), traced since, as their own rays say, without denoising."""
        if not len(again):
            return self
        self.w[again] = self.gathered[again, W]
        self.error[again] = TYPICAL / traced.worth[again]
        return self._replace(calibration=probes.calibrate(self.error, self.w, self.column))


def _more_rays(rounds: list[_Round], traced: _Traced, neighbours: Neighbours, goal: float, max_samples: int) -> Int64s:
    """Rays (k,) to add so that the mean square error of the falloff that errs most becomes the `goal`, or nearer."""
    most = max(rounds, key=lambda round_: round_.mean)
    error = most.error
    for round_ in rounds:
        if round_ is not most:
            error = np.maximum(error, round_.error * (most.mean / max(round_.mean, 1e-30)))
    beyond = most.mean / goal
    farthest = _FARTHEST if mean_square(error) < _UNEVEN * np.mean(error) ** 2 else _NEAR
    aim = goal * (max(_AIM, _NEARLY / np.sqrt(beyond)) if beyond < farthest else beyond ** (2 / 3))
    fall = fall_of(neighbours, np.ascontiguousarray(most.gathered[:, W]), most.level, most.mean, aim)
    more = rays_to_add(error, traced.worth, max_samples, aim, fall, neighbours.threads)
    return np.minimum(more, max_samples - traced.rays)
