"""Denoising: estimates are shrunk towards a leave-one-out prediction from their neighbours (James–Stein weights).

Each point has an estimate y of variance σ² and a prediction p of mean square error t², made without y. The linear
combination of least risk is y + σ²/(σ² + t²) (p − y) (Bates & Granger 1969; with t² taken from the data, James & Stein
1961). E(y − p)² = σ² + t² wherever the two errors are independent, so t² is what the squared residuals around a point
have beyond σ². As samples grow, σ² vanishes before t² and the estimate is left alone. Of a prediction that a small part
h of y has gone into, E(y − w)(p − w) = h σ²: shrunk by a share s, y then errs by σ² (1 − s (1 − 2 h)).

The prediction is the mean over the neighbours, corrected for what makes a vertex differ from them: how it leans
towards what is closed around it, and how far its neighbours stand above its tangent plane. The coefficients are fitted
by least squares, to the whole mesh and then around each point.
"""

from __future__ import annotations

import numpy as np

from raytrace.kernel.arrays import aligned, product
from raytrace.kernel.jit import kernel
from raytrace.kernel.simd import WIDE
from raytrace.kernel.vector import add, cross, dot, load, scale
from raytrace.types import Float32s, Float64s

from ..points.points import Points
from ..rays.directions import BATCHES
from ..rays.estimate import BATCH_VARIANCE, BENT, W
from .one_ring import Neighbours

_SPREAD_REACH = 3  # edges over which the spread between batches is averaged
_REACH = 4  # and squared residuals
_LEAN_REACH = 3  # and what is closed around a point
_FIT_REACH = 4  # and what corrections are fitted to
_OUTLIER = 9.0  # a residual of more than three σ is the point's own
_TYPICAL = 0.2  # of their mean in each expected squared error
_RIDGE, _RIDGE_POINTS = 3e-3, 10.0
_USUAL, _DOUBT = 1.0, 0.3  # factor by which expected squared errors are off, and its standard deviation


def denoise(neighbours: Neighbours, points: Points, rows: Float64s, level: float) -> tuple[Float64s, Float64s]:
    """w (k,) shrunk towards its predictions, and the mean square error expected of each, (k,).

    Where all rays around a point agree, nothing is shrunk.

    Args: rows: (k, COLUMNS), see `gather_hemispheres`. level: mean square error of their w.
    """
    estimate, spread = rows[:, W], neighbours.smooth(rows[:, BATCH_VARIANCE], _SPREAD_REACH)
    variance = distribute_variance(spread, level)
    prediction, part = _prediction(neighbours, points, rows, variance)
    isolated = np.isnan(prediction)
    residual = np.where(isolated, 0.0, estimate - prediction)
    squared = residual**2
    beyond = neighbours.smooth(squared - variance, _REACH)
    error = np.maximum(np.maximum(beyond, squared - _OUTLIER * variance), 0.01 * variance)
    usable = ~isolated & (variance > 0) & (spread > 0)
    share = np.where(usable, variance / np.where(usable, variance + error, 1.0), 0.0)
    return estimate - share * residual, shrunk_to_mean(variance * (1 - share * (1 - 2 * part)))


def _prediction(
    neighbours: Neighbours, points: Points, rows: Float64s, variance: Float64s
) -> tuple[Float64s, Float64s]:
    """Predictions from the neighbours, (k,), NaN without any; and the part that each estimate has in its own, (k,)."""
    estimate, ring = rows[:, W], neighbours.predict(rows[:, W])
    isolated = np.isnan(ring)
    unlike = _differences(neighbours, points, rows, ring)
    residual = np.where(isolated, 0.0, estimate - ring)
    rough = np.nan_to_num(neighbours.predict(neighbours.smooth(residual**2 - variance, 2)))
    weight = 1 / np.maximum(variance + np.maximum(rough, 0.0), 1e-12)
    everywhere = product(unlike, _ridge_regression(unlike, residual, weight))
    around, part = _local_fit(neighbours, unlike, residual - everywhere, weight)
    return ring + everywhere + around, part


def _differences(neighbours: Neighbours, points: Points, rows: Float64s, ring: Float64s) -> Float64s:
    """How each point differs from its neighbours, (k, 3): in what is around these, in its leaning and in its rise.

    Args: ring: (k,), the neighbours' mean w.
    """
    estimate, isolated, normals = rows[:, W], np.isnan(ring), points.normals.astype(np.float64)
    closed = 2 / 3 * normals - rows[:, BENT:]  # mean of (1 − μ)·direction
    predicted = np.where(isolated, estimate, ring)
    wide = neighbours.smooth(predicted, 1)
    own = neighbours.leverage()
    closed = np.where(isolated[:, None], closed, neighbours.predict(closed))
    leaning = np.einsum("ij,ij->i", neighbours.smooth(closed, _LEAN_REACH), normals)
    rise = np.empty(len(points))
    starts, indices = neighbours.starts, neighbours.indices
    neighbours.each(lambda first, last: _mean_rises(first, last, starts, indices, points.origins, points.normals, rise))
    beside = (wide - own * estimate) / (1 - own) - predicted
    unlike = np.column_stack([beside, *(about - neighbours.predict(about) for about in (leaning, rise))])
    unlike[isolated] = 0.0
    return unlike


