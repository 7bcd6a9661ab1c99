"""Baking to a tolerance: as many rays at as few points as a root mean square error asks for.

Probes, points spread over the mesh, are baked twice with independent directions. Where w is made of other rays, (w − a)
(w − b) over a probe's two estimates a and b is an unbiased measure of its mean square error; once the probe is baked, a
is part of w and the measure is (w − b)² − (a − b)²/2. It decides where predicting points from their neighbours is good
enough, whether more rays are needed, and what is reported.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from raytrace.sampling import mix

from .neighbours import Neighbours
from .plan import RATE, plan, sampling_variance
from .receivers import Points
from .reconstruct import judged, reconstruct
from .subset import coarser, fill, owners
from .trace import Tracer

Floats = npt.NDArray[np.float64]

# runs of pilots, pilots at most, their rays; one point in how many is probed, at least and at most
_SMALL = 2, 512, 16, 8, 128, 768  # below _ALL points
_LARGE = 8, 1024, 64, 32, 512, 1536
_COARSEST, _FEWEST = 64, 4096  # stride along the curve at first, points left at least
_HALVED = 1.3  # by what the error of predictions falls when the stride is halved
_ALL = 16384  # points, of which fewer are all baked
_AIM = 0.88  # of the tolerance, so that the true error is within it though its measure is uncertain
_NOISY = 0.7  # part of the mean square error asked for that baked points may have while others are predicted
_SPARE = 0.9  # of the goal, so that one round of baking more is likely to meet it
_MET = 1.1  # times the goal is near enough
_ROUNDS = 3


@dataclass(frozen=True, eq=False)
class Estimate:
    """What a bake knows about its points.

    Attributes:
        rows: float64 (k, 4), w and the mean of μ·direction (x, y, z). variance: (k,), mean square error of w expected.
        samples: rays that a baked point got. predicted: number of points that got none.
    """

    rows: Floats
    variance: Floats
    samples: int
    predicted: int


class _Probes:
    """The points at which the error is measured.

    Attributes:
        rows: int64 (j,), which points. samples: rays of each. raw: (j, 5), one estimate of each, its own if it is
        baked; other: (j,), an independent one. variance: mean square error of either. all_baked: whether all points are
        going to be.
    """

    def __init__(
        self, tracer: Tracer, points: Points, neighbours: Neighbours, aim: float, most: int, key: np.uint32
    ) -> None:
        self.all_baked = len(points) < _ALL
        runs, pilots, rays, share, fewest, probes = _SMALL if self.all_baked else _LARGE
        run = min(pilots, max(len(points) // share, 128)) // runs
        keys = _derive(key, 1), _derive(key, 2)
        self.samples = plan(tracer, points, neighbours, runs, run, min(rays, most), aim, most, keys)
        self.rows = _spread(len(points), int(np.clip(len(points) // share, fewest, probes)))
        probed = points[self.rows]
        self.other = tracer.gather(probed, self.samples, _derive(key, 4))[:, 0]
        self.raw = tracer.gather(probed, self.samples, key)
        self.variance = sampling_variance(self.raw[:, 0], self.other, self.samples)

    def squared(self, w: Floats, baked: npt.NDArray[np.bool_]) -> Floats:
        """Unbiased squared error (j,) of `w` (j,), what all points' estimates make of the probed ones.

        Args: baked: (j,), which of them have a part in it themselves.
        """
        own = (w - self.other) ** 2 - (self.raw[:, 0] - self.other) ** 2 / 2
        return np.where(baked, own, (w - self.raw[:, 0]) * (w - self.other))


def estimate_to(
    tracer: Tracer, points: Points, neighbours: Neighbours, tolerance: float, most: int, key: np.uint32
) -> Estimate:
    """Estimates whose root mean square error over all points is `tolerance`, if `most` rays a point allow it."""
    probes = _Probes(tracer, points, neighbours, _AIM * tolerance, most, key)
    tracer.expected = tracer.rays + probes.samples * len(points)  # the most, if no point can be predicted
    field = _Field(tracer, points, neighbours, probes, key)
    goal = (_AIM * tolerance) ** 2
    for _ in range(_ROUNDS):
        field.refine(goal, most)
        if not field.deepen_to(goal, most):
            break
    return field.estimate()


class _Field:
    """w over all points, from rays at some of them.

    Attributes:
        baked: bool (k,). owner, near, known, cell: `owners` and `coarser` of these. rows: (k, 5), what rays tell.
        values: (b, 4), the baked points' reconstructed w and means of μ·direction; error: (b,), mean square error of w.
        between: (b,), that of the points told from each, of which there are told (b,). mse: that of all points.
    """

    def __init__(self, tracer: Tracer, points: Points, neighbours: Neighbours, probes: _Probes, key: np.uint32) -> None:
        self.tracer, self.points, self.neighbours, self.probes, self.key = tracer, points, neighbours, probes, key
        self.samples, self.noise = probes.samples, probes.variance
        self.stride = 1 if probes.all_baked else _COARSEST
        while self.stride > 1 and len(points) // self.stride < _FEWEST:
            self.stride //= 2
        self.rows = np.zeros((len(points), 5))
        self.baked = np.zeros(len(points), np.bool_)
        self._bake(np.arange(len(points)) % self.stride == 0)
        if (self.owner < 0).any():
            self._bake(self.owner < 0)

    def _bake(self, which: npt.NDArray[np.bool_]) -> None:
        which = which & ~self.baked
        self.baked |= which
        if self.samples == self.probes.samples:
            probed = which[self.probes.rows]
            self.rows[self.probes.rows[probed]] = self.probes.raw[probed]
            which[self.probes.rows] = False
        self.rows[which] = self.tracer.gather(self.points[which], self.samples, self.key)
        self.owner = owners(self.neighbours, self.baked)

    def refine(self, goal: float, most: int) -> None:
        """Bake more points where predictions are worst until the mean square error meets `goal` or all are baked."""
        self._reconstruct()
        while self.mse > _MET * goal and not self.baked.all():
            if self.stride == 1 and self._deepening_pays(goal, most):
                self.deepen_to(goal, most)
            else:
                self.stride = max(self.stride // self._step(goal), 1)
                doubtful = self._doubtful(_SPARE * goal) & (np.arange(len(self.points)) % self.stride == 0)
                self._bake(doubtful if self.stride > 1 or doubtful.any() else ~self.baked)
            self._reconstruct()

    def _missing(self, goal: float) -> int:
        """Rays that every baked point lacks for `goal`: two lattices of n and m rays are worth n^1.5 + m^1.5."""
        return int(self.samples * max(self.mse / goal - 1, 0.0) ** (1 / RATE))

    def _deepening_pays(self, goal: float, most: int) -> bool:
        """Whether the baked points' noise is in the way, and more rays for them are fewer than rays for the rest."""
        share = float(np.mean(self.baked))
        noisy = float(np.mean(self.error)) > _NOISY * goal and self.samples < most
        return noisy and share * self._missing(goal) < (1 - share) * self.samples

    def _reconstruct(self) -> None:
        """Draw the baked points to their neighbours, and measure the mean square error of what all points become."""
        self.near, self.known, self.cell = coarser(self.neighbours, self.owner, self.points.normals)
        raw = self.rows[self.known]
        drawn, self.error = reconstruct(self.near, self.points[self.known], raw, self.noise)
        self.values = np.column_stack([drawn, raw[:, 2:]])
        residual = np.nan_to_num(raw[:, 0] - self.near.predict(raw[:, 0]))
        self.between = np.maximum(self.near.smooth(residual**2, 2), self.error)
        self._judge()

    def _fill(self, wanted: npt.NDArray[np.int64]) -> Floats:
        """Values (j, 4) at the points `wanted` (j,), from those at the baked ones."""
        return fill(self.points, wanted, self.near, self.known, self.cell, self.values)

    def _judge(self) -> None:
        """Bring the expected squared errors to the level that the probes show, and set their mean."""
        rows = self.probes.rows
        predicted, cell = ~self.baked[rows], self.cell[rows]
        squared = self.probes.squared(self._fill(rows)[:, 0], ~predicted)
        told = float(np.sum(self.between[cell[predicted]]))
        self.between *= max(float(np.sum(squared[predicted])), 0.0) / told if told > 0 else 0.0
        level = judged(np.where(predicted, self.between[cell], self.error[cell]), squared)
        self.between *= level
        self.error *= level
        self.told = np.bincount(self.cell, minlength=len(self.known)) - 1
        self.mse = float(np.sum(self.told * self.between) + np.sum(self.error)) / max(len(self.points), 1)

    def _step(self, goal: float) -> int:
        """By what to divide the stride: 2, or more where predictions are so far off that all the next rounds fail."""
        excess = float(np.sqrt(np.sum(self.told * self.between) / np.sum(self.told) / goal))
        return int(2 ** max(np.log(max(excess, 1.0)) / np.log(_HALVED) - 2, 1))

    def _doubtful(self, goal: float) -> npt.NDArray[np.bool_]:
        """The points too ill predicted for `goal`: the fewest whose baking leaves enough to the others."""
        order = np.argsort(self.between, kind="stable")
        told, once_baked = np.cumsum(self.told[order]), float(np.mean(self.error))
        kept = np.cumsum((self.told * self.between)[order]) + once_baked * (told[-1] - told)
        fine = np.flatnonzero(kept <= goal * len(self.points) - float(np.sum(self.error)))
        worst = self.between[order[fine[-1]]] if len(fine) else -1.0
        return ~self.baked & (self.between > worst)[self.cell]

    def deepen_to(self, goal: float, most: int) -> bool:
        """Give every baked point the rays that `goal` lacks, up to `most` in all; whether any were lacking."""
        if self.mse <= _MET * goal or self.samples >= most:
            return False
        samples = min(max(8 * round(self._missing(goal) / 8), 8), most - self.samples)
        more = self.tracer.gather(self.points[self.baked], samples, _derive(self.key, 5 + self.samples))
        ours, theirs = (float(n) ** RATE for n in (self.samples, samples))
        share = theirs / (ours + theirs)
        self.rows[self.baked] += share * (more - self.rows[self.baked])
        self.noise *= ours / (ours + theirs)
        self.samples += samples
        return True

    def estimate(self) -> Estimate:
        rows = self._fill(np.arange(len(self.points)))
        variance = np.where(self.baked, self.error[self.cell], self.between[self.cell])
        return Estimate(rows, variance, self.samples, int(np.count_nonzero(~self.baked)))


def _spread(count: int, wanted: int) -> npt.NDArray[np.int64]:
    """`wanted` of `count` rows, one from each equal stretch of the curve, all if there are no more."""
    wanted = min(count, wanted)
    chance = np.ldexp(mix(np.arange(wanted, dtype=np.uint32)).astype(np.float64), -32)
    return ((np.arange(wanted) + chance) * (count / max(wanted, 1))).astype(np.int64)


def _derive(key: np.uint32, salt: int) -> np.uint32:
    return mix(mix([salt]) ^ key)[0]
