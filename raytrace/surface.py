"""From a hit to a point that can be lit: position, normals by the chosen interpolation, and a safe ray origin."""

from __future__ import annotations

import numpy as np

from .entries import (
    DEPTH,
    FRONT,
    GEOMETRIC,
    GRAIN,
    NORMAL,
    OBJECT,
    ORIGIN,
    POINT,
    TINT,
    VIEW,
    W,
)
from .jit import inline
from .models.rows import ELLIPTICAL_BECKMANN, POULIN_FOURNIER, TWO_SIDED
from .placement import OFFSET_ULPS, ULP
from .shading import centroid, phong_normal, quadratic_normal
from .vector import add, cross, dot, load, scale, subtract, unit

CONSTANT, GOURAUD, PHONG, QUADRATIC = range(4)
VERTEX_CLEARANCE = 0.1  # a vertex normal may lean that far from a face around it
SMOOTH = 0.8660254037844387  # cos 30°: a computed normal that leans away farther marks a hard edge


@inline
def put(entry, column, a):
    """Store a triple."""
    entry[column], entry[column + 1], entry[column + 2] = a


@inline
def take(entry, column):
    """Read a triple."""
    return entry[column], entry[column + 1], entry[column + 2]


@inline
def rotate(matrix, a):
    """The linear part of `matrix` (3, ≥3) times a."""
    return (
        matrix[0, 0] * a[0] + matrix[0, 1] * a[1] + matrix[0, 2] * a[2],
        matrix[1, 0] * a[0] + matrix[1, 1] * a[1] + matrix[1, 2] * a[2],
        matrix[2, 0] * a[0] + matrix[2, 1] * a[1] + matrix[2, 2] * a[2],
    )


@inline
def transform(matrix, a):
    """`matrix` (3, 4) times the point a."""
    return add(rotate(matrix, a), (matrix[0, 3], matrix[1, 3], matrix[2, 3]))


@inline
def corner_normal(geometry, item, vertex, face):
    """A corner's unit normal in the world: the source's own, or a computed one unless it marks a hard edge."""
    n = load(geometry.normals, vertex)
    if not geometry.placed[item]:
        n = unit(rotate(geometry.normal_to_world[item], n))
    if geometry.authored[item]:
        return n if dot(n, n) > 0.0 else face
    return n if dot(n, face) > SMOOTH else face


@inline
def corner(geometry, item, vertex):
    """A vertex's place in the world."""
    p = load(geometry.vertices, vertex)
    return p if geometry.placed[item] else transform(geometry.to_world[item], p)


@inline
def lift(geometry, item, point, normal, largest):
    """`point` moved along `normal` by more than the rounding of a hit on a triangle of coordinates up to `largest`."""
    size = max(geometry.magnitude[item], largest)
    ulps = OFFSET_ULPS * ULP * (abs(normal[0]) + abs(normal[1]) + abs(normal[2]))
    return add(point, scale(ulps * size, normal))


@inline
def smooth_origin(p, p0, p1, p2, n0, n1, n2, u, v):
    """The point on the surface that the normals describe, above `p` where the face cuts a convex one short.

    Source: Hanika 2021, "Hacking the Shadow Terminator".
    """
    d0 = min(0.0, dot(subtract(p, p0), n0))
    d1 = min(0.0, dot(subtract(p, p1), n1))
    d2 = min(0.0, dot(subtract(p, p2), n2))
    rise = add(add(scale((1.0 - u - v) * d0, n0), scale(u * d1, n1)), scale(v * d2, n2))
    return subtract(p, rise)


@inline
def tangent(geometry, i, j, k, edge1, edge2):
    """Unit direction in which u grows over the face, zero without texture coordinates."""
    du1, dv1 = geometry.uv[j, 0] - geometry.uv[i, 0], geometry.uv[j, 1] - geometry.uv[i, 1]
    du2, dv2 = geometry.uv[k, 0] - geometry.uv[i, 0], geometry.uv[k, 1] - geometry.uv[i, 1]
    area = np.float64(du1 * dv2 - du2 * dv1)
    if area == 0.0:
        return (0.0, 0.0, 0.0)
    return unit(scale(1.0 / area, subtract(scale(np.float64(dv2), edge1), scale(np.float64(dv1), edge2))))


