"""Triangles clipped by a texel, exactly."""

from obscurance.raytrace.kernel.jit import inline

CORNERS = 8  # of a triangle cut by a square, at most 7


@inline
def area_of_fan(polygon, k):
    """The area of the triangle of the first corner, corner k and the next."""
    ax = polygon[k, 0] - polygon[0, 0]
    ay = polygon[k, 1] - polygon[0, 1]
    bx = polygon[k + 1, 0] - polygon[0, 0]
    by = polygon[k + 1, 1] - polygon[0, 1]
    return abs(ax * by - ay * bx) / 2.0


@inline
def point_in_fan(polygon, corner, axis, outwards, sideways):
    """A coordinate of a point between the first corner of a polygon, `corner` and the next."""
    a = polygon[0, axis]
    b = polygon[corner, axis]
    c = polygon[corner + 1, axis]
    return a + outwards * (b - a + sideways * (c - b))


@inline
def clip_to_texel(triangle, texel, clipped):
    """Area of what a triangle and a texel have in common (Sutherland & Hodgman 1974), and how many corners it has.

    Args: clipped: (2, CORNERS, 2), whose first polygon receives the corners, relative to the texel's.
    """
    count = 3
    for k in range(3):
        for axis in range(2):
            clipped[0, k, axis] = triangle[k, axis] - texel[axis]
    for side in range(4):  # to and fro between the two polygons
        count = _clip_side(clipped[side % 2], count, side // 2, side % 2 == 0, clipped[1 - side % 2])
    area = 0.0
    for k in range(1, count - 1):
        area += area_of_fan(clipped[0], k)
    return area, count


@inline
def _clip_side(polygon, count, axis, low, out):
    """Write the corners of a polygon that is cut at 0, or else at 1, of an axis; returns their number."""
    written = 0
    for k in range(count):
        ahead = (k + 1) % count
        here = polygon[k, axis] if low else 1.0 - polygon[k, axis]
        there = polygon[ahead, axis] if low else 1.0 - polygon[ahead, axis]
        if here >= 0.0:
            out[written, 0] = polygon[k, 0]
            out[written, 1] = polygon[k, 1]
            written += 1
        if (here < 0.0) != (there < 0.0):
            part = here / (here - there)
            for c in range(2):
                out[written, c] = polygon[k, c] + part * (polygon[ahead, c] - polygon[k, c])
            written += 1
    return written
