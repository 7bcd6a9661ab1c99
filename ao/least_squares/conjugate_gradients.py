"""Large sparse symmetric systems, solved to the same bits on any number of cores."""

import math
from collections.abc import Callable
from functools import partial

import numpy as np
from scipy.sparse import csr_array

from raytrace.kernel.jit import bound, kernel
from raytrace.system.threads import run_blocks
from raytrace.types import Bools, Float64s

FINE, COARSE = 1e-6, 1e-4
_STAGES = COARSE, 1e-5, FINE
_STEPS = 1000
_ROUNDS = 20
_BLOCK, _MOST = 1 << 14, 4  # rows, and blocks at once
_TURNED = 1 << 17  # rows, of which to wake a thread for fewer takes longer


def dot(a: Float64s, b: Float64s) -> float:
    """Σ a_i b_i, by NumPy: BLAS, and with it `scipy.sparse.linalg.cg`, sums in an order that depends on its threads."""
    return float(np.einsum("i,i->", a, b))


def multiply(matrix: csr_array, x: Float64s, threads: int) -> Float64s:
    out = np.empty(len(x))
    _each(len(x), _BLOCK, _product(matrix, x, out), threads)
    return out


def _product(matrix: csr_array, x: Float64s, out: Float64s) -> Callable[[int, int], None]:
    starts, columns = matrix.indptr.view(np.uint32), matrix.indices.view(np.uint32)  # no sign to be minded

    def product(first: int, last: int) -> None:
        _multiply(starts[first : last + 1], columns, matrix.data, x, out[first:last])

    return product


def _each(count: int, block: int, work: Callable[[int, int], None], threads: int) -> None:
    """`run_blocks` of rows, unless there are few: a product of a small mesh takes as long as handing it over."""
    if threads == 1 or count <= block:
        work(0, count)
    else:
        run_blocks(count, block, work, threads, most=_MOST)


@kernel
def _descend(step, inverse, x, residual, image, length, first, last):
    """Go on by `length` · `step`; the preconditioned residual takes the place of the step's `image`."""
    for i in range(first, last):
        residual[i] -= image[i] * length
        x[i] += step[i] * length
        image[i] = inverse[i] * residual[i]


@kernel
def _turn(step, scaled, ratio, first, last):
    for i in range(first, last):
        step[i] = step[i] * ratio + scaled[i]


@kernel
def _multiply(starts, columns, values, x, out):
    for i in range(len(out)):
        total = 0.0
        for k in range(starts[i], starts[i + 1]):
            total += values[k] * x[columns[k]]
        out[i] = total


def solve(
    matrix: csr_array,
    right: Float64s,
    start: Float64s,
    free: Bools | None = None,
    tolerance: float = FINE,
    threads: int = 1,
) -> Float64s:
    """Solve matrix · x = right, positive semidefinite, by conjugate gradients with Jacobi's preconditioner.

    Args: start: (n,), where to begin. free: bool (n,), the unknowns to solve for; fixed unknowns keep their start.
        tolerance: of the residual, as a part of the right side.
    """
    diagonal = matrix.diagonal()
    usable = diagonal > 0 if free is None else (diagonal > 0) & free
    inverse = np.where(usable, 1 / np.where(usable, diagonal, 1.0), 0.0)
    x = start.copy()
    residual = right - multiply(matrix, x, threads)
    stop = tolerance**2 * (dot(inverse * right, right) + dot(diagonal * start, start))
    step = inverse * residual
    size = dot(residual, step)
    image = np.empty(len(x))  # new arrays cost more than what is done to them
    product, turn = _product(matrix, step, image), bound(_turn, step, image)
    descend, sums = bound(_descend, step, inverse, x, residual, image), [0.0] * -(-len(x) // _BLOCK)

    def dot_after(work: Callable[[int, int], None], a: Float64s, b: Float64s) -> float:
        """Σ a_i b_i after `work`: of the sums of blocks, so that it is the same for any number of threads."""

        def work_and_add(first: int, last: int) -> None:
            work(first, last)
            for begin in range(first, last, _BLOCK):
                end = min(begin + _BLOCK, last)
                sums[begin // _BLOCK] = dot(a[begin:end], b[begin:end])

        _each(len(x), _BLOCK, work_and_add, threads)
        return math.fsum(sums)

    for _ in range(_STEPS):
        if size <= stop:
            break
        length = size / dot_after(product, step, image)
        size, before = dot_after(partial(descend, length), residual, image), size
        _each(len(x), _TURNED, partial(turn, size / before), threads)
    return x


def solve_within(
    matrix: csr_array, right: Float64s, start: Float64s, tolerance: float = FINE, threads: int = 1
) -> Float64s:
    """Minimise ½ xᵀ matrix x − xᵀ right over 0 ≤ x ≤ 1, by a primal-dual active set, found roughly first.

    Args: as `solve`; tolerance: COARSE or FINE.
    Source: Hintermüller, Ito & Kunisch 2002, The primal-dual active set strategy as a semismooth Newton method.
    """
    x = solve(matrix, right, start, None, COARSE, threads)
    low, high = x < 0, x > 1
    for accuracy in _STAGES[: _STAGES.index(tolerance) + 1]:
        for _ in range(_ROUNDS):
            held = low | high
            x = solve(matrix, right, np.where(held, high, np.clip(x, 0, 1)), ~held, accuracy, threads)
            pull = right - multiply(matrix, x, threads)
            now = np.where(held, low & (pull < 0), x < 0), np.where(held, high & (pull > 0), x > 1)
            same = np.array_equal(low, now[0]) and np.array_equal(high, now[1])
            low, high = now
            if same:
                break
    return np.clip(x, 0, 1)
