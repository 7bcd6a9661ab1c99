"""Conservative horizon angles in 16 azimuth sectors; rays above them cannot hit and are counted as misses untraced.

Horizon mapping (Max 1988, Horizon Mapping: Shadows for Bump-Mapped Surfaces), here as a bound. The hierarchy is walked
from each point: nodes below the tangent plane, out of reach or below the horizon so far are skipped, small ones raise
the horizon as their bounding sphere, large ones are opened. A horizon never lies lower than what a ray could meet, so
that leaving out the rays above it changes no bit.
"""

from __future__ import annotations

import time
from functools import cached_property
from math import sqrt
from typing import NamedTuple

import numpy as np

from raytrace.kernel.arrays import aligned
from raytrace.kernel.borrow import borrow
from raytrace.kernel.jit import kernel
from raytrace.kernel.simd import WIDE, select
from raytrace.kernel.simd_masks import first, highest, lane_numbers, some
from raytrace.kernel.simd_memory import load_row, store_row
from raytrace.kernel.vector import dot, subtract
from raytrace.mesh.placement import Placement
from raytrace.types import Float32s

from ..falloff import Mu
from ..gather.directions import DirectionTable, choose, turned_frame
from ..gather.points import Points
from ..gather.receivers import Receivers
from .bvh16 import BVH16
from .horizon_kernels import (
    INFINITE,
    ROUNDED,
    SCRATCH,
    STEEP,
    load_sectors,
    raise_over_triangles,
    sector_rows,
    sphere_below,
    sphere_lanes,
    to_frame,
)

_TRIED, _TRIED_SHARE = 64, 16  # points at which horizons are tried first: at most, and one in how many
_WALK, _WALK_CLOSEST = 90, 32  # rays in the open that a walk costs as much as: shadow rays, closest hits
_FINEST, _COARSEST = 0.1, 0.5  # sines of half angles that look small
_STACK = 1 << 8
_LOWEST = np.float32(1e-5)  # a slope so low that a rounded direction might point downwards
_ANGLE = np.float32(2e-6)  # radians that a rounded direction may be off, and more
_SECTORS = sector_rows()

NO_HORIZONS = aligned((0, WIDE), np.float32)


