"""Estimates of sites that grow: rays added in rounds, each round weighted by what its rays are worth."""

from typing import Self

import numpy as np

from obscurance.raytrace.system.parallel import each
from obscurance.raytrace.types import AnyFloats, Float32Rows, Float64Rows, Float64s, Int64s

from ..execute.tracer import Tracer
from ..points.points import Points
from ..rays.gather import BATCH_VARIANCE, COLUMNS
from .sampling_error import RATE

_SHARERS = 4  # of many points, so many share a lattice at first, so that denoising averages what is even
_ENOUGH = 32  # rays from which each point has a lattice of its own, which is more even than a share of a larger one


class Copies:
    """What is gathered at j sites by rays of their own: how many rays each has, and what they are worth.

    Attributes:
        points: of the sites. elsewhere: whether their places are drawn from all of each site.
        rays: (j,). worth: (j,), n^RATE of n rays in one lattice.
        gathered: (j, COLUMNS) by each falloff, float32, or float64 of one round.
    """

    def __init__(self, tracer: Tracer, points: Points, elsewhere: bool = False) -> None:
        self.tracer = tracer
        self.points = points
        self.elsewhere = elsewhere
        self.rays = np.zeros(len(points), np.int64)
        self.worth = np.zeros(len(points))
        self.gathered: list[AnyFloats] = [np.zeros((len(points), COLUMNS), np.float32) for _ in range(tracer.columns)]

    @classmethod
    def of_one_round(cls, tracer: Tracer, points: Points, rays: int, key: np.uint32) -> Self:
        """As many `rays` at every site, once."""
        copies = cls(tracer, points)
        rows = tracer.gather(points, rays, key)
        copies.gathered = [np.ascontiguousarray(rows[:, column]) for column in range(tracer.columns)]
        copies.rays += rays
        copies.worth += float(rays) ** RATE
        return copies

    def add(self, more: Int64s, key: np.uint32, shared: bool = False) -> None:
        """Trace `more` rays (j,) at the sites.

        Args: shared: neighbours share lattices; most of them are to get as many rays.
        """
        tracer = self.tracer
        if not self.elsewhere:  # probes' rays are few
            tracer.expected = tracer.rays + int(more.sum())
        for count in (np.flatnonzero(np.bincount(more)[1:]) + 1).tolist():
            which = np.flatnonzero(more == count)
            leap = _SHARERS if shared and count < _ENOUGH else 1
            subset = self.points if len(which) == len(self.points) else self.points[which]
            rows = tracer.gather(subset, count, key, leap, self.elsewhere)
            for column, gathered in enumerate(self.gathered):
                new = np.ascontiguousarray(rows[:, column], np.float64)
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
