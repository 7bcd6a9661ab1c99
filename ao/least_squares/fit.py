"""Values at the vertices, fitted to the moments of the faces."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from raytrace.mesh.weld import CREASE
from raytrace.types import Float64s

from .conjugate_gradients import COARSE, multiply, solve, solve_within
from .face_moments import BENT, HALF, MATRIX, MOMENTS, RIGHT, SQUARES
from .patch import Patch
from .pattern import Stencil, find_hinges
from .problem import Half, Problem, cross_validated, normal_matrix, right_side, roughness

Once = Callable[[str, Callable[[], Float64s]], Float64s]

_LAPLACIAN_WEIGHT = 1e-7
_RELAXED = 1 / 16
_RUNS, _RUN = 32, 1 << 13  # stretches of faces in Morton order, and faces in each, that stand for all of many more


@dataclass(frozen=True, eq=False)
class Fit:
    """Attributes: w, error: float64 (k,). bent: float64 (k, 3), mean of μ·direction."""

    w: Float64s
    error: Float64s
    bent: Float64s


def build_problems(patch: Patch, moments: Float64s, threads: int) -> tuple[Problem, Problem]:
    """The problem, and one like it, or itself, that is small enough to be solved many times.

    Args: moments: (m, 29), see `gather_faces`.
    """
    diagonal = MATRIX + np.array([0, 3, 5])
    trace = sum(float(moments[:, column].sum()) for column in (*diagonal, *(HALF + diagonal)))
    laplacian = _LAPLACIAN_WEIGHT * trace / max(float(patch.areas.sum()), 1e-300) * patch.areas
    whole = _build_problem(patch, moments, laplacian, threads)
    if len(moments) <= 2 * _RUNS * _RUN:
        return whole, whole
    starts = np.arange(_RUNS) * (len(moments) - _RUN) // (_RUNS - 1)
    rows = (starts[:, None] + np.arange(_RUN)).ravel()
    return whole, _build_problem(patch.part(rows), moments[rows], laplacian[rows], threads)


def fit_values(problem: Problem, trial: Problem, once: Once) -> Fit:
    """Fit 1 − w, so that where nothing is closed w is exactly 1.

    Args: problem, trial: from `build_problems`. once: called with what is long to compute, and a name of it.
    """

    def fit_halves() -> Float64s:
        alpha, fits = cross_validated(trial, _constant_fit(trial))
        if trial is not problem:
            start = _constant_fit(problem)
            fits = problem.fit(problem.halves[0], alpha, start), problem.fit(problem.halves[1], alpha, start)
        return np.concatenate([[alpha], *fits])

    alpha, first, second = np.split(once("halves", fit_halves), [1, 1 + problem.bent.shape[1]])
    stencil, threads, (even, odd) = problem.stencil, problem.threads, problem.halves
    right, data = even.right + odd.right, even.values + odd.values
    variance = _local_mean(stencil, data, (np.clip(first, 0, 1) - np.clip(second, 0, 1)) ** 2 / 4, threads)

    matrix, zeros = problem.system(data, alpha[0]), np.zeros(len(right))
    closed = once("closed", lambda: solve_within(matrix, right, (first + second) / 2, threads=threads))
    bent = once(
        "bent", lambda: np.concatenate([solve(matrix, at, zeros, None, COARSE, threads) for at in problem.bent])
    )
    del matrix  # to make room for the next
    matrix = problem.system(data, alpha[0] * _RELAXED)
    relaxed = once("relaxed", lambda: solve_within(matrix, right, closed, COARSE, threads))
    return Fit(1 - closed, np.sqrt(variance + (closed - relaxed) ** 2), bent.reshape(3, -1).T)


def _build_problem(patch: Patch, moments: Float64s, laplacian: Float64s, threads: int) -> Problem:
    hinges = find_hinges(patch.face_points[: patch.own], patch.normals[: patch.own], CREASE, patch.unknowns)
    stencil = Stencil.of(patch.face_points, hinges, patch.unknowns)
    even, odd = (
        Half(
            normal_matrix(stencil, moments[:, a + MATRIX : a + RIGHT]),
            right_side(stencil, moments[:, a + RIGHT : a + HALF]),
            float(moments[:, a + SQUARES].sum()),
        )
        for a in (0, HALF)
    )
    bent = np.stack([right_side(stencil, moments[:, a : a + 3]) for a in range(BENT, MOMENTS, 3)])
    return Problem(
        stencil, (even, odd), roughness(stencil, hinges, patch.corners, patch.areas), laplacian, bent, threads
    )


def _constant_fit(problem: Problem) -> Float64s:
    """The best fit of one value to all vertices, to start from."""
    right, mass = (sum(part) for part in zip(*((h.right.sum(), h.values.sum()) for h in problem.halves), strict=True))
    return np.full(problem.bent.shape[1], right / max(mass, 1e-300))


def _local_mean(stencil: Stencil, data: Float64s, values: Float64s, threads: int) -> Float64s:
    """Means of `values` (k,) over each vertex and its neighbours, shrunk towards that of all by a tenth."""
    weights = stencil.matrix(data)
    mass, sums = (multiply(weights, x, threads) for x in (np.ones(len(values)), values))
    local = np.where(mass > 0, sums / np.where(mass > 0, mass, 1.0), values)
    return 0.9 * local + 0.1 * float(values[mass > 0].mean() if mass.any() else 0.0)
