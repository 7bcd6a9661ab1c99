"""Cells of texels that the point at one centre can stand for, as it does for linear functions.

Where the surface is smooth and nothing rises from it nearby, w is nearly linear: one sample there is enough for a
texel, and one texel for a block of them, between which w is predicted.
"""

import numpy as np

from raytrace.bvh.bvh16 import BVH16
from raytrace.bvh.closest import begin, closest_on_triangle, new_stack, next_leaf
from raytrace.kernel.arrays import unrefcounted_view
from raytrace.kernel.jit import inline, kernel
from raytrace.kernel.simd import lowest_bit
from raytrace.kernel.vector import dot, length, load, load_triangle, subtract
from raytrace.system.threads import run_blocks
from raytrace.types import Bools, Int64s

from ..points.smooth_surface import SmoothSurface, point_on
from .covered_texels import Coverage, locate
from .raster import EDGE, SLOTS

_AROUND = 7.0  # times the way from a cell's centre to its points, in which nothing may rise
_SLOPE = 2.0  # times what normals may differ by: what rises by more of its distance, rises
_OWN, _LEVEL = 0.25, 1e-3  # of the way in `_AROUND`: how far the cell reaches, and what is flat but for rounding
_ROWS = 8  # of the page, a multiple of blocks' sizes


def smooth_cells(
    coverage: Coverage, smooth: SmoothSurface, tree: BVH16, most: float, largest: int, threads: int
) -> tuple[Bools, Int64s]:
    """Whether the point at the centre can stand for all of a texel, (k,), and the row (k,) of the texel that
    stands for it: the centre of its block, or itself.

    The surface is smooth there, normals differ by less than `most`, and nothing rises from it nearby. Args: largest:
        side of the largest blocks, a power of two, 1 for none.
    """
    layout, count = coverage.layout, len(coverage.texels)
    row_of = np.full(layout.width * layout.height, -1, np.int32)
    row_of[coverage.texels] = np.arange(count, dtype=np.int32)
    by_centre = np.zeros(count, np.bool_)
    cell = np.arange(count)

    def work(start: int, stop: int) -> None:
        faces = (smooth.surface, smooth.axes)
        out = (by_centre, cell)
        page = row_of[: stop * layout.width], start, largest
        _find_smooth(tree, new_stack(), faces, coverage.points, most, page, out)

    run_blocks(layout.height, _ROWS, work, threads)
    return by_centre, cell


@kernel
def _find_smooth(tree, stack, faces, points, most, page, out):
    """`smooth_cells` of some rows of the page, the largest blocks first.

    Args: points: PagePoints. page: rows of texels up to the last one, the first row, side of the largest blocks.
    """
    tree = unrefcounted_view(tree)
    faces = unrefcounted_view(faces)
    points = unrefcounted_view(points)
    row_of, first_row, size = page
    by_centre, cell = unrefcounted_view(out)
    width = points.width
    stop_row = len(row_of) // width
    edges = np.empty((3, EDGE))
    weights = np.empty(3)
    # Blocks of this size, aligned, whose texels no larger block has taken.
    while size > 0:
        for top in range(first_row, stop_row - size + 1, size):
            for left in range(0, width - size + 1, size):
                middle = np.int64(row_of[(top + size // 2) * width + left + size // 2])
                if middle < 0 or by_centre[middle]:
                    continue
                corner = top * width + left
                if not _is_smooth(tree, stack, faces, points, most, (row_of, corner, size, middle), (edges, weights)):
                    continue
                for k in range(size * size):
                    row = row_of[corner + k // size * width + k % size]
                    by_centre[row] = True
                    cell[row] = middle
        size //= 2


@inline
def _is_smooth(tree, stack, faces, points, most, block, scratch):
    """Whether the centre of a texel can stand for a block around it, or for the texel if that is all of the block."""
    surface, axes = faces
    row_of, corner, size, middle = block
    edges, weights = scratch
    if points.triangle[middle, SLOTS] < 0:
        return False
    triangle = locate(points, middle, SLOTS, -1, edges, weights)
    # The centre, and then the other points: how far they are, and how much normals differ.
    p, side, axis, _ = point_on(surface, axes, points.face[triangle], weights)
    reach, bent = 0.0, 0.0
    step = 1
    if size > 1 and _is_on_one_face(points, block):
        step = size - 1  # the block's corners are farthest away
    for k in range(SLOTS if size == 1 else size * size):
        if k % size % step or k // size % step:
            continue
        row, point = middle, k
        if size > 1:
            row, point = np.int64(row_of[corner + k // size * points.width + k % size]), SLOTS
        if row < 0 or points.triangle[row, point] < 0:
            return False
        triangle = locate(points, row, point, triangle, edges, weights)
        q, other_side, other_axis, _ = point_on(surface, axes, points.face[triangle], weights)
        reach = max(reach, length(subtract(q, p)))
        bent = max(bent, length(subtract(other_side, side)), length(subtract(other_axis, axis)))
        if bent >= most:
            return False
    return not _rises(tree, stack, surface, p, side, _AROUND * reach, _SLOPE * most)


@inline
def _is_on_one_face(points, block):
    """Whether the centres of all texels of a block are in one triangle."""
    row_of, corner, size, middle = block
    for k in range(size * size):
        row = np.int64(row_of[corner + k // size * points.width + k % size])
        if row < 0 or points.triangle[row, SLOTS] != points.triangle[middle, SLOTS]:
            return False
    return True


@inline
def _rises(tree, stack, surface, p, side, reach, slope):
    """Whether a face not far around a point rises above the plane through it, by more than a slope."""
    around = begin(tree, stack, p, reach)
    leaf, near = next_leaf(tree, stack, around)
    while near != 0:
        while near != 0:
            f = tree.leaf_faces[leaf, lowest_bit(near)]
            near &= near - 1
            a, b, c = load_triangle(surface.vertices, surface.faces, f)
            to_a = subtract(a, p)
            height = max(dot(to_a, side), dot(subtract(b, p), side), dot(subtract(c, p), side))
            if height <= _LEVEL * slope * reach:
                continue
            distance = closest_on_triangle(p, a, b, c)[0]
            normal = load(surface.normals, f)
            if distance > reach:
                continue
            if length(subtract(normal, side)) < slope:
                if abs(dot(to_a, normal)) > slope * max(distance, _LEVEL * reach):
                    return True
            elif height > slope * max(distance - _OWN * reach, 0.0):
                return True
        leaf, near = next_leaf(tree, stack, around)
    return False
