"""Texels for which the point at their centre can stand for all of them, as it does for linear functions."""

import numpy as np

from raytrace.bvh.bvh16 import BVH16
from raytrace.bvh.closest import begin, closest_on_triangle, new_stack, next_leaf
from raytrace.kernel.arrays import unrefcounted_view
from raytrace.kernel.jit import inline, kernel
from raytrace.kernel.simd import lowest_bit
from raytrace.kernel.vector import dot, length, load, load_triangle, subtract
from raytrace.system.threads import run_blocks
from raytrace.types import Bools

from ..points.smooth_surface import SmoothSurface, point_on
from .covered_texels import Coverage, locate
from .raster import EDGE, POINTS, SLOTS

_AROUND = 7.0  # times the way from a texel's centre to its points, in which nothing may rise
_SLOPE = 2.0  # by more than so many times what normals may differ by, of its distance
_OWN, _LEVEL = 0.25, 1e-3  # of that way: how far the texel reaches, and what is flat but for rounding
_BLOCK, _SHARE = 1 << 10, 16  # texels, and blocks at once


def centres_suffice(coverage: Coverage, smooth: SmoothSurface, tree: BVH16, most: float, threads: int) -> Bools:
    """Whether the point at the centre can stand for all of a texel, (k,).

    The surface is smooth there, normals differ by less than `most`, and nothing rises from it nearby.
    """
    enough = np.zeros(len(coverage.texels), np.bool_)

    def work(first: int, last: int) -> None:
        points, faces = coverage.points, (smooth.surface, smooth.axes)
        _find_smooth(tree, new_stack(), faces, points, most, first, enough[first:last])

    run_blocks(len(enough), _BLOCK, work, threads, most=_SHARE)
    return enough


@kernel
def _find_smooth(tree, stack, faces, points, most, first, enough):
    """`centres_suffice` of texels from the `first`. Args: points: PagePoints."""
    tree = unrefcounted_view(tree)
    surface, axes = unrefcounted_view(faces)
    points = unrefcounted_view(points)
    edges, weights = np.empty((3, EDGE)), np.empty(3)
    for i in range(len(enough)):
        if points.triangle[first + i, SLOTS] < 0:
            continue
        reach, bent, known = 0.0, 0.0, -1
        p = side = axis = (0.0, 0.0, 0.0)
        for k in range(POINTS - 1, -1, -1):  # from the centre on
            known = locate(points, first + i, k, known, edges, weights)
            q, other, up = point_on(surface, axes, points.face[known], weights)
            if k == SLOTS:
                p, side, axis = q, other, up
            reach = max(reach, length(subtract(q, p)))
            bent = max(bent, length(subtract(other, side)), length(subtract(up, axis)))
        enough[i] = bent < most and not _rises(tree, stack, surface, p, side, _AROUND * reach, _SLOPE * most)


@inline
def _rises(tree, stack, surface, p, side, reach, slope):
    """Whether a face not far around a point rises above the plane through it, by more than a slope."""
    around = begin(tree, stack, p, reach)
    leaf, near = next_leaf(tree, stack, around)
    while near != 0:
        while near != 0:
            f = tree.rows[leaf, lowest_bit(near)]
            near &= near - 1
            a, b, c = load_triangle(surface.vertices, surface.faces, f)
            to_a = subtract(a, p)
            height = max(dot(to_a, side), dot(subtract(b, p), side), dot(subtract(c, p), side))
            if height <= _LEVEL * slope * reach:
                continue
            distance, normal = closest_on_triangle(p, a, b, c)[0], load(surface.normals, f)
            if distance > reach:
                continue
            if length(subtract(normal, side)) < slope:
                if abs(dot(to_a, normal)) > slope * max(distance, _LEVEL * reach):
                    return True
            elif height > slope * max(distance - _OWN * reach, 0.0):
                return True
        leaf, near = next_leaf(tree, stack, around)
    return False
