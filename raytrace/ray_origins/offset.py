"""Distances of ray origins from the surface: beyond rounding errors, and short of the next face."""

import numpy as np

from ..bvh.closest import distance_to_triangle
from ..kernel.arrays import product
from ..kernel.borrow import borrow
from ..kernel.jit import bound, inline, kernel
from ..kernel.vector import add, dot, load, load_triangle, scale, subtract
from ..mesh.placement import LEAST, TOUCHING, ULP
from ..system.threads import run_blocks, thread_count
from ..types import Float64s

OFFSET_ULPS = 16.0  # 4 were enough in 20,000 trials
_BLURRED = 5.0  # offsets within which rounding has a say in what a point sees of a face, and where faces are looked for
_BLOCK = 1 << 13  # points
_LEAST = 0.25  # of an offset
_NEAR = 1.0 / 64.0  # of the shortest edge


def ray_offset(directions: Float64s, magnitude: Float64s, clearance: Float64s) -> Float64s:
    """Distance (n,) along unit `directions` (n, 3) at which an origin is surely above the surface that it starts on.

    Args:
        magnitude: (n,), the largest |coordinate| among the corners of the faces that meet there.
        clearance: (n,), the smallest cosine between the direction and those faces' normals; below .01 it counts as .01.
    """
    return OFFSET_ULPS * ULP * product(np.abs(directions), np.ones(3)) * magnitude / np.maximum(clearance, 0.01)


def offsets_and_reaches(
    points: Float64s, directions: Float64s, magnitude: Float64s, clearance: Float64s
) -> tuple[Float64s, Float64s, Float64s]:
    """`ray_offset`, `contact_radius`, and within what distance to look for faces, −1 without a direction: (n,) each.

    Args: points: (n, 3), directions, magnitude, clearance: as `ray_offset` takes them.
    """
    found = np.empty((3, len(points)))
    work = bound(_offsets_and_reaches, points, directions, magnitude, clearance, found)
    run_blocks(len(points), _BLOCK, work, thread_count(None))
    return found[0], found[1], found[2]


@kernel
def _offsets_and_reaches(points, directions, magnitude, clearance, found, first, last):
    offset, touching, reach = found
    for i in range(first, last):
        direction, point = load(directions, i), load(points, i)
        offset[i] = OFFSET_ULPS * ULP * _span(direction) * magnitude[i] / max(clearance[i], 0.01)
        touching[i] = TOUCHING * ULP * max(_span(point), LEAST)
        reach[i] = max(_BLURRED * offset[i], touching[i])  # so far that turning a direction seldom asks for more
        if direction == (0.0, 0.0, 0.0):
            reach[i] = -1.0


@inline
def _span(v):
    return abs(v[0]) + abs(v[2]) + abs(v[1])


def stay_near(offset: Float64s, edge: Float64s) -> Float64s:
    """Offsets (k,) in folds cut to a 64th of the shortest edges (k,) there, but to a quarter of themselves at most."""
    return np.clip(_NEAR * edge, _LEAST * offset, offset)


@kernel
def stop_short(offset, points, directions, touching, near, surface):
    """Cut each offset to half the way to the first face that twice of it would pass, touched faces left out.

    Args:
        offset: float64 (k,). points, directions: float64 (k, 3), directions unit or zero.
        touching: float64 (k,), the least distance from a face at which a point does not touch it.
        near: Contacts of the points. surface: Surface.
    """
    near, surface = borrow(near), borrow(surface)
    for i in range(len(near.point)):
        row, f = near.point[i], near.face[i]
        p, direction, n = load(points, row), load(directions, row), load(surface.normals, f)
        a, b, c = load_triangle(surface.vertices, surface.faces, f)
        facing = dot(n, direction)
        if facing != 0.0:
            ahead = dot(n, subtract(a, p)) / facing
            touched = max(touching[row], surface.rounding[f])
            passed = touched < ahead < 2.0 * offset[row]
            if passed and distance_to_triangle(add(p, scale(ahead, direction)), a, b, c) <= touched:
                offset[row] = min(offset[row], 0.5 * ahead)
