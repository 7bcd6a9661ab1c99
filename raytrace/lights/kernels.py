"""Light that arrives at a point, and a conservative test for lights that bring nothing to a whole box."""

from math import acos, asin, inf, sqrt
from typing import Any

from ..kernel.jit import inline
from ..kernel.simd import select
from ..kernel.vector import add, dot, scale, subtract, tangents, triple, unit
from ..types import Float64s
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
    offset = subtract(triple(row, layout.POSITION), point)
    return unit(offset), sqrt(dot(offset, offset))


@inline
def towards_disc(kind, row, towards_centre, x, y):
    """(l, distance) to the place (x, y) on the unit disc of a light whose disc faces the point.

    Args: all but `kind` and `row` may be lanes; towards_centre: of `towards`.
    """
    l, distance = towards_centre
    across, along = tangents(l)
    shift = scale(row[layout.RADIUS], add(scale(x, across), scale(y, along)))
    if kind == layout.DIRECTIONAL:
        return unit(add(l, shift)), distance
    offset = add(scale(distance, l), shift)
    return unit(offset), sqrt(dot(offset, offset))


@inline
def incident(kind: int, row: Float64s, point: tuple[float, float, float]) -> Any:
    """(l, distance, RGB): `towards` the light, and what arrives of it unshadowed. Add k_a I_a for ambient light."""
    intensity = triple(row, layout.INTENSITY)
    l, distance = towards(kind, row, point)
    if kind in (layout.AMBIENT, layout.DIRECTIONAL):
        return l, distance, add(scale(0.0, point), intensity)
    factor = radial(row, distance)
    if kind == layout.SPOT:
        cosine = -dot(l, triple(row, layout.DIRECTION))
        power = max(0.0, min(1.0, cosine)) ** row[layout.EXPONENT]  # cos^{a_l} φ within the cone
        factor *= select(cosine < row[layout.COS_HALF_ANGLE], 0.0, power)
    return l, distance, scale(factor, intensity)


@inline
def cannot_matter_in(kind, row, low, high):
    """Whether the light brings nothing to any point of the box [low, high]; False where that is not certain.

    The box is bounded by its sphere where angles are concerned, by its nearest point for attenuation.
    """
    brightest = max(row[layout.INTENSITY], row[layout.INTENSITY + 1], row[layout.INTENSITY + 2])
    if kind in (layout.AMBIENT, layout.DIRECTIONAL):
        return brightest <= 0.0
    position = triple(row, layout.POSITION)
    nearest = 0.0
    for k in range(3):
        gap = max(low[k] - position[k], position[k] - high[k], 0.0)
        nearest += gap * gap
    # the hair's breadth covers the rounding of the distance
    if brightest * radial(row, sqrt(nearest) * (1.0 - 1e-12)) <= 0.0:
        return True
    offset = subtract(position, scale(0.5, add(low, high)))
    half = scale(0.5, subtract(high, low))
    distance = sqrt(dot(offset, offset))
    radius = sqrt(dot(half, half))
    if kind != layout.SPOT or distance <= radius:
        return False
    cosine = -dot(scale(1.0 / distance, offset), triple(row, layout.DIRECTION))
    return acos(max(-1.0, min(1.0, cosine))) > row[layout.HALF_ANGLE] + asin(radius / distance) + 1e-9
