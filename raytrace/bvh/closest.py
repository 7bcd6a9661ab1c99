"""Faces near a point, by a walk of a `BVH16` that a kernel takes leaf by leaf, and the closest point of a surface.

around = begin(tree, stack, point, radius)
leaf, near = next_leaf(tree, stack, around)
while near != 0:
    while near != 0:
        face = tree.leaf_faces[leaf, lowest_bit(near)]
        near &= near - 1
        ...
    leaf, near = next_leaf(tree, stack, around)

Source: Ericson, Real-Time Collision Detection, 5.1.5.
"""

from collections.abc import Callable

import numpy as np

from ..kernel.jit import inline, kernel
from ..kernel.simd import WIDE, bits, load_row, lowest_bit
from ..kernel.vector import add, cross, dot, length, load, load_triangle, scale, subtract
from ..system.threads import run_blocks
from ..types import Float32Rows, Float32s, Float64Rows, Float64s, Int32Rows, Int32s, Int64Rows, Int64s
from .bvh16 import BVH16
from .oriented import box_offsets

_BLOCK = 1 << 6  # points, which an interrupt waits for: far from a large mesh each takes some ms
_ENTRIES = 1 << 8
_ROUNDED = 2.0**-20  # of a coordinate and of a distance: sixteen roundings of single precision
_PLANE = np.float32(2.0**-19)
_DIAGONAL = np.float32(1.733)  # of a cube of side 1, from oriented boxes to the axes of space
_NODE, _LEVEL = range(2)  # columns; the last row has how many wait


def closest_points(
    tree: BVH16,
    surface: tuple[Float64s, Int32s],
    points: Float64s,
    radius: float,
    match: tuple[Int64s, Int64s],
    threads: int,
    farther: Callable[[int], None] | None = None,
) -> tuple[Int64s, Float32s]:
    """The face (k,) of its group that is nearest to each of `points` (k, 3), and where on it, barycentric (k, 3); where
    none is within the radius, and it is not to look farther, −1 and 0.

    Args: tree: over `surface`: vertices (n, 3) and faces (m, 3). radius: how far to look, or at first, above 0.
        match: the groups of the points (k,) and of the faces (m,). farther: look as far as it takes, and be called
        with how many points are done at a time; each point's group has a face. None: within the radius alone.
    """
    face = np.full(len(points), -1)
    weights = np.zeros((len(points), 3), np.float32)

    def search(start: int, stop: int) -> None:
        _search(
            tree,
            new_stack(),
            surface,
            points[start:stop],
            radius,
            farther is not None,
            (match[0][start:stop], match[1]),
            (face[start:stop], weights[start:stop]),
        )

    run_blocks(len(points), _BLOCK, search, threads, farther)
    return face, weights


@inline
def closest_on_triangle(p, a, b, c):
    """Distance of a point from a triangle, and the weights of b and c where it is closest."""
    ab = subtract(b, a)
    ac = subtract(c, a)
    ap = subtract(p, a)
    d1 = dot(ab, ap)
    d2 = dot(ac, ap)
    bp = subtract(p, b)
    cp = subtract(p, c)
    d3 = dot(ab, bp)
    d4 = dot(ac, bp)
    d5 = dot(ab, cp)
    d6 = dot(ac, cp)
    va = d3 * d6 - d5 * d4
    vb = d5 * d2 - d1 * d6
    vc = d1 * d4 - d3 * d2
    # A corner is closest, a point of an edge, or one within.
    u = v = 0.0
    if d1 <= 0.0 and d2 <= 0.0:
        near = a
    elif d3 >= 0.0 and d4 <= d3:
        u, near = 1.0, b
    elif d6 >= 0.0 and d5 <= d6:
        v, near = 1.0, c
    elif vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        u = d1 / (d1 - d3)
        near = add(a, scale(u, ab))
    elif vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        v = d2 / (d2 - d6)
        near = add(a, scale(v, ac))
    elif va <= 0.0 and d4 >= d3 and d5 >= d6:
        v = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        u = 1.0 - v
        near = add(b, scale(v, subtract(c, b)))
    else:
        total = va + vb + vc
        u = vb / total
        v = vc / total
        near = add(a, add(scale(u, ab), scale(v, ac)))
    return length(subtract(p, near)), u, v


@kernel
def _search(
    tree: BVH16,
    stack: Int64Rows,
    surface: tuple[Float64Rows, Int32Rows],
    points: Float64Rows,
    radius: float,
    farther: bool,
    match: tuple[Int64s, Int64s],
    out: tuple[Int64s, Float32Rows],
) -> None:
    """Write the closest point to each of `points` on a face of its group. Args: radius: how far to look at first.
    farther: whether to look farther, too. out: faces and weights."""
    vertices, faces = surface
    group, of_face = match
    face, weights = out
    for i in range(len(points)):
        p, reach, best = load(points, i), radius, np.inf
        while best == np.inf:
            around = begin(tree, stack, p, reach)
            leaf, near = next_leaf(tree, stack, around)
            while near != 0:
                while near != 0:
                    f = tree.leaf_faces[leaf, lowest_bit(near)]
                    near &= near - 1
                    if of_face[f] != group[i]:
                        continue
                    a, b, c = load_triangle(vertices, faces, f)
                    away, u, v = closest_on_triangle(p, a, b, c)
                    if away > reach or away > best or (away == best and f > face[i]):
                        continue
                    if away < best:  # what lies farther does not matter any more
                        around = around[0], _rounded_up(around[0], away)
                    best, face[i] = away, f
                    weights[i, 0], weights[i, 1], weights[i, 2] = 1.0 - u - v, u, v
                leaf, near = next_leaf(tree, stack, around)
            if best == np.inf:
                if not farther:
                    break
                reach *= 2.0


