"""Which points to bake next, and with how many rays, for the least work: rate allocation by a Lagrange multiplier.

Source: Shoham and Gersho, IEEE Trans. ASSP 36, 1988.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from raytrace.types import Bools, Float64s, Int32s, Int64s

from .ray_budget import RATE, denoised_error, work

COARSEST = 64  # stride along the curve at first
HALVED = 1.2  # by what the error of predictions falls when the stride is halved
MET = 1.1  # times the goal is near enough
ADDED = 0.7  # of the goal at most, the squared error of points that are baked later
_BISECTIONS = 12  # of the range of multipliers
_DEEPER = np.array([0, 0.25, 0.35, 0.5, 0.7, 1, 1.4, 2, 2.8, 4, 8, 16, 32])  # rays added, times the rays so far


class Cells(NamedTuple):
    """The predicted points of cells, which are the points nearest to each of b baked ones.

    Attributes: error: float64 (b,), their mean squared error. points: float64 (b,), their number.
    """

    error: Float64s
    points: Float64s

    @classmethod
    def of(cls, cell: Int32s, error: Float64s, baked: Bools) -> Cells:
        """Args: cell, error, baked: (k,), of all points."""
        count: Float64s = np.bincount(cell).astype(np.float64) - 1
        total: Float64s = np.bincount(cell, np.where(baked, 0.0, error)).astype(np.float64, copy=False)
        return cls(total / np.maximum(count, 1.0), count)


class Baked(NamedTuple):
    """The points that are baked: their number, rays of each, mean squared error by rays alone, and denoised."""

    number: int
    samples: int
    noise: float
    error: float


def halve_strides(cells: Cells, stride: Float64s, added_error: float, total: float) -> tuple[Int64s, float]:
    """How often to halve the stride in each cell, (b,), for squared errors of sum `total`; points baked by that.

    Halving a stride divides the error of predicted points by HALVED² and doubles the baked points, so that it gains
    most for a ray where error · stride is largest. Cells are halved down to one level of that, the Lagrange
    multiplier, which is bisected.

    Args: stride: (b,), mean of the predicted points'. added_error: squared error of points that are baked by this.
    """
    max_halvings = np.ceil(np.log2(stride))
    gain = np.log2(np.maximum(cells.error * stride, 1e-30)) / np.log2(2 * HALVED**2)

    def halved(level: float) -> tuple[Float64s, Float64s]:
        halvings = np.clip(np.ceil(gain - level), 0, max_halvings)
        return halvings, np.where(halvings > 0, cells.points * np.minimum(np.exp2(halvings) / stride, 1), 0.0)

    low, high = float(gain.min()) - np.log2(COARSEST), float(gain.max())
    for _ in range(_BISECTIONS):
        level = (low + high) / 2
        halvings, added = halved(level)
        predicted = (cells.points - added) * cells.error * HALVED ** (-2 * halvings)
        low, high = (level, high) if float(np.sum(predicted + added * added_error)) <= total else (low, level)
    halvings, added = halved(low)
    return halvings.astype(np.int64), float(np.sum(added))


def cheapest(cells: Cells, baked: Baked, max_samples: int, goal: float) -> tuple[float, int, Bools]:
    """The least work that reaches a mean squared error: work, rays more of every baked point, cells (b,) to bake."""
    order = np.argsort(cells.error, kind="stable")
    error, count = np.cumsum((cells.error * cells.points)[order]), np.cumsum(cells.points[order])
    best: tuple[float, int, int] = np.inf, max_samples - baked.samples, 0
    choices = np.minimum(8 * np.round(_DEEPER * baked.samples / 8), max_samples - baked.samples)
    for more in map(int, np.unique(choices)):
        baked_error = denoised_error(baked.noise, baked.error, variance_factor(baked.samples, more))
        added_error = min(baked_error, ADDED * goal)
        total = error + added_error * (count[-1] - count) + baked_error * baked.number
        enough = np.flatnonzero(total <= goal * (baked.number + count[-1]))
        kept = int(enough[-1]) + 1 if len(enough) else 0  # cells of least error that stay predicted
        added = count[-1] - (count[kept - 1] if kept else 0)
        if kept or added or baked_error <= MET * goal:
            best = min(best, (baked.number * work(more) + added * work(baked.samples + more), more, kept))
    effort, more, kept = best
    chosen = np.zeros(len(order), np.bool_)
    chosen[order[kept:]] = True
    return effort, more, chosen


def variance_factor(samples: int, more: int) -> float:
    """By what `more` rays multiply the variance of `samples`: lattices of n and m rays are worth n^1.5 + m^1.5."""
    now, added = (float(n) ** RATE for n in (samples, more))
    return now / (now + added)
