"""Large sparse symmetric systems, solved to the same bits on any number of cores."""

import math
from collections.abc import Callable
from functools import partial

import numpy as np
from scipy.sparse import csr_array

from obscurance.raytrace.system.parallel import each, parallel
from obscurance.raytrace.system.threads import run_blocks
from obscurance.raytrace.types import Bools, Float64Rows, Float64s, UInt32s

FINE, COARSE = 1e-8, 1e-3  # of x, whose bounds are 0 and 1
_STAGES = 1e-2, COARSE, 1e-4, 1e-5, 1e-6, FINE
_SLACK = 0.1  # of a stage's accuracy, by which the gradient has to call for a fixed unknown to be free
_STEPS = 10_000
_ROUNDS, _STEADY = 50, 4
_GROUP = 8  # consecutive unknowns that the preconditioner solves for exactly
_FLOOR = 1e-12  # of a pivot, as a part of the diagonal
_BLOCK, _MOST = 1 << 14, 4  # rows, and blocks at once; to wake a thread for fewer takes longer than their work


def dot(a: Float64s, b: Float64s) -> float:
    """Σ a_i b_i, by NumPy: BLAS, and with it `scipy.sparse.linalg.cg`, sums in an order that depends on its threads."""
    return float(np.einsum("i,i->", a, b))


def multiply(matrix: csr_array, x: Float64s, threads: int) -> Float64s:
    """matrix · x, (n,)."""
    out = np.empty(len(x))
    _multiply.on(threads)(*_arrays(matrix), x, out)
    return out


def _arrays(matrix: csr_array) -> tuple[UInt32s, UInt32s, Float64s]:
    """The arrays of a sparse matrix as kernels take them: row starts, columns and values."""
    return matrix.indptr.view(np.uint32), matrix.indices.view(np.uint32), matrix.data  # no sign to be minded


@parallel("inverse", _BLOCK)
def _invert(
    start: int, stop: int, starts: UInt32s, columns: UInt32s, values: Float64s, free: Bools, inverse: Float64Rows
) -> None:
    """The matrix's blocks of `_GROUP` rows on the diagonal, inverted by sweeps, and 0 for unknowns that are fixed."""
    diagonal = np.zeros(_GROUP)
    for begin in range(start, stop, _GROUP):
        block = inverse[begin : min(begin + _GROUP, stop)]
        size = len(block)
        for i in range(size):
            for j in range(_GROUP):
                block[i, j] = 0.0
            for k in range(starts[begin + i], starts[begin + i + 1]):
                j = columns[k] - begin
                if 0 <= j < size and free[begin + i] and free[begin + j]:
                    block[i, j] -= values[k]
            diagonal[i] = -block[i, i]
        for k in range(size):
            if diagonal[k] <= 0.0:
                continue
            scale = 1.0 / max(-block[k, k], _FLOOR * diagonal[k])
            for i in range(size):
                for j in range(size):
                    if i != k and j != k:
                        block[i, j] += block[i, k] * block[k, j] * scale
            for i in range(size):
                block[i, k] *= scale
                block[k, i] = block[i, k]
            block[k, k] = scale


@parallel("x", _BLOCK)
def _descend(
    start: int,
    stop: int,
    step: Float64s,
    inverse: Float64Rows,
    x: Float64s,
    residual: Float64s,
    image: Float64s,
    length: float,
) -> None:
    """Step along the search direction: x and the residual change by `length` times `step` and its image.

    The preconditioned residual takes the place of the image.
    """
    for i in range(start, stop):
        residual[i] -= image[i] * length
        x[i] += step[i] * length
    sums = np.zeros(_GROUP)
    for begin in range(start, stop, _GROUP):
        end = min(begin + _GROUP, stop)
        for i in range(_GROUP):
            sums[i] = 0.0
        for j in range(begin, end):
            for i in range(_GROUP):
                sums[i] += inverse[j, i] * residual[j]
        for i in range(begin, end):
            image[i] = sums[i - begin]


@each("step", 1 << 17)
def _next_step(i: int, step: Float64s, scaled: Float64s, ratio: float) -> None:
    """The next direction of descent: the preconditioned residual, conjugate to the step before."""
    step[i] = step[i] * ratio + scaled[i]


@each("out", _BLOCK)
def _multiply(i: int, starts: UInt32s, columns: UInt32s, values: Float64s, x: Float64s, out: Float64s) -> None:
    """Write rows of the sparse matrix times x to `out`."""
    total = 0.0
    for k in range(starts[i], starts[i + 1]):
        total += values[k] * x[columns[k]]
    out[i] = total


