"""The least change of values that makes many differences of them vanish, within [0, 1], by Newton's method on the dual.

Minimised is ½ Σ s_i (x_i − v_i)² + ½ p |D x|². With multipliers λ of the rows of D, x(λ) = clamp(v − Dᵀλ / s), and λ
maximises a concave function, whose gradient is D x − λ / p. Newton's matrix is D W Dᵀ + 1 / p, where W is 1 / s of
values within their bounds and 0 of values held at a bound. Its factors are sparse if rows of D meet along lines. As
few values are at a bound, mostly, the factors for none solve for all steps, by a few steps of conjugate gradients.

Sources: Qi & Sun 1993, A Nonsmooth Version of Newton's Method. Li 2005, An Overview of SuperLU, which SciPy has; Liu
1985 on its order.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from scipy.sparse import csr_array, diags_array

from raytrace.types import Float64s

from .conjugate_gradients import dot

_MEETING = 16  # rows that an entry of D meets in its column, at most on average
_WIDEST = 256  # rows, on average, between one of D and the farthest before it that it meets, in the best order at hand
_NEAR = 1e-5  # of D x to λ / p
_STEPS, _HALVINGS = 50, 10
_TRIED, _SOLVED = 8, 1e-4  # steps of conjugate gradients, and to what part of the residual's square
_RISE = 1e-4  # Armijo's part of the rise expected
_SYMMETRIC = {"diag_pivot_thresh": 0.0, "panel_size": 1, "relax": 1, "options": {"SymmetricMode": True}}


class _Dual(NamedTuple):
    """The problem in the symbols of the module: differences D (m, n), values v (n,), stay s (n,), pull p."""

    differences: csr_array
    across: csr_array  # Dᵀ
    values: Float64s
    stay: Float64s
    pull: float

    def at(self, multipliers: Float64s, wanted: Float64s) -> tuple[float, Float64s, Float64s]:
        """The dual function at some multipliers, its gradient there, and x (n,).

        Args:
            wanted: (n,), the minimum without bounds for these multipliers: x is this, clamped to [0, 1].
        """
        x = wanted.clip(0.0, 1.0)
        image = self.differences @ x
        moved = x - self.values
        gradient = image - multipliers / self.pull
        return 0.5 * (dot(self.stay * moved, moved) + dot(multipliers, image + gradient)), gradient, x

    def factors(self, weight: Float64s, order: str = "NATURAL") -> Any:
        """Factors of Newton's matrix, W being `weight` (n,), with rows in an order of SuperLU's."""
        from scipy.sparse.linalg import splu  # loads for a tenth of a second

        matrix = (self.differences * weight) @ self.across
        matrix += diags_array(np.full(matrix.shape[0], 1 / self.pull))
        return splu(matrix.tocsc(), permc_spec=order, **_SYMMETRIC)

    def solve_like(self, solve: Callable[[Float64s], Float64s], weight: Float64s, right: Float64s) -> Float64s | None:
        """Newton's step by conjugate gradients that `solve` for a matrix like Newton's; None where that takes long."""
        solution = np.zeros(len(right))
        residual = right.copy()
        toward = direction = solve(residual)
        first = left = dot(residual, toward)
        for _ in range(_TRIED):
            image = self.differences @ (weight * (self.across @ direction)) + direction / self.pull
            length = left / dot(direction, image)
            solution += length * direction
            residual -= length * image
            toward = solve(residual)
            before = left
            left = dot(residual, toward)
            if left <= _SOLVED * first:
                return solution
            direction = toward + left / before * direction
        return None


def least_change(differences: csr_array, values: Float64s, stay: Float64s, pull: float) -> Float64s | None:
    """x (n,), found on one thread, or None where the factors would be so full that conjugate gradients are faster.

    Args: differences: D (m, n), int32 indices, as many entries in every row. values, stay: v and s, (n,). pull: p.
    """
    if not _meet_along_lines(differences):
        return None
    first = _Dual(differences, differences.T.tocsr(), values, stay, pull).factors(1 / stay, "MMD_AT_PLUS_A")
    order = np.argsort(first.perm_c)  # minimum degree, sought once
    ordered = differences[order]
    dual = _Dual(ordered, ordered.T.tocsr(), values, stay, pull)

    def solve_unbounded(right: Float64s) -> Float64s:
        """Solve for Newton's matrix with all values within their bounds."""
        return np.asarray(first.solve(right[first.perm_c])[order])

    multipliers, wanted = np.zeros(len(order)), values
    is_like = True  # of Newton's matrix, to that without bounds
    height, gradient, x = dual.at(multipliers, wanted)
    for _ in range(_STEPS):
        if np.abs(gradient).max() < _NEAR:
            break
        # Newton's step, with the unknowns that are within their bounds.
        weight = np.where((wanted > 0) & (wanted < 1), 1 / stay, 0.0)
        step = dual.solve_like(solve_unbounded, weight, gradient) if is_like else None
        is_like = step is not None
        if step is None:
            step = dual.factors(weight).solve(gradient)
        rise = _RISE * dot(gradient, step)
        slide = dual.across @ step / stay
        # Halved until the dual function rises as much as its slope promises (Armijo).
        before, length = (height, multipliers, wanted), 1.0
        for _ in range(_HALVINGS):
            multipliers = before[1] + length * step
            wanted = before[2] - length * slide
            height, gradient, x = dual.at(multipliers, wanted)
            if height >= before[0] + length * rise:
                break
            length /= 2
    return x


def _meet_along_lines(differences: csr_array) -> bool:
    """Whether rows of D share columns with few other rows, all near them in the order of Cuthill & McKee (1969).

    The factors of D Dᵀ are then sparse, as for seams, whose samples lie along lines.
    """
    from scipy.sparse.csgraph import reverse_cuthill_mckee

    if np.sum(np.bincount(differences.indices) ** 2) > _MEETING * differences.nnz:
        return False
    pattern = abs(differences)
    graph = pattern @ pattern.T.tocsr()
    order = reverse_cuthill_mckee(graph, symmetric_mode=True)
    graph = graph[order][:, order]
    graph.sort_indices()
    first_neighbour = graph.indices[graph.indptr[:-1]]
    return bool(np.mean(np.arange(len(first_neighbour)) - first_neighbour) <= _WIDEST)
