"""Sparse symmetric matrices over the corners of faces, all with one pattern: sums of them are sums of arrays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_array

from raytrace.kernel.jit import inline, kernel

Floats = npt.NDArray[np.float64]
Numbers = npt.NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class Stencil:
    """Which unknowns meet: those of one face, and those of two faces at a hinge.

    Attributes:
        seats: int32 (m, 3), the unknown at each corner of each face.
        starts: int32 (n + 1,), others: int32 (z,): unknowns that meet each, itself among them, ascending, as the
            indptr and indices of a `scipy.sparse.csr_array`.
    """

    seats: Numbers
    starts: Numbers
    others: Numbers

    @classmethod
    def of(cls, seats: Numbers, hinges: Numbers, count: int) -> Stencil:
        """Args: seats: as above. hinges: as `find_hinges` gives them. count: how many unknowns there are."""
        starts = np.zeros(count + 1, np.int64)
        _count_meetings(seats, hinges, starts)
        others = np.empty(starts[-1], np.int32)
        _list_meetings(seats, hinges, starts[:-1].copy(), others)
        size = _sort_rows(starts, others)
        return cls(seats, starts.astype(np.int32), others[:size].copy())

    def zeros(self) -> Floats:
        """Values (z,) of a matrix to add to."""
        return np.zeros(len(self.others))

    def matrix(self, values: Floats) -> csr_array:
        """The matrix (n, n) with `values` (z,), which it keeps."""
        count = len(self.starts) - 1
        return csr_array((values, self.others, self.starts), shape=(count, count))


def find_hinges(seats: Numbers, normals: Floats, agreement: float, count: int) -> Numbers:
    """The smooth edges of exactly two faces, (h, 2): opposite which corner in `seats.ravel()` each is, in either face.

    Args: normals: (m, 3), unit. agreement: the cosine below which they make an edge hard. count: of unknowns.
    """
    starts, halves = np.zeros(count + 1, np.int64), np.empty(seats.size, np.int32)
    _sort_halves(seats, starts, halves)
    hinges = np.empty((seats.size // 2, 2), np.int32)
    return hinges[: _find_hinges(seats, normals, agreement, starts, halves, hinges)].copy()


@inline
def _ends(seats, half):
    face, corner = half // 3, half % 3
    a, b = seats[face, (corner + 1) % 3], seats[face, (corner + 2) % 3]
    return min(a, b), max(a, b)


@kernel
def _sort_halves(seats, starts, halves):
    """Half-edges in the order of their lower unknown, and where each unknown's begin."""
    for half in range(seats.size):
        starts[_ends(seats, half)[0] + 1] += 1
    for i in range(len(starts) - 1):
        starts[i + 1] += starts[i]
    for half in range(seats.size):
        low = _ends(seats, half)[0]
        halves[starts[low]] = half
        starts[low] += 1
    for i in range(len(starts) - 1, 0, -1):
        starts[i] = starts[i - 1]
    starts[0] = 0


@kernel
def _find_hinges(seats, normals, agreement, starts, halves, hinges):
    found = 0
    for low in range(len(starts) - 1):
        mine = halves[starts[low] : starts[low + 1]]
        high = np.empty(len(mine), np.int32)
        for k in range(len(mine)):
            high[k] = _ends(seats, mine[k])[1]
        order = np.argsort(high, kind="mergesort")
        k = 0
        while k < len(mine):
            end = k + 1
            while end < len(mine) and high[order[end]] == high[order[k]]:
                end += 1
            if end == k + 2 and high[order[k]] != low:
                one, two = mine[order[k]], mine[order[k + 1]]
                cosine = 0.0
                for axis in range(3):
                    cosine += normals[one // 3, axis] * normals[two // 3, axis]
                if cosine >= agreement:
                    hinges[found, 0], hinges[found, 1] = one, two
                    found += 1
            k = end
    return found


@inline
def _opposite(seats, hinges, h):
    one, two = hinges[h, 0], hinges[h, 1]
    return seats[one // 3, one % 3], seats[two // 3, two % 3]


@kernel
def _count_meetings(seats, hinges, starts):
    """Set `starts` (n + 1,) to where rows begin that have room for every meeting, however often it is found."""
    for f in range(len(seats)):
        for corner in range(3):
            starts[seats[f, corner] + 1] += 2
    for h in range(len(hinges)):
        for i in _opposite(seats, hinges, h):
            starts[i + 1] += 1
    for i in range(len(starts) - 1):
        starts[i + 1] += starts[i] + 1


@kernel
def _list_meetings(seats, hinges, ends, others):
    for i in range(len(ends)):
        others[ends[i]] = i
        ends[i] += 1
    for f in range(len(seats)):
        for corner in range(3):
            i = seats[f, corner]
            for step in range(1, 3):
                others[ends[i]] = seats[f, (corner + step) % 3]
                ends[i] += 1
    for h in range(len(hinges)):
        i, j = _opposite(seats, hinges, h)
        others[ends[i]] = j
        ends[i] += 1
        others[ends[j]] = i
        ends[j] += 1


@kernel
def _sort_rows(starts, others):
    """Sort each row, name each unknown once, close the gaps; returns how many are left."""
    size, begin = 0, 0
    for i in range(len(starts) - 1):
        row = np.sort(others[begin : starts[i + 1]])
        begin = starts[i + 1]
        starts[i] = size
        for k in range(len(row)):
            if k == 0 or row[k] != row[k - 1]:
                others[size] = row[k]
                size += 1
    starts[-1] = size
    return size


@inline
def entry(starts, others, i, j):
    """Where row `i` has column `j`, which it must have."""
    low, high = starts[i], starts[i + 1] - 1
    while low < high:
        middle = (low + high) // 2
        if others[middle] < j:
            low = middle + 1
        else:
            high = middle
    return low
