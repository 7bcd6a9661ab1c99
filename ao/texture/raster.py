"""Scan conversion of triangles on a page: every texel that one reaches into, and which of them lie at points in it.

Whether a triangle reaches into a texel is decided exactly, by the axes that may separate the two (Akenine-Möller & Aila
2005, Conservative and Tiled Rasterization). Points are within a triangle by the signs of its edge functions (Pineda
1988), which are the same from both sides of an edge that triangles share, so that no point falls between these.
"""

from typing import NamedTuple, Self

import numpy as np

from obscurance.raytrace.kernel.jit import inline, kernel
from obscurance.raytrace.types import Bools, Float64Grid, Int32Rows, Int32s, Int64s, UInt8s

from .places import POINTS, SLOTS, Places, point_in_texel

INSIDE = 1e-4  # least barycentric coordinate of what counts as inside: neighbours share their edges
EDGE = 5  # numbers of an edge, see `set_up_edges`
_SLACK = 1e-6  # texels, by which rows' ends are taken farther out, before the exact test


class Marks(NamedTuple):
    """The marks that triangles, scan-converted, leave on n texels."""

    triangle: Int32Rows  # (n, POINTS), the first one at each point, −1 for none
    inside: UInt8s  # (n,), a bit for each of the SLOTS points that is inside of a triangle
    overlapping: Bools  # (n,), whether two triangles have one of these points inside
    reaching: Int32s  # (n,), how many reach into the texel
    chart: Int32s  # (n,), of the first that does
    charts: Bools  # (n,), whether others are of other charts

    @classmethod
    def of(cls, count: int) -> Self:
        """Marks of `count` texels that no triangle has reached."""
        triangle = np.full((count, POINTS), -1, np.int32)
        inside, overlapping, charts = np.zeros(count, np.uint8), np.zeros(count, np.bool_), np.zeros(count, np.bool_)
        return cls(triangle, inside, overlapping, np.zeros(count, np.int32), np.zeros(count, np.int32), charts)


class Lists(NamedTuple):
    """The triangles that reach into each of some texels, ascending, for texel i from starts[i] on."""

    starts: Int64s  # (h + 1,)
    filled: Int64s  # (h,), how many are listed
    triangle: Int32s  # (j,)


