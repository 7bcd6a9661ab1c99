"""The choice of a traversal: all rays of a point at once, or packets through Embree.

Where most rays meet something, in halls and piles, few go far: Embree's packets are faster there for few rays, and on
processors without vectors of sixteen numbers for some more and in the open, too (docs/benchmarks.md).
"""

import numpy as np

from raytrace.bvh.bvh16 import BVH16
from raytrace.kernel.simd import WIDE
from raytrace.system.processor import lanes
from raytrace.types import Float64s, Int64s

from ..mu import KernelMu, fades
from ..options import MAX_SAMPLES, Traversal
from ..points.points import Points
from .directions import DirectionTable
from .estimator import COLUMNS, W
from .gather_streams import gather_streams
from .ray_blocks import Rays
from .ray_scene import RayScene
from .traverse import TraversalState

_POINTS, _RAYS, _KEY = 64, 16, np.uint32(0x7A1)  # that are tried
_CLOSED = 0.5  # part of the rays that meet something from which on most points are closed in
_WIDE = {True: (80, 40), False: (0, 0)}  # rays a point, any-hit and closest-hit, fewer of which are faster in packets,
_NARROW = {True: (144, 96), False: (56, 24)}  # by whether most points are closed in


def packets_below(traversal: Traversal, scene: RayScene, points: Points, mu: KernelMu, t_max: float) -> int:
    """The number of rays a point below which Embree traces them.

    Args: points: all of a mesh, some of which are tried, so that a bake of a part of them is that part of the whole.
    """
    if traversal == "embree":
        return MAX_SAMPLES + 1
    if scene.opacity is not None:  # packets begin anew behind each layer
        return 0
    subset = points[tried(len(points))]
    return fewer_than(try_out(scene.tree, subset, len(subset), mu.limit, t_max), mu)


def most_packets(mu: KernelMu) -> int:
    """The largest number that `packets_below` has for it."""
    return _table()[True][fades(mu)]


def _table() -> dict[bool, tuple[int, int]]:
    return _WIDE if lanes()[0] == WIDE else _NARROW


def tried(count: int) -> Int64s:
    return np.arange(min(count, _POINTS)) * count // max(min(count, _POINTS), 1)


def try_out(tree: BVH16, points: Points, count: int, limit: float, t_max: float) -> Float64s:
    """Openness of `points` (k,), of `count` that are tried in all."""
    table, out = DirectionTable.make(_RAYS, count, _KEY), np.empty((len(points), COLUMNS))
    binary = KernelMu(0.0, limit, 1.0)
    gather_streams(tree, Rays.of(table), TraversalState.of(tree), points.arrays, table, binary, t_max, out)
    return out[:, W]


def fewer_than(openness: Float64s, mu: KernelMu) -> int:
    """`packets_below` from what `try_out` found at all points that are tried, in their order."""
    return _table()[bool(len(openness) and np.mean(openness) <= 1 - _CLOSED)][fades(mu)]