def solve(
    matrix: csr_array,
    right: Float64s,
    start: Float64s,
    free: Bools | None = None,
    near: float = FINE,
    threads: int = 1,
    mean: bool = False,
) -> Float64s:
    """Solve matrix · x = right, positive semidefinite, by conjugate gradients preconditioned by blocks of the diagonal.

    Unknowns that meet had better be near in number: those of a block are solved for together.

    Args: start: (n,), where to begin. free: bool (n,), the unknowns to solve for; fixed unknowns keep their start.
        near: the preconditioned residual, in the units of x, at any unknown or, if `mean`, by the diagonal's weights.
    """
    # The preconditioner: blocks of the diagonal, inverted.
    x = start.copy()
    free = np.ones(len(x), np.bool_) if free is None else free
    inverse = np.empty((len(x), _GROUP))
    _invert.on(threads)(*_arrays(matrix), free, inverse)
    # Kernels over the rows, which share these arrays.
    residual = right - multiply(matrix, x, threads)
    step = np.zeros(len(x))
    image = np.zeros(len(x))  # of the step by the matrix, then the preconditioned residual
    product = _multiply.for_rows(*_arrays(matrix), step, image)
    descend = partial(_descend.for_rows, step, inverse, x, residual, image)
    sums = [0.0] * -(-len(x) // _BLOCK)

    def dot_after(work: Callable[[int, int], None], a: Float64s, b: Float64s) -> float:
        """Σ a_i b_i after `work`: of the sums of blocks, so that it is the same for any number of threads."""

        def work_and_add(start: int, stop: int) -> None:
            """Do the work on rows, then sum a_i b_i over each of their blocks."""
            work(start, stop)
            for begin in range(start, stop, _BLOCK):
                end = min(begin + _BLOCK, stop)
                sums[begin // _BLOCK] = dot(a[begin:end], b[begin:end])

        run_blocks(len(x), _BLOCK, work_and_add, min(threads, len(x) // _BLOCK or 1), most=_MOST)
        return math.fsum(sums)

    # Steps along conjugate directions until the preconditioned residual is small.
    size = dot_after(descend(0.0), residual, image)
    step += image
    most = (1 if mean else _GROUP) * near**2 * float(matrix.diagonal().sum())
    for _ in range(_STEPS):
        if size <= most and (mean or np.abs(image).max(initial=0.0) <= near):
            break
        curvature = dot_after(product, step, image)
        if curvature <= 0:  # by rounding, where the matrix is singular
            break
        length = size / curvature
        before = size
        size = dot_after(descend(length), residual, image)
        _next_step.on(threads)(step, image, size / before)
    return x


def solve_within(
    matrix: csr_array, right: Float64s, start: Float64s, near: float = FINE, threads: int = 1, mean: bool = False
) -> Float64s:
    """Minimise ½ xᵀ matrix x − xᵀ right over 0 ≤ x ≤ 1, by a primal-dual active set, found roughly first.

    Args: as `solve`; near: one of the stages, 1e-2 to FINE.
    Source: Hintermüller, Ito & Kunisch 2002, The primal-dual active set strategy as a semismooth Newton method.
    """
    x = start
    low = start <= 0
    high = start >= 1
    chance = np.random.default_rng(0)
    diagonal = matrix.diagonal()
    for accuracy in _STAGES[: _STAGES.index(near) + 1]:
        for number in range(_ROUNDS if accuracy == near < COARSE else _STEADY):
            # Solve for the unknowns that no bound holds.
            held = low | high
            x = solve(matrix, right, np.where(held, high, np.clip(x, 0, 1)), ~held, accuracy, threads, mean)
            # Unknowns whose gradient pulls them off their bound are freed, others that leave the bounds are held.
            pull = right - multiply(matrix, x, threads)
            slack = _SLACK * accuracy * diagonal
            freed = (low & (pull > slack)) | (high & (pull < -slack))
            below = x < -accuracy
            above = x > 1 + accuracy
            wrong = freed | ~held & (below | above)
            if not wrong.any():
                break
            if number >= _STEADY:  # some of them, so that none turn to and fro together
                wrong &= chance.random(len(x)) < 0.5
            low = np.where(wrong, below, low)
            high = np.where(wrong, above, high)
    return np.clip(x, 0, 1)
