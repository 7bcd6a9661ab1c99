"""Large sparse symmetric systems, solved to the same bits on any number of cores."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_array

Floats = npt.NDArray[np.float64]

FINE, COARSE = 1e-7, 1e-4
_STEPS = 1000
_ROUNDS = 20


def dot(a: Floats, b: Floats) -> float:
    """Σ a_i b_i, by NumPy: BLAS, and with it `scipy.sparse.linalg.cg`, sums in an order that depends on its threads."""
    return float(np.einsum("i,i->", a, b))


def solve(
    matrix: csr_array,
    right: Floats,
    start: Floats,
    free: npt.NDArray[np.bool_] | None = None,
    tolerance: float = FINE,
) -> Floats:
    """Solve matrix · x = right, positive semidefinite, by conjugate gradients with Jacobi's preconditioner.

    Args: start: (n,), where to begin. free: bool (n,), the unknowns to solve for; the others keep their start.
        tolerance: of the residual, as a part of the right side.
    """
    diagonal = matrix.diagonal()
    usable = diagonal > 0 if free is None else (diagonal > 0) & free
    inverse = np.where(usable, 1 / np.where(usable, diagonal, 1.0), 0.0)
    x = start.copy()
    residual = right - matrix @ x
    stop = tolerance**2 * (dot(inverse * right, right) + dot(diagonal * start, start))
    step = inverse * residual
    size = dot(residual, step)
    for _ in range(_STEPS):
        if size <= stop:
            break
        image = matrix @ step
        length = size / dot(step, image)
        x += length * step
        residual -= length * image
        scaled = inverse * residual
        size, before = dot(residual, scaled), size
        step = scaled + size / before * step
    return x


def solve_within(matrix: csr_array, right: Floats, start: Floats) -> Floats:
    """Minimise ½ xᵀ matrix x − xᵀ right over 0 ≤ x ≤ 1, by a primal-dual active set.

    Source: Hintermüller, Ito & Kunisch 2002, The primal-dual active set strategy as a semismooth Newton method.
    """
    x = solve(matrix, right, start)
    low, high = x < 0, x > 1
    for _ in range(_ROUNDS):
        if not (low.any() or high.any()):
            break
        held = low | high
        x = solve(matrix, right, np.clip(np.where(high, 1.0, np.where(low, 0.0, x)), 0, 1), ~held)
        pull = right - matrix @ x
        now = np.where(held, low & (pull < 0), x < 0), np.where(held, high & (pull > 0), x > 1)
        if np.array_equal(low, now[0]) and np.array_equal(high, now[1]):
            break
        low, high = now
    return np.clip(x, 0, 1)
