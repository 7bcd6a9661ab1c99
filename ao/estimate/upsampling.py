"""Upsampling: w at the points of a dense mesh from those of them that are baked.

Every point belongs to the baked point that is nearest along edges, its owner; baked points whose points touch are
neighbours. A point between baked ones is predicted by the plane through its owner's and its owner's neighbours' values
(weighted least squares over the tangent plane), so that what varies linearly over the surface is predicted exactly.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from raytrace.kernel.borrow import borrow
from raytrace.kernel.counting_sort import counting_sort
from raytrace.kernel.jit import kernel
from raytrace.system.threads import run_blocks
from raytrace.types import Bools, Float32s, Float64s, Int32s, Int64s

from ..points.points import Points
from .one_ring import Neighbours

_BLOCK = 1 << 14
_MOST = 32  # baked points that a prediction looks at


def nearest_baked(neighbours: Neighbours, baked: Bools) -> Int64s:
    """For each point the nearest of the `baked` ones (k,), by number of edges; −1 where no path leads to one."""
    owner = np.where(baked, np.arange(len(baked)), -1)
    queue = np.empty(len(baked), np.int64)
    queue[: np.count_nonzero(baked)] = np.flatnonzero(baked)
    _flood(neighbours.starts, neighbours.others, owner, queue, int(np.count_nonzero(baked)))
    return owner


@kernel
def _flood(starts, others, owner, queue, last):
    first = 0
    while first < last:
        i = queue[first]
        first += 1
        for k in range(starts[i], starts[i + 1]):
            j = others[k]
            if j >= 0 and owner[j] < 0:
                owner[j] = owner[i]
                queue[last] = j
                last += 1


def coarsened(neighbours: Neighbours, owner: Int64s, normals: Float32s) -> tuple[Neighbours, Int64s, Int32s]:
    """Neighbours among the baked points, the baked points (b,), ascending, and which of them owns each point, (k,).

    Args: owner: (k,), as `nearest_baked` gives it, ≥ 0 everywhere. normals: float32 (k, 3), of all points.
    """
    baked = np.flatnonzero(owner == np.arange(len(owner)))
    row = np.empty(len(owner), np.int32)
    row[baked] = np.arange(len(baked), dtype=np.int32)
    cell = row[owner]
    if len(baked) == len(owner):
        return neighbours, baked, cell
    starts = np.zeros(len(baked) + 1, np.int64)
    members, _ = counting_sort(cell, len(baked))
    others = np.empty(_crossings(neighbours.starts, neighbours.others, cell), np.int32)
    _adjacent(neighbours.starts, neighbours.others, cell, members, starts, others)
    others = others[: starts[-1]].copy()
    alike = np.ones(len(others), np.float32)
    return Neighbours.weighted(starts, others, alike, normals[baked], neighbours.threads), baked, cell


@kernel
def _crossings(starts, others, cell):
    count = 0
    for i in range(len(cell)):
        for k in range(starts[i], starts[i + 1]):
            count += others[k] >= 0 and cell[others[k]] != cell[i]
    return count


@kernel
def _adjacent(starts, others, cell, members, cell_starts, cell_others):
    """List the cells that touch each cell, once each. Args: members: points sorted by their cell."""
    seen = np.full(len(cell_starts) - 1, -1, np.int32)
    last = 0
    for i in members:
        here = cell[i]
        for k in range(starts[i], starts[i + 1]):
            if others[k] >= 0:
                other = cell[others[k]]
                if other != here and seen[other] != here:
                    seen[other] = here
                    cell_others[last] = other
                    last += 1
        cell_starts[here + 1] = last


def upsample(
    points: Points, wanted: Int64s, near: Neighbours, baked: Int64s, cell: Int32s, values: Float64s, variances: int = 0
) -> Float64s:
    """Values (j, c) at the points `wanted` (j,) from those at the baked ones, (b, c), which are kept as they are.

    Args:
        near, baked, cell: as `coarsened` gives them.
        variances: number of columns, the last ones, that are variances of independent values.
    """
    cells, out = cell[wanted], np.empty((len(wanted), values.shape[1]))
    graph = _BakedPoints(baked, near.starts, near.others)

    def work(first: int, last: int) -> None:
        scratch = np.empty((_MOST, 4))
        some, owner, rows = wanted[first:last], cells[first:last], out[first:last]
        _upsample(points.arrays, graph, some, owner, values, values.shape[1] - variances, scratch, rows)

    run_blocks(len(wanted), _BLOCK, work, near.threads)
    return out


class _BakedPoints(NamedTuple):
    """Attributes: rows: int64 (b,), of the baked points. starts, others: their `Neighbours`."""

    rows: Int64s
    starts: Int64s
    others: Int32s


@kernel
def _upsample(points, graph, wanted, cell, values, plain, scratch, out):
    """Write values at the points `wanted` (j,), owned by `cell` (j,); the columns from `plain` on are variances."""
    origins, normals, _ = borrow(points)
    baked, starts, others = borrow(graph)
    wanted, cell, values, scratch, out = borrow(wanted), borrow(cell), borrow(values), borrow(scratch), borrow(out)
    for row in range(len(wanted)):
        i = wanted[row]
        o = cell[row]
        if baked[o] == i:
            for column in range(values.shape[1]):
                out[row, column] = values[o, column]
            continue
        n = normals[i]
        count, spread = 0, 0.0
        for k in range(starts[o] - 1, min(starts[o + 1], starts[o] + _MOST - 1)):
            c = baked[o if k < starts[o] else others[k]]
            cosine, squared = 0.0, 0.0
            for axis in range(3):
                d = np.float64(origins[c, axis]) - origins[i, axis]
                cosine += n[axis] * normals[c, axis]
                squared += d * d
                scratch[count, axis] = d
            scratch[count, 3] = max(cosine, 1e-3) ** 8
            spread += squared
            count += 1
        spread = max(spread / count, 1e-30)
        # moments of the weighted samples in the tangent plane
        tx, ty, tz = (0.0, n[2], -n[1]) if abs(n[0]) < 0.6 else (-n[2], 0.0, n[0])
        length = np.sqrt(tx * tx + ty * ty + tz * tz)
        tx, ty, tz = tx / length, ty / length, tz / length
        bx, by, bz = n[1] * tz - n[2] * ty, n[2] * tx - n[0] * tz, n[0] * ty - n[1] * tx
        s0 = su = sv = suu = suv = svv = 0.0
        for k in range(count):
            x, y, z = scratch[k, 0], scratch[k, 1], scratch[k, 2]
            u, v = (x * tx + y * ty + z * tz) / np.sqrt(spread), (x * bx + y * by + z * bz) / np.sqrt(spread)
            w = scratch[k, 3] / (0.1 + (x * x + y * y + z * z) / spread) ** 2
            scratch[k, 0], scratch[k, 1], scratch[k, 3] = u, v, w
            s0 += w
            su += w * u
            sv += w * v
            suu += w * u * u
            suv += w * u * v
            svv += w * v * v
        suu += 0.02 * s0  # a plane through samples in a row, or too few of them, leans no further than they do
        svv += 0.02 * s0
        # first row of the inverse moments: the plane's value at the point itself
        a, b, c2 = suu * svv - suv * suv, suv * sv - su * svv, su * suv - suu * sv
        det = s0 * a + su * b + sv * c2
        own = 1.0
        for k in range(1, count):
            scratch[k, 3] *= (a + b * scratch[k, 0] + c2 * scratch[k, 1]) / det
            own -= scratch[k, 3]
        for column in range(values.shape[1]):
            total = 0.0
            for k in range(1, count):
                value, q = values[others[starts[o] + k - 1], column], scratch[k, 3]
                total += q * (value - values[o, column]) if column < plain else q * q * value
            out[row, column] = total + values[o, column] * (1.0 if column < plain else own * own)
