"""Shaft culling of shadow rays: lights that nothing can hide, by boxes around all that casts shadows.

A shaft is the union of all shadow rays from a box of origins to a light (Haines & Wallace 1991, "Shaft Culling for
Efficient Ray-Traced Radiosity"). The cross-section of the shaft, part t of the way, is a box whose sides move linearly
with t, so a box meets the shaft where six linear inequalities in t hold together. Where no box does, no shadow ray
need be traced.

The test errs on the side of tracing: ends and boxes are larger than Embree's rounding. A box that is exactly flat,
like a floor's, is not thickened across: a ray from above it that runs upwards is never found to meet it, since
Embree's signs are exact there. So a floor does not hide the light from the points on it, lifted as they are.
"""

import numpy as np

from ..kernel.arrays import aligned
from ..kernel.jit import inline, kernel
from ..kernel.simd import WIDE, load_row, select, some
from ..kernel.vector import add, scale, subtract, triple
from ..lights.kernels import DIRECTION, DIRECTIONAL, POSITION, RADIUS
from ..mesh.placement import NEAR
from ..types import Float32Grid, Float32Rows, Float32s, Float64s, Int32Rows, Int32s, Int64s

SLACK = 2.0**-18  # of the largest coordinate: sixteen times what Embree's edge tests can be off
ROUNDED = np.float32(2.0**-20)  # relative error of a place on the way, and more
GRID = 8  # clusters along a mesh's longest side, at most
_FACES = 2  # in a cluster, about, where there are few
_BOXES = 1024  # of all objects together, about


def cluster(vertices: Float32s, faces: Int32s, objects: int) -> Float64s:
    """Boxes (n, 2, 3), low and high corners, around clusters of a mesh's faces.

    Args:
        objects: how many objects there are, which share a number of boxes.
    """
    low = vertices.min(axis=0).clip(-NEAR, NEAR)
    high = vertices.max(axis=0).clip(-NEAR, NEAR)
    longest = float((high - low).max())
    side = longest if longest > 1e-30 else 1.0
    finest = np.sqrt(min(len(faces) / _FACES, _BOXES / objects) / 5)  # a sphere goes through some 4 n² cells of n³
    size = side / np.clip(np.ceil(finest), 1, GRID)
    cells = np.maximum(1, np.ceil((high - low) / size)).astype(np.int64)
    boxes = np.empty((int(cells.prod()), 2, 3), np.float32)
    boxes[:, 0], boxes[:, 1] = np.inf, -np.inf
    _enclose(vertices, faces, low, np.float32(1 / size), cells, boxes)
    return boxes[boxes[:, 0, 0] <= boxes[:, 1, 0]].astype(np.float64)


@kernel
def _enclose(
    vertices: Float32Rows, faces: Int32Rows, low: Float32s, per_length: np.float32, cells: Int64s, boxes: Float32Grid
) -> None:
    """Grow the box of the grid's cell that a face's centre lies in around the face."""
    for f in range(len(faces)):
        cell = 0
        for axis in range(3):
            sum_ = vertices[faces[f, 0], axis] + vertices[faces[f, 1], axis] + vertices[faces[f, 2], axis]
            at = int((sum_ / np.float32(3.0) - low[axis]) * per_length)
            cell = cell * cells[axis] + max(0, min(cells[axis] - 1, at))
        for corner in range(3):
            for axis in range(3):
                x = vertices[faces[f, corner], axis]
                boxes[cell, 0, axis] = min(boxes[cell, 0, axis], x)
                boxes[cell, 1, axis] = max(boxes[cell, 1, axis], x)


def merged(boxes: Float64s) -> Float64s:
    """Boxes (n, 2, 3), or where they are many, those around neighbours: every light looks through all of them."""
    if len(boxes) <= 4 * _BOXES:
        return boxes
    middles = boxes.mean(axis=1).clip(-NEAR, NEAR)
    size = np.ptp(middles, axis=0).max() / 2 / GRID or 1.0
    cells, of = np.unique(np.floor((middles - middles.min(axis=0)) / size), axis=0, return_inverse=True)
    ends = np.stack([np.full((len(cells), 3), np.inf), np.full((len(cells), 3), -np.inf)], axis=1)
    np.minimum.at(ends[:, 0], of, boxes[:, 0])
    np.maximum.at(ends[:, 1], of, boxes[:, 1])
    return ends


def pack_boxes(boxes: Float64s) -> Float32s:
    """Boxes (n, 2, 3) thickened and packed for `obstructed`: float32 (⌈n/16⌉, 6, 16), low and high corners."""
    thick = SLACK * np.maximum(1.0, np.abs(boxes).max(axis=(1, 2)))[:, None]
    flat = boxes[:, 0] == boxes[:, 1]
    grown = np.stack([boxes[:, 0] - np.where(flat, 0, thick), boxes[:, 1] + np.where(flat, 0, thick)], axis=1)
    groups = -(-len(boxes) // WIDE)
    padded = np.full((groups * WIDE, 6), np.nan)
    padded[: len(boxes)] = grown.reshape(-1, 6)
    packed = aligned((groups, 6, WIDE), np.float32)
    packed[:] = padded.reshape(groups, WIDE, 6).transpose(0, 2, 1)
    return packed


@inline
def obstructed(boxes, farthest, start, shift, kind, row):
    """Whether some box may meet a shadow ray to a light.

    Args: boxes: of `pack_boxes`. farthest: of `Geometry`. start: corners of a box of the rays' origins, float32; shift:
        of a box of the origins less the points that are lit. kind, row: of the light, not an ambient one.
    """
    size = 1.0
    for axis in range(3):
        size = max(size, abs(start[0][axis]), abs(start[1][axis]), abs(row[POSITION + axis]))
    slack = SLACK * size
    if kind == DIRECTIONAL:
        end, around = scale(-farthest, triple(row, DIRECTION)), start
    else:
        end, around = triple(row, POSITION), shift
    margin = slack + row[RADIUS] * (farthest if kind == DIRECTIONAL else 1.0)
    margin = (margin, margin, margin)
    end_low = subtract(add(end, around[0]), margin)
    end_high = add(add(end, around[1]), margin)
    for box in boxes:
        begin = 0.0 * load_row(box, 0)
        end = begin + 1.0
        for axis in range(3):
            begin, end = narrowed(begin, end, load_row(box, 3 + axis) - start[0][axis], end_low[axis] - start[0][axis])
            begin, end = narrowed(begin, end, start[1][axis] - load_row(box, axis), start[1][axis] - end_high[axis])
        if some(begin * (1.0 - ROUNDED) <= end * (1.0 + ROUNDED)):
            return True
    return False


@inline
def narrowed(begin, end, limit, slope):
    """The part [begin, end] of the way in which also t · pace ≤ room."""
    slope = np.float32(slope)
    if slope > 0.0:
        return begin, min(limit * (np.float32(1.0) / slope), end)
    if slope < 0.0:
        return max(limit * (np.float32(1.0) / slope), begin), end
    return begin, select(limit < 0.0, -1.0, end)
