"""Values at the vertices, fitted to the moments of the faces, with a regularisation chosen by cross-validation.

Minimised is Σ_s dA_s (Σ_j b_sj x_j − f_s)² + α xᵀRx (Kavan, Bargteil & Sloan 2011, Least Squares Vertex Baking).
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array

from obscurance.raytrace.mesh.weld import CREASE
from obscurance.raytrace.types import Float64s, Int64s

from .conjugate_gradients import COARSE, dot, multiply, solve, solve_within
from .face_moments import EACH, FALLOFF, HALF, MATRIX, NOISE, OPEN, RIGHT, SQUARES
from .patch import Patch
from .pattern import Stencil, add_faces, add_jumps, add_laplacian, find_hinges, right_side

Cached = Callable[[str, Callable[[], Float64s]], Float64s]
"""What returns the values of a name: kept ones, or what the function that it is called with computes."""

_LAPLACIAN_WEIGHT = 1e-7
_RELAXED = 1 / 16
_STEP = 4.0
_NEAR = 2e-5  # of the values fitted to either half, in the mean
_PLACES = 3.0  # times as much as all places err do halves of them differ, as variances fall as the square of places
_BENT = 1e-5  # of bent normals: where R outweighs the data, residuals of linear functions are small
_SMOOTHEST, _ROUGHEST = 4, -10
_RUNS, _RUN = 32, 1 << 13  # stretches of faces in Morton order, and faces in each, that stand for all of many more


class NormalEquations(NamedTuple):
    """Σ_s dA_s (b_s·x − f_s)² over some samples, as xᵀ matrix x − 2 x·right + squares."""

    values: Float64s  # (z,), of the matrix
    right: Float64s  # (n,)
    squares: float


@dataclass(frozen=True, eq=False)
class Problem:
    """The normal equations of x from either half of the samples, by one falloff, and the regularisation."""

    stencil: Stencil  # of all matrices
    halves: tuple[NormalEquations, NormalEquations]  # of the samples, independent
    noise: Float64s  # (n,), a right side as random as the rays of all samples make it
    smoothness: Float64s  # (z,), of R
    laplacian: Float64s  # (m,), weights of the faces in `add_laplacian`
    areas: Float64s  # (n,), the share of the surface around each unknown
    bent: Float64s  # (3, n), right sides of other fits, of all samples
    threads: int
    number: Int64s  # (n,), of each of the patch's unknowns: by their faces, so that those that meet are near

    def fit(self, half: NormalEquations, alpha: float, start: Float64s) -> Float64s:
        """x from one half of the samples, roughly."""
        return solve(self.system(half.values, alpha), half.right, start, near=_NEAR, threads=self.threads, mean=True)

    def system(self, data: Float64s, alpha: float) -> csr_array:
        """The matrix of a fit to samples whose normal matrix has the values `data`."""
        values = alpha * self.smoothness
        values += data
        add_laplacian(self.stencil, self.laplacian, values)
        return self.stencil.matrix(values)

    def residual(self, half: NormalEquations, x: Float64s) -> float:
        """Sum of squared residuals of `x` (n,) at one half of the samples."""
        return half.squares - dot(x, half.right) - dot(x, self.pull(half, x))

    def pull(self, half: NormalEquations, x: Float64s) -> Float64s:
        """Half of how fast (n,) the squared residuals of `x` at one half of the samples fall with each value."""
        return half.right - multiply(self.stencil.matrix(half.values), x, self.threads)


class Fit(NamedTuple):
    """Values at the points of a patch."""

    w: Float64s  # (k, c), by c falloffs
    error: Float64s  # (k, c), standard errors
    bent: Float64s  # (k, 3), mean of μ·direction by the first falloff
    in_sight: Float64s  # (k,), the part of the surface around each that is, from 0 to 1


def build_problems(patch: Patch, moments: Float64s, threads: int) -> tuple[list[Problem], Problem]:
    """The least squares problems of a patch by each falloff, and one small enough to be solved many times, for choosing
    α: a part of the first, or the same."""
    diagonal = np.array([0, 3, 5])
    trace = sum(float(moments[:, column].sum()) for column in (*diagonal, *(MATRIX + diagonal)))
    laplacian = _LAPLACIAN_WEIGHT * trace / max(float(patch.areas.sum()), 1e-300) * patch.areas
    problems = _build_problems(patch, moments, laplacian, threads)
    if len(moments) <= 2 * _RUNS * _RUN:
        return problems, problems[0]
    starts = np.arange(_RUNS) * (len(moments) - _RUN) // (_RUNS - 1)
    trial_faces = (starts[:, None] + np.arange(_RUN)).ravel()
    part = patch.part(trial_faces)
    return problems, _build_problems(part, moments[trial_faces], laplacian[trial_faces], threads)[0]


def fit_values(problems: list[Problem], trial: Problem, cached: Cached) -> Fit:
    """Fit 1 − w, so that where nothing is closed w is exactly 1; `cached` is called with what is long to compute.

    All falloffs have the α that suits the first: others of their own err as much.
    """
    problem = problems[0]
    even, odd = problem.halves
    threads = problem.threads
    data = even.values + odd.values
    area = multiply(problem.stencil.matrix(data), np.ones(problem.bent.shape[1]), threads)
    w = np.empty((len(area), len(problems)))
    error = np.empty_like(w)
    bent = np.zeros((3, len(area)))

    alpha = float(cached("alpha", lambda: np.array([cross_validated(trial, _constant_fit(trial))[0]]))[0])
    for column, problem in enumerate(problems):
        # The fit to all samples, begun at that to half of them.
        even, odd = problem.halves
        half = cached(f"half {column}", partial(problem.fit, even, alpha, _constant_fit(problem)))
        right = even.right + odd.right
        matrix = problem.system(data, alpha)
        closed = cached(f"closed {column}", partial(solve_within, matrix, right, half, threads=threads))
        # How far it moves if the halves pull it as they do, but to opposite sides; and by as much as rays scatter.
        pull = problem.pull(even, closed) - problem.pull(odd, closed)
        roughly = partial(solve, matrix, start=np.zeros(len(area)), near=_NEAR, threads=threads, mean=True)
        apart = cached(f"apart {column}", partial(roughly, pull))
        by_rays = cached(f"by rays {column}", partial(roughly, problem.noise))
        mean = partial(_local_mean, problem.stencil, data, area, threads)
        variance = _variance(*(mean(_squared(closed, step)) for step in (half - closed, apart, by_rays)))
        if column == 0:
            for axis, side in enumerate(problem.bent):
                bent[axis] = cached(f"bent {axis}", partial(solve, matrix, side, bent[axis], None, _BENT, threads))

        # With less regularisation: how far it moves values counts as their bias.
        del matrix, roughly  # to make room for the next
        matrix = problem.system(data, alpha * _RELAXED)
        relaxed = cached(f"relaxed {column}", partial(solve_within, matrix, right, closed, COARSE, threads))
        w[:, column] = 1 - closed
        error[:, column] = np.sqrt(variance + (closed - relaxed) ** 2)
    in_sight = np.minimum(area / np.maximum(problem.areas, 1e-300), 1.0)
    return Fit(*(values[problem.number] for values in (w, error, bent.T, in_sight)))


def _build_problems(patch: Patch, moments: Float64s, laplacian: Float64s, threads: int) -> list[Problem]:
    """The least squares problems of a patch by each falloff, from the moments of its faces.

    Args: laplacian: (m,), weights of smoothing.
    """
    # Unknowns are numbered by the first corner that has each; those of no face here are left out, and never asked for.
    used, first_corner = np.unique(patch.face_points, return_index=True)
    number = np.zeros(patch.unknowns, np.int64)
    number[used] = np.argsort(np.argsort(first_corner))
    count = max(len(used), 1)
    # The matrices, all of one sparsity pattern.
    face_points = number[patch.face_points].astype(np.int32)
    hinges = find_hinges(face_points[: patch.mesh_faces], patch.normals[: patch.mesh_faces], CREASE, count)
    stencil = Stencil.of(face_points, hinges, count)
    matrices = [
        stencil.sum(add_faces, np.ascontiguousarray(moments[:, begin : begin + MATRIX])) for begin in (0, MATRIX)
    ]
    bent = np.stack([right_side(stencil, moments[:, a : a + 3]) for a in range(OPEN, FALLOFF, 3)])
    smoothness = stencil.sum(add_jumps, hinges, patch.corners, patch.areas)
    shares = np.repeat(patch.areas * patch.cover / 3, 3)
    weights = shares / max(float(shares.sum()), 1e-300)
    areas = np.bincount(face_points.ravel(), weights=weights, minlength=count).astype(np.float64, copy=False)
    problems = []
    for falloff in range(FALLOFF, moments.shape[1], EACH):
        halves = [
            NormalEquations(matrix, right_side(stencil, half[:, RIGHT:HALF]), float(half[:, SQUARES].sum()))
            for matrix, half in zip(matrices, (moments[:, falloff:], moments[:, falloff + HALF :]), strict=True)
        ]
        noise = right_side(stencil, moments[:, falloff + NOISE : falloff + EACH])
        both = halves[0], halves[1]
        problems.append(Problem(stencil, both, noise, smoothness, laplacian, areas, bent, threads, number))
    return problems


def _constant_fit(problem: Problem) -> Float64s:
    """One value for all vertices, the best, to start iterations from."""
    right = sum(half.right.sum() for half in problem.halves)
    return np.full(problem.bent.shape[1], right / max(sum(half.values.sum() for half in problem.halves), 1e-300))


def _squared(x: Float64s, step: Float64s) -> Float64s:
    """Half the squared way (k,) from x − step to x + step, both within [0, 1]."""
    return (np.clip(x + step, 0, 1) - np.clip(x - step, 0, 1)) ** 2 / 4


def _variance(half: Float64s, apart: Float64s, by_rays: Float64s) -> Float64s:
    """The variance (k,) of a fit from the squares of three differences; see `fit_values`.

    Of few samples a half errs by up to 2.4 times too much, while residuals, which `apart` is of, are as much too small:
    so it is a weighted geometric mean. By places two halves differ more than all err, for places are the more even, the
    more there are; rays of the halves are independent.
    """
    both = np.cbrt(half**2 * apart)
    return np.minimum(both, by_rays) + np.maximum(both - by_rays, 0.0) / _PLACES


def _local_mean(stencil: Stencil, data: Float64s, area: Float64s, threads: int, values: Float64s) -> Float64s:
    """Means of `values` (k,) over each vertex, of an `area` (k,), and its neighbours, shrunk towards that of all by a
    tenth."""
    sums = multiply(stencil.matrix(data), values, threads)
    local = np.where(area > 0, sums / np.where(area > 0, area, 1.0), values)
    return 0.9 * local + 0.1 * dot(area, values) / max(float(area.sum()), 1e-300)


def cross_validated(problem: Problem, start: Float64s) -> tuple[float, list[Float64s]]:
    """The α with which a fit of either half of the samples predicts the other best, and the fits of both with it.

    Tried are powers of four of the ratio of the two matrices' traces, down from where both weigh alike as long as the
    prediction improves, and up if it does not at once.
    """

    def trace(values: Float64s) -> float:
        return float(problem.stencil.matrix(values).diagonal().sum())

    even, odd = problem.halves
    data = trace(even.values) + trace(odd.values)
    rough = trace(problem.smoothness)
    unit = data / rough if rough > 0 else 0.0

    def attempt(power: int, starts: list[Float64s]) -> tuple[float, int, list[Float64s]]:
        """How badly fits with α = unit · 4^power predict the other half, the power, and the fits, begun at `starts`."""
        of_even = problem.fit(even, unit * _STEP**power, starts[0])
        of_odd = problem.fit(odd, unit * _STEP**power, starts[1])
        return problem.residual(odd, of_even) + problem.residual(even, of_odd), power, [of_even, of_odd]

    best = attempt(0, [start, start])
    for direction, limit in ((-1, _ROUGHEST), (1, _SMOOTHEST)):
        while best[1] != limit:
            next_try = attempt(best[1] + direction, best[2])
            if next_try[0] >= best[0]:
                break
            best = next_try
        if best[1]:
            break
    return unit * _STEP ** best[1], best[2]
