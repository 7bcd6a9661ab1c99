"""The point of a triangle, and of a surface, that is closest to a point.

Source: Ericson, Real-Time Collision Detection, 5.1.5.
"""

import numpy as np

from ..kernel.borrow import borrow
from ..kernel.jit import inline, kernel
from ..kernel.simd_masks import lowest_bit
from ..kernel.vector import add, dot, length, load, load_triangle, scale, subtract
from ..system.threads import run_blocks
from ..types import Float32s, Float64s, Int64s
from .bvh16 import BVH16
from .search import begin, new_stack, next_leaf, widened

_BLOCK, _SHARE = 1 << 9, 16  # points, and blocks at once


def closest_points(
    tree: BVH16,
    surface: tuple[Float64s, Int64s],
    places: Float64s,
    radius: float,
    match: tuple[Int64s, Int64s],
    threads: int,
) -> tuple[Int64s, Float32s]:
    """The face (k,) nearest to each of `places` (k, 3) among those of its group, and where on it, barycentric (k, 3).

    Args:
        tree: over the faces of `surface`: vertices (n, 3) and faces (m, 3). radius: how far to look at first, above 0.
        match: groups, of the places (k,) and of the faces (m,), with a face for each that occurs.
    """
    face, weights = np.full(len(places), -1), np.zeros((len(places), 3), np.float32)

    def search(first: int, last: int) -> None:
        out = face[first:last], weights[first:last]
        _search(tree, new_stack(), surface, places[first:last], radius, (match[0][first:last], match[1]), *out)

    run_blocks(len(places), _BLOCK, search, threads, most=_SHARE)
    return face, weights


@inline
def closest_on_triangle(p, a, b, c):
    """Distance of a point from a triangle, and the weights of b and c where it is closest."""
    ab, ac, ap = subtract(b, a), subtract(c, a), subtract(p, a)
    d1, d2 = dot(ab, ap), dot(ac, ap)
    bp, cp = subtract(p, b), subtract(p, c)
    d3, d4, d5, d6 = dot(ab, bp), dot(ac, bp), dot(ab, cp), dot(ac, cp)
    va, vb, vc = d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2
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
        u, near = 1.0 - v, add(b, scale(v, subtract(c, b)))
    else:
        total = va + vb + vc
        u, v = vb / total, vc / total
        near = add(a, add(scale(u, ab), scale(v, ac)))
    return length(subtract(p, near)), u, v


@inline
def distance_to_triangle(p, a, b, c):
    return closest_on_triangle(p, a, b, c)[0]


@kernel
def _search(tree, stack, surface, places, radius, match, face, weights):
    """Write the closest points of `places`, on faces of their groups; `radius`: how far to look at first."""
    tree, (vertices, faces), (group, of_face) = borrow(tree), surface, match
    for i in range(len(places)):
        p, reach, best = load(places, i), radius, np.inf
        middle = np.float32(p[0]), np.float32(p[1]), np.float32(p[2])
        while best > reach:
            if best < np.inf:
                reach = best
            begin(tree, stack)
            within = widened(middle, reach)
            leaf, near = next_leaf(tree, stack, middle, within)
            while near != 0:
                while near != 0:
                    f = tree.rows[leaf, lowest_bit(near)]
                    near &= near - 1
                    if of_face[f] != group[i]:
                        continue
                    a, b, c = load_triangle(vertices, faces, f)
                    away, u, v = closest_on_triangle(p, a, b, c)
                    if away < best or (away == best and f < face[i]):
                        best, face[i] = away, f
                        weights[i, 0], weights[i, 1], weights[i, 2] = 1.0 - u - v, u, v
                leaf, near = next_leaf(tree, stack, middle, within)
            if best == np.inf:
                reach *= 2.0
