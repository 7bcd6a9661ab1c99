"""Sixteen triangles against the rays of a point, by the planes through the point and each edge.

A ray of direction ω from the point meets a triangle a, b, c, relative to the point, where it lies on the same side of
the planes a × b, b × c and c × a, at the distance a·N/ω·N with the triangle's normal N (Amanatides & Choi 1997, Ray
Tracing Triangular Meshes). Two triangles that share an edge get its plane with opposite signs, bit for bit, so that no
ray slips between them. With 2 a × b = (a − b) × (a + b), as Embree does it, long edges near the point lose no digits;
where a corner is near, a × b does. Nothing is allowed for rounding: near a corner it would be a wide angle.
"""

import numpy as np

from obscurance.raytrace.kernel.jit import inline
from obscurance.raytrace.kernel.simd import (
    WIDE,
    bits,
    load_row,
    lowest,
    lowest_bit,
    multiply_add,
    pick,
    select,
    some,
    store_row,
)
from obscurance.raytrace.kernel.vector import add, choose, column, dot, scale, subtract

from .layers import alpha_test, has_alpha
from .ray_blocks import (
    ONE,
    SLACK,
    T_MISS,
    ZERO,
    along,
    blocks_within,
    cone_around,
    deactivate,
    is_active,
    note_side,
    shrink_t_max,
)

PLANES = 19  # rows of sixteen: the edges' normals, N, a·N from the place, a cone around each: axis, cosine, sine; side
_NORMAL, _VOLUME, _AXIS, _COSINE, _SINE, _SIDE = 9, 12, 13, 16, 17, 18
_FOUR = np.float32(4.0)
_THIRD = np.float32(1.0 / 3.0)


@inline
def find_planes(triangles, origin, lift, planes):
    """Write the planes (PLANES, 16) of triangles of a `BVH16`, (9, 16), seen from an origin; returns relative corners.

    Args: lift: of the origin from its place; distances are of the triangles' planes from there, not less than 0.
    """
    a = subtract((load_row(triangles, 0), load_row(triangles, 1), load_row(triangles, 2)), origin)
    b = subtract((load_row(triangles, 3), load_row(triangles, 4), load_row(triangles, 5)), origin)
    c = subtract((load_row(triangles, 6), load_row(triangles, 7), load_row(triangles, 8)), origin)
    ab = subtract(a, b)
    bc = subtract(b, c)
    ca = subtract(c, a)
    n = _normal(ab, bc, ca)
    volume = multiply_add(a[0], n[0], multiply_add(a[1], n[1], a[2] * n[2]))
    side = select(volume < ZERO, -ONE, ONE)  # so that all products are positive where a ray meets the triangle
    store_triple(planes, 0, scale(side, _edge_plane(a, b, ab)))
    store_triple(planes, 3, scale(side, _edge_plane(b, c, bc)))
    store_triple(planes, 6, scale(side, _edge_plane(c, a, ca)))
    n = scale(side, n)
    store_triple(planes, _NORMAL, n)
    store_row(planes, _SIDE, side)
    volume = abs(volume)
    store_row(planes, _VOLUME, select(volume > ZERO, max(volume + dot(n, lift), ZERO), T_MISS))
    return a, b, c


@inline
def find_cones(a, b, c, normal, lowest_sine, planes):
    """Write the cones around triangles after `find_planes`; bits of the triangles with an area that reach above the
    lowest ray, whose elevation over the plane of `normal` has the sine `lowest_sine`."""
    centre = scale(_THIRD, add(add(a, b), c))
    to_a = subtract(a, centre)
    to_b = subtract(b, centre)
    to_c = subtract(c, centre)
    squared_radius = max(max(dot(to_a, to_a), dot(to_b, to_b)), dot(to_c, to_c))
    axis, cosine, sine, distance, radius = cone_around(centre, squared_radius)
    store_triple(planes, _AXIS, axis)
    store_row(planes, _COSINE, cosine)
    store_row(planes, _SINE, sine)
    height = max(max(dot(a, normal), dot(b, normal)), dot(c, normal)) + SLACK * (distance + radius)
    above = height > max(lowest_sine * (distance - radius), ZERO)
    return bits(above & (load_row(planes, _VOLUME) < T_MISS))


@inline
def _edge_plane(a, b, ab):
    """a × b up to a factor, by the form that loses fewer digits; of b and a the exact negative. Args: ab: a − b."""
    both = add(a, b)
    squared_a = dot(a, a)
    squared_b = dot(b, b)
    near_a = _FOUR * squared_a < squared_b
    near_b = _FOUR * squared_b < squared_a
    one = choose(near_a, a, choose(near_b, b, ab))
    other = choose(near_a, b, choose(near_b, scale(-ONE, a), both))
    return _cross(one, other)


@inline
def _cross(a, b):
    """a × b of lanes, rounded less than by separate products."""
    return (
        multiply_add(a[1], b[2], -(a[2] * b[1])),
        multiply_add(a[2], b[0], -(a[0] * b[2])),
        multiply_add(a[0], b[1], -(a[1] * b[0])),
    )


