"""Probes: points spread over the mesh at which the error of a bake to a tolerance is measured.

Probes are baked twice with independent directions, as a and b. Where w is made of other rays, (w − a)(w − b) is an
unbiased measure of its squared error; once the probe is baked, a is part of w and (w − b)² − (a − b)²/2 is.
"""

import numpy as np

from raytrace.sampling.sequences import mix_array
from raytrace.types import Bools, Float64s, Int64s

from ..execute.tracer import Tracer
from ..points.points import Points
from ..rays.gather import W
from .one_ring import Neighbours
from .ray_budget import Pilots, plan, sampling_variance

# pilots besides their neighbours, their rays; one point in how many is probed, at least and at most
_SMALL = 48, 32, 8, 128, 768  # below _ALL points
_LARGE = 160, 64, 32, 512, 1536
_ALL = 16384  # points, of which fewer are all baked


class Probes:
    """The points at which the error is measured.

    Attributes:
        rows: int64 (j,), the points. samples: rays of each. raw: float64 (j, COLUMNS), one estimate of each, its own if
        it is baked; other: (j,), an independent one. variance: mean square error of either. all_baked: whether the mesh
        is so small that all points are baked.
    """

    def __init__(
        self, tracer: Tracer, points: Points, neighbours: Neighbours, aim: float, max_samples: int, key: np.uint32
    ) -> None:
        self.all_baked = len(points) < _ALL
        pilots, rays, share, fewest, probes = _SMALL if self.all_baked else _LARGE
        centres = _stratified_rows(len(points), min(pilots, max(len(points) // (4 * share), 16)))
        sample = Pilots(centres, min(rays, max_samples), (derive(key, 1), derive(key, 2)))
        planned = tracer.planned or max(
            tracer.each_column(lambda: plan(tracer, points, neighbours, sample, aim, max_samples))
        )
        self.samples = tracer.planned = planned
        self.rows = _stratified_rows(len(points), int(np.clip(len(points) // share, fewest, probes)))
        probed = points[self.rows]
        self.other = tracer.gather(probed, self.samples, derive(key, 4))[:, W]
        self.raw = tracer.gather(probed, self.samples, key)
        self.variance = sampling_variance(self.raw[:, W], self.other, self.samples)

    def squared(self, w: Float64s, baked: Bools) -> Float64s:
        """Unbiased squared error (j,) of `w` (j,) at the probes.

        Args: baked: (j,), probes whose own estimate is part of `w`.
        """
        own = (w - self.other) ** 2 - (self.raw[:, W] - self.other) ** 2 / 2
        return np.where(baked, own, (w - self.raw[:, W]) * (w - self.other))


def derive(key: np.uint32, salt: int) -> np.uint32:
    """A key of directions that are independent of the directions of `key`."""
    return mix_array(mix_array([salt]) ^ key)[0]


def _stratified_rows(count: int, wanted: int) -> Int64s:
    """`wanted` of `count` rows, one from each equal stretch of Morton order, all if there are no more."""
    wanted = min(count, wanted)
    chance = np.ldexp(mix_array(np.arange(wanted, dtype=np.uint32)).astype(np.float64), -32)
    return ((np.arange(wanted) + chance) * (count / max(wanted, 1))).astype(np.int64)
