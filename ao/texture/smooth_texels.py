"""Texels for which one sample at the centre is enough, and blocks of texels of which one is enough.

Where the surface is smooth and nothing rises from it nearby, w is nearly linear, and the mean of a linear function
over a block is its value at the centre. Between the centres of blocks w is predicted.
"""

import numpy as np

from obscurance.raytrace.bvh.bvh16 import BVH16
from obscurance.raytrace.bvh.closest import new_stack
from obscurance.raytrace.kernel.jit import inline, kernel
from obscurance.raytrace.kernel.vector import length, subtract
from obscurance.raytrace.ray_origins.surface import Surface
from obscurance.raytrace.system.threads import run_blocks
from obscurance.raytrace.types import Bools, Int32s, Int64Rows, Int64s

from ..points.near_faces import LISTED, has_near_faces
from ..points.smooth_surface import SmoothSurface, VertexAxes, point_on
from .covered_texels import Coverage, PagePoints, locate
from .places import SLOTS, point_in_texel
from .raster import EDGE

_SLOPE = 2.0  # times what normals may differ by: what rises by more of its distance, rises
_WITHIN = 0.4  # of a texel's side, at which its own points would lie about the centre
_ROWS = 8  # of the page, a multiple of blocks' sizes


def smooth_cells(
    coverage: Coverage, smooth: SmoothSurface, tree: BVH16, most: float, tangent: float, largest: int, threads: int
) -> tuple[Bools, Int64s]:
    """Whether one sample at its centre is enough for each texel, (k,), and the row (k,) of the texel at the centre of
    its block, or its own.

    The surface is smooth there, normals differ by less than `most`, nothing rises from it nearby and nothing lies over
    it. In a cone of rays normals differ by less than `most` times its tangent.

    Args:
        tangent: of half the angle of the cone of rays, at most 1.
        largest: side of the largest blocks, a power of two, 1 for none.
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
        _find_smooth(tree, new_stack(), faces, coverage.points, (most, tangent), page, out)

    run_blocks(layout.height, _ROWS, work, threads)
    return by_centre, cell


@kernel
def _find_smooth(
    tree: BVH16,
    stack: Int64Rows,
    faces: tuple[Surface, VertexAxes],
    points: PagePoints,
    bounds: tuple[float, float],
    page: tuple[Int32s, int, int],
    out: tuple[Bools, Int64s],
) -> None:
    """`smooth_cells` of some rows of the page, the largest blocks first.

    Args: points: PagePoints. bounds: `most` and `tangent`. page: rows of texels up to the last one, the first row, side
        of the largest blocks.
    """
    row_of, first_row, size = page
    by_centre, cell = out
    width = points.width
    stop_row = len(row_of) // width
    edges = np.empty((3, EDGE))
    weights = np.empty(3)
    listed = np.empty((2, LISTED), np.int64)
    # Blocks of this size, aligned, whose texels no larger block has taken.
    while size > 0:
        for top in range(first_row, stop_row - size + 1, size):
            for left in range(0, width - size + 1, size):
                middle = np.int64(row_of[(top + size // 2) * width + left + size // 2])
                if middle < 0 or by_centre[middle]:
                    continue
                corner = top * width + left
                block = row_of, corner, size, middle
                if not _is_smooth(tree, stack, faces, points, bounds, block, (edges, weights, listed)):
                    continue
                for k in range(size * size):
                    row = row_of[corner + k // size * width + k % size]
                    by_centre[row] = True
                    cell[row] = middle
        size //= 2


@inline
def _is_smooth(tree, stack, faces, points, bounds, block, scratch):
    """Whether the centre of a texel can stand for a block around it, or for the texel if that is all of the block."""
    surface, axes = faces
    row_of, corner, size, middle = block
    most, tangent = bounds
    edges, weights, listed = scratch
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
        away = length(subtract(q, p))
        if size == 1:
            away *= _WITHIN / _from_centre(points, row, point)
        reach = max(reach, away)
        bent = max(bent, length(subtract(other_side, side)), length(subtract(other_axis, axis)))
        if bent >= most * tangent:
            return False
    return not has_near_faces(tree, stack, surface, (p, side, axis, tangent), reach, _SLOPE * most, listed)


@inline
def _from_centre(points, row, k):
    """How far point k of a texel lies from its centre, in sides of the texel."""
    x, y = point_in_texel(points.places, row, points.texels[row], k)
    return np.sqrt((x - 0.5) ** 2 + (y - 0.5) ** 2)


@inline
def _is_on_one_face(points, block):
    """Whether the centres of all texels of a block are in one triangle."""
    row_of, corner, size, middle = block
    for k in range(size * size):
        row = np.int64(row_of[corner + k // size * points.width + k % size])
        if row < 0 or points.triangle[row, SLOTS] != points.triangle[middle, SLOTS]:
            return False
    return True
