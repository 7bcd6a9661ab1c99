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

from collections.abc import Callable
from typing import NamedTuple, TypeVar, get_type_hints

import numpy as np

from obscurance.raytrace.kernel.arrays import give_memory_back
from obscurance.raytrace.kernel.jit import inline
from obscurance.raytrace.kernel.simd import SHORT, WIDE, load_short_row, store_short_row
from obscurance.raytrace.kernel.vector import add, cross, dot, load, scale
from obscurance.raytrace.system.parallel import each
from obscurance.raytrace.types import Float32Rows, Float32s, Float64Grid, Float64s, Int32s, Int64s

from ..points.points import Points
from ..rays.gather import BATCH_VARIANCE, BENT, W
from .calibration import shrunk_to_mean, variance_line
from .one_ring import Neighbours, PointBlock

_REACH = 4  # edges over which squared residuals are averaged
_COMPARED = 5  # edges from which estimates have a say in a prediction by means
_BLOCK = 1 << 16  # points of which surroundings are in memory at once
_FIT_REACH = 4  # and over which corrections are fitted; three for the spread between batches and what is closed around
_OUTLIER = 9.0  # a residual of more than three σ is the point's own
_RIDGE, _RIDGE_POINTS = 3e-3, 10.0
_SUMMED = 1 << 14  # points whose moments are summed by themselves: sums do not depend on the number of threads
_CLOSED, _SPREAD, _MEAN, _SQUARED = 0, 3, 4, 5  # columns: (1 − μ)·direction, the batches', w, squared residuals of w
_OTHERS, _ROUGHNESS = np.ones((2, WIDE), np.float32)  # weights of a point's own in means
_OTHERS[[_CLOSED, _CLOSED + 1, _CLOSED + 2, _MEAN]] = 0.0
_ROUGHNESS[_SQUARED] = 0.0
Named = TypeVar("Named")


class _Shape(NamedTuple):
    """What denoising takes from where k points lie, float32 (k,)."""

    self_weight: Float32s  # of the point's value in its mean with its neighbours
    leverage: Float32s  # of the point's value in the mean of its prediction and its neighbours' predictions
    rise: Float32s  # mean sine by which neighbours stand above the tangent plane, less theirs; NaN without neighbours


class _Fields(NamedTuple):
    """What denoising reckons at k points, float32 (k,), but (k, 3) for `unlike`."""

    variance: Float32s  # of estimates
    spread: Float32s  # between the batches of the points around
    unlike: Float32Rows  # differences from the neighbours: of the surroundings, of leaning and of rise
    prediction: Float32s  # of w by the neighbours, NaN without any
    residual: Float32s  # of the estimate from its prediction by means
    excess: Float32s  # the square of what the estimate differs by from its prediction, less the variance
    weight: Float32s  # of residuals in fits
    part: Float32s  # of each estimate in its own prediction


def denoise(neighbours: Neighbours, points: Points, gathered: Float32s, level: float) -> tuple[Float64s, Float64s]:
    """w (k,) shrunk towards its predictions, and the mean square error expected of each, (k,).

    Where all rays around a point agree, nothing is shrunk. Args: gathered: (k, COLUMNS), of `Tracer.gather`. level:
        mean square error of w in it.
    """
    w, error = _shrunk_to_predictions(neighbours, points, gathered, level)
    if len(points) > _BLOCK:
        give_memory_back()
    return w, shrunk_to_mean(error)


