"""Upsampling: w at all points of a dense mesh from the baked points.

Every point belongs to the cell of the baked point that is nearest along edges; baked points whose cells touch are
neighbours. A point between baked points is predicted by the plane through the values of the nearest one and its
neighbours (weighted least squares over the tangent plane): linear functions over a plane are predicted exactly.
"""

from dataclasses import replace

import numpy as np

from raytrace.kernel.arrays import unrefcounted_view
from raytrace.kernel.counting_sort import counting_sort
from raytrace.kernel.jit import inline, kernel
from raytrace.system.threads import run_blocks
from raytrace.types import Bools, Float32s, Float64s, Int32s, Int64s

from ..points.points import Points
from .one_ring import Neighbours

_BLOCK, _SHARE = 1 << 10, 16  # points, and blocks at once
_MOST = 32  # baked points that a prediction looks at


def nearest_baked(neighbours: Neighbours, baked: Bools) -> Int64s:
    """The nearest of the `baked` points (k,) to each point, by number of edges; −1 where no path leads to one."""
    nearest = np.where(baked, np.arange(len(baked)), -1)
    queue = np.empty(len(baked), np.int64)
    first = np.flatnonzero(baked)
    queue[: len(first)] = first
    _flood(neighbours.starts, neighbours.indices, nearest, queue, len(first))
    return nearest


@kernel
def _flood(starts, indices, nearest, queue, last):
    first = 0
    while first < last:
        i = queue[first]
        first += 1
        for k in range(starts[i], starts[i + 1]):
            j = indices[k]
            if j >= 0 and nearest[j] < 0:
                nearest[j] = nearest[i]
                queue[last] = j
                last += 1


def coarsened(neighbours: Neighbours, nearest: Int64s, normals: Float32s) -> tuple[Neighbours, Int64s, Int32s]:
    """The graph of the baked points' neighbours, the baked points (b,), ascending, and the cell (k,) of each point.

    Args: nearest: (k,), as `nearest_baked` gives it, ≥ 0 everywhere. normals: float32 (k, 3), of all points.
    """
    baked = np.flatnonzero(nearest == np.arange(len(nearest)))
    row = np.empty(len(nearest), np.int32)
    row[baked] = np.arange(len(baked), dtype=np.int32)
    cell = row[nearest]
    if len(baked) == len(nearest):
        return neighbours, baked, cell
    starts = np.zeros(len(baked) + 1, np.int64)
    members, _ = counting_sort(cell, len(baked))
    indices = np.empty(len(neighbours.indices), np.int32)  # more than there are
    _adjacent(neighbours.starts, neighbours.indices, cell, members, starts, indices)
    indices = indices[: starts[-1]].copy()
    alike = np.ones(len(indices), np.float32)
    return Neighbours.weighted(starts, indices, alike, normals[baked], neighbours.threads), baked, cell


@kernel
def _adjacent(starts, indices, cell, members, cell_starts, cell_others):
    """List the cells beside each cell, each once. Args: members: points sorted by their cell."""
    seen = np.full(len(cell_starts) - 1, -1, np.int32)
    last = 0
    for i in members:
        here = cell[i]
        for k in range(starts[i], starts[i + 1]):
            if indices[k] >= 0:
                other = cell[indices[k]]
                if other != here and seen[other] != here:
                    seen[other] = here
                    cell_others[last] = other
                    last += 1
        cell_starts[here + 1] = last


def upsample(
    points: Points, wanted: Int64s, graph: Neighbours, baked: Int64s, cell: Int32s, values: Float64s, variances: int = 0
) -> Float64s:
    """Values (j, c) at the points `wanted` (j,) from the baked points' values (b, c), which stay as they are.

    Args: graph, baked, cell: as `coarsened` gives them. variances: how many of the last columns are variances.
    """
    cells = cell[wanted]
    out = np.empty((len(wanted), values.shape[1]))
    arrays = baked, graph.starts, graph.indices

    def work(first: int, last: int) -> None:
        scratch = np.empty((_MOST, 4))
        rows = wanted[first:last], cells[first:last]
        _upsample(points.arrays, arrays, *rows, values, values.shape[1] - variances, scratch, out[first:last])

    run_blocks(len(wanted), _BLOCK, work, graph.threads, most=_SHARE)
    return out


