"""The least-squares problem of surface baking, its regularisation and the cross-validation of that.

Minimised is Σ_s dA_s (Σ_j b_sj x_j − f_s)² + α xᵀRx (Kavan, Bargteil & Sloan 2011, Least Squares Vertex Baking).
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array

from raytrace.kernel.borrow import borrow
from raytrace.kernel.jit import kernel
from raytrace.types import Float64s, Int32s

from .conjugate_gradients import COARSE, dot, multiply, solve
from .pattern import Stencil, entry

_STEP = 4.0
_SMOOTHEST, _ROUGHEST = 4, -10


@dataclass(frozen=True, eq=False)
class Half:
    """Σ_s dA_s (b_s·x − f_s)² over some samples, as xᵀ matrix x − 2 x·right + squares.

    Attributes:
        values: float64 (z,), of the matrix. right: float64 (n,). squares: a number.
    """

    values: Float64s
    right: Float64s
    squares: float


@dataclass(frozen=True, eq=False)
class Problem:
    """The normal equations of x from either half of the samples, and the regularisation.

    Attributes:
        stencil: of all matrices. halves: of the samples, independent. smoothness: (z,), of R.
        laplacian: (m,), weights of the faces in `add_laplacian`. threads: to solve on.
        bent: (3, n), right sides of other fits, of all samples.
    """

    stencil: Stencil
    halves: tuple[Half, Half]
    smoothness: Float64s
    laplacian: Float64s
    bent: Float64s
    threads: int

    def fit(self, half: Half, alpha: float, start: Float64s) -> Float64s:
        """x from one half of the samples, roughly."""
        return solve(self.system(half.values, alpha), half.right, start, tolerance=COARSE, threads=self.threads)

    def system(self, data: Float64s, alpha: float) -> csr_array:
        """The matrix of a fit to samples whose normal matrix has the values `data`."""
        values = alpha * self.smoothness
        values += data
        add_laplacian(self.stencil, self.laplacian, values)
        return self.stencil.matrix(values)

    def residual(self, half: Half, x: Float64s) -> float:
        """Sum of squared residuals of `x` (n,) at one half of the samples."""
        image = multiply(self.stencil.matrix(half.values), x, self.threads)
        return dot(x, image) - 2 * dot(x, half.right) + half.squares


def normal_matrix(stencil: Stencil, entries: Float64s) -> Float64s:
    """Values (z,) of Σ b bᵀ, from the upper triangles `entries` (m, 6) of each face's part."""
    values = stencil.zeros()
    _add_faces(stencil, entries, values)
    return values


def right_side(stencil: Stencil, entries: Float64s) -> Float64s:
    """Σ b f, (n,), from `entries` (m, 3) of each face."""
    out = np.zeros(len(stencil.starts) - 1)
    _add_corners(stencil.face_points, entries, out)
    return out


def roughness(stencil: Stencil, hinges: Int32s, corners: Float64s, areas: Float64s) -> Float64s:
    """Values (z,) of R = Σ_hinges (A₁ + A₂) (∂x/∂m₁ + ∂x/∂m₂)²: how much the slope jumps at edges of two faces.

    m is the direction within a face square to the edge, away from it: the bracket is |∇₁ − ∇₂| of the faces unfolded
    into one plane.

    Args: hinges: as `find_hinges` gives them. corners: (m, 3, 3). areas: (m,), above 0.
    """
    values = stencil.zeros()
    _add_jumps(stencil, hinges, corners, areas, values)
    return values


@kernel
def _add_faces(stencil, entries, values):
    face_points, starts, indices = borrow(stencil)
    for f in range(len(face_points)):
        k = 0
        for a in range(3):
            for b in range(a, 3):
                i, j = face_points[f, a], face_points[f, b]
                values[entry(starts, indices, i, j)] += entries[f, k]
                if a != b:
                    values[entry(starts, indices, j, i)] += entries[f, k]
                k += 1


@kernel
def add_laplacian(stencil, weights, values):
    """Add the graph Laplacian Σ_faces weight Σ_edges (x_i − x_j)², so that vertices without samples get neighbours'.

    Args: stencil: `Stencil`. weights: float64 (m,), of its faces. values: float64 (z,), of the matrix.
    """
    face_points, starts, indices = borrow(stencil)
    for f in range(len(face_points)):
        for a in range(3):
            i, j = face_points[f, a], face_points[f, (a + 1) % 3]
            values[entry(starts, indices, i, i)] += weights[f]
            values[entry(starts, indices, j, j)] += weights[f]
            values[entry(starts, indices, i, j)] -= weights[f]
            values[entry(starts, indices, j, i)] -= weights[f]


@kernel
def _add_corners(face_points, entries, out):
    for f in range(len(face_points)):
        for corner in range(3):
            out[face_points[f, corner]] += entries[f, corner]


@kernel
def _add_jumps(stencil, hinges, corners, areas, values):
    face_points, starts, indices = borrow(stencil)
    place, slope = np.empty(6, np.int32), np.empty(6)
    for h in range(len(hinges)):
        weight = areas[hinges[h, 0] // 3] + areas[hinges[h, 1] // 3]
        count = 0
        for side in range(2):
            f, k = hinges[h, side] // 3, hinges[h, side] % 3
            squared = 0.0
            for axis in range(3):
                squared += (corners[f, (k + 2) % 3, axis] - corners[f, (k + 1) % 3, axis]) ** 2
            for c in range(3):  # ∂x/∂m at edge k is Σ_c x_c e_k·e_c/(2A|e_k|)
                product = 0.0
                for axis in range(3):
                    edge = corners[f, (k + 2) % 3, axis] - corners[f, (k + 1) % 3, axis]
                    product += edge * (corners[f, (c + 2) % 3, axis] - corners[f, (c + 1) % 3, axis])
                at = 0
                while at < count and place[at] != face_points[f, c]:
                    at += 1
                if at == count:
                    place[at], slope[at] = face_points[f, c], 0.0
                    count += 1
                slope[at] += product / (2 * areas[f] * np.sqrt(squared))
        for a in range(count):
            for b in range(count):
                values[entry(starts, indices, place[a], place[b])] += weight * slope[a] * slope[b]


def cross_validated(problem: Problem, start: Float64s) -> tuple[float, tuple[Float64s, Float64s]]:
    """The α with which a fit of either half of the samples predicts the other best, and the fits of both with it.

    Tried are powers of four of the ratio of the two matrices' traces, down from where both weigh alike as long as the
    prediction improves, and up if it does not at once.
    """
    halves, trace = problem.halves, lambda values: float(problem.stencil.matrix(values).diagonal().sum())
    data, rough = sum(trace(half.values) for half in halves), trace(problem.smoothness)
    unit = data / rough if rough > 0 else 0.0

    def attempt(power: int, starts: tuple[Float64s, Float64s]) -> tuple[float, int, tuple[Float64s, Float64s]]:
        x, y = (problem.fit(half, unit * _STEP**power, at) for half, at in zip(halves, starts, strict=True))
        return problem.residual(halves[1], x) + problem.residual(halves[0], y), power, (x, y)

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
