"""The rays of one point, sixteen to a block: their directions, the cones around blocks, and what they have met so far.

Cones are bounds: they may be too wide by `SLACK`, which decides what is tested and never what is hit.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from obscurance.raytrace.kernel.arrays import aligned
from obscurance.raytrace.kernel.jit import inline
from obscurance.raytrace.kernel.simd import (
    WIDE,
    bits,
    highest,
    load_row,
    lowest_bit,
    multiply_add,
    popcount,
    reciprocal_root,
    select,
    store_row,
)
from obscurance.raytrace.kernel.vector import dot, scale
from obscurance.raytrace.types import Float32Rows, Float32s, Int64s

from .directions import DirectionTable

SLACK = np.float32(2.0**-18)  # of cosines, sines and parts of distances, for their rounding
ZERO = np.float32(0.0)
ONE = np.float32(1.0)
T_MISS = np.float32(np.inf)  # the distance of a hit that there is not
FULL_SPHERE = np.float32(-1.0)  # the cosine of a cone that holds all directions
LEAST = np.float32(1e-18)  # of a direction's components, for their reciprocals
TINY = np.float32(1e-30)  # of squares, for their roots


class Rays(NamedTuple):
    """b blocks of sixteen rays of a point, in groups of sixteen blocks.

    Attributes:
        directions: float32 (3·b, 16), all x, then all y, then all z. reciprocals: 1 / directions.
        cones: float32 (5·g, 16), the axes of the cones around blocks, and the cosines and sines of their half angles.
        active: int64 (16·g,), bits of the rays of each block that have met nothing that ends them.
        groups: int64 (g,), bits of the blocks of each group that have such rays.
        t_hit: float32 (b, 16), distances of the nearest hits yet, `T_MISS` without one.
        t_sides: float32 (2·b, 16), of the nearest opaque fronts, then of backs, also those that rays pass; or no rows.
        t_max: float32 (b,), how far the rays of a block still matter.
    """

    directions: Float32Rows
    reciprocals: Float32Rows
    cones: Float32Rows
    active: Int64s
    groups: Int64s
    t_hit: Float32Rows
    t_sides: Float32Rows
    t_max: Float32s

    @classmethod
    def of(cls, table: DirectionTable, sides: bool = False) -> Rays:
        """Room for the rays of one point at a time. Args: sides: whether to note `t_sides`."""
        blocks = table.directions.shape[2] // WIDE
        groups = table.cones.shape[2] // WIDE
        directions = aligned((3 * blocks, WIDE), np.float32)
        reciprocals = aligned((3 * blocks, WIDE), np.float32)
        cones = aligned((5 * groups, WIDE), np.float32)
        t_hit = aligned((blocks, WIDE), np.float32)
        t_sides = aligned((2 * blocks * sides, WIDE), np.float32)
        still = np.zeros(groups * WIDE, np.int64), np.zeros(groups, np.int64)
        return cls(directions, reciprocals, cones, *still, t_hit, t_sides, np.zeros(blocks, np.float32))


@inline
def root(a):
    """√a of lanes, for a ≥ 0, with an error within `SLACK`."""
    return a * reciprocal_root(max(a, TINY))


@inline
def cone_around(centre, squared_radius):
    """The cones around sixteen balls: axes, cosines, sines; how far away their centres are, and their radii."""
    squared = max(dot(centre, centre), TINY)
    radius = root(squared_radius)
    nearness = reciprocal_root(squared)
    sine = radius * nearness + SLACK
    cosine = select(sine < ONE, root(max(ONE - sine * sine, ZERO)), FULL_SPHERE)
    return scale(nearness, centre), cosine, sine, squared * nearness, radius


@inline
def along(vectors, k, count, v):
    """The dot products of a triple with the sixteen vectors in rows k, count + k and 2·count + k."""
    xy = multiply_add(load_row(vectors, count + k), v[1], load_row(vectors, 2 * count + k) * v[2])
    return multiply_add(load_row(vectors, k), v[0], xy)


@inline
def _turn(vectors, first_row, k, count, frame, out):
    """Write sixteen vectors, from row `first_row` on, turned from a frame's coordinates into those of space."""
    x = load_row(vectors, first_row + k)
    y = load_row(vectors, first_row + count + k)
    z = load_row(vectors, first_row + 2 * count + k)
    for axis in range(3):
        store_row(out, axis * count + k, x * frame[0][axis] + y * frame[1][axis] + z * frame[2][axis])


