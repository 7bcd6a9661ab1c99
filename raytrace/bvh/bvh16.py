"""A bounding volume hierarchy of sixteen boxes a node, all aligned or all oriented, tested sixteen at once."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..kernel.arrays import aligned
from ..kernel.jit import kernel
from ..kernel.simd import WIDE
from ..system.threads import run_blocks, thread_count
from ..types import Float32s, Int64s
from .median_splits import median_order
from .oriented import orient

_BLOCK, _MOST = 1 << 7, 16  # leaves, and blocks at once
_GROWN = np.float32(1.0 + 2.0**-20)  # half sides, for their rounding


class BVH16(NamedTuple):
    """Leaves of sixteen triangles, nodes of sixteen boxes around leaves or nodes, up to one node, the last.

    Unused places hold NaN, which compares as false.

    Attributes:
        triangles: float32 (leaves, 9, 16), the corners' coordinates. rows: int64 (leaves, 16), which faces they are.
        boxes: float32 (nodes, 6, 16), centres and half sides of a node's children; levels follow each other upwards.
        starts: int64 (levels + 1,), the first node of each level, the lowest one's children being leaves.
        axes: float32 (nodes, 9, 16), three unit vectors, along which the sides of these boxes are; None if all boxes
            are aligned.
    """

    triangles: Float32s
    rows: Int64s
    boxes: Float32s
    starts: Int64s
    axes: Float32s | None

    @classmethod
    def of(cls, vertices: Float32s, faces: Int64s) -> BVH16:
        """The tree over `faces` (m, 3) of `vertices` (n, 3)."""
        order = median_order(vertices, faces)
        leaves = max(-(-len(faces) // WIDE), 1)
        triangles, bounds = aligned((leaves, 9, WIDE), np.float32), np.empty((leaves, 6), np.float32)

        def fill_leaves(first: int, last: int) -> None:
            _fill_leaves(vertices, faces, order[first * WIDE : last * WIDE], triangles[first:last], bounds[first:last])

        run_blocks(leaves, _BLOCK, fill_leaves, thread_count(None), most=_MOST)
        levels, starts = [], [0]
        while True:
            nodes = -(-len(bounds) // WIDE)
            level, parents = np.empty((nodes, 6, WIDE), np.float32), np.empty((nodes, 6), np.float32)
            _build_level(bounds, level, parents)
            levels.append(level)
            starts.append(starts[-1] + nodes)
            if nodes == 1:
                break
            bounds = parents
        boxes = aligned((starts[-1], 6, WIDE), np.float32)
        np.concatenate(levels, out=boxes)
        rows = np.full((leaves, WIDE), -1)
        rows.ravel()[: len(order)] = order
        return cls(triangles, rows, *orient(triangles, boxes, np.array(starts)))


@kernel
def _fill_leaves(vertices, faces, order, triangles, bounds):
    """Write triangles into leaves, and the low and high corners of the boxes around these into `bounds` (leaves, 6)."""
    for leaf in range(len(triangles)):
        triangles[leaf] = np.nan
        bounds[leaf, :3], bounds[leaf, 3:] = np.inf, -np.inf
        for lane in range(min(WIDE, len(order) - leaf * WIDE)):
            corners = faces[order[leaf * WIDE + lane]]
            for corner in range(3):
                for axis in range(3):
                    x = vertices[corners[corner], axis]
                    triangles[leaf, 3 * corner + axis, lane] = x
                    bounds[leaf, axis] = min(bounds[leaf, axis], x)
                    bounds[leaf, 3 + axis] = max(bounds[leaf, 3 + axis], x)


@kernel
def _build_level(bounds, level, parents):
    """Write the boxes `bounds` (c, 6) into nodes of sixteen, and the boxes around these into `parents`."""
    for node in range(len(level)):
        parents[node, :3], parents[node, 3:] = np.inf, -np.inf
        for lane in range(WIDE):
            k = node * WIDE + lane
            for axis in range(3):
                if k >= len(bounds):
                    level[node, axis, lane] = level[node, 3 + axis, lane] = np.nan
                    continue
                low, high = bounds[k, axis], bounds[k, 3 + axis]
                centre = np.float32(0.5) * (low + high)
                level[node, axis, lane] = centre
                level[node, 3 + axis, lane] = max(high - centre, centre - low) * _GROWN
                parents[node, axis] = min(parents[node, axis], low)
                parents[node, 3 + axis] = max(parents[node, 3 + axis], high)
