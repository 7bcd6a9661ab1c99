"""The traversal by all rays of a point of a `BVH16`: each node is read once for all rays that may meet something in it.

Near the point a node lies in the way of many rays: its children are opened by their cones. As soon as no more than
`_LISTED` rays pass through a node they are listed, and each is tested against sixteen children or triangles at once
(ray streams: Tsakok 2009, Faster Incoherent Rays: Multi-BVH Ray Stream Tracing).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from obscurance.raytrace.bvh.bvh16 import BVH16
from obscurance.raytrace.bvh.oriented import along_axes, box_offsets
from obscurance.raytrace.kernel.arrays import aligned
from obscurance.raytrace.kernel.jit import inline
from obscurance.raytrace.kernel.simd import WIDE, bits, lowest_bit, select, store_row
from obscurance.raytrace.kernel.vector import column, dot, subtract
from obscurance.raytrace.types import Float32Rows, Int64Rows, Int64s

from .layers import AlphaHits, leaf_of
from .ray_blocks import FULL_SPHERE, LEAST, ONE, SLACK, ZERO, cone_around, is_active, list_active, list_within, root
from .triangles import PLANES, find_cones, find_planes, intersect_by_rays, intersect_by_triangles, store_triple

_LISTED = 32
_ENTRIES = 1 << 8  # of the stack: fifteen brothers a level
_NODE, _LEVEL, _FIRST, _COUNT = range(4)  # columns of entries; a count of −1: the rays are not listed
_AXIS, _COSINE, _GAP = 0, 3, 4  # columns of bounds: the cone around a node, and how far away it begins


class TraversalState(NamedTuple):
    """Scratch arrays of one traversal at a time.

    Attributes:
        entries: int64 (e, 4), the stack: nodes, their levels, and which part of `listed` are their rays.
        bounds: float32 (e, 5), of the entries' nodes: see `_AXIS`.
        listed: int64, numbers of rays.
        child_rays: int64 (16, _LISTED), the rays that pass through each child of a node. child_counts: int64 (16,).
        children: float32 (5, 16), `bounds` of a node's children. planes: float32 (PLANES, 16), of a leaf's triangles.
        layers: what rays pass, or None where all faces are opaque.
    """

    entries: Int64Rows
    bounds: Float32Rows
    listed: Int64s
    child_rays: Int64Rows
    child_counts: Int64s
    children: Float32Rows
    planes: Float32Rows
    layers: AlphaHits | None

    @classmethod
    def of(cls, tree: BVH16, layers: AlphaHits | None = None) -> TraversalState:
        """Room to traverse a tree."""
        entries = np.zeros((_ENTRIES, 4), np.int64)
        bounds = np.zeros((_ENTRIES, 5), np.float32)
        listed = np.zeros((len(tree.starts) + 1) * WIDE * _LISTED, np.int64)
        child_rays = np.zeros((WIDE, _LISTED), np.int64)
        children = aligned((5, WIDE), np.float32)
        planes = aligned((PLANES, WIDE), np.float32)
        return cls(entries, bounds, listed, child_rays, np.zeros(WIDE, np.int64), children, planes, layers)


@inline
def traverse(tree, state, rays, start, normal, lowest_sine, closest, t_max):
    """Find which rays meet something nearer than `t_max`, and with `closest` how far away.

    Args:
        start: the origin, and its lift from the place that distances count from.
        lowest_sine: of the elevation of the lowest ray over the plane of the unit `normal`.
    """
    triangles, boxes, starts = tree.triangles, tree.boxes, tree.starts
    entries, bounds = state.entries, state.bounds
    origin, lift = start
    levels = len(starts) - 1
    last = WIDE * len(rays.t_hit)
    for ray in range(0, last, last if tree.axes is None else _LISTED):
        # The root, with all rays, or with a list of some where boxes are oriented.
        entries[0, _NODE], entries[0, _LEVEL], entries[0, _FIRST] = starts[levels] - 1, levels, 0
        entries[0, _COUNT] = -1
        if tree.axes is not None:  # there are no cones around oriented boxes
            entries[0, _COUNT] = list_active(rays, ray, min(ray + _LISTED, last), state.listed)
        bounds[0, _COSINE], bounds[0, _GAP] = FULL_SPHERE, ZERO
        waiting = 1
        while waiting > 0:
            waiting -= 1
            node = entries[waiting, _NODE]
            level = entries[waiting, _LEVEL]
            first_listed = entries[waiting, _FIRST]
            count = entries[waiting, _COUNT]
            # Which rays of the node are still to be traced: unlisted ones are within its cone.
            if count < 0:
                bound = bounds[waiting]
                axis = bound[_AXIS], bound[_AXIS + 1], bound[_AXIS + 2]
                count = list_within(rays, axis, bound[_COSINE], bound[_GAP], _LISTED, state.listed, first_listed)
            if count == 0:
                continue
            # A leaf: many rays against each triangle, or each of few against all.
            if level == 0:
                a, b, c = find_planes(triangles[node], origin, lift, state.planes)
                leaf = leaf_of(state.layers, tree, node, origin)
                if count < 0:
                    facing = find_cones(a, b, c, normal, lowest_sine, state.planes)
                    intersect_by_triangles(rays, facing, state.planes, closest, t_max, leaf)
                else:
                    intersect_by_rays(
                        rays, state.listed, first_listed, first_listed + count, state.planes, closest, t_max, leaf
                    )
                continue
            # A node: children that some rays reach, the nearest to be visited next.
            child = (node - starts[level - 1]) * WIDE + (starts[level - 2] if level > 1 else 0)
            if count < 0:
                opened = _open_children(boxes, node, state, origin, normal, lowest_sine, t_max)
            else:
                opened = _intersect_children(
                    tree, node, state, rays, (first_listed, first_listed + count), origin, t_max
                )
            waiting = _push(state, opened, waiting, child, level - 1, first_listed, count >= 0)


@inline
def _push(state, opened, waiting, child, level, first_listed, listed):
    """Put `opened` children, bits, on the stack, the nearest on top; returns how many nodes wait now.

    Args: child: the first child. first_listed: where the children's rays begin in `TraversalState.listed`, if `listed`.
    """
    entries, bounds = state.entries, state.bounds
    bottom = waiting
    while opened != 0:
        k = lowest_bit(opened)
        opened &= opened - 1
        slot, gap = waiting, state.children[_GAP, k]
        while slot > bottom and bounds[slot - 1, _GAP] < gap:
            entries[slot, _NODE] = entries[slot - 1, _NODE]
            bounds[slot, _GAP] = bounds[slot - 1, _GAP]
            slot -= 1
        entries[slot, _NODE], bounds[slot, _GAP] = k, gap
        waiting += 1
    for slot in range(bottom, waiting):
        k = entries[slot, _NODE]
        entries[slot, _NODE], entries[slot, _LEVEL], entries[slot, _FIRST] = child + k, level, first_listed
        if not listed:
            entries[slot, _COUNT] = -1
            for column in range(_GAP):
                bounds[slot, column] = state.children[column, k]
        else:
            entries[slot, _COUNT] = state.child_counts[k]
            for q in range(state.child_counts[k]):
                state.listed[first_listed + q] = state.child_rays[k, q]
            first_listed += state.child_counts[k]
    return waiting


@inline
def _open_children(boxes, node, state, origin, normal, lowest_sine, t_max):
    """Write bounds of a node's children in aligned boxes; bits of the children within t_max above the lowest ray."""
    d, half, gap = _relative(boxes, None, node, origin)
    axis, cosine, _, distance, radius = cone_around(d, dot(half, half))
    upright = abs(normal[0]), abs(normal[1]), abs(normal[2])
    height = dot(d, normal) + dot(half, upright) + SLACK * (distance + radius)
    store_triple(state.children, _AXIS, axis)
    store_row(state.children, _COSINE, cosine)
    store_row(state.children, _GAP, gap * (ONE - SLACK))
    return bits((height > lowest_sine * gap) & (gap * (ONE - SLACK) <= t_max))