class Horizons:
    """Horizons around the points of a mesh.

    Attributes:
        seconds: what each of its uses took.
    """

    def __init__(self, placement: Placement, receivers: Receivers, mu: Mu) -> None:
        self._placement, self._receivers = placement, receivers
        self._reach = min(mu.max_distance * placement.scale, placement.diagonal)
        self._walk_cost = _WALK if mu.tau is None else _WALK_CLOSEST
        self.seconds: list[float] = []

    @cached_property
    def _tree(self) -> BVH16:
        return BVH16.of(self._placement.vertices, self._receivers.faces, self._receivers.of_vertex)

    def pay(self, points: Points, table: DirectionTable) -> bool:
        """Whether finding horizons costs less than tracing the rays above them, tried at some of `points`.

        Where few rays are open they lie among walls, and cost less than in the open: by about the square of that share.
        """
        if table.samples < 2.5 * self._walk_cost or not len(points):
            return False
        start = time.perf_counter()
        slopes = self._walk(points[np.arange(0, len(points), max(len(points) // _TRIED, _TRIED_SHARE))], table)
        self.seconds.append(time.perf_counter() - start)
        share = float(np.mean(1 / (1 + np.minimum(slopes.astype(np.float64), 1e6) ** 2)))  # of rays above, by cosine
        return share**3 * table.samples > self._walk_cost

    def above(self, points: Points, table: DirectionTable) -> Float32s:
        """float32 (k, 16), the slopes above which rays from `points` meet nothing; from any thread, once it pays."""
        start = time.perf_counter()
        slopes = self._walk(points, table)
        self.seconds.append(time.perf_counter() - start)
        return slopes

    def _walk(self, points: Points, table: DirectionTable) -> Float32s:
        slopes = aligned((len(points), WIDE), np.float32)
        small = np.float32(np.clip(3.2 * table.samples ** (-1 / 3), _FINEST, _COARSEST))
        reach = np.float32(self._reach * (1 + 1e-5))
        workspace = _Workspace(_SECTORS, aligned((SCRATCH, WIDE), np.float32))
        _find_horizons(points.arrays, table, self._tree, reach, small, workspace, slopes)
        return slopes


class _Workspace(NamedTuple):
    """Attributes: sectors: `sector_rows`. scratch: float32 (SCRATCH, 16), aligned."""

    sectors: Float32s
    scratch: Float32s


@kernel
def _find_horizons(points, table, tree, reach, small, workspace, out):
    """Write the horizons of points into out, float32 (k, 16), in the frames that `gather_hemispheres` turns.

    Args:
        points: PointArrays. table: DirectionTable. tree: BVH16. workspace: _Workspace.
        reach: how far things count. small: sine of the half angle below which a sphere stands for what is in it.
    """
    origins, normals, numbers = borrow(points)
    triangles, boxes, starts = borrow(tree)
    sector_rows, scratch = borrow(workspace)
    out, key, sets = borrow(out), table.key, len(table.directions)
    sectors = load_sectors(sector_rows)
    middle, none = sectors[2], np.float32(0.0)
    levels = len(starts) - 1
    nodes, heights = np.empty(_STACK, np.int64), np.empty(_STACK, np.int64)
    for i in range(len(origins)):
        origin, n = (origins[i, 0], origins[i, 1], origins[i, 2]), (normals[i, 0], normals[i, 1], normals[i, 2])
        _, turn = choose(numbers[i], key, sets)
        t, b = turned_frame(n, turn)
        frame = t, b, n
        horizon = none * middle[0]
        nodes[0], heights[0] = starts[levels] - 1, levels
        waiting = 1
        while waiting > 0:
            waiting -= 1
            node, level = nodes[waiting], heights[waiting]
            if level == 0:
                horizon = raise_over_triangles(horizon, triangles[node], origin, frame, reach, small, sectors, scratch)
                if highest(horizon) > STEEP:
                    break
                continue
            box = boxes[node]
            d = subtract((load_row(box, 0), load_row(box, 1), load_row(box, 2)), origin)
            half = load_row(box, 3), load_row(box, 4), load_row(box, 5)
            x, y, z = to_frame(d, frame)
            gap = max(abs(d[0]) - half[0], none), max(abs(d[1]) - half[1], none), max(abs(d[2]) - half[2], none)
            radius, away = sqrt(dot(half, half)), sqrt(x * x + y * y)
            height = z + dot(half, (abs(n[0]), abs(n[1]), abs(n[2]))) + ROUNDED * (away + abs(z) + radius)
            above = (height > none) & (dot(gap, gap) <= reach * reach)
            if not some(above):
                continue
            x, y, slope, nearness, sine = sphere_lanes(x, y, away, height, radius)
            store_row(scratch, 0, x)
            store_row(scratch, 1, y)
            store_row(scratch, 2, slope)
            store_row(scratch, 3, nearness)
            store_row(scratch, 4, sine)
            child = (node - starts[level - 1]) * WIDE + (starts[level - 2] if level > 1 else 0)
            while some(above):
                k = first(above)
                above = above & (lane_numbers() != np.int32(k))
                if scratch[4, k] < 1.0:
                    seen, hidden = sphere_below(
                        horizon, middle, scratch[0, k], scratch[1, k], scratch[2, k], scratch[3, k]
                    )
                    if hidden:
                        continue
                    if scratch[4, k] < small:
                        horizon = max(horizon, select(seen, scratch[2, k], none))
                        continue
                nodes[waiting], heights[waiting] = child + k, level - 1
                waiting += 1
        if highest(horizon) > STEEP:
            horizon = horizon + INFINITE
        store_row(out, i, horizon + _LOWEST * (np.float32(1.0) + horizon) + _ANGLE * horizon * horizon)
