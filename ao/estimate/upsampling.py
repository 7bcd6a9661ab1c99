"""Upsampling: w at all points of a dense mesh from the baked points.

A point between baked points is predicted by the plane through the values of the nearest one and its
neighbours (weighted least squares over the tangent plane): linear functions over a plane are predicted exactly.
"""

from dataclasses import replace
from math import sqrt
from typing import NamedTuple

import numpy as np

from obscurance.raytrace.kernel.arrays import aligned
from obscurance.raytrace.kernel.jit import inline, kernel
from obscurance.raytrace.kernel.simd import (
    WIDE,
    gather,
    gather3,
    lane_numbers,
    load_row,
    pick,
    select,
    store_row,
)
from obscurance.raytrace.kernel.vector import dot, scale, subtract, tangents
from obscurance.raytrace.system.threads import run_blocks
from obscurance.raytrace.types import AnyFloats, Float32Rows, Float32s, Float64s, Int32Rows, Int32s

from ..points.points import PointArrays, Points
from ..rays.ray_blocks import ONE, ZERO
from .cells import Cells
from .one_ring import Neighbours

_BLOCK, _SHARE = 1 << 10, 16  # points, and blocks at once
_MOST = 32  # cells that a prediction looks at
_RIDGE = np.float32(0.02)


def upsample(
    points: Points, cell: Int32s, graph: Neighbours, centres: Points, values: AnyFloats, variances: int = 0
) -> Float32s:
    """Values (k, c) at `points` from the values (b, c) at the centres of their cells.

    Args: cell: (k,), of each point. graph: of the cells. variances: how many of the last columns are variances.
    """
    out = np.empty((len(points), values.shape[1]), np.float32)
    origins = aligned(centres.origins.shape, np.float32)
    normals = aligned(centres.normals.shape, np.float32)
    origins[:], normals[:] = centres.origins, centres.normals
    links = graph.starts, graph.indices
    nodes = _Nodes(origins, normals, *links, np.ascontiguousarray(values, np.float32))

    def work(start: int, stop: int) -> None:
        scratch = _Samples(aligned((_MOST, WIDE), np.int32), aligned((4 * _MOST, WIDE), np.float32))
        part = points[start:stop].arrays, cell[start:stop]
        _upsample(*part, nodes, values.shape[1] - variances, scratch, out[start:stop])

    run_blocks(len(points), _BLOCK, work, graph.threads, most=_SHARE)
    return out


class _Nodes(NamedTuple):
    """The centres of b cells, their one-rings, and values (b, c)."""

    origins: Float32Rows
    normals: Float32Rows
    starts: Int32s
    indices: Int32s
    values: Float32Rows


class _Samples(NamedTuple):
    """What sixteen points look at: their own cells, then neighbours of the cells; missing ones have weight 0."""

    cells: Int32Rows  # (_MOST, WIDE)
    placed: Float32Rows  # (4 _MOST, WIDE), for each cell its position relative to the points, and its weight


def extrapolate(points: Points, cells: Cells, graph: Neighbours, values: Float64s) -> Float64s:
    """Values (k, c) at all `points` from `values` (b, c) at the centres, also past the outermost centres.

    Planes are extrapolated one edge at most: farther on, noise would grow. Args: values: the last column is a variance.
    """
    centres = points[cells.centres]
    positions = centres.origins.astype(np.float64)
    valence = np.diff(graph.starts)
    wanted = np.delete(np.arange(len(points)), cells.centres)
    own_cell = cells.cell[wanted]
    needed = np.zeros(len(centres), np.bool_)
    needed[own_cell] = True
    here = np.repeat(np.flatnonzero(needed), valence[needed])
    ends = graph.indices[np.repeat(needed, valence)]
    lengths = np.linalg.norm(positions[ends] - positions[here], axis=1)
    edge = np.bincount(here, lengths, len(centres)) / np.maximum(valence, 1)
    moved = points[wanted]
    away = moved.origins - positions[own_cell]
    distance = np.maximum(np.linalg.norm(away, axis=1), 1e-30)
    away *= np.minimum(1.0, edge[own_cell] / distance)[:, None]
    moved = replace(moved, origins=(positions[own_cell] + away).astype(np.float32))
    out = np.empty((len(points), values.shape[1]))
    out[cells.centres] = values
    out[wanted] = upsample(moved, own_cell, graph, centres, values, variances=1)
    return out


