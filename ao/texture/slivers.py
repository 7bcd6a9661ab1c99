"""Texels of which charts cover so little that no ray meets them: points in what each has in common with a face."""

import numpy as np

from raytrace.bvh.bvh16 import BVH16
from raytrace.bvh.closest import begin, new_stack, next_leaf
from raytrace.kernel.arrays import unrefcounted_view
from raytrace.kernel.jit import inline, kernel
from raytrace.kernel.simd import lowest_bit
from raytrace.system.threads import run_blocks
from raytrace.types import Float32s, Float64s, Int64s

_BLOCK, _SHARE = 1 << 10, 16  # texels, and blocks at once
_LEAST = 1e-9  # area, in texels, that is any at all
_CORNERS = 8  # of a triangle cut by a square, at most 7
PageTree = tuple[Float64s, BVH16, float]  # corners of faces (t, 3, 2), the tree over these, the radius of a texel


def find_slivers(page: PageTree, texels: Int64s, width: int, threads: int) -> tuple[Int64s, Float32s]:
    """The face (k,) that covers most of each of the `texels`, −1 for none, and the centroid of that (k, 3)."""
    face, weights = np.full(len(texels), -1), np.zeros((len(texels), 3), np.float32)
    corners, tree, radius = page

    def work(first: int, last: int) -> None:
        block = slice(first, last)
        _search(tree, new_stack(), corners, texels[block], width, radius, (face[block], weights[block]))

    run_blocks(len(texels), _BLOCK, work, threads, most=_SHARE)
    return face, weights


@kernel
def _search(tree, stack, corners, texels, width, radius, found):
    tree = unrefcounted_view(tree)
    corners = unrefcounted_view(corners)
    texels = unrefcounted_view(texels)
    face, barycentric = unrefcounted_view(found)
    one, other, weights = np.empty((_CORNERS, 2)), np.empty((_CORNERS, 2)), np.empty(3)
    for i in range(len(texels)):
        left, top = np.float64(texels[i] % width), np.float64(texels[i] // width)
        best, best_face = _LEAST, -1
        around = begin(tree, stack, (left + 0.5, top + 0.5, 0.0), radius)
        leaf, near = next_leaf(tree, stack, around)
        while near != 0:
            while near != 0:
                f = tree.rows[leaf, lowest_bit(near)]
                near &= near - 1
                area, x, y = _common(corners[f], left, top, one, other)
                if area > best or (area == best and f < best_face):
                    best, best_face = area, f
                    _weights(corners[f], x, y, weights)
                    for corner in range(3):
                        barycentric[i, corner] = weights[corner]
            leaf, near = next_leaf(tree, stack, around)
        face[i] = best_face


@inline
def _common(triangle, left, top, polygon, scratch):
    """Area and centroid of what a triangle and a texel have in common (Sutherland & Hodgman 1974)."""
    for k in range(3):
        polygon[k, 0], polygon[k, 1] = triangle[k, 0] - left, triangle[k, 1] - top
    count = 3
    for side in range(4):
        axis, low = side % 2, side < 2
        kept = 0
        for k in range(count):
            ahead = (k + 1) % count
            here = polygon[k, axis] if low else 1.0 - polygon[k, axis]
            there = polygon[ahead, axis] if low else 1.0 - polygon[ahead, axis]
            if here >= 0.0:
                scratch[kept, 0], scratch[kept, 1] = polygon[k, 0], polygon[k, 1]
                kept += 1
            if (here < 0.0) != (there < 0.0):
                part = here / (here - there)
                for c in range(2):
                    scratch[kept, c] = polygon[k, c] + part * (polygon[ahead, c] - polygon[k, c])
                kept += 1
        count, polygon, scratch = kept, scratch, polygon
    double = x = y = 0.0
    for k in range(1, count - 1):
        ax, ay = polygon[k, 0] - polygon[0, 0], polygon[k, 1] - polygon[0, 1]
        bx, by = polygon[k + 1, 0] - polygon[0, 0], polygon[k + 1, 1] - polygon[0, 1]
        part = ax * by - ay * bx
        double += part
        x += part * (ax + bx) / 3.0
        y += part * (ay + by) / 3.0
    if count < 3 or double == 0.0:
        return 0.0, left, top
    return abs(double) / 2.0, left + polygon[0, 0] + x / double, top + polygon[0, 1] + y / double


@inline
def _weights(triangle, x, y, out):
    for k in range(3):
        b, c = (k + 1) % 3, (k + 2) % 3
        bx, by = triangle[b, 0] - x, triangle[b, 1] - y
        cx, cy = triangle[c, 0] - x, triangle[c, 1] - y
        out[k] = bx * cy - by * cx
    total = out[0] + out[1] + out[2]
    for k in range(3):
        out[k] = max(out[k] / total, 0.0)
    total = out[0] + out[1] + out[2]
    for k in range(3):
        out[k] /= total