def _ridge_regression(columns: Float64s, target: Float64s, weight: Float64s) -> Float64s:
    """Coefficients (c,) of weighted ridge regression: near 0 where few points or like columns leave them open."""
    matrix, right = np.einsum("ki,kj,k->ij", columns, columns, weight), np.einsum("ki,k,k->i", columns, target, weight)
    size = np.sqrt(np.diag(matrix))
    used = size > 0
    size = np.where(used, size, 1.0)
    ridge = _RIDGE + _RIDGE_POINTS / max(len(target), 1)
    inside = matrix / np.outer(size, size) + ridge * np.eye(len(size))
    return np.where(used, np.linalg.solve(inside, right / size) / size, 0.0)


def _local_fit(
    neighbours: Neighbours, columns: Float64s, target: Float64s, weight: Float64s
) -> tuple[Float64s, Float64s]:
    """`target` (k,) by least squares from three `columns` (k, 3), fitted anew around each point; its own part in that.

    Coefficients are shrunk to 0 as if a typical surrounding had that for a result.
    """
    size = np.sqrt(np.einsum("ki,ki,k->i", columns, columns, weight) / max(len(target), 1))
    scaled = columns / np.where(size > 0, size, 1.0)
    fit, part = np.empty(len(target)), np.empty(len(target))

    def moments() -> Float32s:
        out = aligned((len(target), WIDE), np.float32)
        neighbours.each(lambda first, last: _normal_equations(first, last, scaled, target, weight, out))
        return out

    around = neighbours.smooth(moments(), _FIT_REACH)  # which lets go of them after a round
    neighbours.each(lambda first, last: _local_fits(first, last, scaled, around, fit, part))
    return fit, np.minimum(part * weight * neighbours.smoothed_self_weight(), 0.5)


@kernel
def _normal_equations(first, last, columns, target, weight, out):
    for i in range(first, last):
        a, b, c = load(columns, i)
        values = a * a, a * b, a * c, b * b, b * c, c * c, a * target[i], b * target[i], c * target[i]
        for k in range(9):
            out[i, k] = weight[i] * values[k]


@kernel
def _local_fits(first, last, columns, moments, fit, part):
    for i in range(first, last):
        m = moments[i]
        x, y, z = (1.0 + m[0], m[1], m[2]), (m[1], 1.0 + m[3], m[4]), (m[2], m[4], 1.0 + m[5])
        yz, zx, xy = cross(y, z), cross(z, x), cross(x, y)  # columns of the inverse, times the determinant
        row, determinant = load(columns, i), dot(x, yz)
        solved = add(add(scale(row[0], yz), scale(row[1], zx)), scale(row[2], xy))
        fit[i] = dot(solved, (m[6], m[7], m[8])) / determinant
        part[i] = dot(solved, row) / determinant


@kernel
def _mean_rises(first, last, starts, indices, origins, normals, out):
    """The mean sine by which neighbours stand above each point's tangent plane; a neighbour below counts as 0."""
    for i in range(first, last):
        out[i] = 0.0
        for k in range(starts[i], starts[i + 1]):
            height = squared = 0.0
            for axis in range(3):
                d = np.float64(origins[indices[k], axis]) - origins[i, axis]
                height += d * normals[i, axis]
                squared += d * d
            if height > 0.0:
                out[i] += height / np.sqrt(squared)
        out[i] /= max(starts[i + 1] - starts[i], 1)


def calibration_factor(expected: Float64s, squared: Float64s, everywhere: Float64s) -> float:
    """The factor by which `expected` squared errors (j,) are off in the mean, from unbiased measures `squared` (j,).

    A measure that scatters much is mistrusted: the mean of it and what is usual, weighted by their variances. So is one
    where few points have most of the error `everywhere`, expected of all (k,), for it may have missed these.
    """
    mean = float(np.mean(expected)) if len(expected) else 0.0
    if mean <= 0 or len(squared) <= 1:
        return 1.0
    uneven = float(np.mean(everywhere**2) / np.mean(everywhere) ** 2)
    scatter = (float(np.var(squared)) / mean**2 + 2 * uneven) / len(squared)
    return float(np.clip(_USUAL + (float(np.mean(squared)) / mean - _USUAL) / (1 + scatter / _DOUBT**2), 1 / 3, 3))


def shrunk_to_mean(squared: Float64s, typical: float = _TYPICAL) -> Float64s:
    """Expected squared errors (k,) shrunk towards their mean, for they are uncertain themselves."""
    return squared + typical * (np.mean(squared) - squared) if len(squared) else squared


def distribute_variance(spread: Float64s, level: float) -> Float64s:
    """Variances (k,) of mean `level`, distributed as the `spread` (k,) between each point's batches.

    It is shrunk towards its mean by one degree of freedom, so that lucky agreement never reads as certainty.
    """
    typical = float(np.mean(spread)) if len(spread) else 0.0
    if typical == 0:
        return np.full(len(spread), level)
    freedom = BATCHES - 1
    return level / typical * (freedom * spread + typical) / (freedom + 1)
