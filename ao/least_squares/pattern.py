"""The matrices of a fit, which share a sparsity pattern, so that their sums are sums of arrays."""

from collections.abc import Callable
from typing import Any, NamedTuple, Self

import numpy as np
from scipy.sparse import coo_array, csr_array

from obscurance.raytrace.kernel.arrays import counting_sort
from obscurance.raytrace.kernel.jit import inline, kernel
from obscurance.raytrace.types import AnyInts, Float64Grid, Float64Rows, Float64s, Int32Rows, Int32s, Int64s


class Stencil(NamedTuple):
    """The pairs of unknowns that meet, in one face or opposite each other at a hinge."""

    face_points: Int32Rows  # (m, 3), the unknown at each corner of each face
    starts: Int32s  # (n + 1,), indptr of a `scipy.sparse.csr_array`
    indices: Int32s  # (z,), of the same: unknowns that meet each, itself among them, ascending

    @classmethod
    def of(cls, face_points: Int32s, hinges: Int32s, count: int) -> Self:
        """The pattern of the unknowns that meet in a face, or opposite each other at a hinge.

        Args: hinges: of `find_hinges`. count: how many unknowns there are.
        """
        corners = face_points.ravel()
        ahead = face_points[:, [1, 2, 0]].ravel()
        behind = face_points[:, [2, 0, 1]].ravel()
        one, other = corners[hinges].T
        diagonal = np.arange(count, dtype=np.int32)
        row_of = np.concatenate([corners, corners, one, other, diagonal])
        column_of = np.concatenate([ahead, behind, other, one, diagonal])
        pattern = coo_array((np.ones(len(row_of), np.bool_), (row_of, column_of)), shape=(count, count)).tocsr()
        return cls(face_points, pattern.indptr.astype(np.int32), pattern.indices.astype(np.int32))

    def matrix(self, values: Float64s) -> csr_array:
        """The matrix (n, n) with `values` (z,), which it keeps."""
        count = len(self.starts) - 1
        return csr_array((values, self.indices, self.starts), shape=(count, count))

    def sum(self, add: Callable[..., None], *terms: Any) -> Float64s:
        """Values (z,) of the matrix to which the kernel `add` adds `terms`."""
        values = np.zeros(len(self.indices))
        add(self, *terms, values)
        return values


def shared_edges(face_points: AnyInts, count: int) -> Int64s:
    """The edges of exactly two faces, (h, 2): in either face the corner in `face_points.ravel()` opposite to it.

    Args: face_points: (m, 3), below `count`; edges with a negative one are left out.
    """
    # Edges as pairs of points, ordered: those of the same two points come together.
    one = face_points[:, [1, 2, 0]].ravel()
    other = face_points[:, [2, 0, 1]].ravel()
    low = np.minimum(one, other)
    high = np.maximum(one, other)
    order = counting_sort(high, count)[0]
    order = order[counting_sort(low[order], count)[0]]
    low = low[order]
    high = high[order]
    # Those that come exactly twice.
    ends = np.concatenate([[True], (low[1:] != low[:-1]) | (high[1:] != high[:-1]), [True]])
    pairs = np.flatnonzero(ends[:-2] & ~ends[1:-1] & ends[2:] & (low != high)[:-1])
    return np.stack([order[pairs], order[pairs + 1]], axis=1)


def find_hinges(face_points: Int32s, normals: Float64s, agreement: float, count: int) -> Int32s:
    """The `shared_edges` that are not hard. Args: normals: (m, 3), unit. agreement: least cosine at an edge."""
    hinges = shared_edges(face_points, count).astype(np.int32)
    cosines: Float64s = np.sum(normals[hinges[:, 0] // 3] * normals[hinges[:, 1] // 3], axis=1)
    return hinges[cosines >= agreement]


def right_side(stencil: Stencil, entries: Float64s) -> Float64s:
    """Σ b f, (n,), from `entries` (m, 3) of each face."""
    count = len(stencil.starts) - 1
    return np.bincount(stencil.face_points.ravel(), entries.ravel(), count).astype(np.float64, copy=False)


@kernel
def add_faces(stencil: Stencil, entries: Float64Rows, values: Float64s) -> None:
    """Add Σ b bᵀ, from the upper triangles `entries` (m, 6) of each face's part."""
    face_points, starts, indices = stencil.face_points, stencil.starts, stencil.indices
    for f in range(len(face_points)):
        for a in range(3):
            for b in range(3):
                k = a + b + (a > 0 and b > 0)  # in the upper triangle, row by row
                values[entry(starts, indices, face_points[f, a], face_points[f, b])] += entries[f, k]


@kernel
def add_laplacian(stencil: Stencil, weights: Float64s, values: Float64s) -> None:
    """Add the graph Laplacian Σ_faces weight Σ_edges (x_i − x_j)², so that vertices without samples get neighbours'."""
    face_points, starts, indices = stencil.face_points, stencil.starts, stencil.indices
    for f in range(len(face_points)):
        for a in range(3):
            i = face_points[f, a]
            j = face_points[f, (a + 1) % 3]
            values[entry(starts, indices, i, i)] += weights[f]
            values[entry(starts, indices, j, j)] += weights[f]
            values[entry(starts, indices, i, j)] -= weights[f]
            values[entry(starts, indices, j, i)] -= weights[f]


@kernel
def add_jumps(stencil: Stencil, hinges: Int32Rows, corners: Float64Grid, areas: Float64s, values: Float64s) -> None:
    """Add R = Σ_hinges (A₁ + A₂) (∂x/∂m₁ + ∂x/∂m₂)²: how much the slope jumps at edges of two faces.

    m is the direction within a face square to the edge, away from it: the bracket is |∇₁ − ∇₂| of the faces unfolded
    into one plane.
    """
    face_points, starts, indices = stencil.face_points, stencil.starts, stencil.indices
    points = np.empty(6, np.int32)  # of the two faces, and by how much the slope changes with the value at each
    slope = np.empty(6)
    for h in range(len(hinges)):
        weight = areas[hinges[h, 0] // 3] + areas[hinges[h, 1] // 3]
        # How much the slope at the edge changes with the value at each point of the two faces.
        count = 0
        for side in range(2):
            f = hinges[h, side] // 3
            k = hinges[h, side] % 3
            squared = 0.0
            for axis in range(3):
                squared += (corners[f, (k + 2) % 3, axis] - corners[f, (k + 1) % 3, axis]) ** 2
            for c in range(3):  # ∂x/∂m at edge k is Σ_c x_c e_k·e_c/(2A|e_k|)
                product = 0.0
                for axis in range(3):
                    edge = corners[f, (k + 2) % 3, axis] - corners[f, (k + 1) % 3, axis]
                    product += edge * (corners[f, (c + 2) % 3, axis] - corners[f, (c + 1) % 3, axis])
                at = 0
                while at < count and points[at] != face_points[f, c]:
                    at += 1
                if at == count:
                    points[at] = face_points[f, c]
                    slope[at] = 0.0
                    count += 1
                slope[at] += product / (2 * areas[f] * np.sqrt(squared))
        # Its square.
        for a in range(count):
            for b in range(count):
                values[entry(starts, indices, points[a], points[b])] += weight * slope[a] * slope[b]


@inline
def entry(starts, indices, i, j):
    """The place of column `j` in row `i`, which must have it."""
    low = starts[i]
    high = starts[i + 1] - 1
    while low < high:
        middle = (low + high) // 2
        if indices[middle] < j:
            low = middle + 1
        else:
            high = middle
    return low
