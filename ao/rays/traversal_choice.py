"""The choice of a traversal: all rays of a point at once, or packets through Embree.

Few rays a point take less time in packets, many in `ao.rays.traverse`. The ratio grows as a power of their number, a
lower one where surfaces lie along the axes, as walls do, whose boxes are tight and whose cones are loose, and where
more points are in reach (measured: docs/benchmarks.md).
"""

import math

import numpy as np

from raytrace.kernel.simd import WIDE
from raytrace.system.processor import lanes
from raytrace.types import Float32s, Int64s

from ..mu import KernelMu, fades
from ..options import MAX_SAMPLES, Traversal

_TRIED = 256  # points
_ALONG = 0.999  # cosine between a normal and an axis
_ONE_RAY = 0.55  # time of packets over that of `ao.rays.traverse`, for one ray a point
_WIDE = (0.25, 0.09, 0.018), (0.33, 0.16, 0.024)  # the power, less for points along the axes, less for each factor of e
_NARROW = (0.25, 0.08, 0.025), (0.31, 0.14, 0.031)  # more points in a length of rays; any-hit and closest-hit


def packets_below(
    traversal: Traversal, layered: bool, normals: Float32s, reach: float, count: int, mu: KernelMu
) -> int:
    """The number of rays a point below which Embree traces them.

    Args:
        layered: whether rays pass faces with alpha; packets begin anew behind each.
        normals: (k, 3), at points that are `tried`. reach: length of rays over the mesh's diagonal.
        count: points of the whole mesh, so that a bake of a part of it is that part of the whole.
    """
    if traversal == "embree":
        return MAX_SAMPLES + 1
    if layered or not count:
        return 0
    own, along, within = (_WIDE if lanes()[0] == WIDE else _NARROW)[fades(mu)]
    aligned = float(np.mean(np.abs(normals).max(axis=1) > _ALONG))
    power = own - along * aligned - within * math.log(max(reach * math.sqrt(count), 1.0))
    most = -math.log(_ONE_RAY) / math.log(MAX_SAMPLES)
    return MAX_SAMPLES + 1 if power < most else math.ceil(_ONE_RAY ** (-1 / power))


def tried(count: int) -> Int64s:
    return np.arange(min(count, _TRIED)) * count // max(min(count, _TRIED), 1)
