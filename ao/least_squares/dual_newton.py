"""The least change of values that makes many differences of them vanish, within [0, 1], by Newton's method on the dual.

Minimised is ½ Σ s_i (x_i − v_i)² + ½ p |D x|². With multipliers λ of the rows of D, x(λ) = clamp(v − Dᵀλ / s), and λ
maximises a concave function, whose gradient is D x − λ / p. Newton's matrix is D W Dᵀ + 1 / p, where W is 1 / s of
values within their bounds and 0 of values held at a bound. Its factors L Δ Lᵀ, rows in order of minimum degree, are
sparse if rows of D meet along lines; from step to step only rows of L change that depend on values newly held or free.

Sources: Qi & Sun 1993, A Nonsmooth Version of Newton's Method. Davis 2005, Algorithm 849: A Concise Sparse Cholesky
Factorization Package. Liu 1985, Modification of the Minimum-Degree Algorithm by Multiple Elimination.
"""

import numpy as np
from scipy.sparse import csr_array

from raytrace.kernel.jit import kernel
from raytrace.types import Float64s, Int32s, Int64s

from .conjugate_gradients import dot

_GROUP = 4  # consecutive rows of D that meet are ordered as one
_MEETING, _FILL = 16, 24  # rows that an entry of D meets in its column, and entries of a row of L, at most on average
_SCATTER = 2654435769  # 2³² / golden ratio (Knuth's multiplicative hashing), odd
_NEAR = 1e-5  # of D x to λ / p
_STEPS, _HALVINGS = 50, 10
_RISE = 1e-4  # Armijo's part of the rise expected


def least_change(differences: csr_array, values: Float64s, stay: Float64s, pull: float) -> Float64s | None:
    """x (n,), found on one thread, or None where L would have so many entries that conjugate gradients are faster.

    Args: differences: D (m, n), int32 indices, as many entries in every row. values, stay: v and s, (n,). pull: p.
    """
    if np.sum(np.bincount(differences.indices) ** 2) > _MEETING * differences.nnz:
        return None
    order = _minimum_degree(differences)
    if order is None:
        return None
    differences = differences[order]
    columns = differences.indices.view(np.uint32).reshape(len(order), -1)
    weights = differences.data.reshape(columns.shape)
    across = differences.T.tocsr()
    matrix = columns, weights, across.indptr.view(np.uint32), across.indices.view(np.uint32), across.data
    starts, indices = np.zeros(len(columns) + 1, np.uint32), np.empty(_FILL * len(columns), np.uint32)
    if not _find_fill(matrix, starts, indices):
        return None
    factors = starts, indices, np.empty(starts[-1]), np.empty(len(columns))

    def at(multipliers: Float64s, wanted: Float64s) -> tuple[float, Float64s, Float64s]:
        """The dual function, its gradient, and x, which is `wanted` clamped."""
        x = wanted.clip(0.0, 1.0)
        image, moved = differences @ x, x - values
        gradient = image - multipliers / pull
        return 0.5 * (dot(stay * moved, moved) + dot(multipliers, image + gradient)), gradient, x

    multipliers, wanted, weight_before = np.zeros(len(columns)), values, np.full(len(values), -1.0)
    height, gradient, x = at(multipliers, wanted)
    for _ in range(_STEPS):
        if np.abs(gradient).max() < _NEAR:
            break
        weight = np.where((wanted > 0) & (wanted < 1), 1 / stay, 0.0)
        step = gradient.copy()
        _newton_step(matrix, weight, weight != weight_before, 1 / pull, factors, step)
        rise, slide, weight_before = _RISE * dot(gradient, step), across @ step / stay, weight
        before, length = (height, multipliers, wanted), 1.0
        for _ in range(_HALVINGS):
            multipliers, wanted = before[1] + length * step, before[2] - length * slide
            height, gradient, x = at(multipliers, wanted)
            if height >= before[0] + length * rise:
                break
            length /= 2
    return x


