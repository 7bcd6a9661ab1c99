"""Baking to a tolerance: rays at as few points as a root mean square error needs.

Points far apart are baked first, and w elsewhere is predicted from them; their distance is halved where that gains most
for its rays (`ray_budget`). Then every point that is not baked gets a few rays of its own (`screening`), which find the
jumps of w that no prediction can know of, and points are baked where these rays show a need. Probes measure the error.
"""

import warnings
from dataclasses import dataclass

import numpy as np

from raytrace.mesh.mesh import Mesh
from raytrace.mesh.solids import inward_warnings
from raytrace.types import Bools, Float32s, Float64s, Int64s

from ..execute.tracer import Tracer
from ..options import Options
from ..points.points import Points
from ..rays.gather import BENT, COLUMNS, VALUES, W
from .calibration import Calibration, calibration_factor
from .inside import holes
from .one_ring import Neighbours
from .ray_budget import ADDED, COARSEST, MET, Probes, cheapest, derive, halve_strides, variance_factor, work
from .screening import Screening, screening_samples
from .shrinkage import denoise
from .upsampling import coarsened, nearest_baked, upsample

_FEWEST = 4096  # points baked at first, at least
_AIM = 0.88  # of the tolerance: its square is the goal, for the measured error is uncertain
_COARSE = 4.0  # times the goal that predictions may miss before screening corrects them
_JUMP = 5.0  # aims: larger errors of predictions are taken for jumps, which screening finds
_ROUNDS = 12  # of baking more, at most
_LEFT = 0.03  # of the points may be outliers until the end, when outliers are baked, too
_PAYS = 2.5  # times its own rays is what screening must save


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
        warnings.warn(found[0], ToleranceWarning, stacklevel=5)  # whoever called the face, which two decorators wrap
    if options.thickness:
        return (*found, *holes(solid))
    return (*found, *inward_warnings(solid, vertices[: len(solid.vertices)]))


@dataclass(frozen=True, eq=False)
class Estimate:
    """Values of points, and their errors."""

    rows: Float64s  # (k, 4), w and the mean of μ·direction (x, y, z)
    variance: Float64s  # (k,), mean square error of w expected
    samples: int  # rays of a baked point
    predicted: int  # number of points that were not baked
    screened: int = 0  # rays of each of them
    calibration: Calibration | None = None  # of the variances, at some of the points

    def skipped(self, hidden: int) -> dict[str, int]:
        """Rays not traced, by reason. Args: hidden: number of points inside solids."""
        return {"predicted": (self.samples - self.screened) * self.predicted, "hidden": self.samples * hidden}


def estimate_to(
    tracer: Tracer, points: Points, neighbours: Neighbours, tolerance: float, max_samples: int, key: np.uint32
) -> Estimate:
    """Estimates whose root mean square error over all points is `tolerance`, if `max_samples` rays a point allow it."""
    field = _Field(tracer, points, neighbours, tolerance, max_samples, key)
    field.bake_coarsely()
    field.refine(max_samples)
    return field.estimate()


