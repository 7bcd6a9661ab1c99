"""Horizon slopes of triangles as seen from a point, in sixteen sectors of azimuth at once.

A horizon is, for each sector, a slope z/√(x² + y²) in the frame of a point with its normal along z. It is raised over
whatever may stand in the way of a ray; what rounds, here or in Embree, errs upwards.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from raytrace.kernel.arrays import aligned
from raytrace.kernel.jit import inline
from raytrace.kernel.simd import WIDE, select
from raytrace.kernel.simd_masks import first, lane_numbers, some
from raytrace.kernel.simd_memory import load_row, store_row
from raytrace.kernel.vector import cross, dot, subtract

from ..gather.directions import SECTORS

STEEP = np.float32(40.0)  # a slope so near the normal that no sector can be told, which makes horizons infinite
INFINITE = np.float32(np.inf)
SCRATCH = 15  # rows of sixteen that `raise_over_triangles` needs
ROUNDED = np.float32(2.0**-22)  # part of a distance by which a height computed in single precision may be off
_MOST_UNCERTAIN = np.float32(0.5)  # radians by which an edge may be off, at most
_SIGN_UNCERTAIN = np.float32(1e-4)  # part of a sum below which its sign says nothing
_OBLIQUE = np.float32(0.9)  # sine of a half angle above which a sphere says nothing
_ASIDE = np.float32(1e-4)  # radians that spheres are widened by
_HALF = np.pi / SECTORS
_COS_HALF, _SIN_HALF = np.float32(np.cos(_HALF)), np.float32(np.sin(_HALF))
_ZERO, _ONE, _NONE = np.float32(0.0), np.float32(1.0), np.float32(-1.0)


def sector_rows():
    """float32 (6, 16): x and y of each sector's first side, of its second side and of its middle."""
    rows = aligned((6, WIDE), np.float32)
    for row, part in enumerate((0.0, 1.0, 0.5)):
        azimuth = 2 * np.pi * (np.arange(SECTORS) + part) / SECTORS
        rows[2 * row], rows[2 * row + 1] = np.cos(azimuth), np.sin(azimuth)
    return rows


@inline
def load_sectors(rows):
    """First sides, second sides and middles as pairs of lanes."""
    return (
        (load_row(rows, 0), load_row(rows, 1)),
        (load_row(rows, 2), load_row(rows, 3)),
        (load_row(rows, 4), load_row(rows, 5)),
    )


@inline
def to_frame(d, frame):
    """`d` in the coordinates of a frame of three axes."""
    return dot(d, frame[0]), dot(d, frame[1]), dot(d, frame[2])


@inline
def _cross_z(a, b):
    """z of a × b"""
    return a[0] * b[1] - a[1] * b[0]


@inline
def sphere_lanes(x, y, away, height, radius):
    """The share of a horizon that spheres take: lanes (x, y, slope, nearness, sine) for `sphere_below`.

    Args: lanes x, y, away: of their centres and √(x² + y²). height: the highest point within each, or more.
    """
    sine = radius / away
    nearness = (sqrt(max(_ONE - sine * sine, _ZERO)) * _COS_HALF - sine * _SIN_HALF - _ASIDE) * away
    return x, y, height / (away - radius), nearness, select(sine < _OBLIQUE, sine, _ONE)


@inline
def sphere_below(horizon, middle, x, y, slope, nearness):
    """The sectors of which a sphere has a part, and whether it is below the horizon in all of them."""
    seen = middle[0] * x + middle[1] * y >= nearness
    return seen, not some(seen & (horizon < slope))


@inline
def _raise_over_edge(horizon, a, b, off, sectors):
    """The horizon raised over the edge from `a` to `b`, which are each up to `off` elsewhere."""
    left, right, _ = sectors
    m = cross(a, b)
    if m[2] < _ZERO:
        a, b, m = b, a, (-m[0], -m[1], -m[2])
    ra, rb = sqrt(a[0] * a[0] + a[1] * a[1]), sqrt(b[0] * b[0] + b[1] * b[1])
    aa, bb = dot(a, a), dot(b, b)
    # Embree adds a and b before it takes products, so that the farther end rounds the nearer one
    off = ROUNDED * (aa + bb) / sqrt(aa * bb if dot(a, b) > _ZERO else dot(m, m)) + off / sqrt(min(aa, bb))
    crest = -m[0], -m[1]  # the azimuth at which the edge's great circle is highest
    inner = _cross_z(a, crest) > _ZERO and _cross_z(crest, b) > _ZERO
    slope_a, slope_b = a[2] / ra, b[2] / rb
    top = max(slope_a, slope_b)
    if inner:
        top = max(top, sqrt(m[0] * m[0] + m[1] * m[1]) / m[2])
    if not (top < STEEP and off < _MOST_UNCERTAIN):
        return horizon + INFINITE
    aside = off * (_ONE + abs(top))
    beside_a, beside_b = -aside * ra, -aside * rb
    over = select((_cross_z(left, a) >= beside_a) & (_cross_z(a, right) >= beside_a), slope_a, _NONE)
    over = max(over, select((_cross_z(left, b) >= beside_b) & (_cross_z(b, right) >= beside_b), slope_b, _NONE))
    if inner:
        over = max(over, select((_cross_z(left, crest) >= _ZERO) & (_cross_z(crest, right) >= _ZERO), top, _NONE))
    for side in (left, right):
        within = (_cross_z(a, side) >= beside_a) & (_cross_z(side, b) >= beside_b)
        slope = (crest[0] * side[0] + crest[1] * side[1]) / m[2]
        over = max(over, select(within, select(slope < top, slope, top), _NONE))
    return max(horizon, select(over > _NONE, over + off * (_ONE + top * top), _NONE))


