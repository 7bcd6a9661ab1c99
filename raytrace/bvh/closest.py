"""The point of a triangle that is closest to a point. Source: Ericson, Real-Time Collision Detection, 5.1.5."""

from ..kernel.jit import inline
from ..kernel.vector import add, dot, length, scale, subtract


@inline
def closest_on_triangle(p, a, b, c):
    """Distance of a point from a triangle, and the weights of b and c where it is closest."""
    ab, ac, ap = subtract(b, a), subtract(c, a), subtract(p, a)
    d1, d2 = dot(ab, ap), dot(ac, ap)
    bp, cp = subtract(p, b), subtract(p, c)
    d3, d4, d5, d6 = dot(ab, bp), dot(ac, bp), dot(ab, cp), dot(ac, cp)
    va, vb, vc = d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2
    u = v = 0.0
    if d1 <= 0.0 and d2 <= 0.0:
        near = a
    elif d3 >= 0.0 and d4 <= d3:
        u, near = 1.0, b
    elif d6 >= 0.0 and d5 <= d6:
        v, near = 1.0, c
    elif vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        u = d1 / (d1 - d3)
        near = add(a, scale(u, ab))
    elif vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        v = d2 / (d2 - d6)
        near = add(a, scale(v, ac))
    elif va <= 0.0 and d4 >= d3 and d5 >= d6:
        v = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        u, near = 1.0 - v, add(b, scale(v, subtract(c, b)))
    else:
        total = va + vb + vc
        u, v = vb / total, vc / total
        near = add(a, add(scale(u, ab), scale(v, ac)))
    return length(subtract(p, near)), u, v


@inline
def distance_to_triangle(p, a, b, c):
    return closest_on_triangle(p, a, b, c)[0]