def _minimum_degree(differences: csr_array) -> Int64s | None:
    """An order of the rows in which L has few entries: again and again all of lower degree than their neighbours.

    None where what is left has ever more entries, and too many.
    """
    columns: Int32s = differences.indices.reshape(differences.shape[0], -1)
    apart = ~((columns[1:, :1] == columns[:-1]) | (columns[1:] == columns[:-1, :1])).any(axis=1)
    begins = np.concatenate([[0], np.flatnonzero(apart) + 1, [len(columns)]])
    along = np.arange(len(columns)) - np.repeat(begins[:-1], np.diff(begins))
    starts = np.append(np.flatnonzero(along % _GROUP == 0), len(columns))
    left = np.arange(len(starts) - 1)
    entries = np.ones(columns.size), differences.indices, differences.indptr[starts]
    groups, order = csr_array(entries, shape=(len(left), differences.shape[1])), []
    graph, size = groups @ groups.T, columns.size**2
    while len(left) and graph.nnz <= size:
        size = graph.nnz
        key = (np.diff(graph.indptr).astype(np.int64) << 32) + left * _SCATTER % (1 << 32)
        lowest = key == np.minimum.reduceat(key[graph.indices], graph.indptr[:-1])
        order.append(left[lowest])
        eliminated, kept = np.flatnonzero(lowest), np.flatnonzero(~lowest)
        left, graph = left[kept], graph[kept]
        meeting = graph[:, eliminated]
        graph = graph[:, kept] + meeting @ meeting.T
        graph.data[:] = 1.0
    if graph.nnz * _GROUP**2 > _FILL * len(columns):
        return None
    rank = np.argsort(np.concatenate([*order, left]))
    return np.argsort(np.repeat(rank, np.diff(starts)), kind="stable")


@kernel
def _find_fill(matrix, starts, indices):
    """Columns of entries of L's rows below the diagonal, ascending; False if `indices` has too little room."""
    columns, _, begins, rows, _ = matrix
    count, used = len(columns), 0
    parent, seen = np.full(count, count, np.uint32), np.full(count, count, np.uint32)
    for k in range(count):
        seen[k] = k
        for e in range(columns.shape[1]):
            for q in range(begins[columns[k, e]], begins[columns[k, e] + 1]):
                i = rows[q]
                if i >= k:
                    break
                while seen[i] != k:  # up the elimination tree
                    if used == len(indices):
                        return False
                    place = used
                    while place > starts[k] and indices[place - 1] > i:
                        indices[place] = indices[place - 1]
                        place -= 1
                    indices[place], seen[i] = i, k
                    used += 1
                    if parent[i] == count:
                        parent[i] = k
                    i = parent[i]
        starts[k + 1] = used
    return True


@kernel
def _newton_step(matrix, weight, changed, shift, factors, x):
    """Solve (D · weight · Dᵀ + shift) y = x in place, after updating the rows of L on which `changed` weights act."""
    columns, weights, begins, rows, across = matrix
    starts, indices, lower, diagonal = factors
    sums, stale = np.zeros(len(x)), np.zeros(len(x), np.bool_)
    for k in range(len(x)):
        for e in range(columns.shape[1]):
            stale[k] |= changed[columns[k, e]]
        for q in range(starts[k], starts[k + 1]):
            stale[k] |= stale[indices[q]]
        if stale[k]:
            for e in range(columns.shape[1]):
                factor = weight[columns[k, e]] * weights[k, e]
                for q in range(begins[columns[k, e]], begins[columns[k, e] + 1]):
                    if rows[q] > k:
                        break
                    sums[rows[q]] += factor * across[q]
            pivot, sums[k] = sums[k] + shift, 0.0
            for q in range(starts[k], starts[k + 1]):
                total = sums[indices[q]]
                for p in range(starts[indices[q]], starts[indices[q] + 1]):
                    total -= lower[p] * sums[indices[p]]
                sums[indices[q]] = total
            for q in range(starts[k], starts[k + 1]):
                lower[q] = sums[indices[q]] / diagonal[indices[q]]
                pivot -= lower[q] * sums[indices[q]]
                sums[indices[q]] = 0.0
            diagonal[k] = pivot
        for q in range(starts[k], starts[k + 1]):
            x[k] -= lower[q] * x[indices[q]]
    x /= diagonal
    for k in range(len(x) - 1, -1, -1):
        for q in range(starts[k], starts[k + 1]):
            x[indices[q]] -= lower[q] * x[k]
