"""Polygons of more than three corners as kernels read them: centre, Newell normal and outline of each."""

from typing import NamedTuple

import numpy as np

from ..kernel.arrays import counting_sort
from ..kernel.jit import inline, kernel
from ..kernel.vector import add, cross, dot, load, load_triangle, scale, store, subtract, unit
from ..sampling import hash32
from ..types import Float32Rows, Float32s, Float64Rows, Int32Rows, Int32s, Int64Rows, Int64s

_TURNED = 1e-5  # of twice a polygon's area: a triangle turned over by more than this is one of a fold


class Polygons(NamedTuple):
    """Polygons of a mesh whose triangles all face the way of the Newell normal."""

    of: Int32s  # (m,), the polygon of each face, −1 for none
    centres: Float64Rows  # (p, 3), mean of the corners
    normals: Float64Rows  # (p, 3), unit Newell normals
    edges: Int32Rows  # (e, 2), vertices of the outlines' edges, polygon after polygon
    counts: Int32s  # (p,), edges of each


def mesh_polygons(vertices: Float32s, faces: Int32s, polygon_of: Int64s | None) -> Polygons:
    """The polygons of a mesh. Args: polygon_of: as `Mesh.polygons`."""
    _, number = np.unique(np.arange(0) if polygon_of is None else polygon_of, return_inverse=True)
    order, starts = counting_sort(number, int(number.max(initial=-1)) + 1)
    sizes = np.diff(starts)
    most = int((sizes > 1).sum())
    places = 3 * int(sizes[sizes > 1].sum())
    of = np.full(len(faces), -1, np.int32)
    counts = np.empty(most, np.int32)
    out = Polygons(of, np.empty((most, 3)), np.empty((most, 3)), np.empty((places, 2), np.int32), counts)
    slots = np.empty((2, _slots(int(sizes.max(initial=0)))), np.int64)
    count, used = _find_polygons(vertices, faces, order, starts, slots, out)
    return Polygons(out.of, out.centres[:count], out.normals[:count], out.edges[:used].copy(), out.counts[:count])


@inline
def _slots(faces: int) -> int:
    """Places of a hash table for the edges of a polygon of so many faces: a power of two, half of them free."""
    size = 8
    while size < 6 * faces:
        size *= 2
    return size


@kernel
def _find_polygons(
    vertices: Float32Rows, faces: Int32Rows, order: Int64s, starts: Int64s, slots: Int64Rows, out: Polygons
) -> tuple[int, int]:
    """Fill `out`; returns the number of polygons and of edges.

    Args: order, starts: of `counting_sort`, the faces by polygon. slots: int64 (2, …), scratch for the largest.
    """
    count = used = 0
    for polygon in range(len(starts) - 1):
        triangles = order[starts[polygon] : starts[polygon + 1]]
        newell = (0.0, 0.0, 0.0)  # Martin Newell's (a, b, c), the same whichever triangles the polygon is cut into
        for f in triangles:
            newell = add(newell, _twice_area(vertices, faces, f))
        if len(triangles) < 2 or _folded(vertices, faces, triangles, newell):
            continue
        # Count the directed edges of its triangles.
        size = _slots(len(triangles))
        slots[0, :size], slots[1, :size] = -1, 0
        for half in range(3 * len(triangles)):  # the two sides of a diagonal cancel
            a, b = _half_edge(faces, triangles, half)
            slots[1, _slot(slots, size, a, b)] += 1 if a < b else -1
        first_edge, centre = used, (0.0, 0.0, 0.0)
        for half in range(3 * len(triangles)):
            a, b = _half_edge(faces, triangles, half)
            if a != b and slots[1, _slot(slots, size, a, b)] * (1 if a < b else -1) > 0:
                out.edges[used, 0], out.edges[used, 1] = a, b
                centre = add(centre, load(vertices, a))
                used += 1
        # Record the polygon.
        for f in triangles:
            out.of[f] = count
        store(out.centres, count, scale(1.0 / (used - first_edge), centre))
        store(out.normals, count, unit(newell))
        out.counts[count] = used - first_edge
        count += 1
    return count, used


@inline
def _twice_area(vertices, faces, f):
    """Normal of a face, as long as its area twice."""
    a, b, c = load_triangle(vertices, faces, f)
    return cross(subtract(b, a), subtract(c, a))


@inline
def _folded(vertices, faces, triangles, newell):
    """Whether a polygon has no area, or triangles turned over. Args: newell: its normal, as long as its area twice."""
    limit = _TURNED * dot(newell, newell)
    for f in triangles:
        if dot(_twice_area(vertices, faces, f), newell) < -limit:
            return True
    return limit == 0.0


@inline
def _half_edge(faces, triangles, half):
    """The two vertices of the half-edge of this number, three to a face."""
    f = triangles[half // 3]
    corner = half % 3
    return faces[f, corner], faces[f, (corner + 1) % 3]


@inline
def _slot(slots, size, a, b):
    """The slot of a polygon's edge, of the first `size`; a new edge is entered."""
    key = min(a, b) << 32 | max(a, b)
    at = np.int64(hash32(hash32(a) + hash32(b))) & (size - 1)
    while slots[0, at] >= 0 and slots[0, at] != key:
        at = (at + 1) & (size - 1)
    slots[0, at] = key
    return at
