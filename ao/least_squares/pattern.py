"""The sparsity pattern that all matrices of a fit share, so that their sums are sums of arrays."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array

from raytrace.kernel.counting_sort import counting_sort
from raytrace.kernel.jit import inline, kernel
from raytrace.types import Float64s, Int32s


class Stencil(NamedTuple):
    """The pairs of unknowns that meet, in one face or opposite each other at a hinge.

    Attributes:
        face_points: int32 (m, 3), the unknown at each corner of each face.
        starts: int32 (n + 1,), indices: int32 (z,): unknowns that meet each, itself among them, ascending, as the
            indptr and indices of a `scipy.sparse.csr_array`.
    """

    face_points: Int32s
    starts: Int32s
    indices: Int32s

    @classmethod
    def of(cls, face_points: Int32s, hinges: Int32s, count: int) -> Stencil:
        """Args: face_points: as above. hinges: as `find_hinges` gives them. count: how many unknowns there are."""
        starts = np.zeros(count + 1, np.int64)
        _count_meetings(face_points, hinges, starts)
        indices = np.empty(starts[-1], np.int32)
        _list_meetings(face_points, hinges, starts[:-1].copy(), indices)
        size = _sort_rows(starts, indices)
        return cls(face_points, starts.astype(np.int32), indices[:size].copy())

    def zeros(self) -> Float64s:
        """Values (z,) of a matrix to add to."""
        return np.zeros(len(self.indices))

    def matrix(self, values: Float64s) -> csr_array:
        """The matrix (n, n) with `values` (z,), which it keeps."""
        count = len(self.starts) - 1
        return csr_array((values, self.indices, self.starts), shape=(count, count))


def find_hinges(face_points: Int32s, normals: Float64s, agreement: float, count: int) -> Int32s:
    """The smooth edges of exactly two faces, (h, 2): in either face the corner in `face_points.ravel()` opposite to it.

    Args: normals: (m, 3), unit. agreement: the cosine below which they make an edge hard. count: of unknowns.
    """
    lower = np.empty(face_points.size, np.int32)
    _lower_ends(face_points, lower)
    half_edges, starts = counting_sort(lower, count)
    hinges = np.empty((face_points.size // 2, 2), np.int32)
    return hinges[: _match_halves(face_points, normals, agreement, starts, half_edges, hinges)].copy()


@inline
def _ends(face_points, half_edge):
    face, corner = half_edge // 3, half_edge % 3
    a, b = face_points[face, (corner + 1) % 3], face_points[face, (corner + 2) % 3]
    return min(a, b), max(a, b)


@kernel
def _lower_ends(face_points, out):
    """Write the lower unknown of each half-edge."""
    for half_edge in range(face_points.size):
        out[half_edge] = _ends(face_points, half_edge)[0]


@kernel
def _match_halves(face_points, normals, agreement, starts, half_edges, hinges):
    count = 0
    for low in range(len(starts) - 1):
        edges = half_edges[starts[low] : starts[low + 1]]
        high = np.empty(len(edges), np.int32)
        for k in range(len(edges)):
            high[k] = _ends(face_points, edges[k])[1]
        order = np.argsort(high, kind="mergesort")
        k = 0
        while k < len(edges):
            end = k + 1
            while end < len(edges) and high[order[end]] == high[order[k]]:
                end += 1
            if end == k + 2 and high[order[k]] != low:
                one, two = edges[order[k]], edges[order[k + 1]]
                cosine = 0.0
                for axis in range(3):
                    cosine += normals[one // 3, axis] * normals[two // 3, axis]
                if cosine >= agreement:
                    hinges[count, 0], hinges[count, 1] = one, two
                    count += 1
            k = end
    return count


@inline
def _opposite(face_points, hinges, h):
    one, two = hinges[h, 0], hinges[h, 1]
    return face_points[one // 3, one % 3], face_points[two // 3, two % 3]


@kernel
def _count_meetings(face_points, hinges, starts):
    """Set `starts` (n + 1,) to where rows begin that have room for every meeting, however often it is found."""
    for f in range(len(face_points)):
        for corner in range(3):
            starts[face_points[f, corner] + 1] += 2
    for h in range(len(hinges)):
        for i in _opposite(face_points, hinges, h):
            starts[i + 1] += 1
    for i in range(len(starts) - 1):
        starts[i + 1] += starts[i] + 1


@kernel
def _list_meetings(face_points, hinges, ends, indices):
    for i in range(len(ends)):
        indices[ends[i]] = i
        ends[i] += 1
    for f in range(len(face_points)):
        for corner in range(3):
            i = face_points[f, corner]
            for step in range(1, 3):
                indices[ends[i]] = face_points[f, (corner + step) % 3]
                ends[i] += 1
    for h in range(len(hinges)):
        i, j = _opposite(face_points, hinges, h)
        indices[ends[i]] = j
        ends[i] += 1
        indices[ends[j]] = i
        ends[j] += 1


@kernel
def _sort_rows(starts, indices):
    """Sort each row, name each unknown once, close the gaps; returns how many are left."""
    size, begin = 0, 0
    for i in range(len(starts) - 1):
        first = size
        for k in range(begin, starts[i + 1]):
            other, place = indices[k], size
            while place > first and indices[place - 1] >= other:
                place -= 1
            if place < size and indices[place] == other:
                continue
            for later in range(size, place, -1):
                indices[later] = indices[later - 1]
            indices[place] = other
            size += 1
        begin = starts[i + 1]
        starts[i] = first
    starts[-1] = size
    return size


@inline
def entry(starts, indices, i, j):
    """The place of column `j` in row `i`, which must have it."""
    low, high = starts[i], starts[i + 1] - 1
    while low < high:
        middle = (low + high) // 2
        if indices[middle] < j:
            low = middle + 1
        else:
            high = middle
    return low
