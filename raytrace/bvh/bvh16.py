"""A bounding volume hierarchy of sixteen boxes a node, all aligned or all oriented, tested sixteen at once.

A node takes its children from the halves of halves of its triangles, each cut across the longest side of the box around
their centroids, as in a k-d tree (Bentley 1975, Multidimensional Binary Search Trees Used for Associative Searching).
So every 16, every 16², … triangles lie close together. All nodes but the last of a level are full, so that a tree needs
no links.
"""

from __future__ import annotations

from threading import Event
from typing import NamedTuple

import numpy as np

from ..kernel.arrays import aligned, give_memory_back
from ..kernel.jit import inline, kernel
from ..kernel.simd import WIDE, load_row, pick
from ..kernel.vector import load_triangle
from ..system.parallel import each
from ..system.threads import run_blocks, thread_count
from ..types import Float32Grid, Float32Rows, Float32s, Int32Rows, Int32s, Int64s
from .oriented import orient

_GROWN = np.float32(1.0 + 2.0**-20)  # half sides, for their rounding
_LEAST, _PARTS = 1 << 12, 16  # triangles of a part that one thread orders, and how many parts there are at least
_STACK = 1 << 7
_LARGE = 1 << 24  # bytes of triangles that are worth letting go
_ROW = WIDE // 4  # triangles whose records are a row of lanes


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
    def of(cls, vertices: Float32s, faces: Int32s) -> BVH16:
        """The tree over `faces` (m, 3) of `vertices` (n, 3)."""
        order = median_order(vertices, faces)
        leaves = max(-(-len(faces) // WIDE), 1)
        leaf_faces = np.full((leaves, WIDE), -1, np.int32)
        leaf_faces.ravel()[: len(order)] = order
        del order
        triangles = aligned((leaves, 9, WIDE), np.float32)
        bounds = np.empty((leaves, 6), np.float32)
        _fill_leaves(vertices, faces, leaf_faces, triangles, bounds)
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
        return cls(triangles, leaf_faces, *orient(triangles, boxes, np.array(starts)))


class Hierarchy:
    """A tree whose triangles, most of its memory, can be let go and are written again when it is next asked for.

    Whoever has the tree meanwhile keeps it whole.
    """

    def __init__(self, tree: BVH16, vertices: Float32s, faces: Int32s) -> None:
        """Args: tree: over `faces` (m, 3) of `vertices` (n, 3)."""
        self._tree = tree
        self._surface = vertices, faces

    @property
    def tree(self) -> BVH16:
        """The whole tree."""
        tree = self._tree
        if not len(tree.triangles):
            give_memory_back()
            triangles = aligned((len(tree.leaf_faces), 9, WIDE), np.float32, zeroed=False)
            _fill_leaves(*self._surface, tree.leaf_faces, triangles, None)
            tree = self._tree = tree._replace(triangles=triangles)
        return tree

    def release(self) -> None:
        """Let go of the triangles, if they are many."""
        if self._tree.triangles.nbytes > _LARGE:
            self._tree = self._tree._replace(triangles=np.empty((0, 9, WIDE), np.float32))
            give_memory_back()


@each("triangles", 1 << 7)
def _fill_leaves(
    leaf: int,
    vertices: Float32Rows,
    faces: Int32Rows,
    leaf_faces: Int32Rows,
    triangles: Float32Grid,
    bounds: Float32Rows | None,
) -> None:
    """Write triangles into leaves, and the low and high corners of the boxes around these into `bounds` (leaves, 6)."""
    triangles[leaf] = np.nan
    if bounds is not None:
        bounds[leaf, :3], bounds[leaf, 3:] = np.inf, -np.inf
    for lane in range(WIDE):
        f = leaf_faces[leaf, lane]
        if f < 0:
            continue
        for corner in range(3):
            for axis in range(3):
                x = vertices[faces[f, corner], axis]
                triangles[leaf, 3 * corner + axis, lane] = x
                if bounds is not None:
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


def median_order(vertices: Float32s, faces: Int32s) -> Int32s:
    """The order (m,) of `faces` (m, 3) of `vertices` (n, 3): each part is split at the median along its longest
    axis."""
    # A record is a centroid and the number of its face, moved together; unused ones of the last row compare as false.
    records = aligned((-(-len(faces) // _ROW) * _ROW, 4), np.float32)
    records[len(faces) :] = np.nan
    numbers = records.view(np.int32)
    _find_centroids(vertices, faces, records, numbers)

    parts = [(0, len(faces), -1)]
    most = max(_LEAST, len(faces) // _PARTS)
    for number, (begin, end, _) in enumerate(parts):
        if end - begin > most:
            half = _middle(begin, end)
            parts += [(begin, half, number), (half, end, number)]
    ordered = [Event() for _ in parts]

    def divide(number: int, _: int) -> None:
        """Sort part `number` about its middle, as soon as the block that it lies in is sorted."""
        begin, end, enclosing = parts[number]
        try:
            if enclosing >= 0:  # a block that has begun before this one
                ordered[enclosing].wait()
            (_halve if end - begin > most else _split)(records, numbers, begin, end)
        finally:
            ordered[number].set()

    run_blocks(len(parts), 1, divide, thread_count(None))
    return numbers[: len(faces), 3].copy()


def _middle(start: int, stop: int) -> int:
    """Where the second half of a part begins: after full children."""
    child = WIDE
    while child * WIDE < stop - start:
        child *= WIDE
    return start + (stop - start + child - 1) // child // 2 * child


_middle_of = inline(_middle)


@each("faces")
def _find_centroids(f: int, vertices: Float32Rows, faces: Int32Rows, records: Float32Rows, numbers: Int32Rows) -> None:
    """Write three times the centroid of each face, and its number."""
    a, b, c = load_triangle(vertices, faces, f)
    for axis in range(3):
        records[f, axis] = a[axis] + b[axis] + c[axis]
    numbers[f, 3] = f


@kernel
def _halve(records: Float32Rows, numbers: Int32Rows, start: int, stop: int) -> int:
    """Reorder records[start:stop] so that all before the index that is returned lie below all after it."""
    middle: int = _middle_of(start, stop)
    _partition(records, numbers, start, stop, middle, _longest_axis(records, start, stop))
    return middle


@kernel
def _split(records: Float32Rows, numbers: Int32Rows, start: int, stop: int) -> None:
    """Reorder records[start:stop] by halves of halves until parts have at most sixteen triangles."""
    firsts = np.empty(_STACK, np.int64)
    lasts = np.empty(_STACK, np.int64)
    firsts[0], lasts[0] = start, stop
    waiting = 1
    while waiting > 0:
        waiting -= 1
        start = firsts[waiting]
        stop = lasts[waiting]
        if stop - start <= WIDE:
            continue
        middle = _halve(records, numbers, start, stop)
        firsts[waiting], lasts[waiting] = middle, stop
        firsts[waiting + 1], lasts[waiting + 1] = start, middle
        waiting += 2


@inline
def _longest_axis(records, start, stop):
    """The axis along which the centroids of a part extend farthest."""
    low = high = load_row(records, start // _ROW)
    for row in range(start // _ROW + 1, -(-stop // _ROW)):
        here = load_row(records, row)
        low = min(here, low)
        high = max(here, high)
    longest, most = 0, np.float32(-1.0)
    for axis in range(3):
        least = min(min(pick(low, axis), pick(low, axis + 4)), min(pick(low, axis + 8), pick(low, axis + 12)))
        last = max(max(pick(high, axis), pick(high, axis + 4)), max(pick(high, axis + 8), pick(high, axis + 12)))
        if last - least > most:
            longest, most = axis, last - least
    return longest


@inline
def _partition(records, numbers, start, stop, middle, axis):
    """Reorder a part so that none before `middle` lies behind any after it (quickselect, Hoare 1961)."""
    low, high = start, stop - 1
    while low < high:
        a = records[low, axis]
        b = records[high, axis]
        c = records[(low + high) // 2, axis]
        pivot = max(min(a, b), min(max(a, b), c))
        i, j = low, high
        while i <= j:
            while records[i, axis] < pivot:
                i += 1
            while records[j, axis] > pivot:
                j -= 1
            if i <= j:
                for column in range(4):  # as whole numbers: as float32, some would be no numbers
                    numbers[i, column], numbers[j, column] = numbers[j, column], numbers[i, column]
                i += 1
                j -= 1
        if middle <= j:
            high = j
        elif middle >= i:
            low = i
        else:
            break
