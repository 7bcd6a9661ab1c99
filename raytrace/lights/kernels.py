"""Light that arrives at a point, and a conservative test for lights that bring nothing to a whole box.

A kernel reads a light as an integer kind and a row of `WIDTH` float64, whose columns are named here.
"""

from math import acos, asin, inf, sqrt
from typing import Any

from ..kernel.jit import inline
from ..kernel.simd import select
from ..kernel.vector import add, dot, scale, subtract, tangents, triple, unit
from ..types import Float64s

POINT, DIRECTIONAL, SPOT, AMBIENT = range(4)

INTENSITY = 0  # RGB
POSITION = 3  # of point and spot lights
DIRECTION = 6  # unit, the way the light travels
RADIAL = 9  # a0, a1, a2
COS_HALF_ANGLE, HALF_ANGLE = 12, 13  # of a spot's cone, radians
EXPONENT = 14  # of the cosine within the cone
INVERSE_RANGE = 15  # 1/range, 0 without end
RADIUS = 16  # of the disc that shines; of a directional light the tangent of half its angular diameter
DIFFUSE, SPECULAR = 17, 20  # RGB in [0, 1] of INTENSITY, what is reflected diffusely, and what highlights reflect
WIDTH = 23

ZENITH, HORIZON, GROUND, UP, SKY_WIDTH = 0, 3, 6, 9, 12  # of a sky's row: three RGB, and the unit direction upwards
MAP_WIDTH, MAP_HEIGHT = 128, 64  # texels of an image all around
MAPS, MAP_SLOPE = 5, 0.1  # its maps: of slope 0, `MAP_SLOPE`, and then twice as rough each
FLOOR = 1e-30  # of the attenuation's denominator: finite at the light itself


@inline
def radial(row, distance):
    """1/(a0 + a1 d + a2 d²) (12.26), times the window of the range."""
    part = min(1.0, distance * row[INVERSE_RANGE])
    part *= part
    a0, a1, a2 = triple(row, RADIAL)
    return (1.0 - part * part) / max(FLOOR, a0 + distance * (a1 + distance * a2))


@inline
def towards(kind, row, point):
    """(l, distance): unit direction to the light and how far it is, for the shadow ray.

    The point may be a triple of lanes. Directional: distance is infinite. Ambient light has no direction: l = 0,
    distance 0, so that no material reflects it through n·l. At the very place of a point light l = 0 too.
    """
    zero = scale(0.0, point)  # of the point's own type
    if kind == AMBIENT:
        return zero, zero[0]
    if kind == DIRECTIONAL:
        return subtract(zero, triple(row, DIRECTION)), zero[0] + inf
    offset = subtract(triple(row, POSITION), point)
    return unit(offset), sqrt(dot(offset, offset))


@inline
def towards_disc(kind, row, towards_centre, x, y):
    """(l, distance) to the place (x, y) on the unit disc of a light whose disc faces the point.

    Args: all but `kind` and `row` may be lanes; towards_centre: of `towards`.
    """
    l, distance = towards_centre
    across, along = tangents(l)
    shift = scale(row[RADIUS], add(scale(x, across), scale(y, along)))
    if kind == DIRECTIONAL:
        return unit(add(l, shift)), distance
    offset = add(scale(distance, l), shift)
    return unit(offset), sqrt(dot(offset, offset))


@inline
def incident(kind: int, row: Float64s, point: tuple[float, float, float]) -> Any:
    """(l, distance, RGB): `towards` the light, and what arrives of it unshadowed. Add k_a I_a for ambient light."""
    intensity = triple(row, INTENSITY)
    l, distance = towards(kind, row, point)
    if kind in (AMBIENT, DIRECTIONAL):
        return l, distance, add(scale(0.0, point), intensity)
    factor = radial(row, distance)
    if kind == SPOT:
        cosine = -dot(l, triple(row, DIRECTION))
        power = max(0.0, min(1.0, cosine)) ** row[EXPONENT]  # cos^{a_l} φ within the cone
        factor *= select(cosine < row[COS_HALF_ANGLE], 0.0, power)
    return l, distance, scale(factor, intensity)


@inline
def cannot_matter_in(kind, row, low, high):
    """Whether the light brings nothing to any point of the box [low, high]; False where that is not certain.

    The box is bounded by its sphere where angles are concerned, by its nearest point for attenuation.
    """
    brightest = max(row[INTENSITY], row[INTENSITY + 1], row[INTENSITY + 2])
    if kind in (AMBIENT, DIRECTIONAL):
        return brightest <= 0.0
    position = triple(row, POSITION)
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
    if kind != SPOT or distance <= radius:
        return False
    cosine = -dot(scale(1.0 / distance, offset), triple(row, DIRECTION))
    return acos(max(-1.0, min(1.0, cosine))) > row[HALF_ANGLE] + asin(radius / distance) + 1e-9
