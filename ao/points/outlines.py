"""Outlines of discs, which end where their sheet does: at its border, and at convex edges.

As surface splats are clipped at sharp features (Zwicker et al. 2004), a disc is cut by the planes of points beyond a
convex edge; at a border, somewhat beyond the convex hull of its sheet's points around it.
"""

import numpy as np

from obscurance.raytrace.kernel.jit import inline
from obscurance.raytrace.kernel.vector import add, dot, load, scale, store, subtract, tangents
from obscurance.raytrace.system.parallel import each
from obscurance.raytrace.types import Float64Grid, Float64Rows, Int64s

from .sheets import FLAT, NEAR, Cloud, beside

CORNERS = 10
"""Of an outline, at most: of a hexagon that is cut four times."""
_HEXAGON = np.stack([np.cos(np.radians(60 * np.arange(6))), np.sin(np.radians(60 * np.arange(6)))], axis=1)
_AROUND = 1.4  # of the radius: with points of the sheet so far off in every sixth, no border is near
_ALL_SIXTHS = 0b10111101  # of the signs of y, a − y and a + y, a = √3 x, those that there are
_MARGIN = 0.4  # of the mean spacing in the hull, by which the sheet goes on beyond it
_OUTERMOST = 0.5  # spacing within the hull, up to which a point is at a border
_BEYOND = 1.0  # spacing beyond a side of the hull, where the sheet has a point if a hole and no border lies there
_HOLE = 5.0  # spacings, within which such a point is sought
_AHEAD = 0.35  # cosine between the way to it and the way out
_THIN = 0.05  # of its square, the hull's area: points along a line, beside which nothing is known
_CROSSED = 1.5  # of the radius, within which other planes cross the disc's at its sheet's edge
_ROUNDED = 1.0 + 1e-9  # times an offset, at which an outline that was cut there may end
_BESIDE = 0.7  # cosine between directions to the same side


@each("corners")
def outline(i: int, cloud: Cloud, corners: Float64Grid, counts: Int64s, borders: Float64Rows) -> None:
    """Write the corners of each disc, (k, CORNERS, 3), how many these are, and outward vectors (k, 3) as long as the
    spacing at outermost points of a sheet, elsewhere 0."""
    p = load(cloud.points, i)
    u, v = tangents(load(cloud.axes, i))
    radius = cloud.radius[i]
    outlines = np.empty((2, CORNERS, 2))  # of which one is cut to the other
    for k in range(6):
        for axis in range(2):
            outlines[0, k, axis] = radius * _HEXAGON[k, axis]
    count = 6
    # The sheet's points in the plane of the disc, and where planes of others cross it.
    sheet = np.zeros((NEAR + 1, 2))
    crossings = np.empty((NEAR, 3))
    of_sheet, reach, is_all_around = _find_sheet(cloud, i, sheet)
    crossing = _find_crossings(cloud, i, crossings)
    # Convex edges.
    for j in range(crossing):
        x, y, offset = crossings[j, 0], crossings[j, 1], crossings[j, 2]
        if offset >= 0.0:
            for k in range(of_sheet):
                offset = max(offset, x * sheet[k, 0] + y * sheet[k, 1])
            count = _cut(outlines, count, x, y, offset)
    outwards = 0.0, 0.0, 0.0
    if not is_all_around:
        others = (crossings, crossing)
        count, outwards = _cut_at_borders(cloud, i, (sheet, of_sheet), others, (outlines, count, reach))
    store(borders, i, outwards)
    counts[i] = count
    for k in range(count):
        corner = add(p, add(scale(outlines[0, k, 0], u), scale(outlines[0, k, 1], v)))
        corners[i, k, 0], corners[i, k, 1], corners[i, k, 2] = corner


@inline
def _find_sheet(cloud, i, sheet):
    """Write the points of the sheet of point i in the plane of its disc, from the second row on. Returns how many there
    are with the point itself, how far the farthest of all near points is, and whether some are in every sixth around.
    """
    u, v = tangents(load(cloud.axes, i))
    of_sheet, square, sixths = 1, 0.0, 0
    for j in range(cloud.near.shape[1]):
        between = subtract(load(cloud.points, cloud.near[i, j]), load(cloud.points, i))
        square = max(square, dot(between, between))
        if not cloud.of_sheet[i, j]:
            continue
        x = dot(between, u)
        y = dot(between, v)
        if x * x + y * y > (_AROUND * cloud.radius[i]) ** 2:
            a = np.sqrt(3.0) * x
            sixths |= 1 << (4 * (y > 0.0) + 2 * (a > y) + (a > -y))
        sheet[of_sheet, 0] = x
        sheet[of_sheet, 1] = y
        of_sheet += 1
    return of_sheet, np.sqrt(square), sixths == _ALL_SIXTHS


@inline
def _find_crossings(cloud, i, crossings):
    """Write where planes of other sheets cross that of disc i: the unit direction across, and how far from its centre,
    at a concave edge −1. Returns how many."""
    u, v = tangents(load(cloud.axes, i))
    radius = cloud.radius[i]
    level = FLAT * radius
    crossing = 0
    for j in range(cloud.near.shape[1]):
        if cloud.of_sheet[i, j]:
            continue
        _, above, along = beside(cloud, i, j)
        x = dot(load(cloud.axes, cloud.near[i, j]), u)
        y = dot(load(cloud.axes, cloud.near[i, j]), v)
        size = np.sqrt(x * x + y * y)
        is_across = above * along < 0.0 or min(abs(above), abs(along)) < level
        if is_across and abs(above - along) > level and abs(along) < _CROSSED * radius * size:
            side = 1.0 if above < along else -1.0  # of a convex edge, or of a crease
            crossings[crossing, 0] = side * x / size
            crossings[crossing, 1] = side * y / size
            crossings[crossing, 2] = along / size if side > 0.0 else -1.0
            crossing += 1
    return crossing


