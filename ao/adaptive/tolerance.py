"""Baking to a tolerance: as many rays at as few points as a root mean square error asks for.

Points far apart are baked first and the others predicted from them; halving the distance goes on where predictions are
poor. Then every point that is not baked gets a few rays of its own (`screening`), which find the jumps of w that no
prediction can know of, and more points are baked where they show that it is needed. Probes say when to stop.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ..denoise.one_ring import Neighbours
from ..denoise.shrinkage import calibration_factor, denoise
from ..denoise.upsampling import coarsened, nearest_baked, upsample
from ..gather.hemisphere import BENT, COLUMNS, VALUES, W
from ..gather.points import Points
from ..trace.tracer import Tracer
from .probes import Probes, derive
from .ray_budget import RATE
from .screening import Screening

Floats = npt.NDArray[np.float64]

_COARSEST, _FEWEST = 64, 4096  # stride along the curve at first, points left at least
_HALVED = 1.3  # by what the error of predictions falls when the stride is halved
_AIM = 0.88  # of the tolerance: its square is the goal, for what measures the error is uncertain
_COARSE = 4.0  # times the goal that predictions may miss before screening corrects them
_JUMP = 5.0  # aims: larger errors of predictions are taken for jumps, which screening finds
_SPARE = 0.9  # of the goal, so that one round of baking more is likely to meet it
_MET = 1.1  # times the goal is near enough
_ROUNDS = 12  # of baking more, at most
_LEFT = 0.03  # of the points may be outliers until the end, when they are baked, too
_WORTH = 1 / 32  # of the points, worth a round of baking
_ONCE_BAKED = 0.7  # of the goal at most, the squared error of points baked among others
_DEEPER = np.array([0, 0.25, 0.35, 0.5, 0.7, 1, 1.4, 2, 2.8, 4, 8, 16, 32])  # times as many rays more, to choose from


class ToleranceWarning(UserWarning):
    """A bake's estimated error exceeds the tolerance asked for."""