def _shrunk_to_predictions(
    neighbours: Neighbours, points: Points, gathered: Float32s, level: float
) -> tuple[Float64s, Float64s]:
    """`denoise`, but for the errors' own shrinkage."""
    threads = neighbours.threads
    shape = shape_of(neighbours, points)
    at = _empty(_Fields, len(points))
    for block in neighbours.blocks(_BLOCK, _COMPARED):
        _compare_with_neighbours(block, points.normals, gathered, shape, at)
    nothing = np.empty(0, np.float32)  # in place of what is no longer needed
    shape = shape._replace(leverage=nothing, rise=nothing)
    line = variance_line(float(np.mean(at.spread, dtype=np.float64)) if len(points) else 0.0, level)
    _weigh.on(threads)(line, at.spread, at.variance, at.weight)
    fit = _ridge_regression(at, threads)
    for block in neighbours.blocks(_BLOCK, _FIT_REACH):
        moments = np.empty((len(block.rows), SHORT), np.float32)
        _normal_equations.on(threads)(block.rows, fit, at, moments)
        moments = block.neighbours.smooth(moments, _FIT_REACH)[block.of_rows]
        _local_fits.on(threads)(block.of_all.start or 0, gathered, fit, shape, moments, at)
    del shape
    at = at._replace(unlike=np.empty((0, 3), np.float32), residual=nothing, weight=nothing)
    w = np.empty(len(points))
    error = np.empty(len(points))
    neighbours.smooth(at.excess, _REACH, then=lambda beyond: _shrink.for_rows(gathered, beyond, at, w, error))
    return w, error


def _compare_with_neighbours(
    block: PointBlock, all_normals: Float32s, all_gathered: Float32s, all_shapes: _Shape, out: _Fields
) -> None:
    """Fill in the fields of a block's points but `variance`, `excess` and `part`: predictions by means alone, and as
    `weight` the mean squared residual around."""
    rows = block.rows
    neighbours = block.neighbours
    means = neighbours.means
    normals = all_normals[rows]
    shape = _Shape(*(column[rows] for column in all_shapes))
    at = _empty(_Fields, len(rows))
    around = np.zeros((len(rows), SHORT), np.float32)
    gathered = all_gathered[rows]
    _begin.on(neighbours.threads)(gathered, normals, around)
    near = means(around, _OTHERS, then=lambda mean: _compare.for_rows(shape, around, mean, at))
    wide = means(near, 1.0, around, lambda wide: _compare_wide.for_rows(gathered, shape, near, wide, at))
    wider = means(wide, 1.0, near)
    leaning = np.empty(len(rows), np.float32)
    means(wider, _ROUGHNESS, wide, lambda widest: _lean.for_rows(wider, widest, normals, at, leaning))
    means(leaning, 0.0, then=lambda mean: _compare_leaning.for_rows(leaning, mean, at))
    for name in ("spread", "unlike", "prediction", "residual", "weight"):
        getattr(out, name)[block.of_all] = getattr(at, name)[block.of_rows]


def _empty(kind: Callable[..., Named], count: int) -> Named:
    """Arrays of `count` points, to be filled in."""
    names = get_type_hints(kind)
    return kind(*(np.empty((count, 3) if name == "unlike" else count, np.float32) for name in names))


def shape_of(neighbours: Neighbours, points: Points) -> _Shape:
    """Where points lie among their neighbours."""
    ring = neighbours.ring
    shape = _empty(_Shape, len(points))
    _measure.on(neighbours.threads)(ring, points.origins, points.normals, shape)
    rise = neighbours.means(shape.rise, 0.0, then=lambda mean: _compare_shapes.for_rows(ring, shape, mean))
    return shape._replace(rise=rise)


@each("origins")
def _measure(
    i: int,
    ring: tuple[Int32s, Int32s, Float32s],
    origins: Float32Rows,
    normals: Float32Rows,
    shape: _Shape,
) -> None:
    """Fill in `self_weight`, and `rise` of points alone, where a neighbour below counts as 0."""
    starts, indices, weights = ring
    whole, rise = 1.0, 0.0
    for k in range(starts[i], starts[i + 1]):
        height = squared = 0.0
        for axis in range(3):
            d = np.float64(origins[indices[k], axis]) - origins[i, axis]
            height += d * normals[i, axis]
            squared += d * d
        if height > 0.0:
            rise += height / np.sqrt(squared)
        whole += weights[k]
    shape.rise[i] = rise / max(starts[i + 1] - starts[i], 1)
    shape.self_weight[i] = 1.0 / whole


