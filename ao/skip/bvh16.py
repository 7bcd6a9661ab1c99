"""A bounding volume hierarchy of sixteen axis-aligned bounding boxes (AABB) a node, tested sixteen at once."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from raytrace.kernel.arrays import aligned
from raytrace.kernel.counting_sort import counting_sort
from raytrace.kernel.jit import inline, kernel
from raytrace.kernel.simd import WIDE
from raytrace.kernel.vector import cross, dot, load, subtract
from raytrace.mesh.placement import ULP
from raytrace.system.threads import run_blocks, thread_count
from raytrace.types import Float32s, Int64s

_BLOCK = 1 << 10  # leaves
_GROWN = np.float32(1.0 + 2.0**-20)  # half sides, for their rounding


class BVH16(NamedTuple):
    """Leaves of sixteen triangles, nodes of sixteen boxes around leaves or nodes, up to one node, the last.

    Unused places hold NaN, which compares as false.

    Attributes:
        triangles: float32 (leaves, 10, 16), the corners' coordinates, and the distance by which Embree may misplace a
            flat triangle. Boxes are larger by twice that.
        boxes: float32 (nodes, 6, 16), centres and half sides of a node's children; levels follow each other upwards.
        starts: int64 (levels + 1,), the first node of each level, the lowest one's children being leaves.
    """

    triangles: Float32s
    boxes: Float32s
    starts: Int64s

    @classmethod
    def of(cls, vertices: Float32s, faces: Int64s, of_vertex: Int64s) -> BVH16:
        """The tree over `faces` (m, 3) of `vertices` (n, 3).

        Args: of_vertex: (n,), each vertex's place in Morton order, −1 for none. Faces are taken in the order of their
            first corners.
        """
        first = np.empty(len(faces), np.int64)
        _first_places(faces, of_vertex, first)
        order, _ = counting_sort(first, len(of_vertex) + 1)
        leaves = max(-(-len(faces) // WIDE), 1)
        triangles, bounds = aligned((leaves, 10, WIDE), np.float32), np.empty((leaves, 6), np.float32)

        def fill_leaves(first: int, last: int) -> None:
            _fill_leaves(vertices, faces, order[first * WIDE : last * WIDE], triangles[first:last], bounds[first:last])

        run_blocks(leaves, _BLOCK, fill_leaves, thread_count(None))
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
        return cls(triangles, boxes, np.array(starts))


@kernel
def _first_places(faces, of_vertex, out):
    """Write the least place in Morton order of each face's corners, the number of vertices for a face without any."""
    for f in range(len(faces)):
        out[f] = len(of_vertex)
        for corner in range(3):
            place = of_vertex[faces[f, corner]]
            if 0 <= place < out[f]:
                out[f] = place


@kernel
def _fill_leaves(vertices, faces, order, triangles, bounds):
    """Write triangles into leaves, and the low and high corners of the boxes around these into `bounds` (leaves, 6)."""
    for leaf in range(len(triangles)):
        triangles[leaf] = np.nan
        bounds[leaf, :3], bounds[leaf, 3:] = np.inf, -np.inf
        for lane in range(min(WIDE, len(order) - leaf * WIDE)):
            corners = faces[order[leaf * WIDE + lane]]
            off = np.float32(
                _deviation(load(vertices, corners[0]), load(vertices, corners[1]), load(vertices, corners[2]))
            )
            triangles[leaf, 9, lane] = off
            for corner in range(3):
                for axis in range(3):
                    x = vertices[corners[corner], axis]
                    triangles[leaf, 3 * corner + axis, lane] = x
                    bounds[leaf, axis] = min(bounds[leaf, axis], x - 2 * off)
                    bounds[leaf, 3 + axis] = max(bounds[leaf, 3 + axis], x + 2 * off)


@inline
def _deviation(a, b, c):
    """A rounding of the longest edge over the sine of the smallest angle."""
    ab, bc, ca = subtract(b, a), subtract(c, b), subtract(a, c)
    normal = cross(ab, bc)
    x, y, z = dot(ab, ab), dot(bc, bc), dot(ca, ca)
    longest, shortest = max(max(x, y), z), min(min(x, y), z)
    others = np.sqrt(x * y * z / max(shortest, 1e-300))  # the product of the two longer ones
    return ULP * np.sqrt(longest) * others / max(np.sqrt(dot(normal, normal)), 1e-150)


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
