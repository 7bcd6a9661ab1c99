"""Interpolation over a triangle: constant, Gouraud, Phong and quadratic shading, as kernels.

All take a hit's barycentrics as Embree gives them: u, v weigh corners 1 and 2, and 1 − u − v weighs corner 0. Points,
normals and colours are triples of floats, or of lanes of them. A normal that does not exist is the zero vector, which
reflects nothing.

- constant: light `centroid` with the face's own normal once, for the whole face;
- Gouraud 1971: light the corners, then `interpolate` their colours;
- Phong 1975: light the hit with `phong_normal`;
- quadratic, van Overveld & Wyvill 1997: light the hit with `quadratic_normal`, which turns where linear
  interpolation stays flat.
"""

from ..kernel.jit import inline
from ..kernel.simd import select
from ..kernel.vector import add, dot, scale, subtract, unit


@inline
def interpolate(a0, a1, a2, u, v):
    """(1 − u − v) a0 + u a1 + v a2: positions, colours, texture coordinates."""
    return add(add(scale(1.0 - u - v, a0), scale(u, a1)), scale(v, a2))


@inline
def centroid(p0, p1, p2):
    """The point at which a constantly shaded face is lit."""
    return scale(1.0 / 3.0, add(add(p0, p1), p2))


@inline
def phong_normal(n0, n1, n2, u, v):
    """Linear interpolation of unit normals, renormalised."""
    return unit(interpolate(n0, n1, n2, u, v))


@inline
def edge_term(p0, p1, n0, n1):
    """n_ij = n_i + n_j − a_ij, where a = 3((n_i + n_j)·w)/(w·w) w makes ∫ n(s)·w ds = 0 along the edge w."""
    total = add(n0, n1)
    w = subtract(p1, p0)
    length2 = dot(w, w)
    return subtract(total, scale(select(length2 > 0.0, 3.0 * dot(total, w) / length2, 0.0), w))


@inline
def quadratic_normal(p0, p1, p2, n0, n1, n2, u, v):
    """n = Σ n_i λ_i² + Σ_{i<j} n_ij λ_i λ_j, renormalised; on an edge it is n0 + b s + a s² of the paper."""
    t = 1.0 - u - v
    squares = add(add(scale(t * t, n0), scale(u * u, n1)), scale(v * v, n2))
    along_first = edge_term(p0, p1, n0, n1)
    second = edge_term(p1, p2, n1, n2)
    third = edge_term(p0, p2, n0, n2)
    return unit(add(add(squares, scale(t * u, along_first)), add(scale(u * v, second), scale(t * v, third))))