class _Field:
    """w over all points, from rays at some of them.

    Attributes:
        baked: bool (k,). nearest, graph, baked_rows, cell: `nearest_baked` and `coarsened` of the baked points.
        rows: (k, COLUMNS), by rays. values: (b, 4), the baked points' reconstructed w and means of μ·direction.
        w: (k,), of all points. error: (k,), its expected square error; mse: their mean. outliers: see `Screening`.
        samples: rays of a baked point; noise: mean square error of its w by rays alone.
        stride: int64 (k,), the distance along the curve between baked points around each point, outliers left out.
    """

    def __init__(
        self, tracer: Tracer, points: Points, neighbours: Neighbours, tolerance: float, max_samples: int, key: np.uint32
    ) -> None:
        self.tracer, self.points, self.neighbours, self.key = tracer, points, neighbours, key
        self.aim = _AIM * tolerance
        self.goal, self.tolerance = self.aim**2, self.aim / _AIM
        self.probes = probes = Probes(tracer, points, neighbours, self.aim, max_samples, key)
        tracer.expected = tracer.rays + probes.samples * len(points)  # the most, if no point can be predicted
        self.samples, self.noise = probes.samples, probes.variance
        self.screening: Screening | None = None
        stride = 1 if probes.all_baked else COARSEST
        while stride > 1 and len(points) // stride < _FEWEST:
            stride //= 2
        self.stride = np.full(len(points), stride)
        self.rows = np.zeros((len(points), COLUMNS))
        self.baked = np.zeros(len(points), np.bool_)
        self._bake(np.arange(len(points)) % stride == 0)
        if (self.nearest < 0).any():
            self._bake(self.nearest < 0)

    def _bake(self, which: Bools) -> None:
        self._trace(which & ~self.baked)
        self.nearest = nearest_baked(self.neighbours, self.baked)

    def _trace(self, which: Bools) -> None:
        self.baked |= which
        if self.samples == self.probes.samples:
            probed = which[self.probes.rows]
            self.rows[self.probes.rows[probed]] = self.probes.raw[probed]
            which[self.probes.rows] = False
        self.rows[which] = self.tracer.gather(self.points[which], self.samples, self.key)

    def bake_coarsely(self) -> None:
        """Bake points where predictions are worst until screening can do the rest, or all are baked."""
        self._reconstruct()
        while self.mse > _COARSE * self.goal and not self.baked.all():
            left = np.count_nonzero(~self.baked)
            saved = work(self.samples) * (left - self._halvings(self.goal)[1])
            if saved < _PAYS * work(screening_samples(self.tolerance, self.samples)) * left:
                self._bake(~self.baked)
            else:
                self._bake(self._halve(self._halvings(_COARSE / 2 * self.goal)[0]))
            self._reconstruct()

    def refine(self, max_samples: int) -> None:
        """Screen predicted points, and bake outliers and doubtful points or trace more rays until the goal is met."""
        if not self.baked.all():
            self.screening = Screening(
                self.tracer, self.points, self.neighbours, ~self.baked, self.tolerance, self.probes, derive(self.key, 3)
            )
            self._reconstruct()
        for _ in range(_ROUNDS):
            chosen = self.outliers.copy()
            few = np.count_nonzero(chosen) <= _LEFT * len(self.points)
            if self.mse > MET * self.goal and few:
                halvings, added = self._halvings(self.goal)
                errors, baked = (self.noise, float(np.mean(self.error[self.baked]))), len(self.baked_rows)
                effort, more, cells = cheapest(*self._cells(), baked, self.samples, errors, max_samples, self.goal)
                if more and not 0 < added * work(self.samples) <= effort:
                    chosen |= ~self.baked & cells[self.cell]
                    kept, key = variance_factor(self.samples, more), derive(self.key, 5 + self.samples)
                    rows = self.tracer.gather(self.points[self.baked], more, key)
                    self.rows[self.baked] += (1 - kept) * (rows - self.rows[self.baked])
                    self.noise *= kept
                    self.samples += more
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
        """Shrink baked points towards their neighbours, predict all other points, and measure the error."""
        self.graph, self.baked_rows, self.cell = coarsened(self.neighbours, self.nearest, self.points.normals)
        raw = self.rows[self.baked_rows]
        denoised, error = denoise(self.graph, self.points[self.baked_rows], raw, self.noise)
        self.values = np.column_stack([denoised, raw[:, BENT:]])
        residual = np.nan_to_num(raw[:, W] - self.graph.means((raw[:, W], 0.0))[0]) ** 2
        jump = np.inf if self.screening else (_JUMP * self.aim) ** 2
        between = np.maximum(self.graph.smooth(np.minimum(residual, jump), 2), error)
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
        """Values (j, columns) at the points `wanted` (j,), upsampled from the baked points."""
        values = np.ascontiguousarray(self.values[:, :columns])
        return upsample(self.points, wanted, self.graph, self.baked_rows, self.cell, values)

    def _rescale(self, probed: Float64s, jump: float) -> None:
        """Scale expected squared errors to the level of the errors of the probes' w, `probed` (j,), each ≤ `jump`."""
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
        """Halve the stride in each cell `halvings` (b,) times; the points (k,) to bake for that."""
        self.stride = np.maximum(self.stride >> halvings[self.cell], 1)
        return ~self.baked & (np.arange(len(self.points)) % self.stride == 0)

    def _cells(self) -> tuple[Float64s, Float64s]:
        """Mean squared error (b,) of the points of each cell that are predicted, and their number (b,)."""
        count: Float64s = np.bincount(self.cell).astype(np.float64) - 1
        total = np.bincount(self.cell, np.where(self.baked, 0.0, self.error)).astype(np.float64, copy=False)
        return total / np.maximum(count, 1.0), count

    def _halvings(self, goal: float) -> tuple[Int64s, float]:
        """`halve_strides` for a mean square error of `goal`."""
        (error, count), spent = self._cells(), float(np.sum(self.error[self.baked]))
        stride = np.bincount(self.cell, np.where(self.baked, 0, self.stride)) / np.maximum(count, 1)
        added_error = min(spent / len(self.baked_rows), ADDED * self.goal)
        return halve_strides(error, count, np.maximum(stride, 1), added_error, goal * len(self.points) - spent)

    def estimate(self) -> Estimate:
        """The estimate of all points; the few outliers that are left are traced, and not denoised."""
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
