"""Texels of charts that are small, or show much of the surface: points spread over all that each has of any face."""

from typing import NamedTuple

import numpy as np

from raytrace.bvh.bvh16 import BVH16
from raytrace.bvh.closest import begin, new_stack, next_leaf
from raytrace.kernel.arrays import unrefcounted_view
from raytrace.kernel.jit import inline, kernel
from raytrace.kernel.simd import lowest_bit
from raytrace.system.threads import run_blocks
from raytrace.types import Bools, Float32s, Float64s, Int64s

from .page_rays import SLOTS

_BLOCK, _SHARE = 1 << 10, 16  # texels, and blocks at once
_LEAST, _OF_FACE = 1e-9, 1e-6  # area, in texels, or part of the face's, that is any at all
_CORNERS = 8  # of a triangle cut by a square, at most 7
_MORE, _MOST = 16, 64  # points of a texel with several faces, or with much surface
_CROWDED, _FULL = 8.0, 32.0  # texels of an even layout that would show as much, from which it has more, and most


class PageTree(NamedTuple):
    """Faces on a page."""

    corners: Float64s  # (t, 3, 2)
    crowding: Float64s  # (t,), how many texels of an even layout show as much of the surface as one texel of the face
    tree: BVH16  # over these
    radius: float  # of a texel


def is_crowded(crowding: Float64s) -> Bools:
    """Whether texels that show as much as so many of an even layout need more points than others."""
    return crowding >= _CROWDED


def find_slivers(
    page: PageTree, texels: Int64s, width: int, offsets: Float64s, threads: int
) -> tuple[Int64s, Int64s, Float32s]:
    """How many points each of the `texels` has, (k,), 0 of what no face reaches into, and their faces and barycentrics.

    Args: offsets: (k, 2) or (1, 2), from 0 to 1, where the first point lies in its part of the texel.
    """
    counts, face = np.zeros(len(texels), np.int64), np.empty((len(texels), _MOST), np.int64)
    weights = np.empty((len(texels), _MOST, 3), np.float32)

    def work(first: int, last: int) -> None:
        block = slice(first, last)
        own = offsets[block] if len(offsets) > 1 else offsets
        found = counts[block], face[block], weights[block]
        faces = page.corners, page.crowding
        _search(page.tree, new_stack(), faces, texels[block], width, page.radius, own, found)

    run_blocks(len(texels), _BLOCK, work, threads, most=_SHARE)
    there = np.arange(_MOST) < counts[:, None]
    return counts, face[there], weights[there]


@kernel
def _search(tree, stack, faces, texels, width, radius, offsets, found):
    tree = unrefcounted_view(tree)
    texels = unrefcounted_view(texels)
    corners, crowding = faces
    counts, face, barycentric = unrefcounted_view(found)
    polygon = np.empty((_CORNERS, 2))
    scratch = np.empty((_CORNERS, 2))
    weights = np.empty(3)
    for i in range(len(texels)):
        left, top = np.float64(texels[i] % width), np.float64(texels[i] // width)
        along, across = offsets[i % len(offsets), 0], offsets[i % len(offsets), 1]
        total, crowd, met = 0.0, 0.0, 0
        for placing in range(2):
            if placing:
                if total == 0.0:
                    break
                few = crowd < _CROWDED and met == 1
                counts[i] = SLOTS if few else _MORE if crowd < _FULL else _MOST
            done, k = 0.0, 0
            around = begin(tree, stack, (left + 0.5, top + 0.5, 0.0), radius)
            leaf, near = next_leaf(tree, stack, around)
            while near != 0:
                while near != 0:
                    f = tree.rows[leaf, lowest_bit(near)]
                    near &= near - 1
                    area, count = _common(corners[f], left, top, polygon, scratch)
                    if area <= min(_LEAST, _OF_FACE * _area(corners[f], 1)):
                        continue
                    if not placing:
                        total += area
                        crowd += area * crowding[f]
                        met += 1
                        continue
                    for corner in range(1, count - 1):  # the polygon is a fan of triangles
                        part = _area(polygon, corner)
                        while k < counts[i] and (k + along) * total < (done + part) * counts[i]:
                            outwards = np.sqrt(((k + along) * total / counts[i] - done) / part)
                            sideways = (_reversed(k) + across) % 1.0
                            for axis in range(2):
                                a, b, c = polygon[0, axis], polygon[corner, axis], polygon[corner + 1, axis]
                                weights[axis] = a + outwards * (b - a + sideways * (c - b))
                            _weights(corners[f], left + weights[0], top + weights[1], weights)
                            face[i, k] = f
                            for own in range(3):
                                barycentric[i, k, own] = weights[own]
                            k += 1
                        done += part
                leaf, near = next_leaf(tree, stack, around)
            if placing:
                counts[i] = k


@inline
def _area(polygon, k):
    """The area of the triangle of the first corner, corner k and the next."""
    ax, ay = polygon[k, 0] - polygon[0, 0], polygon[k, 1] - polygon[0, 1]
    bx, by = polygon[k + 1, 0] - polygon[0, 0], polygon[k + 1, 1] - polygon[0, 1]
    return abs(ax * by - ay * bx) / 2.0


@inline
def _reversed(k):
    """The radical inverse of k < 64 in base 2."""
    fraction = 0.0
    for bit in range(6):
        fraction += ((k >> bit) & 1) * 0.5 ** (bit + 1)
    return fraction


@inline
def _common(triangle, left, top, polygon, scratch):
    """Area of what a triangle and a texel have in common (Sutherland & Hodgman 1974), and how many corners it has.

    Args: polygon: receives these, from the texel's corner on.
    """
    for k in range(3):
        polygon[k, 0], polygon[k, 1] = triangle[k, 0] - left, triangle[k, 1] - top
    count = 3
    for side in range(4):
        axis, low = side % 2, side < 2
        kept = 0
        for k in range(count):
            ahead = (k + 1) % count
            here = polygon[k, axis] if low else 1.0 - polygon[k, axis]
            there = polygon[ahead, axis] if low else 1.0 - polygon[ahead, axis]
            if here >= 0.0:
                scratch[kept, 0], scratch[kept, 1] = polygon[k, 0], polygon[k, 1]
                kept += 1
            if (here < 0.0) != (there < 0.0):
                part = here / (here - there)
                for c in range(2):
                    scratch[kept, c] = polygon[k, c] + part * (polygon[ahead, c] - polygon[k, c])
                kept += 1
        count, polygon, scratch = kept, scratch, polygon
    area = 0.0
    for k in range(1, count - 1):
        area += _area(polygon, k)
    return area, count


@inline
def _weights(triangle, x, y, out):
    for k in range(3):
        b, c = (k + 1) % 3, (k + 2) % 3
        bx, by = triangle[b, 0] - x, triangle[b, 1] - y
        cx, cy = triangle[c, 0] - x, triangle[c, 1] - y
        out[k] = bx * cy - by * cx
    total = out[0] + out[1] + out[2]
    for k in range(3):
        out[k] = max(out[k] / total, 0.0)
    total = out[0] + out[1] + out[2]
    for k in range(3):
        out[k] /= total
