"""Baking to a tolerance: as many rays at as few points as a root mean square error asks for.

Points far apart are baked first and the others predicted from them; the distance is halved where that gains most for
its rays (rate allocation by a Lagrange multiplier, Shoham and Gersho, IEEE Trans. ASSP 36, 1988). Then every point that
is not baked gets a few rays of its own (`screening`), which find the jumps of w that no prediction can know of, and
more points are baked where they show that it is needed. Probes say when to stop.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np

from raytrace.types import Bools, Float64s, Int64s

from ..execute.tracer import Tracer
from ..options import Options
from ..points.points import Points
from ..rays.estimate import BENT, COLUMNS, VALUES, W
from .calibration import Calibration
from .one_ring import Neighbours
from .probes import Probes, derive
from .ray_budget import RATE, denoised_error, work
from .screening import Screening, screening_samples
from .shrinkage import calibration_factor, denoise
from .upsampling import coarsened, nearest_baked, upsample

_COARSEST, _FEWEST = 64, 4096  # stride along the curve at first, points left at least
_HALVED = 1.2  # by what the error of predictions falls when the stride is halved
_AIM = 0.88  # of the tolerance: its square is the goal, for what measures the error is uncertain
_COARSE = 4.0  # times the goal that predictions may miss before screening corrects them
_JUMP = 5.0  # aims: larger errors of predictions are taken for jumps, which screening finds
_MET = 1.1  # times the goal is near enough
_ROUNDS = 12  # of baking more, at most
_LEFT = 0.03  # of the points may be outliers until the end, when they are baked, too
_PAYS = 2.5  # times its own rays is what screening must save
_BISECTIONS = 12  # of the range of multipliers
_ONCE_BAKED = 0.7  # of the goal at most, the squared error of points baked among others
_DEEPER = np.array([0, 0.25, 0.35, 0.5, 0.7, 1, 1.4, 2, 2.8, 4, 8, 16, 32])  # times as many rays more, to choose from


class ToleranceWarning(UserWarning):
    """A bake's estimated error exceeds the tolerance asked for."""


def shortfall(options: Options, rmse: float, samples: int, each: str) -> str | None:
    """In words what an estimated error lacks of the tolerance asked for, or None; it is warned of, too.

    Args: samples: rays that each point, of the sort `each`, got.
    """
    if options.tolerance is None or rmse <= options.tolerance:
        return None
    reason = f": {samples:,} rays a {each} were allowed" if samples >= options.rays else ""
    text = f"tolerance {options.tolerance:g} is not met, the estimated RMSE is {rmse:.3g}{reason}"
    warnings.warn(text, ToleranceWarning, stacklevel=5)  # whoever called the Python face, which two decorators wrap
    return text


@dataclass(frozen=True, eq=False)
class Estimate:
    """What a bake knows about its points.

    Attributes:
        rows: float64 (k, 4), w and the mean of μ·direction (x, y, z). variance: (k,), mean square error of w expected.
        samples: rays that a baked point got. predicted: number of points that were not baked; screened: rays of each.
        calibration: of the variances, at some of the points.
    """

    rows: Float64s
    variance: Float64s
    samples: int
    predicted: int
    screened: int = 0
    calibration: Calibration | None = None

    def skipped(self, hidden: int) -> dict[str, int]:
        """Rays not traced, by reason. Args: hidden: number of points inside solids."""
        return {"predicted": (self.samples - self.screened) * self.predicted, "hidden": self.samples * hidden}


def estimate_to(
    tracer: Tracer, points: Points, neighbours: Neighbours, tolerance: float, most: int, key: np.uint32
) -> Estimate:
    """Estimates whose root mean square error over all points is `tolerance`, if `most` rays a point allow it."""
    aim = _AIM * tolerance
    probes = Probes(tracer, points, neighbours, aim, most, key)
    tracer.expected = tracer.rays + probes.samples * len(points)  # the most, if no point can be predicted
    field = _Field(tracer, points, neighbours, probes, aim, key)
    field.bake_coarsely()
    field.refine(most)
    return field.estimate()