@kernel
def _upsample(
    points: PointArrays, cell: Int32s, nodes: _Nodes, first_variance: int, samples: _Samples, out: Float32Rows
) -> None:
    """Write values at the points, sixteen at once; the columns from `first_variance` on are variances."""
    columns = nodes.values.shape[1]
    for begin in range(0, len(cell), WIDE):
        point_rows = min(lane_numbers() + begin, len(cell) - 1)
        normal = _triples(points.normals, point_rows)
        count, spread, alike = _find_samples(
            _triples(points.origins, point_rows), normal, nodes, gather(cell, point_rows), samples
        )
        own_weight = _weigh_plane_fit(normal, spread, alike, samples.placed, count)
        own_values = columns * load_row(samples.cells, 0)
        for column in range(columns):
            centre = gather(nodes.values, own_values + column)
            is_variance = column >= first_variance
            total = own_weight * own_weight * centre if is_variance else centre
            for k in range(1, count):
                value = gather(nodes.values, columns * load_row(samples.cells, k) + column)
                weight = load_row(samples.placed, 4 * k + 3)
                total += weight * weight * value if is_variance else weight * (value - centre)
            for lane in range(min(WIDE, len(cell) - begin)):
                out[begin + lane, column] = pick(total, lane)


@inline
def _triples(array, point_rows):
    """Rows of an array (k, 3), a number of each in a lane, as a triple of lanes."""
    return gather(array, 3 * point_rows), gather(array, 3 * point_rows + 1), gather(array, 3 * point_rows + 2)


@inline
def _find_samples(p, normal, nodes, own_cell, samples):
    """Set `samples`, weighted by normals, around points `p` of the cells `own_cell`; returns the most samples of one,
    the mean of the samples' squared distances and the sum of their weights."""
    first_link = gather(nodes.starts, own_cell)
    neighbours = gather(nodes.starts, own_cell + 1) - first_link
    most = 1
    for lane in range(WIDE):
        most = max(most, 1 + int(pick(neighbours, lane)))
    most = min(most, _MOST)
    count = ZERO * p[0]
    spread = total = count
    for k in range(most):
        is_there = neighbours >= k
        cells = own_cell
        if k > 0:
            linked = gather(nodes.indices, select(is_there, first_link + (k - 1), 0))
            cells = select(is_there, linked, own_cell)
        away = subtract(gather3(nodes.origins, cells), p)
        alike = max(dot(normal, gather3(nodes.normals, cells)), np.float32(1e-3))
        alike *= alike
        alike *= alike
        store_row(samples.cells, k, cells)
        for axis in range(3):
            store_row(samples.placed, 4 * k + axis, away[axis])
        alike = select(is_there, alike * alike, ZERO)
        store_row(samples.placed, 4 * k + 3, alike)
        total += alike
        count += select(is_there, ONE, ZERO)
        spread += select(is_there, dot(away, away), ZERO)
    return most, max(spread / count, np.float32(1e-30)), total


@inline
def _weigh_plane_fit(n, spread, alike, placed, count):
    """Turn positions and weights by normals into weights of samples in the value at 0 of the plane fitted to samples
    over coordinates u, v across n; returns the first sample's weight."""
    t, b = tangents(n)
    size = ONE / sqrt(spread)
    s0 = ZERO * spread
    su, sv, suu, suv, svv = s0, s0, s0, s0, s0
    for k in range(count):
        away = scale(size, (load_row(placed, 4 * k), load_row(placed, 4 * k + 1), load_row(placed, 4 * k + 2)))
        u = dot(away, t)
        v = dot(away, b)
        w = load_row(placed, 4 * k + 3) / alike / (ONE + dot(away, away))  # of sum about 1: no product of three is lost
        store_row(placed, 4 * k, u)
        store_row(placed, 4 * k + 1, v)
        store_row(placed, 4 * k + 3, w)
        s0 += w
        su += w * u
        sv += w * v
        suu += w * u * u
        suv += w * u * v
        svv += w * v * v
    suu += _RIDGE * s0  # a plane through samples in a row, or too few of them, leans no further than they do
    svv += _RIDGE * s0
    # first row of the inverse moments
    of_value = suu * svv - suv * suv
    of_u = suv * sv - su * svv
    of_v = su * suv - suu * sv
    size = ONE / (s0 * of_value + su * of_u + sv * of_v)
    own_weight = ONE + ZERO * spread
    for k in range(1, count):
        fitted = of_value + of_u * load_row(placed, 4 * k) + of_v * load_row(placed, 4 * k + 1)
        w = load_row(placed, 4 * k + 3) * fitted * size
        store_row(placed, 4 * k + 3, w)
        own_weight = own_weight - w
    return own_weight