@each("mean")
def _compare_shapes(i: int, ring: tuple[Int32s, Int32s, Float32s], shape: _Shape, mean: Float32s) -> None:
    """Fill in `leverage`, and turn the neighbours' mean `rise` into what the point's own has beyond it."""
    starts, indices, weights = ring
    leverage = 0.0
    for k in range(starts[i], starts[i + 1]):
        whole = 1.0 / shape.self_weight[indices[k]] - 1.0
        if whole > 1e-6:
            leverage += weights[k] * weights[k] / whole
    shape.leverage[i] = leverage / (1.0 / shape.self_weight[i] - 1.0 + 1.0)
    mean[i] = shape.rise[i] - mean[i]


@each("gathered")
def _begin(i: int, gathered: Float32Rows, normals: Float32Rows, around: Float32Rows) -> None:
    """Fill in what surroundings are means of."""
    around[i, _MEAN] = gathered[i, W]
    around[i, _SPREAD] = gathered[i, BATCH_VARIANCE]
    for axis in range(3):
        around[i, _CLOSED + axis] = 2.0 / 3.0 * normals[i, axis] - gathered[i, BENT + axis]


@each("around")
def _compare(i: int, shape: _Shape, around: Float32Rows, mean: Float32Rows, at: _Fields) -> None:
    """Compare points with the means of their neighbours' `w` and `rise`; a point alone is its own surroundings."""
    alone = np.isnan(mean[i, _MEAN])
    at.prediction[i] = mean[i, _MEAN]
    if alone:
        store_short_row(mean, i, load_short_row(around, i))
    at.residual[i] = around[i, _MEAN] - mean[i, _MEAN]
    at.unlike[i, 2] = 0.0 if alone else shape.rise[i]
    mean[i, _SQUARED] = at.residual[i] ** 2


@each("near")
def _compare_wide(
    i: int, gathered: Float32Rows, shape: _Shape, near: Float32Rows, wide: Float32Rows, at: _Fields
) -> None:
    """Compare the neighbours' mean with their neighbours' mean, `wide`, less the point's own part in it."""
    leverage = shape.leverage[i]
    beside = (wide[i, _MEAN] - leverage * gathered[i, W]) / (1.0 - leverage) - near[i, _MEAN]
    at.unlike[i, 0] = 0.0 if np.isnan(at.prediction[i]) else beside


@each("leaning")
def _lean(
    i: int,
    wider: Float32Rows,
    widest: Float32Rows,
    normals: Float32Rows,
    at: _Fields,
    leaning: Float32s,
) -> None:
    """Fill in the dot product of each normal and the mean closed direction around, `leaning`; `spread`, and the mean
    squared residual as `weight`."""
    leaning[i] = dot(load(widest, i), load(normals, i))
    at.spread[i] = wider[i, _SPREAD]
    at.weight[i] = widest[i, _SQUARED]


@each("leaning")
def _compare_leaning(i: int, leaning: Float32s, mean: Float32s, at: _Fields) -> None:
    """Write how far each point's `leaning` is from the mean of its neighbours'."""
    at.unlike[i, 1] = 0.0 if np.isnan(at.prediction[i]) else leaning[i] - mean[i]


@each("weight")
def _weigh(i: int, line: tuple[float, float], spread: Float32s, variance: Float32s, weight: Float32s) -> None:
    """Fill in `variance`, and the `weight` of residuals, which is their mean square around before."""
    slope, at_zero = line
    variance[i] = slope * spread[i] + at_zero
    squared = weight[i]
    weight[i] = 1.0 / max(variance[i] if np.isnan(squared) else max(variance[i], squared), 1e-12)


