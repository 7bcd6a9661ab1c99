"""Cells of points: about some of them, the centres, along edges; cells that touch are neighbours."""

from functools import partial
from typing import NamedTuple, Self

import numpy as np

from obscurance.raytrace.kernel.arrays import counting_sort
from obscurance.raytrace.kernel.jit import kernel
from obscurance.raytrace.system.parallel import each
from obscurance.raytrace.types import AnyInts, Bools, Float32s, Int32s, Int64s

from .one_ring import Neighbours

_CELL, _STEPS = 4, 4  # points of a cell, about; edges between a point and its centre, at most


def nearest_baked(neighbours: Neighbours, baked: Bools) -> Int64s:
    """The nearest of the `baked` points (k,) to each point, by number of edges; −1 where no path leads to one."""
    return _flooded(neighbours, np.flatnonzero(baked), len(baked))[0]


def around(neighbours: Neighbours, centres: Int64s, count: int) -> Int64s:
    """About `count` points, the nearest to the points `centres` (c,) by number of edges, with these; ascending."""
    return np.sort(_flooded(neighbours, centres, count)[1])


def _flooded(neighbours: Neighbours, sources: Int64s, enough: int) -> tuple[Int64s, Int64s]:
    """The nearest source of each point, −1 for none; and the points reached, `enough` or all."""
    nearest = np.full(len(neighbours.starts) - 1, -1)
    nearest[sources] = sources
    queue = np.empty(len(nearest), np.int64)
    queue[: len(sources)] = sources
    return nearest, queue[: _flood(neighbours.starts, neighbours.indices, nearest, queue, len(sources), enough)]


@kernel
def _flood(starts: Int32s, indices: Int32s, nearest: Int64s, queue: Int64s, tail: int, enough: int) -> int:
    """Append to the `queue` of points, of length `tail`, their neighbours, and theirs, until there are `enough`."""
    head = 0
    while head < tail < enough:
        i = queue[head]
        head += 1
        for k in range(starts[i], starts[i + 1]):
            j = indices[k]
            if j >= 0 and nearest[j] < 0:
                nearest[j] = nearest[i]
                queue[tail] = j
                tail += 1
    return tail


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
        """Cells of about four points: every fourth and the points a few edges away; of one where none is so near."""
        points = np.arange(len(neighbours.starts) - 1, dtype=np.int32)
        nearest = np.where(points % _CELL == 0, points, np.int32(-1))
        for _ in range(_STEPS):
            before = nearest.copy()
            _step.on(neighbours.threads)(*neighbours.ring, before, nearest)
        return cls.of(np.where(nearest < 0, points, nearest))

    def joined(self, neighbours: Neighbours, normals: Float32s) -> Neighbours:
        """The graph of the cells, neighbours where points of two cells are. Args: normals: float32 (c, 3)."""
        if len(self.centres) == len(self.cell):
            return neighbours
        threads = neighbours.threads
        list_links = partial(_list_links.on(threads), neighbours.starts, neighbours.indices, self)
        merged = Neighbours.merged(list_links, len(self.centres), threads)
        alike = np.ones(len(merged.indices), np.float32)
        return Neighbours.weighted(merged.starts, merged.indices, alike, normals, threads)


@each("nearest")
def _step(i: int, starts: Int32s, indices: Int32s, weights: Float32s, before: Int32s, nearest: Int32s) -> None:
    """Give points without a centre the centre that their most similar neighbour had `before`, the least of several."""
    most = np.float32(-1.0)
    for k in range(starts[i], starts[i + 1]):
        centre = before[indices[k]]
        if before[i] >= 0 or centre < 0 or weights[k] < most or (weights[k] == most and centre > nearest[i]):
            continue
        nearest[i] = centre
        most = weights[k]


@each("places")
def _list_links(
    row: int, starts: Int32s, indices: Int32s, cells: Cells, first: int, places: Int64s, ends: Int32s | None
) -> None:
    """Write the cell beyond each link out of cell first + row from places[row] on, or count them, without `ends`."""
    own, count = first + row, 0
    for member in range(cells.starts[own], cells.starts[own + 1]):
        i = cells.members[member]
        for k in range(starts[i], starts[i + 1]):
            other = cells.cell[indices[k]]
            if other != own:
                if ends is not None:
                    ends[places[row] + count] = other
                count += 1
    if ends is None:
        places[row] = count