@dataclass(frozen=True, eq=False)
class Estimate:
    """What a bake knows about its points.

    Attributes:
        rows: float64 (k, 4), w and the mean of μ·direction (x, y, z). variance: (k,), mean square error of w expected.
        samples: rays that a baked point got. predicted: number of points that were not baked; screened: rays of each.
    """

    rows: Floats
    variance: Floats
    samples: int
    predicted: int
    screened: int = 0


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
        samples: rays of a baked point; noise: mean square error of what they alone give.
    """

    def __init__(
        self, tracer: Tracer, points: Points, neighbours: Neighbours, probes: Probes, aim: float, key: np.uint32
    ) -> None:
        self.tracer, self.points, self.neighbours, self.probes, self.key = tracer, points, neighbours, probes, key
        self.aim, self.goal, self.tolerance = aim, aim**2, aim / _AIM
        self.samples, self.noise = probes.samples, probes.variance
        self.screening: Screening | None = None
        self.stride = 1 if probes.all_baked else _COARSEST
        while self.stride > 1 and len(points) // self.stride < _FEWEST:
            self.stride //= 2
        self.rows = np.zeros((len(points), COLUMNS))
        self.baked = np.zeros(len(points), np.bool_)
        self._bake(np.arange(len(points)) % self.stride == 0)
        if (self.owner < 0).any():
            self._bake(self.owner < 0)

    def _bake(self, which: npt.NDArray[np.bool_]) -> None:
        self._trace(which & ~self.baked)
        self.owner = nearest_baked(self.neighbours, self.baked)

    def _trace(self, which: npt.NDArray[np.bool_]) -> None:
        self.baked |= which
        if self.samples == self.probes.samples:
            probed = which[self.probes.rows]
            self.rows[self.probes.rows[probed]] = self.probes.raw[probed]
            which[self.probes.rows] = False
        self.rows[which] = self.tracer.gather(self.points[which], self.samples, self.key)

    def bake_coarsely(self) -> None:
        """Bake more points where predictions are worst until screening can do the rest, or all are baked."""
        goal = _COARSE * self.goal
        self._reconstruct()
        while self.mse > goal and not self.baked.all():
            self._bake(self._doubtful(goal))
            self._reconstruct()

    def refine(self, most: int) -> None:
        """Screen what is predicted, and bake outliers and doubtful points or trace more rays until the goal is met."""
        if not self.baked.all():
            self.screening = Screening(
                self.tracer, self.points, self.neighbours, ~self.baked, self.tolerance, self.probes, derive(self.key, 3)
            )
            self._reconstruct()
        for _ in range(_ROUNDS):
            chosen = self._outliers()
            few = np.count_nonzero(chosen) <= _LEFT * len(self.points)
            if self.mse > _MET * self.goal and few:
                if self.stride > 1:
                    chosen |= self._doubtful(self.goal)
                else:
                    more, doubtful = self._cheapest(most)
                    chosen |= doubtful
                    if more:
                        self._deepen(more)
                    elif not chosen.any():
                        return
            elif few:
                return
            self._bake(chosen)
            self._reconstruct()

    def _outliers(self) -> npt.NDArray[np.bool_]:
        if self.screening is None:
            return np.zeros(len(self.points), np.bool_)
        return self.screening.outliers(self.w) & ~self.baked

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
        rows = self.probes.rows
        if self.screening is None or self.baked.all():
            self._rescale(self._fill(rows, 1)[:, 0], jump)
        else:
            self.w = self._fill(np.arange(len(self.points)), 1)[:, 0]
            self._rescale(self.w[rows], jump)
            self.w = self.screening.correct(self.w, self.error, ~self.baked)
            self._rescale(self.w[rows], jump)
        self.mse = float(np.mean(self.error))

    def _fill(self, wanted: npt.NDArray[np.int64], columns: int = 4) -> Floats:
        """Values (j, columns) at the points `wanted` (j,), from those at the baked ones."""
        values = np.ascontiguousarray(self.values[:, :columns])
        return upsample(self.points, wanted, self.near, self.known, self.cell, values)

    def _rescale(self, probed: Floats, jump: float) -> None:
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

    def _doubtful(self, goal: float) -> npt.NDArray[np.bool_]:
        """Points nearer together than baked ones, by half or more, where predictions fail `goal`; lowers the stride."""
        excess = float(np.sqrt(np.mean(self.error[~self.baked]) / goal))
        between, order, total, count = self._cells()
        error = float(np.mean(self.error[self.baked]))
        fine = self._fine(total, count, error, min(error, _ONCE_BAKED * goal), _SPARE * goal)
        worst = between[order[fine - 1]] if fine else -1.0
        doubtful = ~self.baked & (between > worst)[self.cell]
        self.stride //= int(2 ** max(np.log(max(excess, 1.0)) / np.log(_HALVED) - 2, 1))
        while self.stride > 1:
            chosen = doubtful & (np.arange(len(self.points)) % self.stride == 0)
            if np.count_nonzero(chosen) >= _WORTH * len(self.points):
                return chosen
            self.stride //= 2
        self.stride = 1
        return doubtful if doubtful.any() else ~self.baked

    def _cells(self) -> tuple[Floats, npt.NDArray[np.int64], Floats, Floats]:
        """Mean error of the points predicted in each cell; cells in its order; running sums of errors and of points."""
        count = np.bincount(self.cell, minlength=len(self.known)) - 1
        total = np.bincount(self.cell, np.where(self.baked, 0.0, self.error), len(self.known))
        between = total / np.maximum(count, 1)
        order = np.argsort(between, kind="stable")
        return between, order, np.cumsum(total[order]), np.cumsum(count[order], dtype=np.float64)

    def _fine(self, total: Floats, count: Floats, error: float, once_baked: float, goal: float) -> int:
        """How many cells may stay predicted if the others' points get `once_baked` and baked ones have `error`."""
        number = len(self.points)
        baked = number - count[-1]
        kept = total + once_baked * (count[-1] - count) + error * baked
        return int(np.flatnonzero(kept <= goal * number)[-1]) + 1 if (kept <= goal * number).any() else 0

    def _cheapest(self, most: int) -> tuple[int, npt.NDArray[np.bool_]]:
        """How many rays more for every baked point, and which points besides, reach the goal with the fewest rays."""
        between, order, total, count = self._cells()
        number, error = np.count_nonzero(self.baked), float(np.mean(self.error[self.baked]))
        best: tuple[float, int, int] = np.inf, most - self.samples, 0
        for more in np.unique(np.minimum(8 * np.round(_DEEPER * self.samples / 8), most - self.samples).astype(int)):
            lessened = error * self._lessened(int(more))
            fine = self._fine(total, count, lessened, min(lessened, _ONCE_BAKED * self.goal), _SPARE * self.goal)
            left = count[-1] - (count[fine - 1] if fine else 0)
            if fine or left or lessened <= _MET * self.goal:
                best = min(best, (number * more + left * (self.samples + more), int(more), fine))
        _, more, fine = best
        doubtful = np.zeros(len(between), np.bool_)
        doubtful[order[fine:]] = True
        return more, ~self.baked & doubtful[self.cell]

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
            rows[:, 0] = self.w
            left = self._outliers()
            self._trace(left.copy())
            rows[left] = self.rows[left][:, VALUES]
            self.error[left] = self.noise
        screened = self.screening.samples if self.screening else 0
        return Estimate(rows, self.error, self.samples, int(np.count_nonzero(~self.baked)), screened)
