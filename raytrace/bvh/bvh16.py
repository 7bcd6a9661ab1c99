"""A bounding volume hierarchy of sixteen boxes a node, all aligned or all oriented, tested sixteen at once."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..kernel.arrays import aligned
from ..kernel.simd import WIDE
from ..system.parallel import each
from ..types import Float32Grid, Float32Rows, Float32s, Int32Rows, Int32s, Int64Rows, Int64s
from .median_splits import median_order
from .oriented import orient

_GROWN = np.float32(1.0 + 2.0**-20)  # half sides, for their rounding


class BVH16(NamedTuple):
    """Leaves of sixteen triangles, nodes of sixteen boxes around leaves or nodes, up to one node, the last.

    Unused places hold NaN, which compares as false.

    Attributes:
        triangles: float32 (leaves, 9, 16), the corners' coordinates. leaf_faces: int32 (leaves, 16), their faces.
        boxes: float32 (nodes, 6, 16), centres and half sides of a node's children; levels follow each other upwards.
        starts: int64 (levels + 1,), the first node of each level, the lowest one's children being leaves.
        axes: float32 (nodes, 9, 16), three unit vectors, along which the boxes' sides are; None if all are aligned.
    """

    triangles: Float32Grid
    leaf_faces: Int32Rows
    boxes: Float32Grid
    starts: Int64s
    axes: Float32Grid | None

    @classmethod
    def of(cls, vertices: Float32s, faces: Int64s) -> BVH16:
        """The tree over `faces` (m, 3) of `vertices` (n, 3)."""
        order = median_order(vertices, faces)
        leaves = max(-(-len(faces) // WIDE), 1)
        triangles = aligned((leaves, 9, WIDE), np.float32)
        bounds = np.empty((leaves, 6), np.float32)
        _fill_leaves(vertices, faces, order, triangles, bounds)
        levels = []
        starts = [0]
        while True:
            level, bounds = _level_around(bounds)
            levels.append(level)
            starts.append(starts[-1] + len(level))
            if len(level) == 1:
                break
        boxes = aligned((starts[-1], 6, WIDE), np.float32)
        np.concatenate(levels, out=boxes)
        leaf_faces = np.full((leaves, WIDE), -1, np.int32)
        leaf_faces.ravel()[: len(order)] = order
        return cls(triangles, leaf_faces, *orient(triangles, boxes, np.array(starts)))


@each("triangles", 1 << 7)
def _fill_leaves(
    leaf: int,
    vertices: Float32Rows,
    faces: Int64Rows,
    order: Int32s,
    triangles: Float32Grid,
    bounds: Float32Rows,
) -> None:
    """Write triangles into leaves, and the low and high corners of the boxes around these into `bounds` (leaves, 6)."""
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


def _level_around(bounds: Float32s) -> tuple[Float32s, Float32s]:
    """A level of the tree: nodes (n, 6, 16) that hold the boxes `bounds` (c, 6), and the boxes (n, 6) around the
    nodes."""
    corners = np.full((-(-len(bounds) // WIDE) * WIDE, 6), np.nan, np.float32)
    corners[: len(bounds)] = bounds
    low, high = corners.reshape(-1, WIDE, 2, 3).transpose(2, 0, 3, 1)
    with np.errstate(invalid="ignore"):  # the box around nothing
        centre = np.float32(0.5) * (low + high)
        half = np.maximum(high - centre, centre - low) * _GROWN
    parents = np.fmin.reduce(low, axis=2), np.fmax.reduce(high, axis=2)
    return np.concatenate([centre, half], axis=1), np.concatenate(parents, axis=1)
