"""Connected parts that bound closed solids, and points that may lie in one of another part."""

import numpy as np

from raytrace.kernel.counting_sort import counting_sort
from raytrace.kernel.jit import bound, inline, kernel
from raytrace.kernel.vector import cross, dot, load_triangle
from raytrace.mesh.components import connected_components
from raytrace.mesh.mesh import Mesh
from raytrace.mesh.placement import Placement
from raytrace.mesh.weld import coincident
from raytrace.system.threads import run_blocks
from raytrace.types import Bools, Float32s, Int64s

_BLOCK, _MOST = 1 << 9, 16  # points, and blocks at once


def closed_parts(vertices: Float32s, faces: Int64s) -> tuple[Int64s, Bools]:
    """The connected part (n,) of each vertex, and whether each part is a closed solid whose faces look outwards.

    Vertices at the same place are one. At every edge of a closed part as many faces run one way as the other. Where
    there is only one part, it counts as open.
    """
    part = connected_components(faces, len(vertices))
    if _are_one(part, faces):  # the usual case, found soonest
        return part, np.zeros(int(part.max(initial=-1)) + 1, np.bool_)
    place = coincident(vertices, faces)
    corners = place[faces]
    part = connected_components(corners, int(place.max()) + 1)
    closed = np.zeros(int(part.max()) + 1, np.bool_)
    if not _are_one(part, corners):
        volume = np.zeros(len(closed))
        _add_volumes(vertices, faces, part[place], volume)
        closed = volume > 0
        edges, starts = counting_sort(np.minimum(corners, corners[:, [1, 2, 0]]), len(part))
        _strike_open(corners, edges, starts, part, closed)
    return part[place], closed


def holes(mesh: Mesh) -> str | None:
    """What rays in a mesh that is not closed mean for its thickness, in words; None if at every edge as many faces run
    one way as the other, vertices at the same place taken for one.
    """
    corners = coincident(Placement.of(mesh).vertices, mesh.faces)[mesh.faces]
    a, b = corners.ravel(), corners[:, [1, 2, 0]].ravel()
    edge = np.unique(np.minimum(a, b) * len(mesh.vertices) + np.maximum(a, b), return_inverse=True)[1]
    open_edges = np.count_nonzero(np.bincount(edge, np.sign(b - a)))
    text = "edges are open: where rays leave through holes, the mesh counts as thick"
    return f"{mesh.source}: {open_edges:,} {text}" if open_edges else None


def inside_boxes(
    points: Float32s, own: Int64s, vertices: Float32s, part: Int64s, closed: Bools, threads: int
) -> Int64s:
    """Rows, ascending, of the `points` (k, 3) within the bounding box of a closed part that is not their `own` (k,).

    Args: points: along a curve, for speed. vertices: (n, 3). part, closed: of `closed_parts`.
    """
    low, high = np.full((len(closed), 3), np.inf, np.float32), np.full((len(closed), 3), -np.inf, np.float32)
    _bound(vertices, part, low, high)
    numbers, found = np.flatnonzero(closed), np.zeros(len(points), np.bool_)
    work = bound(_mark_within, points, own, (numbers, low[numbers], high[numbers]), found)
    run_blocks(len(points), _BLOCK, work, threads, most=_MOST)
    return np.flatnonzero(found)


def _are_one(part: Int64s, faces: Int64s) -> bool:
    of_face = part[faces[:, 0]] if part.any() else part
    return bool((of_face == of_face[:1]).all())


@kernel
def _add_volumes(vertices, faces, part, volume):
    """Six times the volume that the faces of each part bound."""
    for f in range(len(faces)):
        a, b, c = load_triangle(vertices, faces, f)
        volume[part[faces[f, 0]]] += dot(a, cross(b, c))


@kernel
def _strike_open(corners, edges, starts, part, closed):
    """Unset `closed` of parts that have an edge along which more faces run one way than the other.

    Args: edges: edges[starts[i] : starts[i + 1]] have the lower end i; edge 3 f + k begins at corners[f, k].
    """
    balance = np.zeros(len(part), np.int64)
    for i in range(len(part)):
        for edge in edges[starts[i] : starts[i + 1]]:
            a, b = corners[edge // 3, edge % 3], corners[edge // 3, (edge % 3 + 1) % 3]
            balance[max(a, b)] += np.sign(b - a)
        for edge in edges[starts[i] : starts[i + 1]]:
            other = max(corners[edge // 3, edge % 3], corners[edge // 3, (edge % 3 + 1) % 3])
            if balance[other] != 0:
                closed[part[i]] = False
                balance[other] = 0


@kernel
def _bound(vertices, part, low, high):
    """Grow the bounding box of each part to hold its vertices."""
    for i in range(len(vertices)):
        for axis in range(3):
            low[part[i], axis] = min(low[part[i], axis], vertices[i, axis])
            high[part[i], axis] = max(high[part[i], axis], vertices[i, axis])


@kernel
def _mark_within(points, own, parts, found, first, last):
    """Set `found` of the points that lie in the box of a part that is not their `own`.

    Args: parts: their numbers, and the low and high corners of their boxes.
    """
    numbers, low, high = parts
    near, around = np.empty(len(numbers), np.int64), np.empty((2, 3), np.float32)
    for begin in range(first, last, _BLOCK):
        end, count = min(begin + _BLOCK, last), 0
        around[0], around[1] = np.inf, -np.inf
        for i in range(begin, end):
            for axis in range(3):
                around[0, axis] = min(around[0, axis], points[i, axis])
                around[1, axis] = max(around[1, axis], points[i, axis])
        for k in range(len(numbers)):
            if _meet(around[0], around[1], low[k], high[k]):
                near[count] = k
                count += 1
        for i in range(begin, end):
            for k in near[:count]:
                if numbers[k] != own[i] and _meet(points[i], points[i], low[k], high[k]):
                    found[i] = True
                    break


@inline
def _meet(low, high, other_low, other_high):
    """Whether two boxes have a point in common."""
    x = low[0] <= other_high[0] and high[0] >= other_low[0]
    y = low[1] <= other_high[1] and high[1] >= other_low[1]
    return x and y and low[2] <= other_high[2] and high[2] >= other_low[2]
