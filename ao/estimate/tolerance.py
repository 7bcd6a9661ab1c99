"""Baking to a tolerance: rays at every point, a few at first, more where the error that is left asks for them.

Every point gets some rays, so that no jump of w stays unseen; values are denoised over all scales, and the error that
is left at each point says how many more rays it gets: rate allocation by a Lagrange multiplier (Shoham & Gersho 1988).
`Probes` measure the error by rays that are no part of any estimate.
"""

import warnings
from typing import NamedTuple

import numpy as np

from raytrace.kernel.jit import bind, kernel
from raytrace.mesh.mesh import Mesh
from raytrace.mesh.solids import inward_warnings
from raytrace.system.threads import run_blocks
from raytrace.types import Bools, Float32s, Float64s, Int64s

from ..execute.tracer import Tracer
from ..options import Options
from ..points.points import Points
from ..rays.gather import BATCH_VARIANCE, BENT, COLUMNS, W
from .calibration import Calibration, distribute_variance, mean_square
from .inside import holes
from .one_ring import Neighbours
from .probes import Probes
from .ray_plan import fall_of, first_rays, rays_to_add
from .sampling_error import RATE, TYPICAL, derive, rays_alone
from .scales import denoise_over_scales

_AIM = 0.92  # times the goal is aimed at: a few rays more, later, are worth little
_FARTHEST = 20.0  # times that the squared error may have to fall for the rays to be foreseen; else some come before
_NEAR, _UNEVEN = 2.0, 2.5  # the same at jumps of w, where its mean square is so many times its squared mean
_ROUNDS = 8  # of adding rays, at most
_WORST = 8.0  # times the tolerance that a point may be expected to err
_BLOCK = 1 << 12  # points


class ToleranceWarning(UserWarning):
    """A bake's estimated error exceeds the tolerance asked for."""


def shortfalls(
    options: Options, rmse: float, samples: int, each: str, solid: Mesh, vertices: Float32s
) -> tuple[str, ...]:
    """How a bake with `samples` rays at `each` point falls short of what was asked for, in words, a tolerance in a
    warning, too; closed parts of the `solid` that look inwards; and what rays in one with holes mean for its thickness.

    Args: vertices: of the solid and what else occludes, in render space.
    """
    found = []
    if options.tolerance is not None and rmse > options.tolerance:
        reason = f": {samples:,} rays a {each} were allowed" if samples >= options.rays else ""
        found = [f"tolerance {options.tolerance:g} is not met, the estimated RMSE is {rmse:.3g}{reason}"]
        warnings.warn(found[0], ToleranceWarning, stacklevel=4)  # whoever called the face, which a decorator wraps
    if options.thickness:
        return (*found, *holes(solid))
    return (*found, *inward_warnings(solid, vertices[: len(solid.vertices)]))


class Estimate(NamedTuple):
    """Values of points, and their errors."""

    rows: Float64s  # (k, 4), w and the mean of μ·direction (x, y, z)
    variance: Float64s  # (k,), mean square error of w expected
    samples: int  # rays of a point, the most that one has
    spared: int = 0  # rays fewer than that at the other points
    calibration: Calibration | None = None  # of the variances, at some of the points

    @property
    def mean_samples(self) -> int:
        """Rays of a point in the mean."""
        return self.samples - self.spared // max(len(self.rows), 1)

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
        goal = tolerance**2 / (1 + probes.doubt)
        rays = np.zeros(len(points), np.int64)
        worth = np.zeros(len(points))
        more = np.full(len(points), min(first_rays(tolerance, len(points)), max_samples))
        gathered = [np.zeros((len(points), COLUMNS), np.float32) for _ in range(tracer.columns)]
        for turn in range(_ROUNDS):
            found = list[_Round]()  # lets go of the last ones
            tracer.stage = f"rays, round {turn + 1}"
            _add_rays(tracer, points, gathered, (rays, worth), more, derive(key, 16 + turn))
            found = [_Round.of(points, neighbours, rows, worth, probes, column) for column, rows in enumerate(gathered)]
            means = [float(np.mean(each.error)) for each in found]
            column = int(np.argmax(means))
            if means[column] <= goal or (rays >= max_samples).all():
                break
            error = found[column].error
            for each, mean in zip(found, means, strict=True):
                if each is not found[column]:
                    error = np.maximum(error, each.error * (means[column] / max(mean, 1e-30)))
            beyond = means[column] / goal
            farthest = _FARTHEST if mean_square(error) < _UNEVEN * np.mean(error) ** 2 else _NEAR
            aim = goal * (_AIM if beyond < farthest else beyond ** (2 / 3))
            raw = np.ascontiguousarray(gathered[column][:, W])
            fall = fall_of(neighbours, raw, probes.level(raw, worth, column), means[column], aim)
            more = np.minimum(rays_to_add(error, worth, max_samples, aim, fall, tracer.threads), max_samples - rays)
        if means[column] <= goal:  # points that are expected to be far off meet the tolerance by rays of their own
            worst = [
                each.errs_by_more(_WORST * tolerance, neighbours, rows, probes.level(rows[:, W], worth, column))
                for column, (each, rows) in enumerate(zip(found, gathered, strict=True))
            ]
            more = np.where(np.any(worst, axis=0), np.clip(rays_alone(tolerance), rays, max_samples) - rays, 0)
            _add_rays(tracer, points, gathered, (rays, worth), more, derive(key, 16 + _ROUNDS))
            again = np.flatnonzero(more)
            found = [
                each.by_own_rays(again, rows, worth, probes, column)
                for column, (each, rows) in enumerate(zip(found, gathered, strict=True))
            ]
        most = int(rays.max())
        spared = most * len(rays) - int(rays.sum())
        tracer.planned = [
            Estimate(np.column_stack([each.w, rows[:, BENT:]]), each.error, most, spared, each.calibration)
            for each, rows in zip(found, gathered, strict=True)
        ]
    planned: list[Estimate] = tracer.planned
    return planned[tracer.column]