@inline
def _cut_at_borders(cloud, i, sheet, others, outline):
    """Cut the outline of point i to the hull of its sheet's points. Returns how many corners it has, and its row of the
    vectors at borders.

    Args: sheet, others: in the plane of the disc, and how many. outline: with how far the farthest point is.
    """
    places, of_sheet = sheet
    crossings, crossing = others
    outlines, count, reach = outline
    u, v = tangents(load(cloud.axes, i))
    hull = np.empty(NEAR + 1, np.int64)
    size, area = _hull(places, of_sheet, hull)
    at_border = 0.0, 0.0, 0.0
    if area <= _THIN * reach * reach:
        return count, at_border
    spacing = np.sqrt(area / of_sheet)
    for k in range(size):
        a = hull[k]
        b = hull[(k + 1) % size]
        x = places[b, 1] - places[a, 1]
        y = places[a, 0] - places[b, 0]
        length = np.sqrt(x * x + y * y)
        x /= length
        y /= length
        offset = x * places[a, 0] + y * places[a, 1]
        border = offset + _MARGIN * spacing
        if border >= cloud.radius[i] or _is_crossed(crossings, crossing, x, y):
            continue
        outwards = add(scale(x, u), scale(y, v))
        if not _goes_on(cloud, i, outwards, offset + _BEYOND * spacing, _HOLE * spacing):
            count = _cut(outlines, count, x, y, border)
            if offset < _OUTERMOST * spacing:
                at_border = scale(spacing, outwards)
    return count, at_border


@inline
def _is_crossed(crossings, count, x, y):
    """Whether another plane crosses the disc's in a direction."""
    most = -1.0
    for j in range(count):
        most = max(most, crossings[j, 0] * x + crossings[j, 1] * y)
    return most > _BESIDE


@inline
def _goes_on(cloud, i, outwards, beyond, farthest):
    """Whether the sheet has points farther off in a direction, on the other side of a hole."""
    p = load(cloud.points, i)
    for j in range(cloud.near.shape[1]):
        if cloud.of_sheet[i, j]:
            at = cloud.near[i, j]
            for k in range(cloud.near.shape[1]):
                between = subtract(load(cloud.points, cloud.near[at, k]), p)
                square = dot(between, between)
                along = dot(between, outwards)
                if cloud.of_sheet[at, k] and square < farthest**2 and along > max(beyond, _AHEAD * np.sqrt(square)):
                    return True
    return False


@inline
def _cut(outlines, count, x, y, offset):
    """Cut the first outline by a half-plane (Sutherland and Hodgman 1974), unless it would have too many corners, or
    nothing is left: along a side that is there already, rounding can add several."""
    farthest = -np.inf
    for k in range(count):
        farthest = max(farthest, x * outlines[0, k, 0] + y * outlines[0, k, 1])
    if count == CORNERS or farthest <= offset * _ROUNDED:
        return count
    left = 0
    for k in range(count):
        m = (k + 1) % count
        here = offset - x * outlines[0, k, 0] - y * outlines[0, k, 1]
        there = offset - x * outlines[0, m, 0] - y * outlines[0, m, 1]
        if here >= 0.0:
            if left == CORNERS:
                return count
            for axis in range(2):
                outlines[1, left, axis] = outlines[0, k, axis]
            left += 1
        if (here >= 0.0) != (there >= 0.0):
            if left == CORNERS:
                return count
            t = here / (here - there)
            for axis in range(2):
                outlines[1, left, axis] = outlines[0, k, axis] + t * (outlines[0, m, axis] - outlines[0, k, axis])
            left += 1
    if left < 3:
        return count
    for k in range(left):
        for axis in range(2):
            outlines[0, k, axis] = outlines[1, k, axis]
    return left


@inline
def _hull(points, count, hull):
    """The convex hull of points by gift wrapping (Jarvis 1973), anticlockwise: write its corners, and return how many
    and its area."""
    first = 0
    for k in range(1, count):
        if points[k, 1] < points[first, 1] or (points[k, 1] == points[first, 1] and points[k, 0] < points[first, 0]):
            first = k
    size = 0
    area = 0.0
    at = first
    while size < count:
        hull[size] = at
        size += 1
        to = -1
        for k in range(count):
            x = points[k, 0] - points[at, 0]
            y = points[k, 1] - points[at, 1]
            if x == 0.0 and y == 0.0:
                continue
            if to >= 0:
                along = points[to, 0] - points[at, 0]
                aside = points[to, 1] - points[at, 1]
                turn = along * y - aside * x
                if turn > 0.0 or (turn == 0.0 and x * x + y * y <= along * along + aside * aside):
                    continue
            to = k
        if to < 0:
            break
        area += 0.5 * (points[at, 0] * points[to, 1] - points[at, 1] * points[to, 0])
        at = to
        if points[at, 0] == points[first, 0] and points[at, 1] == points[first, 1]:
            break
    return size, area