@inline
def _raise_over_triangle(horizon, a, b, c, off, sectors):
    """The horizon raised over the upper edges of a triangle, infinite where that covers the normal."""
    u, v, w = _cross_z(a, b), _cross_z(b, c), _cross_z(c, a)
    doubt = ROUNDED * max(max(a[0] * a[0] + a[1] * a[1], b[0] * b[0] + b[1] * b[1]), c[0] * c[0] + c[1] * c[1])
    part_a, part_b, part_c = a[2] * v, b[2] * w, c[2] * u
    volume = part_a + part_b + part_c
    around_normal = min(min(u, v), w) >= -doubt or max(max(u, v), w) <= doubt
    if around_normal and not volume / (u + v + w) <= _ZERO:
        return horizon + INFINITE
    # seen from the point, the corners of a triangle of positive volume run around it to the left, above to the right
    if abs(volume) <= _SIGN_UNCERTAIN * (abs(part_a) + abs(part_b) + abs(part_c)):
        volume = _ZERO
    doubt += _SIGN_UNCERTAIN * max(max(abs(u), abs(v)), abs(w))
    if (a[2] > _ZERO or b[2] > _ZERO) and (abs(u) <= doubt or u * volume <= _ZERO):
        horizon = _raise_over_edge(horizon, a, b, off, sectors)
    if (b[2] > _ZERO or c[2] > _ZERO) and (abs(v) <= doubt or v * volume <= _ZERO):
        horizon = _raise_over_edge(horizon, b, c, off, sectors)
    if (c[2] > _ZERO or a[2] > _ZERO) and (abs(w) <= doubt or w * volume <= _ZERO):
        horizon = _raise_over_edge(horizon, c, a, off, sectors)
    return horizon


@inline
def raise_over_triangles(horizon, triangles, origin, frame, reach, small, sectors, scratch):
    """The horizon raised over sixteen triangles of a `BVH16`, or over the spheres around those that look small.

    Args:
        triangles: float32 (10, 16). reach: how far things count. small: sine of the half angle that is small.
        scratch: float32 (SCRATCH, 16).
    """
    a = to_frame(subtract((load_row(triangles, 0), load_row(triangles, 1), load_row(triangles, 2)), origin), frame)
    b = to_frame(subtract((load_row(triangles, 3), load_row(triangles, 4), load_row(triangles, 5)), origin), frame)
    c = to_frame(subtract((load_row(triangles, 6), load_row(triangles, 7), load_row(triangles, 8)), origin), frame)
    off, third = load_row(triangles, 9), np.float32(1.0 / 3.0)
    lift = off + off
    a, b, c = (a[0], a[1], a[2] + lift), (b[0], b[1], b[2] + lift), (c[0], c[1], c[2] + lift)
    centre = (a[0] + b[0] + c[0]) * third, (a[1] + b[1] + c[1]) * third, (a[2] + b[2] + c[2]) * third
    to_a, to_b, to_c = subtract(a, centre), subtract(b, centre), subtract(c, centre)
    radius = sqrt(max(max(dot(to_a, to_a), dot(to_b, to_b)), dot(to_c, to_c))) + lift
    away = sqrt(centre[0] * centre[0] + centre[1] * centre[1])
    distance = sqrt(dot(centre, centre))
    height = max(max(a[2], b[2]), c[2]) + ROUNDED * (distance + radius)
    above = (height > _ZERO) & (distance - radius <= reach)
    if not some(above):
        return horizon
    for k in range(3):
        store_row(scratch, k, a[k])
        store_row(scratch, 3 + k, b[k])
        store_row(scratch, 6 + k, c[k])
    x, y, slope, nearness, sine = sphere_lanes(centre[0], centre[1], away, height, radius)
    store_row(scratch, 9, x)
    store_row(scratch, 10, y)
    store_row(scratch, 11, slope)
    store_row(scratch, 12, nearness)
    store_row(scratch, 13, sine)
    store_row(scratch, 14, off)
    while some(above):
        i = first(above)
        above = above & (lane_numbers() != np.int32(i))
        if scratch[13, i] < _ONE:
            seen, hidden = sphere_below(
                horizon, sectors[2], scratch[9, i], scratch[10, i], scratch[11, i], scratch[12, i]
            )
            if hidden:
                continue
            if scratch[13, i] < small:
                horizon = max(horizon, select(seen, scratch[11, i], _ZERO))
                continue
        horizon = _raise_over_triangle(
            horizon,
            (scratch[0, i], scratch[1, i], scratch[2, i]),
            (scratch[3, i], scratch[4, i], scratch[5, i]),
            (scratch[6, i], scratch[7, i], scratch[8, i]),
            scratch[14, i],
            sectors,
        )
    return horizon