class _Field:
    """w over all points, from rays at some of them.

    Attributes:
        baked: bool (k,). owner, near, known, cell: `nearest_baked`, `coarsened` of these. rows: (k, COLUMNS), by rays.
        values: (b, 4), the baked points' reconstructed w and means of μ·direction.
        w: (k,), of all points; error: (k,), its expected square error. mse: the mean of that.
        outliers: bool (k,), points not baked whose w is to be traced, see `Screening.outliers`.
        samples: rays of a baked point; noise: mean square error of what they alone give.
        stride: int64 (k,), the distance along the curve of the points that are baked around each, outliers left out.
    """

    def __init__(
        self, tracer: Tracer, points: Points, neighbours: Neighbours, probes: Probes, aim: float, key: np.uint32
    ) -> None:
        self.tracer, self.points, self.neighbours, self.probes, self.key = tracer, points, neighbours, probes, key
        self.aim, self.goal, self.tolerance = aim, aim**2, aim / _AIM
        self.samples, self.noise = probes.samples, probes.variance
        self.screening: Screening | None = None
        stride = 1 if probes.all_baked else _COARSEST
        while stride > 1 and len(points) // stride < _FEWEST:
            stride //= 2
        self.stride = np.full(len(points), stride)
        self.rows = np.zeros((len(points), COLUMNS))
        self.baked = np.zeros(len(points), np.bool_)
        self._bake(np.arange(len(points)) % stride == 0)
        if (self.owner < 0).any():
            self._bake(self.owner < 0)

    def _bake(self, which: Bools) -> None:
        self._trace(which & ~self.baked)
        self.owner = nearest_baked(self.neighbours, self.baked)

    def _trace(self, which: Bools) -> None:
        self.baked |= which
        if self.samples == self.probes.samples:
            probed = which[self.probes.rows]
            self.rows[self.probes.rows[probed]] = self.probes.raw[probed]
            which[self.probes.rows] = False
        self.rows[which] = self.tracer.gather(self.points[which], self.samples, self.key)

    def bake_coarsely(self) -> None:
        """Bake more points where predictions are worst until screening can do the rest, or all are baked."""
        self._reconstruct()
        while self.mse > _COARSE * self.goal and not self.baked.all():
            left = np.count_nonzero(~self.baked)
            saved = work(self.samples) * (left - self._halvings(self.goal)[1])
            if saved < _PAYS * work(screening_samples(self.tolerance, self.samples)) * left:
                self._bake(~self.baked)
            else:
                self._bake(self._halve(self._halvings(_COARSE / 2 * self.goal)[0]))
            self._reconstruct()

    def refine(self, most: int) -> None:
        """Screen what is predicted, and bake outliers and doubtful points or trace more rays until the goal is met."""
        if not self.baked.all():
            self.screening = Screening(
                self.tracer, self.points, self.neighbours, ~self.baked, self.tolerance, self.probes, derive(self.key, 3)
            )
            self._reconstruct()
        for _ in range(_ROUNDS):
            chosen = self.outliers.copy()
            few = np.count_nonzero(chosen) <= _LEFT * len(self.points)
            if self.mse > _MET * self.goal and few:
                halvings, added = self._halvings(self.goal)
                effort, more, doubtful = self._cheapest(most)
                if more and not 0 < added * work(self.samples) <= effort:
                    self._deepen(more)
                    chosen |= doubtful
                elif added > 0:
                    chosen |= self._halve(halvings)
                else:
                    return
            elif few:
                return
            if chosen.any():
                self._bake(chosen)
            self._reconstruct()

    def _reconstruct(self) -> None:
        """Shrink the baked points towards their neighbours, predict the others, and measure the error of all."""
        self.near, self.known, self.cell = coarsened(self.neighbours, self.owner, self.points.normals)
        raw = self.rows[self.known]
        denoised, error = denoise(self.near, self.points[self.known], raw, self.noise)
        self.values = np.column_stack([denoised, raw[:, BENT:]])
        residual = np.nan_to_num(raw[:, W] - self.near.predict(raw[:, W])) ** 2
        jump = np.inf if self.screening else (_JUMP * self.aim) ** 2
        between = np.maximum(self.near.smooth(np.minimum(residual, jump), 2), error)
        self.error = np.where(self.baked, error[self.cell], between[self.cell])
        self.outliers = np.zeros(len(self.points), np.bool_)
        rows = self.probes.rows
        if self.screening is None or self.baked.all():
            self._rescale(self._fill(rows, 1)[:, 0], jump)
        else:
            self.w = self._fill(np.arange(len(self.points)), 1)[:, 0]
            self._rescale(self.w[rows], jump)
            self.w = self.screening.correct(self.w, self.error, ~self.baked)
            self._rescale(self.w[rows], jump)
            self.outliers = self.screening.outliers(self.w) & ~self.baked
        self.mse = float(np.mean(self.error))

    def _fill(self, wanted: Int64s, columns: int = 4) -> Float64s:
        """Values (j, columns) at the points `wanted` (j,), from those at the baked ones."""
        values = np.ascontiguousarray(self.values[:, :columns])
        return upsample(self.points, wanted, self.near, self.known, self.cell, values)

    def _rescale(self, probed: Float64s, jump: float) -> None:
        """Bring expected squared errors to the level that the probes' w, `probed` (j,), show, `jump` at most each."""
        rows = self.probes.rows
        predicted = ~self.baked[rows]
        squared = np.minimum(self.probes.squared(probed, ~predicted), jump)
        expected, measured = self.error[rows[predicted]], squared[predicted]
        if expected.any():
            less = float(np.sum(measured)) < float(np.sum(expected))
            chance = 2 * len(expected) * np.mean(self.error[~self.baked] ** 2)
            doubt = float(np.sqrt(np.sum(measured**2) + chance)) if less else 0.0
            self.error[~self.baked] *= (max(float(np.sum(measured)), 0.0) + doubt) / (float(np.sum(expected)) + doubt)
        self.error *= calibration_factor(self.error[rows], squared, self.error)

    def _halve(self, halvings: Int64s) -> Bools:
        """Halve the stride in each cell as often as `halvings` (b,) say; the points (k,) to bake for that."""
        self.stride = np.maximum(self.stride >> halvings[self.cell], 1)
        return ~self.baked & (np.arange(len(self.points)) % self.stride == 0)

    def _halvings(self, goal: float) -> tuple[Int64s, float]:
        """How often to halve the stride in each cell, (b,), for a mean square error of `goal`; points baked by that.

        Halving a stride divides the error of what is predicted by _HALVED² and doubles what is baked, so that it gains
        most for a ray where error · stride is largest. Cells are halved down to one level of that, the Lagrange
        multiplier, which is bisected.
        """
        between, count = self._cells()
        baked, total = float(np.sum(self.error[self.baked])), goal * len(self.points)
        once_baked = min(baked / len(self.known), _ONCE_BAKED * self.goal)
        stride = np.maximum(np.bincount(self.cell, np.where(self.baked, 0, self.stride)) / np.maximum(count, 1), 1)
        most = np.ceil(np.log2(stride))
        gain = np.log2(np.maximum(between * stride, 1e-30)) / np.log2(2 * _HALVED**2)

        def halved(level: float) -> tuple[Float64s, Float64s]:
            halvings = np.clip(np.ceil(gain - level), 0, most)
            return halvings, np.where(halvings > 0, count * np.minimum(np.exp2(halvings) / stride, 1), 0.0)

        low, high = float(gain.min()) - np.log2(_COARSEST), float(gain.max())
        for _ in range(_BISECTIONS):
            level = (low + high) / 2
            halvings, added = halved(level)
            predicted = (count - added) * between * _HALVED ** (-2 * halvings)
            fine = float(np.sum(predicted + added * once_baked)) + baked <= total
            low, high = (level, high) if fine else (low, level)
        halvings, added = halved(low)
        return halvings.astype(np.int64), float(np.sum(added))

    def _cells(self) -> tuple[Float64s, Float64s]:
        """Mean error of the points predicted in each cell, (b,), and how many they are."""
        count: Float64s = np.bincount(self.cell).astype(np.float64) - 1
        total: Float64s = np.bincount(self.cell, np.where(self.baked, 0.0, self.error)).astype(np.float64, copy=False)
        return total / np.maximum(count, 1.0), count

    def _fine(self, total: Float64s, count: Float64s, error: float, once_baked: float, goal: float) -> int:
        """How many cells may stay predicted if the others' points get `once_baked` and baked ones have `error`."""
        number = len(self.points)
        baked = number - count[-1]
        kept = total + once_baked * (count[-1] - count) + error * baked
        return int(np.flatnonzero(kept <= goal * number)[-1]) + 1 if (kept <= goal * number).any() else 0

    def _cheapest(self, most: int) -> tuple[float, int, Bools]:
        """The least work that reaches the goal, how many rays each baked point gets by it, and which points besides."""
        between, count = self._cells()
        order = np.argsort(between, kind="stable")
        total, count = np.cumsum((between * count)[order]), np.cumsum(count[order])
        number, error = np.count_nonzero(self.baked), float(np.mean(self.error[self.baked]))
        best: tuple[float, int, int] = np.inf, most - self.samples, 0
        for more in np.unique(np.minimum(8 * np.round(_DEEPER * self.samples / 8), most - self.samples).astype(int)):
            lessened = denoised_error(self.noise, error, self._lessened(int(more)))
            fine = self._fine(total, count, lessened, min(lessened, _ONCE_BAKED * self.goal), self.goal)
            left = count[-1] - (count[fine - 1] if fine else 0)
            if fine or left or lessened <= _MET * self.goal:
                best = min(best, (number * work(more) + left * work(self.samples + more), int(more), fine))
        effort, more, fine = best
        doubtful = np.zeros(len(between), np.bool_)
        doubtful[order[fine:]] = True
        return effort, more, ~self.baked & doubtful[self.cell]

    def _lessened(self, more: int) -> float:
        """By what `more` rays multiply the variance of a baked point: lattices of n, m rays are worth n^1.5 + m^1.5."""
        now, added = (float(n) ** RATE for n in (self.samples, more))
        return now / (now + added)

    def _deepen(self, more: int) -> None:
        """Give every baked point `more` rays."""
        rows = self.tracer.gather(self.points[self.baked], more, derive(self.key, 5 + self.samples))
        kept = self._lessened(more)
        self.rows[self.baked] += (1 - kept) * (rows - self.rows[self.baked])
        self.noise *= kept
        self.samples += more

    def estimate(self) -> Estimate:
        """What all points become; the few outliers that are left are traced, too, and stay as they are."""
        rows = self._fill(np.arange(len(self.points)))
        if self.screening and not self.baked.all():
            left = self.outliers
            rows[:, W] = self.screening.combined(self.w, self.error, ~self.baked)
            self._trace(left.copy())
            rows[left] = self.rows[left][:, VALUES]
            self.error[left] = self.noise
        screened = self.screening.samples if self.screening else 0
        probed = self.probes.rows
        measured = self.probes.squared(rows[probed, W], self.baked[probed])
        calibration = Calibration(self.error[probed], measured)
        return Estimate(rows, self.error, self.samples, int(np.count_nonzero(~self.baked)), screened, calibration)
