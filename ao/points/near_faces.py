"""Tests for faces near a cell of texels, over which w cannot be smooth: faces that rise beside it or lie over it.

Rays in a cone see what is near within the cone alone. So heights along its axis are multiplied by the tangent of half
its angle, as if every cone were one of 45°; a cone that is wider counts as one of 45°.
"""

import numpy as np

from obscurance.raytrace.bvh.closest import begin, closest_on_triangle, next_leaf
from obscurance.raytrace.kernel.jit import inline
from obscurance.raytrace.kernel.simd import lowest_bit
from obscurance.raytrace.kernel.vector import add, divide, dot, length, load, load_triangle, scale, subtract
from obscurance.raytrace.ray_origins.surface import front

_AROUND = 7.0  # times the way from a cell's centre to its points, in which nothing may rise
_OWN, _LEVEL = 0.25, 1e-3  # of the way in `_AROUND`: how far the cell reaches, and what is flat but for rounding
_DISC = 1.8  # times the way to a cell's points, in which all of the cell lies
_CHORD = 0.6  # of how far normals differ: how far a smooth surface's chord leans from their mean's plane, half and some
_STEP, _BALL = 1.5, 1.25  # between balls along a cone's axis, and their radius, by which they hold all that is around
_ORIGIN = (0.0, 0.0, 0.0)
LISTED = 128  # faces over a cell, at most, that may yet be of its own surface
_ELSEWHERE, _SURFACE, _ABOVE = range(3)
_OVER, _JOINED = range(2)  # rows of what is listed: faces, and whether they hang together with the surface


@inline
def has_near_faces(tree, stack, surface, place, reach, slope, listed):
    """Whether a face rises beside a cell, by more than a slope, or lies over it.

    Args:
        place: the point at the cell's centre, its face's normal, the hemisphere's axis, and the tangent of the cone.
        reach: the way to the cell's points. listed: int64 (2, LISTED), to be written.
    """
    point, side, axis, tangent = place
    level = _normal(side, axis, tangent)
    around_cell = _AROUND * reach
    balls = np.int64(np.ceil((1.0 / tangent - 1.0) / _STEP)) + 1
    radius = around_cell if balls == 1 else _BALL * around_cell
    over = 0
    for turn in range(2):  # what rises, and faces over the cell; then, if any, which of them hang together with it
        for ball in range(balls):
            around = begin(tree, stack, add(point, scale(ball * _STEP * around_cell, axis)), radius)
            leaf, near = next_leaf(tree, stack, around)
            while near != 0:
                while near != 0:
                    f = tree.leaf_faces[leaf, lowest_bit(near)]
                    near &= near - 1
                    triangle = _relative(surface, f, point, axis, tangent)
                    normal = _normal(front(surface, f), axis, tangent)
                    if turn == 0 and _rises(triangle, normal, level, around_cell, slope):
                        return True
                    where = _where(triangle, normal, level, (_DISC * reach, around_cell, slope, surface.rounding[f]))
                    if turn == 0 and where == _ABOVE:
                        if over == LISTED:
                            return True
                        listed[_OVER, over] = f
                        listed[_JOINED, over] = 0
                        over += 1
                    elif turn == 1 and where == _SURFACE:
                        _join(surface, f, listed, over)
                leaf, near = next_leaf(tree, stack, around)
        if over == 0:
            return False
    return not _hang_together(surface, listed, over)


@inline
def _relative(surface, f, point, axis, tangent):
    """The corners of a face relative to a point, heights along the axis multiplied by the tangent."""
    a, b, c = load_triangle(surface.vertices, surface.faces, f)
    a = subtract(a, point)
    b = subtract(b, point)
    c = subtract(c, point)
    if tangent == 1.0:
        return a, b, c
    less = 1.0 - tangent
    return (
        subtract(a, scale(less * dot(a, axis), axis)),
        subtract(b, scale(less * dot(b, axis), axis)),
        subtract(c, scale(less * dot(c, axis), axis)),
    )


@inline
def _normal(normal, axis, tangent):
    """The unit normal of a face whose heights along the axis are multiplied by the tangent."""
    if tangent == 1.0:
        return normal
    turned = add(normal, scale((1.0 / tangent - 1.0) * dot(normal, axis), axis))
    return divide(turned, length(turned))


@inline
def _rises(triangle, normal, level, around_cell, slope):
    """Whether a triangle rises above the plane through the origin, by more than a slope."""
    a, b, c = triangle
    height = max(dot(a, level), dot(b, level), dot(c, level))
    if height <= _LEVEL * slope * around_cell:
        return False
    distance = closest_on_triangle(_ORIGIN, a, b, c)[0]
    if distance > around_cell:
        return False
    if length(subtract(normal, level)) < slope:
        return abs(dot(a, normal)) > slope * max(distance, _LEVEL * around_cell)
    return height > slope * max(distance - _OWN * around_cell, 0.0)


@inline
def _where(triangle, normal, level, limits):
    """Where a triangle about level, either way round, is that reaches into the disc of a cell, seen from above.

    A chord of a smooth surface is perpendicular to the mean of the normals at its ends, about: the triangle may be of
    the surface through the origin, or lies above that.
    """
    radius, around_cell, slope, rounding = limits
    a, b, c = triangle
    ab = subtract(b, a)
    ac = subtract(c, a)
    height = dot(a, level)
    most = radius + _sum(ab) + _sum(ac)
    if dot(a, a) - height * height > most * most:  # most faces, at little cost
        return _ELSEWHERE
    if dot(normal, level) < 0.0:
        normal = scale(-1.0, normal)
    bent = length(subtract(normal, level))
    if bent >= slope or not _is_in_disc(triangle, level, radius):
        return _ELSEWHERE
    distance, u, v = closest_on_triangle(_ORIGIN, a, b, c)
    chord = add(a, add(scale(u, ab), scale(v, ac)))
    leaning = 0.5 * dot(chord, add(level, normal))
    allowed = _CHORD * bent * distance + rounding
    if distance > around_cell or leaning < -allowed:
        return _ELSEWHERE
    return _ABOVE if leaning > allowed else _SURFACE


@inline
def _is_in_disc(triangle, level, radius):
    """Whether the projection of a triangle reaches into a disc about the origin."""
    a, b, c = triangle
    a = subtract(a, scale(dot(a, level), level))
    b = subtract(b, scale(dot(b, level), level))
    c = subtract(c, scale(dot(c, level), level))
    return closest_on_triangle(_ORIGIN, a, b, c)[0] <= radius


@inline
def _sum(v):
    """The sum of the absolute coordinates: no less than the length."""
    return abs(v[0]) + abs(v[1]) + abs(v[2])


@inline
def _hang_together(surface, listed, over):
    """Whether all faces over a cell hang together by corners with its own surface."""
    joined = 0
    for i in range(over):
        joined += listed[_JOINED, i]
    before = -1
    while before < joined < over:
        before = joined
        for i in range(over):
            if listed[_JOINED, i]:
                joined += _join(surface, listed[_OVER, i], listed, over)
    return joined == over


@inline
def _join(surface, f, listed, over):
    """Note which listed faces have a corner where face f, of the cell's surface, has one; returns how many are new."""
    new = 0
    for k in range(over):
        if not listed[_JOINED, k] and _touch(surface, f, listed[_OVER, k]):
            listed[_JOINED, k] = 1
            new += 1
    return new


@inline
def _touch(surface, f, g):
    """Whether two faces have a corner at the same place."""
    for i in range(3):
        corner = load(surface.vertices, surface.faces[f, i])
        for j in range(3):
            if corner == load(surface.vertices, surface.faces[g, j]):
                return True
    return False