def _add_rays(
    tracer: Tracer,
    points: Points,
    gathered: list[Float32s],
    counts: tuple[Int64s, Float64s],
    more: Int64s,
    key: np.uint32,
) -> None:
    """Trace `more` rays (k,) at the points and put them into the rows (k, COLUMNS) of each falloff, and into `counts`:
    how many the points have, (k,), and what these are worth, (k,)."""
    tracer.expected = tracer.rays + int(more.sum())
    rays, worth = counts
    for count in (np.flatnonzero(np.bincount(more)[1:]) + 1).tolist():
        which = np.flatnonzero(more == count)
        subset = points[which] if len(which) < len(points) else points

        def added() -> Float64s:
            return tracer.gather(subset, count, key)  # noqa: B023

        for rows, new in zip(gathered, tracer.each_column(added), strict=True):
            run_blocks(
                len(which), _BLOCK, bind(_combine, which, worth, float(count) ** RATE, new, rows), tracer.threads
            )
        rays[which] += count
        worth[which] += float(count) ** RATE


@kernel
def _combine(which, worth, more, new, rows, first, last):
    """Add new rows, worth `more`, to some rows, in proportion to what both are worth."""
    for k in range(first, last):
        i = which[k]
        kept = worth[i] / (worth[i] + more)
        for column in range(COLUMNS):
            if column == BATCH_VARIANCE:
                rows[i, column] = kept**2 * rows[i, column] + (1.0 - kept) ** 2 * new[k, column]
            else:
                rows[i, column] = new[k, column] + kept * (rows[i, column] - new[k, column])


class _Round(NamedTuple):
    """The estimate by what is gathered, its errors scaled to what the probes measure."""

    w: Float64s  # (k,)
    error: Float64s  # (k,), squared, expected
    calibration: Calibration

    @classmethod
    def of(
        cls,
        points: Points,
        neighbours: Neighbours,
        rows: Float32s,
        worth: Float64s,
        probes: Probes,
        column: int,
    ) -> "_Round":
        level = probes.level(rows[:, W], worth, column)

        def risk(w: Float64s) -> float:
            return probes.mean_squared(w, column)

        w, error = denoise_over_scales(neighbours, points, rows, level, probes.rows, risk)
        probes.add_where_error_is_largest(error)
        return cls(w, error, probes.calibrate(error, w, column))

    def errs_by_more(self, limit: float, neighbours: Neighbours, rows: Float32s, level: float) -> Bools:
        """The points (k,) that are expected to; where w differs from the neighbours' by more, their own rays decide.

        Args: level: mean square error of w in `rows` (k, COLUMNS).
        """
        unlike = (self.w - neighbours.means(self.w.astype(np.float32), 0.0)) ** 2
        variance = distribute_variance(rows[:, BATCH_VARIANCE].astype(np.float64), level)
        return np.asarray((self.error > limit**2) | (np.minimum(variance, unlike) > limit**2))

    def by_own_rays(self, again: Int64s, rows: Float32s, worth: Float64s, probes: Probes, column: int) -> "_Round":
        """With the points `again` (j,) as their rows say it, without denoising."""
        if not len(again):
            return self
        self.w[again] = rows[again, W]
        self.error[again] = TYPICAL / worth[again]
        return self._replace(calibration=probes.calibrate(self.error, self.w, column))