@inline
def fill(entry, geometry, item, face, u, v, depth, backward, shading, terminator):
    """Write an entry for a hit.

    Args: item: row of the object; face: of its shape; u, v: barycentrics; depth: distance to the viewer; backward: unit
        direction against the viewing ray.
    """
    f = geometry.first_face[item] + face
    i, j, k = geometry.faces[f, 0], geometry.faces[f, 1], geometry.faces[f, 2]
    p0, p1, p2 = corner(geometry, item, i), corner(geometry, item, j), corner(geometry, item, k)
    edge1, edge2 = subtract(p1, p0), subtract(p2, p0)
    point = add(p0, add(scale(u, edge1), scale(v, edge2)))
    geometric = scale(geometry.mirrored[item], unit(cross(edge1, edge2)))
    n0 = corner_normal(geometry, item, i, geometric)
    n1 = corner_normal(geometry, item, j, geometric)
    n2 = corner_normal(geometry, item, k, geometric)
    side = 1.0 if dot(geometric, backward) >= 0.0 else -1.0
    entry[FRONT] = 1.0 if side > 0.0 or geometry.rows[item, TWO_SIDED] == 1.0 else 0.0
    geometric, n0, n1, n2 = scale(side, geometric), scale(side, n0), scale(side, n1), scale(side, n2)

    origin, lit, normal = point, point, geometric
    if shading == CONSTANT:
        lit = centroid(p0, p1, p2)
    else:
        if terminator:
            origin = smooth_origin(point, p0, p1, p2, n0, n1, n2, u, v)
        if shading == QUADRATIC:
            normal = quadratic_normal(p0, p1, p2, n0, n1, n2, u, v)
        else:
            normal = phong_normal(n0, n1, n2, u, v)
    largest = 0.0
    for axis in range(3):
        largest = max(largest, abs(p0[axis]), abs(p1[axis]), abs(p2[axis]))
    put(entry, POINT, lit)
    put(entry, ORIGIN, lift(geometry, item, origin, geometric, largest))
    put(entry, NORMAL, normal)
    put(entry, VIEW, backward)
    kind = geometry.kinds[item]
    grain = (0.0, 0.0, 0.0)
    if kind in (ELLIPTICAL_BECKMANN, POULIN_FOURNIER):
        grain = tangent(geometry, i, j, k, edge1, edge2)
    put(entry, GRAIN, grain)
    put(entry, TINT, (1.0, 1.0, 1.0))
    put(entry, GEOMETRIC, geometric)
    own = geometry.first_w[item] - geometry.first_vertex[item]
    entry[W] = (1.0 - u - v) * geometry.w[own + i] + u * geometry.w[own + j] + v * geometry.w[own + k]
    entry[OBJECT] = item
    entry[DEPTH] = depth


@inline
def vertex_entry(entry, geometry, item, vertex, eye, forward, orthographic):
    """Write an entry for a vertex (its row in the shape's arrays) as Gouraud shading lights it."""
    point = corner(geometry, item, vertex)
    normal = unit(rotate(geometry.normal_to_world[item], load(geometry.normals, vertex)))
    backward = scale(-1.0, forward) if orthographic else unit(subtract(eye, point))
    side = 1.0 if dot(normal, backward) >= 0.0 else -1.0
    entry[FRONT] = 1.0 if side > 0.0 or geometry.rows[item, TWO_SIDED] == 1.0 else 0.0
    normal = scale(side, normal)
    largest = max(abs(point[0]), abs(point[1]), abs(point[2]))
    put(entry, POINT, point)
    put(entry, ORIGIN, lift(geometry, item, point, scale(1.0 / VERTEX_CLEARANCE, normal), largest))
    put(entry, NORMAL, normal)
    put(entry, VIEW, backward)
    put(entry, GRAIN, (0.0, 0.0, 0.0))
    put(entry, TINT, (1.0, 1.0, 1.0))
    put(entry, GEOMETRIC, normal)
    entry[OBJECT] = item
