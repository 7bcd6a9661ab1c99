"""Denoising over scales: what one-rings leave of the noise on a dense mesh, larger cells of points take away.

Points are joined into cells of four, cells into larger ones, and values averaged over each. Every level is denoised
by its own one-rings (`shrinkage`); from the coarsest down, what a level says is then shrunk towards what the level
above predicts for it, by weights from the residuals around each point (James–Stein): where w bends within a cell, the
residuals exceed the noise and the finer level stays; where it does not, the coarser one is taken, whose noise is less.
Like shrinkage of wavelets with local variances (Mıhçak, Kozintsev, Ramchandran & Moulin 1999).
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from raytrace.types import Float32s, Float64s, Int32s

from ..points.points import Points
from ..rays.gather import BATCH_VARIANCE
from .calibration import distribute_variance, shrunk_to_mean
from .one_ring import Neighbours
from .shrinkage import denoise
from .upsampling import coarsened, nearest_baked, upsample

_LEVELS = 3  # above the points
_CELL = 4  # points, about
_FEWEST = 1024  # points of a level that is worth one above it
_REACH, _REACH_ABOVE = 6, 4  # edges over which squared residuals are averaged, of the points and of cells
_AMOUNTS = 1.2, 0.8, 0.4, 0.0  # times the expected noise is taken for noise in the residuals of points
_CANCELLED = 0.1  # length of a mean normal below which it says nothing
_SHARED = 0.45  # the same of cells, whose values and predictions have most of their rays in common
Risk = Callable[[Float64s], float]  # a measure of the mean square error of w (k,), by rays that are no part of it


class _Cells(NamedTuple):
    """Cells of points, or of cells."""

    neighbours: Neighbours
    points: Points  # centroids with mean normals
    rows: Float64s  # (c, COLUMNS), means
    weight: Float64s  # (c,) points in each


def denoise_over_scales(
    neighbours: Neighbours, points: Points, rows: Float64s, level: float, risk: Risk
) -> tuple[Float64s, Float64s]:
    """w (k,) denoised over all scales, and the mean square error expected of each, (k,).

    Args: level: mean square error of w in `rows` (k, COLUMNS). risk: chooses how much larger cells are trusted.
    """
    w, variance = denoise(neighbours, points, rows, level)
    rows = rows.copy()
    rows[:, BATCH_VARIANCE] = distribute_variance(rows[:, BATCH_VARIANCE], level)
    points_alone = _Cells(neighbours, points, rows, np.ones(len(points)))
    coarser = _from_above(points_alone, _LEVELS) if level > 0 else None
    if coarser is None:
        return w, variance
    predicted, error = coarser
    residual = w - predicted
    squared = np.maximum(neighbours.smooth(residual**2, _REACH), 1e-12)

    def share_by(amount: float) -> Float64s:
        return np.clip(1 - amount * variance / squared, 0.0, 1.0)

    share = share_by(min(_AMOUNTS, key=lambda amount: risk(predicted + share_by(amount) * residual)))
    return predicted + share * residual, shrunk_to_mean(error + share * np.maximum(variance - error, 0.0))


def _from_above(fine: _Cells, above: int) -> tuple[Float64s, Float64s] | None:
    """What cells predict for the points (k,), and the mean square errors expected; None where there are no cells.

    Args: above: how many levels there may be above this one.
    """
    if above == 0 or len(fine.points) < _FEWEST:
        return None
    coarse, cell = _joined(fine)
    if 2 * len(coarse.points) > len(fine.points):
        return None
    level = float(np.mean(coarse.rows[:, BATCH_VARIANCE]))
    w, variance = denoise(coarse.neighbours, coarse.points, coarse.rows, level)
    coarser = _from_above(coarse, above - 1)
    if coarser is not None:
        predicted, error = coarser
        residual = w - predicted
        squared = np.maximum(coarse.neighbours.smooth(residual**2, _REACH_ABOVE), 1e-12)
        share = np.clip(1 - _SHARED * variance / squared, 0.0, 1.0)
        w, variance = predicted + share * residual, error + share * np.maximum(variance - error, 0.0)
    found = _predicted(fine, coarse, cell, np.column_stack([w, variance]))
    return found[:, 0], np.maximum(found[:, 1], 0.0)


def _joined(fine: _Cells) -> tuple[_Cells, Int32s]:
    """Cells of about four, each of the points nearest along edges to one of them, and the cell (k,) of each point."""
    every = np.arange(len(fine.points))
    nearest = nearest_baked(fine.neighbours, every % _CELL == 0)
    nearest = np.where(nearest < 0, every, nearest)
    graph, centres, cell = coarsened(fine.neighbours, nearest, fine.points.normals)
    count = np.bincount(cell, fine.weight).astype(np.float64, copy=False)

    def means(values: Float64s | Float32s) -> Float64s:
        columns = [np.bincount(cell, column * fine.weight) / count for column in values.T]
        return np.stack(columns, axis=1)

    rows = means(fine.rows)
    rows[:, BATCH_VARIANCE] = np.bincount(cell, fine.rows[:, BATCH_VARIANCE] * fine.weight**2) / count**2
    normals = means(fine.points.normals)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.where(length > _CANCELLED, normals / np.maximum(length, _CANCELLED), fine.points.normals[centres])
    origins = means(fine.points.origins).astype(np.float32)
    points = Points(origins, normals.astype(np.float32), fine.points.numbers[centres])
    alike = np.ones(len(graph.indices), np.float32)
    around = Neighbours.weighted(graph.starts, graph.indices, alike, points.normals, graph.threads)
    return _Cells(around, points, rows, count), cell


def _predicted(fine: _Cells, coarse: _Cells, cell: Int32s, values: Float64s) -> Float64s:
    """`values` (c, 2) of the cells, w and its squared error, at the points (k, 2)."""
    count, cells = len(fine.points), np.arange(len(coarse.points))
    both = Points(
        np.concatenate([fine.points.origins, coarse.points.origins]),
        np.concatenate([fine.points.normals, coarse.points.normals]),
        np.concatenate([fine.points.numbers, coarse.points.numbers]),
    )
    of = np.concatenate([cell, cells]).astype(np.int32)
    return upsample(both, np.arange(count), coarse.neighbours, count + cells, of, values)
