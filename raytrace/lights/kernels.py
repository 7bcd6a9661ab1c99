"""Light that arrives at a point, and conservative tests for lights that cannot matter there or anywhere in a box.

Skipping is exact for a threshold of zero. With a threshold ε > 0 every skipped light would have brought at most ε of
incident light in each channel, so what k skipped lights would have reflected is at most k ε times the material's
`reflect` value: at most k ε for Phong-type materials, ρ k ε/π for Lambert.
"""

from math import acos, asin, inf, pi, sqrt

from ..kernel.jit import inline
from ..kernel.simd import select
from ..kernel.vector import add, dot, scale, subtract, triple, unit
from . import layout

FLOOR = 1e-30  # of the attenuation's denominator: finite at the light itself


@inline
def radial(row, distance):
    """1/(a0 + a1 d + a2 d²) (12.26), times the window of the range."""
    part = min(1.0, distance * row[layout.INVERSE_RANGE])
    part *= part
    a0, a1, a2 = triple(row, layout.RADIAL)
    return (1.0 - part * part) / max(FLOOR, a0 + distance * (a1 + distance * a2))


@inline
def angular(row, cosine):
    """cos^{a_l} φ within the cone, 0 outside, φ the angle to the spot's axis."""
    return select(cosine < row[layout.COS_HALF_ANGLE], 0.0, max(0.0, min(1.0, cosine)) ** row[layout.EXPONENT])


@inline
def towards(kind, row, point):
    """(l, distance): unit direction to the light and how far it is, for the shadow ray.

    The point may be a triple of lanes. Directional: distance is infinite. Ambient light has no direction: l = 0,
    distance 0, so that no material reflects it through n·l. At the very place of a point light l = 0 too.
    """
    zero = scale(0.0, point)  # of the point's own type
    if kind == layout.AMBIENT:
        return zero, zero[0]
    if kind == layout.DIRECTIONAL:
        return subtract(zero, triple(row, layout.DIRECTION)), zero[0] + inf
    way = subtract(triple(row, layout.POSITION), point)
    return unit(way), sqrt(dot(way, way))


@inline
def incident(kind, row, point):
    """(l, distance, RGB): `towards` the light, and what arrives of it unshadowed. Add k_a I_a for ambient light."""
    intensity = triple(row, layout.INTENSITY)
    l, distance = towards(kind, row, point)
    if kind in (layout.AMBIENT, layout.DIRECTIONAL):
        return l, distance, add(scale(0.0, point), intensity)
    factor = radial(row, distance)
    if kind == layout.SPOT:
        factor *= angular(row, -dot(l, triple(row, layout.DIRECTION)))
    return l, distance, scale(factor, intensity)


@inline
def cannot_matter_at(kind, row, point, normal, threshold):
    """Whether the light is behind `point`, does not reach it, or brings at most `threshold` in every channel.

    Not for two-sided materials where n·l ≤ 0: a light behind them matters.
    """
    l, _, rgb = incident(kind, row, point)
    if kind != layout.AMBIENT and dot(normal, l) <= 0.0:
        return True
    return max(rgb[0], rgb[1], rgb[2]) <= threshold


@inline
def cannot_matter_in(kind, row, low, high, axis, spread, threshold):
    """Whether `cannot_matter_at` holds in all of the box [low, high] for all normals within `spread` of `axis`.

    Conservative: the box is bounded by its sphere where angles are concerned, by its nearest point for attenuation.
    """
    brightest = max(row[layout.INTENSITY], row[layout.INTENSITY + 1], row[layout.INTENSITY + 2])
    if kind == layout.AMBIENT:
        return brightest <= threshold
    if kind == layout.DIRECTIONAL:
        return brightest <= threshold or turned_away(scale(-1.0, triple(row, layout.DIRECTION)), 0.0, axis, spread)

    place = triple(row, layout.POSITION)
    nearest = 0.0
    for k in range(3):
        gap = max(low[k] - place[k], place[k] - high[k], 0.0)
        nearest += gap * gap
    # the hair's breadth covers the rounding of the distance
    if brightest * radial(row, sqrt(nearest) * (1.0 - 1e-12)) <= threshold:
        return True

    centre = (0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]), 0.5 * (low[2] + high[2]))
    towards, half = subtract(place, centre), scale(0.5, subtract(high, low))
    distance, radius = sqrt(dot(towards, towards)), sqrt(dot(half, half))
    if distance <= radius:
        return False
    opening = asin(radius / distance)
    l = scale(1.0 / distance, towards)
    if turned_away(l, opening, axis, spread):
        return True
    outside = row[layout.HALF_ANGLE] + opening + 1e-9
    return kind == layout.SPOT and angle(scale(-1.0, l), triple(row, layout.DIRECTION)) > outside


@inline
def angle(a, b):
    """Angle between unit vectors, radians."""
    return acos(max(-1.0, min(1.0, dot(a, b))))


@inline
def turned_away(l, opening, axis, spread):
    """Whether every normal within `spread` of `axis` turns away from every direction within `opening` of l."""
    return spread < 0.5 * pi and angle(l, axis) >= 0.5 * pi + opening + spread + 1e-9