@kernel
def count_bands(corners: Float64Grid, height: int, band_rows: int, counts: Int64s) -> None:
    """Add to `counts` how many triangles reach into each band of `band_rows` rows of a page."""
    for t in range(len(corners)):
        start, stop = _rows(corners[t], 0, height)
        if start < stop:
            for band in range(start // band_rows, (stop - 1) // band_rows + 1):
                counts[band] += 1


@kernel
def list_bands(corners: Float64Grid, height: int, band_rows: int, places: Int64s, listed: Int64s) -> None:
    """List the triangles of each band, ascending, from places[band] on, which is moved past them."""
    for t in range(len(corners)):
        start, stop = _rows(corners[t], 0, height)
        if start < stop:
            for band in range(start // band_rows, (stop - 1) // band_rows + 1):
                listed[places[band]] = t
                places[band] += 1


@kernel
def scan_convert(
    listed: Int64s,
    triangles: tuple[Float64Grid, Int32s],
    texels: Int64s,
    width: int,
    places: Places,
    marks: Marks | None,
    lists: Lists | None,
) -> None:
    """Visit those of n `texels` of a page, ascending, that triangles reach into, one triangle after another.

    Args:
        listed: rows of the triangles, ascending. triangles: their corners (t, 3, 2) and charts (t,).
        texels: (n,), row · width + column, some more than once. width: of the page.
        places: of the texels' points. marks: `Marks` to be made, or None. lists: `Lists` to be filled, or None.
    """
    corners, chart = triangles
    edges = np.empty((3, EDGE))
    if len(texels) == 0:
        return
    all_there = True  # one after another, none left out
    for i in range(1, len(texels)):
        all_there &= texels[i] == texels[i - 1] + 1
    for t in listed:
        area = set_up_edges(corners[t], edges)
        first_row, last_row = _rows(corners[t], texels[0] // width, texels[-1] // width + 1)
        for row in range(first_row, last_row):
            before = row * width
            left, right = _columns(corners[t], row, width)
            for i in range(_place_of(texels, before + left, all_there), _place_of(texels, before + right, all_there)):
                corner = np.float64(texels[i] - before), np.float64(row)
                touching, within = _reach(edges, corner[0] + 0.5, corner[1] + 0.5)
                if touching <= 0.0:
                    continue
                if marks is not None:
                    if marks.reaching[i] == 0:
                        marks.chart[i] = chart[t]
                    elif marks.chart[i] != chart[t]:
                        marks.charts[i] = True
                    _mark(marks, i, t, edges, corner, (places, texels[i]), area, within > INSIDE * area)
                if lists is not None:
                    lists.triangle[lists.starts[i] + lists.filled[i]] = t
                    lists.filled[i] += 1


@inline
def _place_of(texels, texel, all_there):
    """How many of `texels`, ascending, come before one. Args: all_there: these are one after another."""
    if all_there:
        return min(max(texel - texels[0], 0), len(texels))
    return np.searchsorted(texels, texel)


@inline
def _mark(marks, i, t, edges, texel, place, area, all_inside):
    """Give triangle `t` the points of texel `i` in it that no earlier triangle has.

    Args: place: `Places` and the texel's number. all_inside: the texel is in the triangle as a whole.
    """
    places, number = place
    triangle, inside = marks.triangle, marks.inside
    marks.reaching[i] += 1
    for k in range(POINTS):
        least = area
        if not all_inside:
            x, y = point_in_texel(places, i, number, k)
            least = least_edge(edges, texel[0] + x, texel[1] + y)
        if least < 0.0:
            continue
        if triangle[i, k] < 0:
            triangle[i, k] = t
        if k < SLOTS and least > INSIDE * area:
            bit = np.uint8(1 << k)
            if inside[i] & bit:
                marks.overlapping[i] = True
            inside[i] = inside[i] | bit


@inline
def set_up_edges(triangle, edges):
    """Write each edge, opposite to corner k: a point, x and y of its direction, and the sign of the edge function of
    points inside; returns twice the triangle's area. The point is the same from both sides."""
    ux = triangle[1, 0] - triangle[0, 0]
    uy = triangle[1, 1] - triangle[0, 1]
    vx = triangle[2, 0] - triangle[0, 0]
    vy = triangle[2, 1] - triangle[0, 1]
    area = ux * vy - uy * vx
    for k in range(3):
        a = (k + 1) % 3
        b = (k + 2) % 3
        sign = 1.0 if area > 0.0 else -1.0
        if (triangle[b, 0], triangle[b, 1]) < (triangle[a, 0], triangle[a, 1]):
            a, b, sign = b, a, -sign
        edges[k, 0] = triangle[a, 0]
        edges[k, 1] = triangle[a, 1]
        edges[k, 2] = triangle[b, 0] - triangle[a, 0]
        edges[k, 3] = triangle[b, 1] - triangle[a, 1]
        edges[k, 4] = sign
    return abs(area)


@inline
def edge_function(edges, k, x, y):
    """Barycentric coordinate k of a point, times twice the triangle's area. Args: edges: of `set_up_edges`."""
    return edges[k, 4] * (edges[k, 2] * (y - edges[k, 1]) - edges[k, 3] * (x - edges[k, 0]))


@inline
def least_edge(edges, x, y):
    """The least edge function, below 0 outside of the triangle."""
    return min(edge_function(edges, 0, x, y), edge_function(edges, 1, x, y), edge_function(edges, 2, x, y))


@inline
def store_barycentric(edges, x, y, out):
    """Write the barycentric coordinates of a point in the triangle of `set_up_edges`, inside but for rounding."""
    a = max(edge_function(edges, 0, x, y), 0.0)
    b = max(edge_function(edges, 1, x, y), 0.0)
    c = max(edge_function(edges, 2, x, y), 0.0)
    out[0] = a / (a + b + c)
    out[1] = b / (a + b + c)
    out[2] = c / (a + b + c)


@inline
def _reach(edges, x, y):
    """The least edge functions at the nearest and at the farthest points of the texel about a centre: above 0 if the
    triangle reaches into it, as far as edges say, and if it covers all of it."""
    touching, within = np.inf, np.inf
    for k in range(3):
        at_centre = edge_function(edges, k, x, y)
        half = 0.5 * (abs(edges[k, 2]) + abs(edges[k, 3]))
        touching = min(touching, at_centre + half)
        within = min(within, at_centre - half)
    return touching, within


@inline
def _rows(triangle, start, stop):
    """The rows from `start` to `stop` that a triangle reaches into: the first row, and the row after the last."""
    low = min(triangle[0, 1], triangle[1, 1], triangle[2, 1])
    high = max(triangle[0, 1], triangle[1, 1], triangle[2, 1])
    return max(np.int64(np.floor(low)), start), min(np.int64(np.ceil(high)), stop)


@inline
def _columns(triangle, row, width):
    """The columns that a triangle may reach into in a row: the first column, and the column after the last."""
    low, high = np.inf, -np.inf
    for k in range(3):
        ax = triangle[k, 0]
        ay = triangle[k, 1]
        bx = triangle[(k + 1) % 3, 0]
        by = triangle[(k + 1) % 3, 1]
        if max(ay, by) < row or min(ay, by) > row + 1:
            continue
        from_, to = 0.0, 1.0  # parts of the edge between which it is in the row
        if ay != by:
            t_start = (row - ay) / (by - ay)
            t_end = (row + 1 - ay) / (by - ay)
            from_ = max(from_, min(t_start, t_end))
            to = min(to, max(t_start, t_end))
        for part in (from_, to):
            x = ax + part * (bx - ax)
            low = min(low, x)
            high = max(high, x)
    if low > high:
        return 0, 0
    left = np.int64(np.floor(max(low - _SLACK, min(triangle[0, 0], triangle[1, 0], triangle[2, 0]))))
    right = np.int64(np.ceil(min(high + _SLACK, max(triangle[0, 0], triangle[1, 0], triangle[2, 0]))))
    return max(left, 0), min(right, width)