def extrapolate(
    points: Points, wanted: Int64s, graph: Neighbours, baked: Int64s, cell: Int32s, values: Float64s
) -> Float64s:
    """`upsample` to the points `wanted`, with the others' own values (k, c): past the outermost baked points.

    Planes are extrapolated one edge at most: farther on, noise would grow. Args: values: the last column is a variance.
    """
    positions = points.origins.astype(np.float64)
    valence = np.diff(graph.starts)
    own = cell[wanted]
    needed = np.zeros(len(baked), np.bool_)
    needed[own] = True
    here = np.repeat(np.flatnonzero(needed), valence[needed])
    ends = graph.indices[np.repeat(needed, valence)]
    lengths = np.linalg.norm(positions[baked[ends]] - positions[baked[here]], axis=1)
    edge = np.bincount(here, lengths, len(baked)) / np.maximum(valence, 1)
    nearest = positions[baked[own]]
    away = positions[wanted] - nearest
    distance = np.maximum(np.linalg.norm(away, axis=1), 1e-30)
    away *= np.minimum(1.0, edge[own] / distance)[:, None]
    moved = replace(points, origins=points.origins.copy())
    moved.origins[wanted] = nearest + away
    rows = np.empty((len(positions), values.shape[1]))
    values = np.ascontiguousarray(values)
    rows[baked], rows[wanted] = values, upsample(moved, wanted, graph, baked, cell, values, variances=1)
    return rows


@kernel
def _upsample(points, graph, wanted, cell, values, plain, scratch, out):
    """Write values at the points `wanted` (j,) of cells `cell` (j,); the columns from `plain` on are variances.

    Args: graph: the baked points' rows, `starts` and `indices`.
    """
    points = unrefcounted_view(points)
    graph = unrefcounted_view(graph)
    baked, starts, indices = graph
    wanted = unrefcounted_view(wanted)
    cell = unrefcounted_view(cell)
    values = unrefcounted_view(values)
    scratch = unrefcounted_view(scratch)
    out = unrefcounted_view(out)
    for row in range(len(wanted)):
        o = cell[row]
        if baked[o] == wanted[row]:
            for column in range(values.shape[1]):
                out[row, column] = values[o, column]
            continue
        count, spread = _relative_positions(points, graph, wanted[row], o, scratch)
        own = _weigh_plane_fit(points.normals[wanted[row]], spread, scratch[:count])
        for column in range(values.shape[1]):
            total = 0.0
            for k in range(1, count):
                value = values[indices[starts[o] + k - 1], column]
                q = scratch[k, 3]
                total += q * (value - values[o, column]) if column < plain else q * q * value
            out[row, column] = total + values[o, column] * (1.0 if column < plain else own * own)


@inline
def _relative_positions(points, graph, i, o, samples):
    """Set rows of `samples` to positions relative to point i, and weights by normals, of baked point o and its
    neighbours; their number, and the mean of their squared distances."""
    origins, normals, (baked, starts, indices) = points.origins, points.normals, graph
    count, spread = 0, 0.0
    for k in range(starts[o] - 1, min(starts[o + 1], starts[o] + _MOST - 1)):
        c = baked[o if k < starts[o] else indices[k]]
        cosine, squared = 0.0, 0.0
        for axis in range(3):
            d = np.float64(origins[c, axis]) - origins[i, axis]
            cosine += normals[i, axis] * normals[c, axis]
            squared += d * d
            samples[count, axis] = d
        samples[count, 3] = max(cosine, 1e-3) ** 8
        spread += squared
        count += 1
    return count, max(spread / count, 1e-30)


@inline
def _weigh_plane_fit(n, spread, samples):
    """Turn positions and weights by normals into weights of samples in the value at 0 of the plane fitted to them over
    coordinates u, v across n; the first one's weight."""
    tx, ty, tz = (0.0, n[2], -n[1]) if abs(n[0]) < 0.6 else (-n[2], 0.0, n[0])
    length = np.sqrt(tx * tx + ty * ty + tz * tz)
    tx = tx / length
    ty = ty / length
    tz = tz / length
    bx = n[1] * tz - n[2] * ty
    by = n[2] * tx - n[0] * tz
    bz = n[0] * ty - n[1] * tx
    s0 = su = sv = suu = suv = svv = 0.0
    for k in range(len(samples)):
        x = samples[k, 0]
        y = samples[k, 1]
        z = samples[k, 2]
        u = (x * tx + y * ty + z * tz) / np.sqrt(spread)
        v = (x * bx + y * by + z * bz) / np.sqrt(spread)
        w = samples[k, 3] / (1.0 + (x * x + y * y + z * z) / spread)
        samples[k, 0], samples[k, 1], samples[k, 3] = u, v, w
        s0 += w
        su += w * u
        sv += w * v
        suu += w * u * u
        suv += w * u * v
        svv += w * v * v
    suu += 0.02 * s0  # a plane through samples in a row, or too few of them, leans no further than they do
    svv += 0.02 * s0
    # first row of the inverse moments
    a = suu * svv - suv * suv
    b = suv * sv - su * svv
    c = su * suv - suu * sv
    determinant = s0 * a + su * b + sv * c
    own = 1.0
    for k in range(1, len(samples)):
        samples[k, 3] *= (a + b * samples[k, 0] + c * samples[k, 1]) / determinant
        own -= samples[k, 3]
    return own
