"""Rays straight down on a page through Embree: the faces at the points of texels, overlapping faces too."""

import numpy as np

from raytrace.embree import packets
from raytrace.embree.packets import intersect8
from raytrace.embree.rays import Hits, intersect
from raytrace.embree.scene import TriangleScene
from raytrace.kernel.arrays import borrow
from raytrace.kernel.jit import inline, kernel
from raytrace.types import Float64s

SLOTS = 4  # points of a texel
_GRID = np.array([[0.375, 0.125], [0.125, 0.625], [0.875, 0.375], [0.625, 0.875]])
"""A rotated grid: means of a linear function over a texel are exact, also over a diagonal: the first and the last
point, or the other two. Two faces over one another take turns so that each has a diagonal; of other texels the
first two points are one."""
DEEP = 16  # points of a texel in which more than two faces lie over one another
_TURNS = np.array([0, 2, 3, 1])  # of slots, so that the first two take different ones of two faces
_ABOVE = 1.0
_LAYERS = 16
_INSIDE = 1e-4  # least barycentric coordinate of what counts as inside: neighbours share their edges


def look_down(scene: TriangleScene, places: Float64s, threads: int) -> Hits:
    """The first hits of rays down on the `places` (k, 2) of a page."""
    origins = np.empty((len(places), 3), np.float32)
    origins[:, :2], origins[:, 2] = places, _ABOVE
    return intersect(scene, origins, [[0.0, 0.0, -1.0]], np.inf, threads)


@kernel
def find_hits(packet, texels, width, step, in_turn, found, layered):
    """Find the triangle at each point of some texels by rays down: of several in turn if `in_turn`, or the first.

    Args, written where there are any: found: triangles (k, SLOTS), barycentrics, and whether there are several at any
        point, (k,). layered: whether more than two, (k,), and points on all of them, (k, DEEP) and barycentrics.
    """
    packet = borrow(packet)
    rays, valid = packet.rays, packet.valid
    triangle, barycentric, overlapping = found
    deep, deep_triangle, deep_place = layered
    count = SLOTS * len(texels)
    layers, several = np.zeros(packets.LANES, np.int64), np.zeros(packets.LANES, np.bool_)
    face, weights = np.zeros((packets.LANES, _LAYERS), np.int64), np.zeros((packets.LANES, _LAYERS, 3), np.float32)
    height, stack = np.zeros(packets.LANES), (layers, face, weights, several)
    for first in range(0, count, packets.LANES):
        for lane in range(packets.LANES):
            i, k = divmod(min(first + lane, count - 1), SLOTS)
            valid[lane] = -1 if first + lane < count else 0
            height[lane], layers[lane], several[lane] = _ABOVE, 0, False
            rays[packets.ORG_X, lane] = texels[i] % width + _GRID[k, 0]
            rays[packets.ORG_Y, lane] = texels[i] // width + _GRID[k, 1]
            rays[packets.DIR_X, lane], rays[packets.DIR_Y, lane], rays[packets.DIR_Z, lane] = 0.0, 0.0, -1.0
        depth, going = 0, True
        while going and depth < _LAYERS:
            for lane in range(packets.LANES):
                rays[packets.ORG_Z, lane], rays[packets.TFAR, lane] = height[lane], np.inf
            intersect8(packet.scene, rays, valid)
            going = False
            for lane in range(packets.LANES):
                if valid[lane] != 0 and _note_layer(rays, lane, depth, first, triangle, barycentric, stack):
                    height[lane] -= rays[packets.TFAR, lane] + step / 2.0
                    if depth > 0 and not (several[lane] and in_turn):
                        valid[lane] = 0
                    going = going or valid[lane] != 0
                else:
                    valid[lane] = 0
            depth += 1
        for lane in range(min(packets.LANES, count - first)):
            if several[lane]:
                i, k = divmod(first + lane, SLOTS)
                overlapping[i] = True
                deep[i] |= in_turn and layers[lane] > 2
                if in_turn:
                    chosen = (_TURNS[k] * layers[lane] // SLOTS + texels[i]) % layers[lane]
                    triangle[i, k] = face[lane, chosen]
                    _put(barycentric, i, k, weights[lane, chosen])
        for begin in range(0, min(packets.LANES, count - first), SLOTS):
            i = (first + begin) // SLOTS
            if not (overlapping[i] and in_turn):
                _bring_forward(triangle[i], barycentric[i])
            if deep[i]:
                _spread(stack, begin, deep_triangle, deep_place, i)


@inline
def _note_layer(rays, lane, depth, first, triangle, barycentric, stack):
    """Note what a ray has met in its `depth`-th step on the stack of its layers; whether it met anything."""
    layers, face, weights, several = stack
    ids = rays.view(np.uint32)
    if ids[packets.GEOM_ID, lane] == packets.INVALID:
        return False
    met, u, v = np.int64(ids[packets.PRIM_ID, lane]), rays[packets.U, lane], rays[packets.V, lane]
    place = np.float32(1.0) - u - v, u, v
    if depth == 0:
        i, k = divmod(first + lane, SLOTS)
        triangle[i, k] = met
        _put(barycentric, i, k, place)
    if min(place[0], place[1], place[2]) > _INSIDE:
        if depth == 1:
            several[lane] = layers[lane] == 1 and face[lane, 0] != met
        face[lane, layers[lane]] = met
        _put(weights, lane, layers[lane], place)
        layers[lane] += 1
    return True


@inline
def _spread(stack, begin, triangle, barycentric, i):
    """Spread `DEEP` points over all layers at the points of the texel `i`, whose lanes start at `begin`."""
    layers, face, weights, _ = stack
    total = layers[begin : begin + SLOTS].sum()
    for point in range(DEEP):
        lane, layer = begin, point * total // DEEP
        while layer >= layers[lane]:
            layer -= layers[lane]
            lane += 1
        triangle[i, point] = face[lane, layer]
        _put(barycentric, i, point, weights[lane, layer])


@inline
def _put(rows, i, k, v):
    rows[i, k, 0], rows[i, k, 1], rows[i, k, 2] = v[0], v[1], v[2]


@inline
def _bring_forward(triangle, barycentric):
    """Put the last point of a texel in the second place."""
    for k in range(SLOTS - 1, 1, -1):
        triangle[k - 1], triangle[k] = triangle[k], triangle[k - 1]
        for corner in range(3):
            barycentric[k - 1, corner], barycentric[k, corner] = barycentric[k, corner], barycentric[k - 1, corner]
