"""Three-vectors for kernels: tuples of three floats, or of three lanes of floats, which stay in registers."""

from math import atan2, sqrt

import numpy as np

from .jit import inline
from .simd import select


@inline
def load(array, i):
    """Row `i` of an (n, 3) array as a double-precision tuple."""
    return (np.float64(array[i, 0]), np.float64(array[i, 1]), np.float64(array[i, 2]))


@inline
def triple(row, column):
    """Three consecutive columns of a row."""
    return row[column], row[column + 1], row[column + 2]


@inline
def column(rows, first, step, lane):
    """The vector in one lane of three rows of an array: `first`, first + step and first + 2·step."""
    return rows[first, lane], rows[first + step, lane], rows[first + 2 * step, lane]


@inline
def load_triangle(vertices, faces, f):
    """The corners of face `f` of `faces` (m, 3), rows of `vertices` (n, 3)."""
    return load(vertices, faces[f, 0]), load(vertices, faces[f, 1]), load(vertices, faces[f, 2])


@inline
def store(array, i, a):
    """Write a triple to row `i` of an (n, 3) array."""
    array[i, 0], array[i, 1], array[i, 2] = a


@inline
def dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inline
def cross(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


@inline
def scale(s, a):
    return (s * a[0], s * a[1], s * a[2])


@inline
def divide(a, s):
    return (a[0] / s, a[1] / s, a[2] / s)


@inline
def multiply(a, b):
    """Componentwise product: light through a colour."""
    return (a[0] * b[0], a[1] * b[1], a[2] * b[2])


@inline
def add(a, b):
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


@inline
def subtract(a, b):
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


@inline
def length(a):
    return sqrt(dot(a, a))


@inline
def angle_between(a, b):
    """Angle between two vectors of any length, in radians."""
    return atan2(length(cross(a, b)), dot(a, b))


@inline
def choose(condition, a, b):
    """a where the condition holds, else b."""
    return (select(condition, a[0], b[0]), select(condition, a[1], b[1]), select(condition, a[2], b[2]))


@inline
def unit(a):
    """a/|a|; the zero vector for a vector without a direction: shorter than 1e-150, in lanes of float32 1e-22."""
    square = dot(a, a)
    return scale(select(square > 1e-300, 1.0 / sqrt(square), 0.0), a)


@inline
def mirror(n, l):
    """r = 2(n·l)n − l: direction `l` mirrored about the unit normal `n`."""
    return subtract(scale(2.0 * dot(n, l), n), l)


@inline
def halfway(l, v):
    """h = (l+v)/|l+v| (12.24); the zero vector for l = −v."""
    return unit(add(l, v))


@inline
def tangents(n):
    """Unit tangents (t, n × t) of the unit normal `n` (Duff et al. 2017)."""
    sign = select(n[2] >= 0.0, 1.0, -1.0)
    a = -1.0 / (sign + n[2])
    b = n[0] * n[1] * a
    return (1.0 + sign * n[0] * n[0] * a, sign * b, -sign * n[0]), (b, sign + n[1] * n[1] * a, -n[1])


@inline
def perpendicular(n, grain):
    """Unit tangents (g, n × g): `grain` projected into the plane of the unit normal `n`; some if it is along that."""
    projected = subtract(grain, scale(dot(grain, n), n))
    axis = choose(abs(n[0]) < 0.6, (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    without = dot(projected, projected) <= 1e-20 * dot(grain, grain)
    g = unit(choose(without, subtract(axis, scale(dot(axis, n), n)), projected))
    return g, cross(n, g)
