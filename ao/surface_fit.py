"""The least-squares problem of surface baking, and how smooth its answer should be.

Minimised is Σ_s dA_s (Σ_j b_sj x_j − f_s)² + α xᵀRx (Kavan, Bargteil & Sloan 2011, Least Squares Vertex Baking).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_array, csr_array

from .conjugate_gradients import COARSE, dot, solve

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]

_PAIRS = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))
_STEP = 4.0
_SMOOTHEST, _ROUGHEST = 4, -10


@dataclass(frozen=True, eq=False)
class Half:
    """Σ_s dA_s (b_s·x − f_s)² over some samples, as xᵀ matrix x − 2 x·right + squares.

    Attributes:
        matrix: (n, n). right: float64 (n,). squares: a number.
    """

    matrix: csr_array
    right: Floats
    squares: float

    def misfit(self, x: Floats) -> float:
        return dot(x, self.matrix @ x) - 2 * dot(x, self.right) + self.squares


def normal_matrix(seats: Ints, entries: Floats, count: int) -> csr_array:
    """Σ b bᵀ, (count, count), from the upper triangles `entries` (m, 6) of each face's part."""
    i, j = np.array(_PAIRS).T
    cross = i != j
    rows = np.concatenate([seats[:, i].ravel(), seats[:, j[cross]].ravel()])
    columns = np.concatenate([seats[:, j].ravel(), seats[:, i[cross]].ravel()])
    values = np.concatenate([entries.ravel(), entries[:, cross].ravel()])
    return coo_array((values, (rows, columns)), shape=(count, count)).tocsr()


def right_side(seats: Ints, entries: Floats, count: int) -> Floats:
    """Σ b f, (count,), from `entries` (m, 3) of each face."""
    return np.bincount(seats.ravel(), entries.ravel(), count).astype(np.float64)


def ties(seats: Ints, weights: Floats, count: int) -> csr_array:
    """Σ_faces weight Σ_edges (x_i − x_j)², (count, count): what gives a vertex without samples a neighbour's value."""
    return normal_matrix(seats, weights[:, None] * np.array([2.0, -1.0, -1.0, 2.0, -1.0, 2.0]), count)


def roughness(corners: Floats, seats: Ints, normals: Floats, areas: Floats, agreement: float, count: int) -> csr_array:
    """R = Σ_edges (A₁ + A₂) (∂x/∂m₁ + ∂x/∂m₂)², (count, count): how much the slope jumps at edges of two faces.

    m is the direction within a face square to the edge, away from it: the bracket is |∇₁ − ∇₂| of the faces unfolded
    into one plane. Left out are hard edges, whose faces' normals agree less than the cosine `agreement`, edges that
    the unknowns do not share, and those of one face or of more than two.

    Args: corners: (m, 3, 3). seats: (m, 3), the unknown at each corner. normals: (m, 3), unit. areas: (m,), above 0.
    """
    if not len(seats):
        return csr_array((count, count))
    one, two = _inner_edges(seats)
    smooth = np.einsum("ij,ij->i", normals[one // 3], normals[two // 3]) >= agreement
    one, two = one[smooth], two[smooth]
    edge = np.roll(corners, 1, axis=1) - np.roll(corners, -1, axis=1)
    length = np.linalg.norm(edge, axis=2)
    slope = np.einsum("fki,fci->fkc", edge, edge) / (2 * areas[:, None, None] * length[:, :, None])
    slope = slope.reshape(-1, 3)  # ∂x/∂m at edge k is Σ_c x_c e_k·e_c/(2A|e_k|)
    weight = np.sqrt(areas[one // 3] + areas[two // 3])
    values = np.concatenate([slope[one], slope[two]], axis=1) * weight[:, None]
    columns = np.concatenate([seats[one // 3], seats[two // 3]], axis=1)
    del edge, length, slope, weight
    jumps = csr_array((values.ravel(), columns.ravel(), np.arange(0, values.size + 1, 6)), shape=(len(one), count))
    jumps.sum_duplicates()
    return (jumps.T @ jumps).tocsr()


def _inner_edges(seats: Ints) -> tuple[Ints, Ints]:
    """Edges of exactly two faces: where each is opposite a corner in `seats.ravel()`, in one face and in the other."""
    tail, head = seats[:, [1, 2, 0]].ravel(), seats[:, [2, 0, 1]].ravel()
    low, high = np.minimum(tail, head), np.maximum(tail, head)
    order = np.lexsort((high, low))
    fresh = np.concatenate([[True], (np.diff(low[order]) != 0) | (np.diff(high[order]) != 0), [True]])
    first = np.flatnonzero(fresh)
    first = first[:-1][(np.diff(first) == 2) & (low != high)[order[first[:-1]]]]
    return order[first], order[first + 1]


def cross_validated(
    halves: tuple[Half, Half], smoothness: csr_array, tie: csr_array, start: Floats
) -> tuple[float, tuple[Floats, Floats]]:
    """The α with which a fit of either half of the samples predicts the other best, and the fits of both with it.

    Tried are powers of four of the ratio of the two matrices' traces, down from where both weigh alike as long as the
    prediction improves, and up if it does not at once.
    """
    data, rough = sum(half.matrix.diagonal().sum() for half in halves), smoothness.diagonal().sum()
    unit = float(data / rough) if rough > 0 else 0.0

    def attempt(power: int, starts: tuple[Floats, Floats]) -> tuple[float, int, tuple[Floats, Floats]]:
        prior = unit * _STEP**power * smoothness + tie
        x, y = (
            solve(half.matrix + prior, half.right, at, tolerance=COARSE)
            for half, at in zip(halves, starts, strict=True)
        )
        return halves[1].misfit(x) + halves[0].misfit(y), power, (x, y)

    best = attempt(0, (start, start))
    for way, last in ((-1, _ROUGHEST), (1, _SMOOTHEST)):
        while best[1] != last:
            other = attempt(best[1] + way, best[2])
            if other[0] >= best[0]:
                break
            best = other
        if best[1]:
            break
    return unit * _STEP ** best[1], best[2]