@inline
def init_rays(rays, directions, cones, chosen, samples, frame, t_max):
    """Begin with a point: turn set `chosen` of a table's directions and cones into its frame; nothing is met yet."""
    blocks = len(rays.t_hit)
    groups = len(rays.groups)
    for k in range(len(rays.t_sides)):
        store_row(rays.t_sides, k, T_MISS)
    for k in range(blocks):
        _turn(directions, 3 * blocks * chosen, k, blocks, frame, rays.directions)
        for axis in range(3):
            x = load_row(rays.directions, axis * blocks + k)
            store_row(rays.reciprocals, axis * blocks + k, ONE / select(abs(x) > LEAST, x, LEAST))
        store_row(rays.t_hit, k, T_MISS)
        rays.t_max[k] = t_max
        rays.active[k] = (1 << min(samples - WIDE * k, WIDE)) - 1
    for g in range(groups):
        _turn(cones, 5 * groups * chosen, g, groups, frame, rays.cones)
        for row in (3, 4):
            store_row(rays.cones, row * groups + g, load_row(cones, 5 * groups * chosen + row * groups + g))
        rays.groups[g] = (1 << min(blocks - WIDE * g, WIDE)) - 1


@inline
def close_below(rays, front):
    """Let rays end where they start that go below the plane of a unit normal, zero: none; returns how many."""
    closed = 0
    if front == (ZERO, ZERO, ZERO):
        return closed
    blocks = len(rays.t_hit)
    for k in range(blocks):
        is_below = along(rays.directions, k, blocks, front) < ZERO
        below = bits(is_below) & rays.active[k]
        if below != 0:
            store_row(rays.t_hit, k, select(is_below, ZERO, T_MISS))
            deactivate(rays, k, below)
            closed += popcount(below)
    return closed


@inline
def count_behind(rays, samples):
    """How many rays end on the back of a face, by `t_sides`, or would if they did not pass it."""
    blocks = len(rays.t_hit)
    behind = 0
    for k in range(blocks):
        sent = (1 << min(samples - WIDE * k, WIDE)) - 1
        back = load_row(rays.t_sides, blocks + k)
        behind += popcount(bits((back < load_row(rays.t_sides, k)) & (back <= load_row(rays.t_hit, k))) & sent)
    return behind


@inline
def note_side(rays, block, lane, is_back, distance):
    """Note that a ray meets an opaque face, from behind or not."""
    if len(rays.t_sides) > 0:
        row = block + is_back * len(rays.t_hit)
        rays.t_sides[row, lane] = min(rays.t_sides[row, lane], distance)


@inline
def blocks_within(rays, g, axis, cosine, sine):
    """The blocks of a group, as bits, that have active rays and may have rays within a cone."""
    groups = len(rays.groups)
    if cosine == FULL_SPHERE:
        return rays.groups[g]
    both = load_row(rays.cones, 3 * groups + g) * cosine - load_row(rays.cones, 4 * groups + g) * sine - SLACK
    return bits(along(rays.cones, g, groups, axis) >= both) & rays.groups[g]


@inline
def list_within(rays, axis, cosine, gap, max_count, out, first_entry):
    """List, from out[first_entry], active rays within a cone that matter at distance `gap`; −1 for over `max_count`."""
    count, sine = 0, np.float32(np.sqrt(max(ONE - cosine * cosine, ZERO))) + SLACK
    for g in range(len(rays.groups)):
        inside = blocks_within(rays, g, axis, cosine, sine)
        while inside != 0:
            k = g * WIDE + lowest_bit(inside)
            inside &= inside - 1
            if rays.t_max[k] < gap:
                continue
            within = rays.active[k]
            if cosine != FULL_SPHERE:
                within &= bits(along(rays.directions, k, len(rays.t_hit), axis) >= cosine - SLACK)
            while within != 0:
                if count == max_count:
                    return -1
                out[first_entry + count] = WIDE * k + lowest_bit(within)
                within &= within - 1
                count += 1
    return count


@inline
def list_active(rays, start, stop, out):
    """List the active rays from `start` to `stop` in `out`; returns their number."""
    count = 0
    for ray in range(start, stop):
        if is_active(rays, ray):
            out[count] = ray
            count += 1
    return count


@inline
def is_active(rays, ray):
    """Whether a ray goes on."""
    return rays.active[ray // WIDE] >> (ray % WIDE) & 1 != 0


@inline
def deactivate(rays, block, stopped):
    """Mark the rays `stopped`, bits of a block, as inactive."""
    rays.active[block] &= ~stopped
    if rays.active[block] == 0:
        rays.groups[block // WIDE] &= ~(1 << (block % WIDE))


@inline
def shrink_t_max(rays, block, t_max):
    """Note how far the rays of a block matter after some of them have hit."""
    rays.t_max[block] = min(highest(load_row(rays.t_hit, block)), t_max)