def new_stack() -> Int64s:
    """A stack for one walk at a time: nodes to be opened, int64 (_ENTRIES + 1, 2)."""
    return np.zeros((_ENTRIES + 1, 2), np.int64)


@inline
def begin(tree, stack, point, radius):
    """Begin a walk: the point, and a radius that finds all within `radius` of it."""
    stack[0, _NODE] = tree.starts[-1] - 1
    stack[0, _LEVEL] = len(tree.starts) - 1
    stack[_ENTRIES, 0] = 1
    x = np.float32(point[0])
    y = np.float32(point[1])
    z = np.float32(point[2])
    return (x, y, z), _rounded_up((x, y, z), radius)


@inline
def _rounded_up(point, radius):
    """A radius that finds all within `radius` of a point in spite of single precision."""
    return np.float32(radius + _ROUNDED * (radius + max(abs(point[0]), abs(point[1]), abs(point[2]))))


@inline
def next_leaf(tree, stack, around):
    """Go on to the next leaf of the walk that may hold something near.

    Returns the leaf and, as bits, its triangles whose boxes may be within the radius along every axis; no bits at the
    end of the walk.

    Args:
        around: the point and the radius, of `begin`.
    """
    starts, (point, radius) = tree.starts, around
    while stack[_ENTRIES, 0] > 0:
        waiting = stack[_ENTRIES, 0] - 1
        node = stack[waiting, _NODE]
        level = stack[waiting, _LEVEL]
        if level == 0:
            stack[_ENTRIES, 0] = waiting
            within = _triangles_within(tree.triangles[node], point, radius)
            if within != 0:
                within &= _faces_within(tree.triangles[node], point, radius)
            if within != 0:
                return node, within
            continue
        child = (node - starts[level - 1]) * WIDE + (starts[level - 2] if level > 1 else 0)
        within = _boxes_within(tree.boxes, tree.axes, node, point, radius)
        while within != 0:
            stack[waiting, _NODE] = child + lowest_bit(within)
            stack[waiting, _LEVEL] = level - 1
            within &= within - 1
            waiting += 1
        stack[_ENTRIES, 0] = waiting
    return np.int64(-1), np.int64(0)


@inline
def _boxes_within(boxes, axes, node, point, radius):
    """The sixteen boxes of a node that may hold something within `radius` of a point along every axis, as bits."""
    d, half = box_offsets(boxes, axes, node, point)
    reach = radius if axes is None else _DIAGONAL * radius
    return bits((abs(d[0]) - half[0] <= reach) & (abs(d[1]) - half[1] <= reach) & (abs(d[2]) - half[2] <= reach))


@inline
def _triangles_within(triangles, point, radius):
    """The triangles (9, 16) whose boxes are within `radius` of a point along every axis, as bits."""
    x = _along_axis(triangles, 0, point[0], radius)
    y = _along_axis(triangles, 1, point[1], radius)
    return bits(x & y & _along_axis(triangles, 2, point[2], radius))


@inline
def _along_axis(triangles, axis, x, radius):
    """The triangles (9, 16) that reach within `radius` of the coordinate `x` along an axis."""
    a = load_row(triangles, axis)
    b = load_row(triangles, 3 + axis)
    c = load_row(triangles, 6 + axis)
    return (min(min(a, b), c) - radius <= x) & (max(max(a, b), c) + radius >= x)


@inline
def _faces_within(triangles, point, radius):
    """The triangles (9, 16) that may be within `radius` of a point, by their planes and planes across their edges."""
    a = load_row(triangles, 0), load_row(triangles, 1), load_row(triangles, 2)
    b = load_row(triangles, 3), load_row(triangles, 4), load_row(triangles, 5)
    c = load_row(triangles, 6), load_row(triangles, 7), load_row(triangles, 8)
    ab = subtract(b, a)
    bc = subtract(c, b)
    ca = subtract(a, c)
    n = cross(ca, ab)
    a = subtract(a, point)
    b = subtract(b, point)
    c = subtract(c, point)
    size = _sum(ab) + _sum(ca)
    vague = _PLANE * size * size * (_sum(a) + size + radius)  # of its sides: rounding
    beside = abs(dot(n, a)) > radius * _sum(n) + vague
    return bits(~(beside | _beyond(ab, n, a, radius, vague) | _beyond(bc, n, b, radius, vague)
                  | _beyond(ca, n, c, radius, vague)))  # fmt: skip


@inline
def _beyond(edge, n, end, radius, vague):
    """Lanes where a point is surely beyond an edge of a triangle by more than `radius`.

    Args: n: normals. end: where the edge ends, relative to the point. vague: rounding of coordinates.
    """
    outwards = cross(edge, n)
    return dot(outwards, end) < -(radius * _sum(outwards) + vague * _sum(edge))


@inline
def _sum(v):
    """The sum of the absolute coordinates, |x| + |y| + |z|."""
    return abs(v[0]) + abs(v[1]) + abs(v[2])
