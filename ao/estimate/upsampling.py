"""Upsampling: w at all points of a dense mesh from the baked points.

Every point belongs to the cell of the baked point that is nearest along edges; baked points whose cells touch are
neighbours. A point between baked points is predicted by the plane through the values of the nearest one and its
neighbours (weighted least squares over the tangent plane): linear functions over a plane are predicted exactly.
"""

from dataclasses import replace
from typing import NamedTuple, Self

import numpy as np

from raytrace.kernel.arrays import unrefcounted_view
from raytrace.kernel.counting_sort import counting_sort
from raytrace.kernel.jit import bind, inline, kernel
from raytrace.kernel.vector import dot, load, store, subtract
from raytrace.system.threads import run_blocks
from raytrace.types import AnyInts, Bools, Float32s, Float64s, Int32s, Int64s

from ..points.points import Points
from .one_ring import Neighbours

_BLOCK, _SHARE = 1 << 10, 16  # points, and blocks at once
_MOST = 32  # cells that a prediction looks at
_CELL, _STEPS = 4, 4  # points of a cell, about; edges between a point and its centre, at most


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


class Cells(NamedTuple):
    """Cells of k points around some of them, their centres."""

    centres: Int64s  # (c,), ascending
    cell: Int32s  # (k,), of each point
    members: Int32s  # (k,), points by their cell, ascending in each
    starts: Int64s  # (c + 1,), where the members of each cell begin

    @classmethod
    def of(cls, nearest: AnyInts) -> Self:
        """Args: nearest: (k,), the centre of each point, itself for a centre."""
        centres = np.flatnonzero(nearest == np.arange(len(nearest)))
        number = np.empty(len(nearest), np.int32)
        number[centres] = np.arange(len(centres), dtype=np.int32)
        cell = number[nearest]
        members, starts = counting_sort(cell, len(centres))
        return cls(centres, cell, members.astype(np.int32), starts)

    @classmethod
    def about_four(cls, neighbours: Neighbours) -> Self:
        """Cells of about four points: every fourth one and those a few edges away; of one where none is so near."""
        rows = np.arange(len(neighbours.starts) - 1, dtype=np.int32)
        nearest = np.where(rows % _CELL == 0, rows, np.int32(-1))
        for _ in range(_STEPS):
            before = nearest.copy()
            neighbours.each(bind(_step, *neighbours.ring, before, nearest))
        return cls.of(np.where(nearest < 0, rows, nearest))

    def joined(self, neighbours: Neighbours, normals: Float32s) -> Neighbours:
        """The graph of the cells, neighbours where points of theirs are. Args: normals: float32 (c, 3)."""
        if len(self.centres) == len(self.cell):
            return neighbours
        links = neighbours.starts, neighbours.indices, self
        listed = np.zeros(len(self.starts), np.int64)
        threads = neighbours.threads
        run_blocks(len(self.centres), _BLOCK, bind(_list_links, *links, listed, None), threads, most=_SHARE)
        np.cumsum(listed, out=listed)
        ends = np.empty(listed[-1], np.int32)
        run_blocks(len(self.centres), _BLOCK, bind(_list_links, *links, listed, ends), threads, most=_SHARE)
        merged = Neighbours.merged(listed, ends, threads)
        alike = np.ones(len(merged.indices), np.float32)
        return Neighbours.weighted(merged.starts, merged.indices, alike, normals, threads)


@kernel
def _step(starts, indices, weights, before, nearest, first, last):
    """Give points without a centre that of the most similar neighbour that had one `before`."""
    for i in range(first, last):
        most = np.float32(-1.0)
        for k in range(starts[i], starts[i + 1]):
            if before[i] < 0 and before[indices[k]] >= 0 and weights[k] > most:
                nearest[i] = before[indices[k]]
                most = weights[k]


@kernel
def _list_links(starts, indices, cells, listed, ends, first, last):
    """List the cell beyond each link out of a cell from listed[c] on, or count these links: listed[c + 1]."""
    cells = unrefcounted_view(cells)
    for c in range(first, last):
        count = 0
        for member in range(cells.starts[c], cells.starts[c + 1]):
            i = cells.members[member]
            for k in range(starts[i], starts[i + 1]):
                other = cells.cell[indices[k]]
                if other != c:
                    if ends is not None:
                        ends[listed[c] + count] = other
                    count += 1
        if ends is None:
            listed[c + 1] = count


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
        own = _weigh_plane_fit(points.normals[row], spread, scratch[:count])
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
