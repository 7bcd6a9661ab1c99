"""Rays straight down on a page through Embree: the faces at the points of texels, overlapping faces too."""

import numpy as np

from raytrace.embree import packets
from raytrace.embree.packets import intersect8
from raytrace.embree.rays import Hits, intersect
from raytrace.embree.scene import TriangleScene
from raytrace.kernel.arrays import unrefcounted_view
from raytrace.kernel.jit import inline, kernel
from raytrace.kernel.vector import store
from raytrace.types import Float64s

SLOTS = 4  # points of a texel
GRID = np.array([[0.375, 0.125], [0.125, 0.625], [0.875, 0.375], [0.625, 0.875]])
"""A rotated grid: means of a linear function over a texel are exact, also over a diagonal: the first and the last
point, or the other two. Two faces over one another have a diagonal each; of other texels the first two points are one.
"""
_DIAGONAL = np.array([0, 1, 1, 0])
_FEW = 4  # layers that have a point at each place of the grid; more have one each
_MOST = 64  # layers that all have a point; of more, as many have, evenly spaced
_ABOVE = 1.0
_INSIDE = 1e-4  # least barycentric coordinate of what counts as inside: neighbours share their edges


def look_down(scene: TriangleScene, places: Float64s, threads: int) -> Hits:
    """The first hits of rays down on the `places` (k, 2) of a page."""
    origins = np.empty((len(places), 3), np.float32)
    origins[:, :2], origins[:, 2] = places, _ABOVE
    return intersect(scene, origins, [[0.0, 0.0, -1.0]], np.inf, threads)


@kernel
def find_hits(packet, texels, places, width, step, triangle, barycentric, overlapping):
    """Find the first triangle at each point of some texels by rays down, and whether another lies below it.

    Args: places: of points in texels, (k, SLOTS, 2), or (1, SLOTS, 2) for all. Written where there are any: triangle,
        barycentric: of the points (k, SLOTS). overlapping: of texels (k,).
    """
    packet = unrefcounted_view(packet)
    rays, valid = packet.rays, packet.valid
    ids = rays.view(np.uint32)
    count = SLOTS * len(texels)
    for first in range(0, count, packets.LANES):
        for lane in range(packets.LANES):
            valid[lane] = -1 if first + lane < count else 0
            _aim(rays, lane, texels, places, min(first + lane, count - 1), width)
        intersect8(packet.scene, rays, valid)
        for lane in range(min(packets.LANES, count - first)):
            i, k = divmod(first + lane, SLOTS)
            if ids[packets.GEOM_ID, lane] == packets.INVALID:
                valid[lane] = 0
                continue
            place = _barycentric(rays, lane)
            triangle[i, k] = ids[packets.PRIM_ID, lane]
            _put(barycentric, i, k, place)
            if not _is_inside(place):
                valid[lane] = 0
            _go_below(rays, lane, step)
        intersect8(packet.scene, rays, valid)
        for lane in range(min(packets.LANES, count - first)):
            i, k = divmod(first + lane, SLOTS)
            if valid[lane] != 0 and ids[packets.GEOM_ID, lane] != packets.INVALID:
                other = np.int64(ids[packets.PRIM_ID, lane]) != triangle[i, k]
                overlapping[i] |= other and _is_inside(_barycentric(rays, lane))
        for begin in range(0, min(packets.LANES, count - first), SLOTS):
            i = (first + begin) // SLOTS
            _bring_forward(triangle[i], barycentric[i])


@kernel
def find_layers(packet, texels, places, width, step, depths, points):
    """Count the triangles over one another at each point of some texels by rays down, or find points on them.

    Args: places: as for `find_hits`. depths: int64 (k, SLOTS), written without `points`. points: None, or starts
        (k + 1,) by `layer_counts`, and, to be written from these on, triangles (j,) and barycentrics (j, 3).
    """
    packet = unrefcounted_view(packet)
    rays, valid = packet.rays, packet.valid
    ids = rays.view(np.uint32)
    layers = np.zeros(packets.LANES, np.int64)
    for i in range(len(texels)):
        for lane in range(packets.LANES):
            valid[lane], layers[lane] = -1 if lane < SLOTS else 0, 0
            _aim(rays, lane, texels, places, SLOTS * i + lane % SLOTS, width)
        entry, deepest, listed = 0, _deepest(depths, i), _listed(depths, i, texels[i])
        going = True
        while going:
            intersect8(packet.scene, rays, valid)
            going = False
            for k in range(SLOTS):
                if valid[k] == 0 or ids[packets.GEOM_ID, k] == packets.INVALID:
                    valid[k] = 0
                    continue
                going = True
                place = _barycentric(rays, k)
                met = ids[packets.PRIM_ID, k]
                _go_below(rays, k, step)
                if not _is_inside(place):
                    continue
                if points is not None:
                    starts, triangle, barycentric = points
                    if _is_listed(layers[k], k, texels[i], deepest):
                        to = entry * (starts[i + 1] - starts[i]) // listed
                        if to < (entry + 1) * (starts[i + 1] - starts[i]) // listed:
                            triangle[starts[i] + to] = met
                            store(barycentric, starts[i] + to, place)
                        entry += 1
                layers[k] += 1
        if points is None:
            for k in range(SLOTS):
                depths[i, k] = layers[k]


@kernel
def layer_counts(texels, depths, counts):
    """Write how many points texels have on layers, int64 (k,). Args: depths: of `find_layers`."""
    for i in range(len(texels)):
        counts[i] = min(_listed(depths, i, texels[i]), _MOST)


@inline
def _is_listed(layer, k, texel, deepest):
    """Whether a layer has a point at the place k of a texel, so that all have equally many."""
    if deepest <= 2:
        return (layer + texel) % 2 == _DIAGONAL[k]
    return deepest <= _FEW or (layer + texel) % SLOTS == k


@inline
def _deepest(depths, i):
    return max(depths[i, 0], depths[i, 1], depths[i, 2], depths[i, 3])


@inline
def _listed(depths, i, texel):
    """How many points a texel has on its layers, whose numbers are row `i` of `depths`."""
    total, deepest = 0, _deepest(depths, i)
    for k in range(SLOTS):
        for layer in range(depths[i, k]):
            total += 1 if _is_listed(layer, k, texel, deepest) else 0
    return total


@inline
def _aim(rays, lane, texels, places, number, width):
    """Let a ray look down on the point `number` of those of all texels."""
    i, k = divmod(number, SLOTS)
    place = places[i % len(places), k]
    rays[packets.ORG_X, lane] = texels[i] % width + place[0]
    rays[packets.ORG_Y, lane] = texels[i] // width + place[1]
    rays[packets.ORG_Z, lane], rays[packets.TFAR, lane] = _ABOVE, np.inf
    rays[packets.DIR_X, lane], rays[packets.DIR_Y, lane], rays[packets.DIR_Z, lane] = 0.0, 0.0, -1.0


@inline
def _go_below(rays, lane, step):
    """Let a ray that has met a triangle begin anew below it."""
    rays[packets.ORG_Z, lane] -= rays[packets.TFAR, lane] + step / 2.0
    rays[packets.TFAR, lane] = np.inf


@inline
def _barycentric(rays, lane):
    u, v = rays[packets.U, lane], rays[packets.V, lane]
    return np.float32(1.0) - u - v, u, v


@inline
def _is_inside(place):
    return min(place[0], place[1], place[2]) > _INSIDE


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
