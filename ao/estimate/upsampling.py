"""Upsampling: w at all points of a dense mesh from the baked points.

A point between baked points is predicted by the plane through the values of the nearest one and its
neighbours (weighted least squares over the tangent plane): linear functions over a plane are predicted exactly.
"""

from dataclasses import replace

import numpy as np

from raytrace.kernel.arrays import unrefcounted_view
from raytrace.kernel.jit import inline, kernel
from raytrace.kernel.vector import dot, load, store, subtract, tangents
from raytrace.system.threads import run_blocks
from raytrace.types import Float64s, Int32s

from ..points.points import Points
from .cells import Cells
from .one_ring import Neighbours

_BLOCK, _SHARE = 1 << 10, 16  # points, and blocks at once
_MOST = 32  # cells that a prediction looks at


def upsample(
    points: Points, cell: Int32s, graph: Neighbours, centres: Points, values: Float64s, variances: int = 0
) -> Float64s:
    """Values (k, c) at `points` from the values (b, c) at the centres of their cells.

    Args: cell: (k,), of each point. graph: of the cells. variances: how many of the last columns are variances.
    """
    out = np.empty((len(points), values.shape[1]))
    nodes = centres.origins, centres.normals, graph.starts, graph.indices

    def work(first: int, last: int) -> None:
        scratch = np.empty((_MOST, 4))
        rows = points[first:last].arrays, cell[first:last]
        _upsample(*rows, nodes, values, values.shape[1] - variances, scratch, out[first:last])

    run_blocks(len(points), _BLOCK, work, graph.threads, most=_SHARE)
    return out


def extrapolate(points: Points, cells: Cells, graph: Neighbours, values: Float64s) -> Float64s:
    """Values (k, c) at all `points` from those at the centres (b, c): past the outermost ones.

    Planes are extrapolated one edge at most: farther on, noise would grow. Args: values: the last column is a variance.
    """
    centres = points[cells.centres]
    positions = centres.origins.astype(np.float64)
    valence = np.diff(graph.starts)
    wanted = np.delete(np.arange(len(points)), cells.centres)
    own = cells.cell[wanted]
    needed = np.zeros(len(centres), np.bool_)
    needed[own] = True
    here = np.repeat(np.flatnonzero(needed), valence[needed])
    ends = graph.indices[np.repeat(needed, valence)]
    lengths = np.linalg.norm(positions[ends] - positions[here], axis=1)
    edge = np.bincount(here, lengths, len(centres)) / np.maximum(valence, 1)
    moved = points[wanted]
    away = moved.origins - positions[own]
    distance = np.maximum(np.linalg.norm(away, axis=1), 1e-30)
    away *= np.minimum(1.0, edge[own] / distance)[:, None]
    moved = replace(moved, origins=(positions[own] + away).astype(np.float32))
    rows = np.empty((len(points), values.shape[1]))
    values = np.ascontiguousarray(values)
    rows[cells.centres] = values
    rows[wanted] = upsample(moved, own, graph, centres, values, variances=1)
    return rows


@kernel
def _upsample(points, cell, nodes, values, plain, scratch, out):
    """Write values at the points; the columns from `plain` on are variances.

    Args: nodes: the cells' centres: `origins`, `normals`, `starts` and `indices`.
    """
    points = unrefcounted_view(points)
    nodes = unrefcounted_view(nodes)
    starts, indices = nodes[2], nodes[3]
    cell = unrefcounted_view(cell)
    values = unrefcounted_view(values)
    scratch = unrefcounted_view(scratch)
    out = unrefcounted_view(out)
    for row in range(len(cell)):
        o = cell[row]
        count, spread = _relative_positions(load(points.origins, row), load(points.normals, row), nodes, o, scratch)
        own = _weigh_plane_fit(load(points.normals, row), spread, scratch[:count])
        for column in range(values.shape[1]):
            total = 0.0
            for k in range(1, count):
                value = values[indices[starts[o] + k - 1], column]
                q = scratch[k, 3]
                total += q * (value - values[o, column]) if column < plain else q * q * value
            out[row, column] = total + values[o, column] * (1.0 if column < plain else own * own)


@inline
def _relative_positions(p, normal, nodes, o, samples):
    """Set rows of `samples` to positions relative to a point `p`, and weights by normals, of a cell's centre and its
    neighbours; their number, and the mean of their squared distances."""
    origins, normals, starts, indices = nodes
    count, spread = 0, 0.0
    for k in range(starts[o] - 1, min(starts[o + 1], starts[o] + _MOST - 1)):
        c = o if k < starts[o] else indices[k]
        away = subtract(load(origins, c), p)
        store(samples, count, away)
        samples[count, 3] = max(dot(normal, load(normals, c)), 1e-3) ** 8
        spread += dot(away, away)
        count += 1
    return count, max(spread / count, 1e-30)


@inline
def _weigh_plane_fit(n, spread, samples):
    """Turn positions and weights by normals into weights of samples in the value at 0 of the plane fitted to them over
    coordinates u, v across n; the first one's weight."""
    t, b = tangents(n)
    s0 = su = sv = suu = suv = svv = 0.0
    for k in range(len(samples)):
        away = load(samples, k)
        u = dot(away, t) / np.sqrt(spread)
        v = dot(away, b) / np.sqrt(spread)
        w = samples[k, 3] / (1.0 + dot(away, away) / spread)
        store(samples, k, (u, v, 0.0))
        samples[k, 3] = w
        s0 += w
        su += w * u
        sv += w * v
        suu += w * u * u
        suv += w * u * v
        svv += w * v * v
    suu += 0.02 * s0  # a plane through samples in a row, or too few of them, leans no further than they do
    svv += 0.02 * s0
    # first row of the inverse moments
    of_value = suu * svv - suv * suv
    of_u = suv * sv - su * svv
    of_v = su * suv - suu * sv
    determinant = s0 * of_value + su * of_u + sv * of_v
    own = 1.0
    for k in range(1, len(samples)):
        samples[k, 3] *= (of_value + of_u * samples[k, 0] + of_v * samples[k, 1]) / determinant
        own -= samples[k, 3]
    return own
