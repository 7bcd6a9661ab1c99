"""Oriented bounding boxes, where slivers or pages lie so close that most of their aligned boxes overlap.

Their axes are the principal axes of the corners inside (Gottschalk, Lin & Manocha 1996, OBBTree). They decide what is
tested, and never what is hit.
"""

from functools import partial
from itertools import pairwise

import numpy as np

from ..kernel.arrays import aligned
from ..kernel.jit import inline, kernel
from ..kernel.simd import WIDE, count, load_row
from ..kernel.vector import dot, subtract
from ..system.threads import run_blocks, thread_count
from ..types import Float32Grid, Float32Rows, Float32s, Float64Grid, Int64s

_OVERLAPPING = 8.0  # boxes of leaves around the middle of a triangle, from which on others are tried
_GAIN = 2.0  # how many times fewer oriented boxes must be around it
_TRIANGLES = 32  # that are compared with all leaves
_LEAVES = 1 << 9  # of a block
_GROWN = 2.0**-20  # of half sides, for their rounding and the rounding of what is compared with them


def orient(triangles: Float32s, boxes: Float32s, starts: Int64s) -> tuple[Float32s, Int64s, Float32s | None]:
    """`boxes`, `starts` and `axes` of a `BVH16`: aligned boxes as they are, or oriented ones if these overlap less."""
    overlap = _overlap(triangles, boxes[: starts[1]], None)
    if overlap < _OVERLAPPING:
        return boxes, starts, None
    oriented = aligned(boxes.shape, np.float32)
    axes = aligned((len(boxes), 9, WIDE), np.float32)
    span = 1
    oriented[:], threads = boxes, thread_count(None)
    for start, stop in pairwise(starts):
        children = -(-len(triangles) // span)
        span = span * WIDE
        run_blocks(
            children,
            max(_LEAVES * WIDE // span, 1),
            partial(_turn, triangles, span // WIDE, axes[start:stop], oriented[start:stop]),
            threads,
        )
    fewer = _overlap(triangles, oriented[: starts[1]], axes[: starts[1]]) * _GAIN < overlap
    return (oriented, starts, axes) if fewer else (boxes, starts, None)


def _turn(triangles: Float32s, span: int, axes: Float32s, boxes: Float32s, start: int, stop: int) -> None:
    """Write axes and boxes of the children from `start` to `stop` of a level, each around `span` leaves."""
    covariances = np.zeros((stop - start, 3, 3))
    _covariances(triangles, span, start, covariances)
    node, lane = np.divmod(np.arange(start, stop), WIDE)
    axes[node, :, lane] = np.linalg.eigh(covariances)[1].transpose(0, 2, 1).reshape(-1, 9)
    _enclose(triangles, span, axes, boxes, start, stop)


def _overlap(triangles: Float32s, boxes: Float32s, axes: Float32s | None) -> float:
    """How many boxes of leaves hold the middle of a triangle, on average over a sample of triangles."""
    centroids = triangles[:: -(-len(triangles) // _TRIANGLES), :, 0].reshape(-1, 3, 3).mean(axis=1)
    return float(_count_around(centroids, boxes, axes)) / len(centroids)


@kernel
def _count_around(points: Float32Rows, boxes: Float32Grid, axes: Float32Grid | None) -> int:
    """How many of the boxes are around each of the `points`, added up."""
    total = 0
    for node in range(len(boxes)):
        for i in range(len(points)):
            d, half = box_offsets(boxes, axes, node, (points[i, 0], points[i, 1], points[i, 2]))
            total += count((abs(d[0]) <= half[0]) & (abs(d[1]) <= half[1]) & (abs(d[2]) <= half[2]))
    return total


@kernel
def _covariances(triangles: Float32Grid, span: int, first_child: int, out: Float64Grid) -> None:
    """Write the covariances, up to a factor, of the corners in `span` leaves of each child, from `first_child` on."""
    for row in range(len(out)):
        k = first_child + row
        corners = 0
        total = np.zeros(3)
        offset = np.zeros(3)
        for leaf in range(k * span, min((k + 1) * span, len(triangles))):
            for slot in range(3 * WIDE):
                corner = slot // WIDE
                lane = slot % WIDE
                if np.isnan(triangles[leaf, 0, lane]):
                    continue
                corners += 1
                for axis in range(3):
                    offset[axis] = np.float64(triangles[leaf, 3 * corner + axis, lane]) - triangles[k * span, axis, 0]
                    total[axis] += offset[axis]
                for axis in range(3):
                    for other in range(3):
                        out[row, axis, other] += offset[axis] * offset[other]
        for axis in range(3):
            for other in range(3):
                out[row, axis, other] -= total[axis] * total[other] / corners


@kernel
def _enclose(triangles: Float32Grid, span: int, axes: Float32Grid, boxes: Float32Grid, start: int, stop: int) -> None:
    """Write boxes (nodes, 6, 16) along `axes` (nodes, 9, 16), of children, each around `span` leaves."""
    for k in range(start, stop):
        node = k // WIDE
        lane = k % WIDE
        low = np.full(3, np.inf)
        high = np.full(3, -np.inf)
        centre = np.zeros(3)
        along = np.zeros(3)
        # The bounds of all corners along the axes.
        for leaf in range(k * span, min((k + 1) * span, len(triangles))):
            for slot in range(3 * WIDE):
                corner = 3 * (slot // WIDE)
                at = slot % WIDE
                if np.isnan(triangles[leaf, 0, at]):
                    continue
                for axis in range(3):
                    x = 0.0
                    for j in range(3):
                        x += np.float64(axes[node, 3 * axis + j, lane]) * triangles[leaf, corner + j, at]
                    low[axis] = min(x, low[axis])
                    high[axis] = max(x, high[axis])
        # The centre, rounded as it is stored, and where that lies along the axes.
        for axis in range(3):
            for j in range(3):
                centre[j] += 0.5 * (low[axis] + high[axis]) * axes[node, 3 * axis + j, lane]
        for j in range(3):
            boxes[node, j, lane] = centre[j]
            for axis in range(3):
                along[axis] += np.float64(axes[node, 3 * axis + j, lane]) * boxes[node, j, lane]
        # Half extents about it, larger by the rounding of a ray in the frame.
        half = 0.0
        for axis in range(3):
            half += max(high[axis] - along[axis], along[axis] - low[axis])
        for axis in range(3):
            away = max(high[axis] - along[axis], along[axis] - low[axis])
            boxes[node, 3 + axis, lane] = (away + _GROWN * half) * (1.0 + _GROWN)


@inline
def box_offsets(boxes, axes, node, point):
    """Centres of a node's sixteen boxes relative to a point, along their axes, and half their sides: triples."""
    box = boxes[node]
    d = subtract((load_row(box, 0), load_row(box, 1), load_row(box, 2)), point)
    return along_axes(axes, node, d), (load_row(box, 3), load_row(box, 4), load_row(box, 5))


@inline
def along_axes(axes, node, v):
    """A vector, or sixteen, along the axes of a node's boxes; as it is where they are aligned."""
    if axes is None:
        return v
    frame = axes[node]
    return (
        dot((load_row(frame, 0), load_row(frame, 1), load_row(frame, 2)), v),
        dot((load_row(frame, 3), load_row(frame, 4), load_row(frame, 5)), v),
        dot((load_row(frame, 6), load_row(frame, 7), load_row(frame, 8)), v),
    )