def _ridge_regression(at: _Fields, threads: int) -> tuple[Float64s, Float64s]:
    """Coefficients (3,) of the columns of `unlike` by which these fit the residuals best, near 0 where few points or
    like columns leave them open; and root mean squares (3,) of the columns."""
    count = max(len(at.weight), 1)
    parts = np.zeros((-(-count // _SUMMED), 3, 4))
    _sum_moments.on(threads)(at, parts)
    moments = parts.sum(axis=0)
    matrix, right = moments[:, :3], moments[:, 3]  # normal equations, to be solved in columns of size 1
    size = np.sqrt(np.diag(matrix))
    used = size > 0
    size = np.where(used, size, 1.0)
    scaled = matrix / np.outer(size, size) + (_RIDGE + _RIDGE_POINTS / count) * np.eye(len(size))
    mean = np.sqrt(np.diag(matrix) / count)
    return np.where(used, np.linalg.solve(scaled, right / size) / size, 0.0), np.where(mean > 0, mean, 1.0)


@each("parts", 1)
def _sum_moments(part: int, at: _Fields, parts: Float64Grid) -> None:
    """Sum the normal equations of some points: products of the columns of `unlike`, and with the residual."""
    moments = parts[part]
    for k in range(part * _SUMMED, min((part + 1) * _SUMMED, len(at.weight))):
        for i in range(3):
            weighted = at.unlike[k, i] * at.weight[k]
            for j in range(3):
                moments[i, j] += weighted * at.unlike[k, j]
            moments[i, 3] += weighted * at.residual[k]


@each("out")
def _normal_equations(k: int, rows: Int64s, fit: tuple[Float64s, Float64s], at: _Fields, out: Float32Rows) -> None:
    """The moments of least squares around a point, of what the coefficients of the `fit` leave, in columns scaled by
    its sizes."""
    coefficients, size = fit
    i = rows[k]
    u = load(at.unlike, i)
    target = at.residual[i] - _everywhere(u, coefficients)
    a = u[0] / size[0]
    b = u[1] / size[1]
    c = u[2] / size[2]
    values = a * a, a * b, a * c, b * b, b * c, c * c, a * target, b * target, c * target
    for column in range(SHORT):
        out[k, column] = at.weight[i] * values[column]


@each("moments")
def _local_fits(
    k: int,
    first: int,
    gathered: Float32Rows,
    fit: tuple[Float64s, Float64s],
    shape: _Shape,
    moments: Float32Rows,
    at: _Fields,
) -> None:
    """Correct predictions by the fit to all points and by one around each, shrunk to 0 as if typical surroundings came
    to 0; of points from the `first` on."""
    coefficients, size = fit
    i = first + k
    m = moments[k]
    x = (1.0 + m[0], m[1], m[2])
    y = (m[1], 1.0 + m[3], m[4])
    z = (m[2], m[4], 1.0 + m[5])
    yz, zx, xy = cross(y, z), cross(z, x), cross(x, y)  # columns of the inverse, times the determinant
    u = load(at.unlike, i)
    row = np.float32(u[0] / size[0]), np.float32(u[1] / size[1]), np.float32(u[2] / size[2])
    determinant = dot(x, yz)
    solved = add(add(scale(row[0], yz), scale(row[1], zx)), scale(row[2], xy))
    at.prediction[i] += _everywhere(u, coefficients)
    at.prediction[i] += dot(solved, (m[6], m[7], m[8])) / determinant
    share = shape.self_weight[i]
    share *= (1.0 + share) / 2.0  # about, of four rounds of `smooth`, for valences from 1 to 8
    at.part[i] = min(dot(solved, row) / determinant * at.weight[i] * share, 0.5)
    at.excess[i] = _residual(gathered, at, i) ** 2 - at.variance[i]


@inline
def _everywhere(u, coefficients):
    """The correction by the fit to all points."""
    return u[0] * coefficients[0] + u[2] * coefficients[2] + u[1] * coefficients[1]


@inline
def _residual(gathered, at, i):
    """What the estimate differs by from its prediction, 0 without any."""
    return np.float32(0.0) if np.isnan(at.prediction[i]) else gathered[i, W] - at.prediction[i]


@each("w")
def _shrink(i: int, gathered: Float32Rows, beyond: Float32s, at: _Fields, w: Float64s, errors: Float64s) -> None:
    """Write w, shrunk, and the mean square errors expected."""
    variance = np.float64(at.variance[i])
    residual = np.float64(_residual(gathered, at, i))
    error = max(max(beyond[i], residual * residual - _OUTLIER * variance), 0.01 * variance)
    usable = not np.isnan(at.prediction[i]) and variance > 0.0 and at.spread[i] > 0.0
    share = variance / (variance + error) if usable else 0.0
    w[i] = gathered[i, W] - share * residual
    errors[i] = variance * (1.0 - share * (1.0 - 2.0 * at.part[i]))
