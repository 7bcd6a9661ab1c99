"""The one-ring of every point, the points joined to it by an edge, and means over it that stop at creases."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import NamedTuple, Self

import numpy as np

from obscurance.raytrace.kernel.arrays import aligned
from obscurance.raytrace.kernel.jit import kernel
from obscurance.raytrace.kernel.simd import WIDE, load_row, load_short_row, multiply_add, select, store_short_row
from obscurance.raytrace.system.parallel import each, parallel
from obscurance.raytrace.system.threads import run_blocks
from obscurance.raytrace.types import AnyInts, Bools, Float32Rows, Float32s, Int32Rows, Int32s, Int64s

Block = Callable[[int, int], None]
ListEnds = Callable[[int, Int64s, Int32s | None], None]
"""Adds how many ends of edges there are at points from the first on to their places, or writes the ends, −1 for none,
from the places on."""
_NOTHING = np.float32(1e-6)  # of weight
_CREASE = 16  # power of n·n' by which a neighbour counts less
_BLOCK, _MOST = 1 << 11, 16  # points, and blocks at once; to wake a thread for fewer takes longer than their work
_LISTED, _PARTS = 1 << 18, 4  # points whose edges are listed at once, at least, and as what part of all at most
_FEW = 32  # ends of edges at a point that are looked through


@dataclass(frozen=True, eq=False)
class Neighbours:
    """The one-ring of every point: the neighbours of point i are indices[starts[i]:starts[i + 1]]."""

    starts: Int32s
    indices: Int32s
    weights: Float32s  # 1 for a neighbour of the same normal, half along an edge with one face
    threads: int

    @classmethod
    def of(cls, faces: Int32s, of_vertex: AnyInts, normals: Float32s, threads: int) -> Self:
        """Neighbours along the edges of `faces` (m, 3).

        Args: of_vertex: (n,), the point of each vertex, −1 for none. normals: float32 (k, 3), unit.
        """
        list_ends = partial(_list_ends.on(threads), faces, of_vertex.astype(np.int32))
        return cls.weighted(*cls.merged(list_ends, len(normals), threads).ring, normals, threads)

    @classmethod
    def linked(cls, here: AnyInts, there: AnyInts, normals: Float32s, threads: int) -> Self:
        """Points joined by links from `here` (l,) to `there` (l,), both ways. Args: normals: float32 (k, 3), unit."""
        count = len(normals)
        one, other = np.asarray(here, np.int64), np.asarray(there, np.int64)
        ends = np.sort(np.concatenate([one * count + other, other * count + one]))
        rows, indices = np.divmod(ends[np.append(True, ends[1:] != ends[:-1])[: len(ends)]], count)
        rows, indices = rows[rows != indices], indices[rows != indices].astype(np.int32)
        starts = np.concatenate([[0], np.cumsum(np.bincount(rows, minlength=count))])
        return cls.weighted(starts.astype(np.int32), indices, np.ones(len(indices), np.float32), normals, threads)

    @classmethod
    def merged(cls, list_ends: ListEnds, count: int, threads: int) -> Self:
        """One-rings of `count` points from the ends of edges at them, half a weight each."""
        listed = np.zeros(count + 1, np.int64)
        list_ends(0, listed[1:], None)
        np.cumsum(listed, out=listed)
        parts = []
        size = max(_LISTED, -(-count // _PARTS))
        for start in range(0, max(count, 1), size):
            places = listed[start : start + size + 1] - listed[start]
            ends = np.empty(places[-1], np.int32)
            list_ends(start, places[:-1].copy(), ends)
            parts.append(cls._merged(places, ends, threads))
        del listed, places, ends
        return cls._joined(parts)

    @classmethod
    def _merged(cls, listed: Int64s, ends: Int32s, threads: int) -> Self:
        """Args: listed: (k + 1,), where the `ends` at each point begin; overwritten, as these are."""
        weights = np.empty(len(ends), np.float32)
        starts = np.zeros(len(listed), np.int64)
        _merge_edges.on(threads)(listed, ends, weights, starts[1:])
        np.cumsum(starts, out=starts)
        indices = np.empty(starts[-1], np.int32)
        merged = np.empty(starts[-1], np.float32)
        narrow = starts.astype(np.int32)
        _pack.on(threads)(listed[:-1], ends, weights, narrow, indices, merged)
        return cls(narrow, indices, merged, threads)

    @classmethod
    def _joined(cls, parts: list[Self]) -> Self:
        """One-rings of points that follow one another. Args: parts: emptied, so that no more memory is taken."""
        begins = np.cumsum([0, *(len(part.indices) for part in parts)])
        starts = np.concatenate([[0], *(part.starts[1:] + begin for part, begin in zip(parts, begins, strict=False))])
        indices = np.empty(begins[-1], np.int32)
        weights = np.empty(begins[-1], np.float32)
        threads = parts[0].threads
        for begin, end in pairwise(begins.tolist()):
            part = parts.pop(0)
            indices[begin:end] = part.indices
            weights[begin:end] = part.weights
        return cls(starts.astype(np.int32), indices, weights, threads)

    @classmethod
    def weighted(cls, starts: Int32s, indices: Int32s, weights: Float32s, normals: Float32s, threads: int) -> Self:
        """One-rings whose `weights` are lowered where the points' `normals`, float32 (k, 3), disagree."""
        _weigh_by_normals.on(threads)(starts, indices, normals, weights)
        return cls(starts, indices, weights, threads)

    def among(self, point_rows: Int64s) -> Self:
        """The one-rings of some points (j,), ascending, of the neighbours that are among them."""
        if len(point_rows) == len(self.starts) - 1:
            return self
        row_of_point = np.full(len(self.starts) - 1, -1, np.int32)
        row_of_point[point_rows] = np.arange(len(point_rows), dtype=np.int32)
        starts = np.zeros(len(point_rows) + 1, np.int64)
        _pick.on(self.threads)(point_rows, self.ring, row_of_point, starts[1:], None)
        np.cumsum(starts, out=starts)
        picked = np.empty(starts[-1], np.int32), np.empty(starts[-1], np.float32)
        _pick.on(self.threads)(point_rows, self.ring, row_of_point, starts[:-1], picked)
        return type(self)(starts.astype(np.int32), *picked, self.threads)

    def blocks(self, size: int, edges: int) -> Iterator["PointBlock"]:
        """All the points, about `size` at once, with those at most so many `edges` away."""
        count = len(self.starts) - 1
        blocks = max(round(count / size), 1)
        if blocks == 1:
            yield PointBlock(np.arange(count), slice(None), slice(None), self)
            return
        for block in range(blocks):
            start = count * block // blocks
            stop = count * (block + 1) // blocks
            is_near = np.zeros(count, np.bool_)
            is_near[start:stop] = True
            _reach(self.starts, self.indices, np.arange(start, stop), edges, is_near)
            rows = np.flatnonzero(is_near)
            first = int(np.searchsorted(rows, start))
            yield PointBlock(rows, slice(start, stop), slice(first, first + stop - start), self.among(rows))

    @property
    def ring(self) -> tuple[Int32s, Int32s, Float32s]:
        return self.starts, self.indices, self.weights

    def smooth(
        self,
        values: Float32s,
        rounds: int,
        spare: Float32s | None = None,
        then: Callable[[Float32s], Block] | None = None,
    ) -> Float32s:
        """`values`, as `means` takes them, averaged with the neighbours', `rounds` times: about so many edges far.

        Args: spare: of the shape of `values`; both are overwritten. then: of the last means.
        """
        for left in range(rounds, 0, -1):
            values, spare = self.means(values, 1.0, spare, then if left == 1 else None), values
        return values

    def means(
        self,
        values: Float32s,
        self_weight: float | Float32s,
        out: Float32s | None = None,
        then: Callable[[Float32s], Block] | None = None,
    ) -> Float32s:
        """Weighted means over the neighbours, NaN without any, in one pass over the points.

        Args: values: (k,), or (k, SHORT). self_weight: of a point's own value, or one for each lane.
            out: what the means are written to. then: makes of the means what is called on blocks once their means are
            written.
        """
        out = np.empty_like(values) if out is None else out
        weight = aligned((WIDE,), np.float32)
        weight[:] = self_weight
        mean = (_mean if values.ndim == 1 else _mean_rows).for_rows(*self.ring, values, weight, out)
        use = then(out) if then else None

        def run(start: int, stop: int) -> None:
            mean(start, stop)
            if use:
                use(start, stop)

        run_blocks(len(out), _BLOCK, run, min(self.threads, len(out) // _BLOCK or 1), most=_MOST)
        return out


class PointBlock(NamedTuple):
    """Points that follow one another, and those around them."""

    rows: Int64s  # (j,), ascending, of them all
    of_all: slice  # the points among all points
    of_rows: slice  # and among `rows`
    neighbours: Neighbours  # of `rows` among one another


@each("rows")
def _pick(
    k: int,
    rows: Int64s,
    ring: tuple[Int32s, Int32s, Float32s],
    row_of_point: Int32s,
    places: Int64s,
    picked: tuple[Int32s, Float32s] | None,
) -> None:
    """Write the neighbours of a point that have a row, and their weights, from places[k] on, or count them: places[k],
    without `picked`."""
    starts, indices, weights = ring
    count = 0
    for entry in range(starts[rows[k]], starts[rows[k] + 1]):
        row = row_of_point[indices[entry]]
        if row >= 0:
            if picked is not None:
                picked[0][places[k] + count], picked[1][places[k] + count] = row, weights[entry]
            count += 1
    if picked is None:
        places[k] = count


@kernel
def _reach(starts: Int32s, indices: Int32s, front: Int64s, edges: int, is_near: Bools) -> None:
    """Mark the points at most so many `edges` from those in `front`, which are marked."""
    for _ in range(edges):
        reached = np.empty(len(is_near), np.int64)
        count = 0
        for i in front:
            for k in range(starts[i], starts[i + 1]):
                if not is_near[indices[k]]:
                    is_near[indices[k]] = True
                    reached[count] = indices[k]
                    count += 1
        front = reached[:count].copy()


@parallel("places", alone=True)
def _list_ends(
    start: int, stop: int, faces: Int32Rows, of_vertex: Int32s, first: int, places: Int64s, ends: Int32s | None
) -> None:
    """Write the ends of edges at point first + i from places[i] on, or count them, without `ends`; move places[i] past
    them."""
    for f in range(len(faces)):
        for k in range(3):
            point = of_vertex[faces[f, k]]
            i = point - first
            if start <= i < stop:
                if ends is not None:
                    for step in range(2):
                        j = of_vertex[faces[f, (k + 1 + step) % 3]]
                        ends[places[i] + step] = -1 if point == j else j
                places[i] += 2


@parallel("counts")
def _merge_edges(start: int, stop: int, listed: Int64s, ends: Int32s, weights: Float32s, counts: Int64s) -> None:
    """List every neighbour once, weighted by half the number of faces at the edge to it; their number: counts[i].
    A neighbour is sought among the neighbours listed before it, at points with very many by a hash table."""
    most = 0
    for i in range(start, stop):
        most = max(most, listed[i + 1] - listed[i])
    slots = np.empty(4 * most + 4, np.int64)
    for i in range(start, stop):
        begin = listed[i]
        end = listed[i]
        size = 0
        if listed[i + 1] - begin > _FEW:
            size = 4
            while size < 2 * (listed[i + 1] - begin):
                size *= 2
            slots[:size] = -1
        for k in range(begin, listed[i + 1]):
            j, slot, at = ends[k], 0, begin
            if j < 0:
                continue
            if size > 0:
                slot = (j * 0x9E3779B1 >> 8) & (size - 1)
                while slots[slot] >= 0 and ends[slots[slot]] != j:
                    slot = (slot + 1) & (size - 1)
                at = end if slots[slot] < 0 else slots[slot]
                slots[slot] = at
            else:
                while at < end and ends[at] != j:
                    at += 1
            if at == end:
                ends[end], weights[end] = j, 0.0
                end += 1
            weights[at] += np.float32(0.5)
        counts[i] = end - begin


@each("listed")
def _pack(
    i: int,
    listed: Int64s,
    ends: Int32s,
    weights: Float32s,
    starts: Int32s,
    indices: Int32s,
    merged: Float32s,
) -> None:
    for k in range(starts[i + 1] - starts[i]):
        indices[starts[i] + k] = ends[listed[i] + k]
        merged[starts[i] + k] = weights[listed[i] + k]


@each("normals")
def _weigh_by_normals(i: int, starts: Int32s, indices: Int32s, normals: Float32Rows, weights: Float32s) -> None:
    for k in range(starts[i], starts[i + 1]):
        cosine = np.float32(0.0)
        for axis in range(3):
            cosine += normals[i, axis] * normals[indices[k], axis]
        weights[k] *= max(cosine, np.float32(0.0)) ** _CREASE


@each("out")
def _mean(
    i: int,
    starts: Int32s,
    indices: Int32s,
    weights: Float32s,
    values: Float32s,
    self_weight: Float32s,
    out: Float32s,
) -> None:
    """Ring means, the point's value weighted by `self_weight`, of differences: equal values stay equal to the bit."""
    weight, difference, centre = self_weight[0], np.float32(0.0), values[i]
    for k in range(np.uint64(starts[i]), np.uint64(starts[i + 1])):  # unsigned: nothing is counted from the end
        weight += weights[k]
        difference += weights[k] * (values[np.uint32(indices[k])] - centre)
    out[i] = centre + difference / weight if weight > _NOTHING else np.float32(np.nan)


@each("out")
def _mean_rows(
    i: int,
    starts: Int32s,
    indices: Int32s,
    weights: Float32s,
    values: Float32Rows,
    self_weight: Float32s,
    out: Float32Rows,
) -> None:
    """`_mean` of short rows."""
    weight = load_row(self_weight, 0)
    centre = load_short_row(values, i)
    difference = centre - centre
    for k in range(np.uint64(starts[i]), np.uint64(starts[i + 1])):
        weight += weights[k]
        difference = multiply_add(weights[k], load_short_row(values, indices[k]) - centre, difference)
    share = select(weight > _NOTHING, np.float32(1.0) / weight, np.float32(np.nan))
    store_short_row(out, i, multiply_add(share, difference, centre))