@inline
def _normal(ab, bc, ca):
    """The normal of triangles with these edges: each coordinate from the edges whose products are smaller."""
    one = _cross(ab, bc)
    other = _cross(bc, ca)
    return (
        select(abs(ab[2] * bc[1]) < abs(bc[2] * ca[1]), one[0], other[0]),
        select(abs(ab[0] * bc[2]) < abs(bc[0] * ca[2]), one[1], other[1]),
        select(abs(ab[1] * bc[0]) < abs(bc[1] * ca[0]), one[2], other[2]),
    )


@inline
def store_triple(array, row, v):
    """Write a triple of lanes to three rows that follow one another."""
    store_row(array, row, v[0])
    store_row(array, row + 1, v[1])
    store_row(array, row + 2, v[2])


@inline
def _meets(sides, ahead, volume, t_max):
    """The mask of rays that hit triangles nearer than `t_max`."""
    return (min(min(sides[0], sides[1]), sides[2]) >= ZERO) & (volume < t_max * ahead)


@inline
def intersect_by_rays(rays, listed, start, stop, planes, closest, t_max, leaf):
    """Test listed rays one by one, each against all sixteen triangles. Args: leaf: of `leaf_of`."""
    blocks = len(rays.t_hit)
    volume = load_row(planes, _VOLUME)
    for entry in range(start, stop):
        ray = listed[entry]
        k = ray // WIDE
        lane = ray % WIDE
        if not is_active(rays, ray):
            continue
        v = column(rays.directions, k, blocks, lane)
        sides = along(planes, 0, 1, v), along(planes, 3, 1, v), along(planes, 6, 1, v)
        ahead = along(planes, _NORMAL, 1, v)
        met = _meets(sides, ahead, volume, t_max)
        if not some(met):
            continue
        # What the ray meets: faces with alpha one by one, else the nearest, or any.
        if leaf is not None:
            distances = volume / ahead
            hit_lanes = bits(met)
            while hit_lanes != 0 and is_active(rays, ray):
                j = lowest_bit(hit_lanes)
                hit_lanes &= hit_lanes - 1
                alpha_test(leaf, rays, k, lane, j, pick(distances, j), closest, t_max)
        elif closest:
            distances = select(met, volume / ahead, T_MISS)
            rays.t_hit[k, lane] = min(rays.t_hit[k, lane], lowest(distances))
            shrink_t_max(rays, k, t_max)
            if len(rays.t_sides) > 0:
                is_back = load_row(planes, _SIDE) > ZERO
                note_side(rays, k, lane, 0, lowest(select(is_back, T_MISS, distances)))
                note_side(rays, k, lane, 1, lowest(select(is_back, distances, T_MISS)))
        else:
            deactivate(rays, k, 1 << lane)


@inline
def intersect_by_triangles(rays, triangles, planes, closest, t_max, leaf):
    """Test triangles, bits, one by one, each against blocks of sixteen rays. Args: leaf: of `leaf_of`."""
    directions, blocks = rays.directions, len(rays.t_hit)
    while triangles != 0:
        j = lowest_bit(triangles)
        triangles &= triangles - 1
        ab = column(planes, 0, 1, j)
        bc = column(planes, 3, 1, j)
        ca = column(planes, 6, 1, j)
        n = column(planes, _NORMAL, 1, j)
        axis = column(planes, _AXIS, 1, j)
        volume = planes[_VOLUME, j]
        # Only blocks whose cone meets the cone about the triangle.
        for g in range(len(rays.groups)):
            inside = blocks_within(rays, g, axis, planes[_COSINE, j], planes[_SINE, j])
            while inside != 0:
                k = g * WIDE + lowest_bit(inside)
                inside &= inside - 1
                left = along(directions, k, blocks, ab)
                right = along(directions, k, blocks, bc)
                sides = (left, right, along(directions, k, blocks, ca))
                ahead = along(directions, k, blocks, n)
                met = _meets(sides, ahead, volume, t_max)
                if not some(met):
                    continue
                # What the rays meet: a face with alpha one by one, else nearer hits than before, or any.
                if leaf is not None and has_alpha(leaf, j):
                    distances = volume / ahead
                    hit_lanes = bits(met) & rays.active[k]
                    while hit_lanes != 0:
                        lane = lowest_bit(hit_lanes)
                        hit_lanes &= hit_lanes - 1
                        alpha_test(leaf, rays, k, lane, j, pick(distances, lane), closest, t_max)
                elif closest:
                    t_hit = load_row(rays.t_hit, k)
                    store_row(rays.t_hit, k, select(met, min(volume / ahead, t_hit), t_hit))
                    shrink_t_max(rays, k, t_max)
                    if len(rays.t_sides) > 0:
                        row = k + blocks * (planes[_SIDE, j] > ZERO)
                        before = load_row(rays.t_sides, row)
                        store_row(rays.t_sides, row, select(met, min(volume / ahead, before), before))
                else:
                    deactivate(rays, k, bits(met))