@inline
def _relative(boxes, axes, node, origin):
    """Centres of a node's boxes relative to a point and half their sides along `axes`, and how far away they begin."""
    d, half = box_offsets(boxes, axes, node, origin)
    if axes is not None:
        blur = SLACK * (abs(d[0]) + abs(d[1]) + abs(d[2]))
        half = half[0] + blur, half[1] + blur, half[2] + blur
    gap = max(abs(d[0]) - half[0], ZERO), max(abs(d[1]) - half[1], ZERO), max(abs(d[2]) - half[2], ZERO)
    return d, half, root(dot(gap, gap))


@inline
def _reciprocals(rays, ray, axes, node, used):
    """1 / the components of a ray along the axes of a node's boxes, in sixteen lanes."""
    k = ray // WIDE
    lane = ray % WIDE
    blocks = len(rays.t_hit)
    if axes is not None:
        x, y, z = along_axes(axes, node, _repeated(rays.directions, k, lane, blocks, used))
        x = select(abs(x) > LEAST, x, LEAST)
        y = select(abs(y) > LEAST, y, LEAST)
        z = select(abs(z) > LEAST, z, LEAST)
        return ONE / x, ONE / y, ONE / z
    return _repeated(rays.reciprocals, k, lane, blocks, used)


@inline
def _repeated(vectors, k, lane, count, mask):
    """A vector in rows k, count + k and 2·count + k as a triple of lanes."""
    x, y, z = column(vectors, k, count, lane)
    return select(mask, x, x), select(mask, y, y), select(mask, z, z)


@inline
def _intersect_children(tree, node, state, rays, listed, origin, t_max):
    """List the rays that pass through each child of a node within t_max, by slabs; bits of the children with any.

    Args: listed: from where to where the rays of the node are in `TraversalState.listed`.
    """
    d, half, gap = _relative(tree.boxes, tree.axes, node, origin)
    store_row(state.children, _GAP, gap)
    used = half[0] >= ZERO
    low = subtract(d, half)
    high = (d[0] + half[0], d[1] + half[1], d[2] + half[2])
    opened = 0
    for k in range(WIDE):
        state.child_counts[k] = 0
    # Each ray against the slabs of all children at once.
    for child in range(listed[0], listed[1]):
        ray = state.listed[child]
        if not is_active(rays, ray):
            continue
        k = ray // WIDE
        lane = ray % WIDE
        x, y, z = _reciprocals(rays, ray, tree.axes, node, used)
        ax = low[0] * x
        bx = high[0] * x
        ay = low[1] * y
        by = high[1] * y
        az = low[2] * z
        bz = high[2] * z
        enter = max(max(min(ax, bx), min(ay, by)), max(min(az, bz), ZERO))
        leave = min(min(max(ax, bx), max(ay, by)), min(max(az, bz), min(rays.t_hit[k, lane], t_max)))
        passed = bits((enter * (ONE - SLACK) <= leave * (ONE + SLACK)) & used)
        opened |= passed
        while passed != 0:
            c = lowest_bit(passed)
            passed &= passed - 1
            state.child_rays[c, state.child_counts[c]] = ray
            state.child_counts[c] += 1
    return opened
