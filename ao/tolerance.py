"""Baking to a tolerance: as many rays at as few points as a root mean square error asks for.

Probes, points spread over the mesh, are baked twice with independent directions. Whatever w is made of the other rays,
(w − a)(w − b) over the probes' two estimates a and b is an unbiased measure of its mean square error. It decides how
many rays a point gets, where predicting points from their neighbours is good enough, and what is reported.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from raytrace.sampling import mix

from .neighbours import Neighbours
from .receivers import Points
from .reconstruct import SPREAD_REACH, reconstruct, shared_out
from .subset import coarser, fill, owners
from .trace import Tracer

Floats = npt.NDArray[np.float64]

LEAST = 16  # rays a point
_PILOT_POINTS, _PILOT_RAYS = 128, 64  # of each run
_PROBES = (512, 1536)
_PROBE_SHARE = 32
_COARSEST, _FEWEST, _STEP = 64, 4096, 4  # strides along the curve: at most, points left at least, from one to the next
_RATE = 1.5  # the variance of n rays falls as n^−1.5
_AIM = 0.92  # of the tolerance, so that the true error is within it though its measure is uncertain
_GAIN = 1.25  # at most what the raw error may exceed the aim by, for reconstruction to bring it back
_RUNS = 8  # stretches of the curve that tell how much that is
_SHARED = 0.2  # variance of a neighbours' mean, relative to one neighbour's
_LOSS = 1.1  # of the gain, for roughness is not the same everywhere
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
    """The points at which the error is measured, and their two estimates."""

    def __init__(
        self, tracer: Tracer, points: Points, neighbours: Neighbours, aim: float, most: int, key: np.uint32
    ) -> None:
        self.samples = self._plan(tracer, points, neighbours, aim, most, key)
        self.rows = _spread(len(points), int(np.clip(len(points) // _PROBE_SHARE, *_PROBES)))
        probed = points[self.rows]
        self.a, self.b = (tracer.gather(probed, self.samples, _derive(key, salt))[:, 0] for salt in (3, 4))
        self.variance = float(np.mean((self.a - self.b) ** 2)) / 2

    @staticmethod
    def _plan(tracer: Tracer, points: Points, neighbours: Neighbours, aim: float, most: int, key: np.uint32) -> int:
        """Rays a point for an error of about `aim` once it is drawn to its neighbours, judged by a few runs."""
        rays = min(_PILOT_RAYS, most)
        run = np.arange(min(_PILOT_POINTS, len(points)))
        starts = np.linspace(0, len(points) - len(run), _RUNS).astype(np.int64)
        rows = np.unique(starts[:, None] + run)
        first, second = (tracer.gather(points[rows], rays, _derive(key, salt))[:, 0] for salt in (1, 2))
        noise = float(np.mean((first - second) ** 2)) / 2
        values = np.full(len(points), np.nan)
        values[rows] = first
        inside = neighbours.among(np.isfinite(values))
        residual = (values - inside.predict(np.nan_to_num(values)))[rows]
        # E (y − p)² = σ² + t², and t² = s² + κ σ² where neighbours of variance σ² predict
        rough = (
            max(float(np.nanmean(residual**2)) - (1 + _SHARED) * noise, 0.0) if np.isfinite(residual).any() else np.inf
        )
        counts = np.arange(8, most + 8, 8)
        variance = noise * (rays / counts) ** _RATE
        told = rough + _SHARED * variance
        drawn = _LOSS * variance * told / (variance + told) if np.isfinite(rough) else variance
        enough = np.maximum(drawn, variance / _GAIN**2) <= aim**2
        return int(np.clip(counts[np.argmax(enough)] if enough.any() else most, min(LEAST, most), most))

    def squared(self, w: Floats) -> Floats:
        """Unbiased squared error of `w` (k,) at each probe."""
        return (w[self.rows] - self.a) * (w[self.rows] - self.b)


def estimate_to(
    tracer: Tracer, points: Points, neighbours: Neighbours, tolerance: float, most: int, key: np.uint32
) -> Estimate:
    """Estimates whose root mean square error over all points is `tolerance`, if `most` rays a point allow it."""
    probes = _Probes(tracer, points, neighbours, _AIM * tolerance, most, key)
    tracer.expected = tracer.rays + probes.samples * len(points)  # the most, if no point can be predicted
    field = _Field(tracer, points, neighbours, probes, key)
    for _ in range(_ROUNDS):
        field.refine((_AIM * tolerance) ** 2)
        excess = field.mse / (_AIM * tolerance) ** 2
        if excess <= 1.1 or field.samples >= most:
            break
        # two lattices of n and m rays are worth n^1.5 + m^1.5
        field.deepen(min(most - field.samples, 8 * int(np.ceil(field.samples * (excess - 1) ** (1 / _RATE) / 8))))
    return field.estimate()


class _Field:
    """w over all points, from rays at some of them."""

    def __init__(self, tracer: Tracer, points: Points, neighbours: Neighbours, probes: _Probes, key: np.uint32) -> None:
        self.tracer, self.points, self.neighbours, self.probes, self.key = tracer, points, neighbours, probes, key
        self.samples, self.noise = probes.samples, probes.variance
        self.stride = _COARSEST
        while self.stride > 1 and len(points) // self.stride < _FEWEST:
            self.stride //= _STEP
        self.rows = np.zeros((len(points), 5))
        self.baked = np.zeros(len(points), np.bool_)
        self._bake(np.arange(len(points)) % self.stride == 0)
        self.owner = owners(neighbours, self.baked)
        self._bake(self.owner < 0)

    def _bake(self, which: npt.NDArray[np.bool_]) -> None:
        which = which & ~self.baked
        self.rows[which] = self.tracer.gather(self.points[which], self.samples, self.key)
        self.baked |= which

    def refine(self, goal: float) -> None:
        """Bake more points where predictions are worst, until the mean square error meets `goal` or all are baked."""
        self._reconstruct()
        while self.mse > goal and not self.baked.all():
            self.stride = max(self.stride // _STEP, 1)
            doubtful = self._doubtful(goal) & (np.arange(len(self.points)) % self.stride == 0)
            self._bake(doubtful if self.stride > 1 or doubtful.any() else ~self.baked)
            self._reconstruct()

    def _reconstruct(self) -> None:
        """Set w and its expected squared error from the baked points, and measure the mean square error."""
        self.owner = owners(self.neighbours, self.baked)
        if self.baked.all():
            near, baked = self.neighbours, np.arange(len(self.points))
        else:
            near, baked = coarser(self.neighbours, self.owner, self.points.normals)
        estimate = self.rows[baked, 0]
        variance = shared_out(near.smooth(self.rows[baked, 1], SPREAD_REACH), self.noise)
        drawn, error = reconstruct(near, estimate, variance)
        self.w = fill(
            self.points, self.owner, near, baked, np.column_stack([drawn, self.rows[baked, 2:]]), self.tracer.threads
        )
        residual = np.nan_to_num(estimate - near.predict(estimate))
        self.doubt = np.zeros(len(self.points))
        self.doubt[baked] = np.maximum(near.smooth(residual**2, 2), variance)
        self.doubt = self.doubt[self.owner]
        self._judge(baked, error)

    def _judge(self, baked: npt.NDArray[np.int64], error: Floats) -> None:
        """Bring the expected squared errors to the level that the probes show, and set their mean."""
        rows = self.probes.rows
        squared, predicted = self.probes.squared(self.w[:, 0]), ~self.baked[rows]
        told = float(np.sum(self.doubt[rows][predicted]))
        self.doubt *= max(float(np.sum(squared[predicted])), 0.0) / told if told > 0 else 0.0
        self.doubt[baked] = error
        told = float(np.sum(self.doubt[rows]))
        self.doubt *= np.clip(float(np.sum(squared)) / told, 0.5, 2.0) if told > 0 else 1.0
        self.mse = float(np.mean(self.doubt))

    def _doubtful(self, goal: float) -> npt.NDArray[np.bool_]:
        """The points too ill predicted for `goal`: the fewest whose baking leaves enough to the others."""
        rest = np.flatnonzero(~self.baked)
        order = rest[np.argsort(self.doubt[rest], kind="stable")]
        once_baked = float(np.mean(self.doubt[self.baked]))
        allowance = goal * len(self.points) - once_baked * int(np.count_nonzero(self.baked))
        kept = np.cumsum(self.doubt[order]) + once_baked * np.arange(len(order) - 1, -1, -1)
        fine = np.flatnonzero(kept <= max(allowance, 0.0))
        doubtful = np.zeros(len(self.points), np.bool_)
        doubtful[order[fine[-1] + 1 if len(fine) else 0 :]] = True
        return doubtful

    def deepen(self, samples: int) -> None:
        """Give every baked point `samples` more rays."""
        more = self.tracer.gather(self.points[self.baked], samples, _derive(self.key, 5 + self.samples))
        ours, theirs = (float(n) ** _RATE for n in (self.samples, samples))
        share = theirs / (ours + theirs)
        self.rows[self.baked] += share * (more - self.rows[self.baked])
        self.noise *= ours / (ours + theirs)
        self.samples += samples

    def estimate(self) -> Estimate:
        return Estimate(self.w, self.doubt, self.samples, int(np.count_nonzero(~self.baked)))


def _spread(count: int, wanted: int) -> npt.NDArray[np.int64]:
    """`wanted` of `count` rows, one from each equal stretch of the curve, all if there are no more."""
    wanted = min(count, wanted)
    chance = np.ldexp(mix(np.arange(wanted, dtype=np.uint32)).astype(np.float64), -32)
    return ((np.arange(wanted) + chance) * (count / max(wanted, 1))).astype(np.int64)


def _derive(key: np.uint32, salt: int) -> np.uint32:
    return mix(mix([salt]) ^ key)[0]
