"""Denoising over scales: what one-rings leave of the noise on a dense mesh, larger cells of points take away.

Points are joined into cells of four, cells into larger ones, and values averaged over each. Every level is denoised
by its own one-rings (`shrinkage`); from the coarsest down, what a level says is then shrunk towards what the level
above predicts for it, by weights from the residuals around each point (James–Stein): where w bends within a cell, the
residuals exceed the noise and the finer level stays; where it does not, the coarser one is taken, whose noise is less.
Like shrinkage of wavelets with local variances (Mıhçak, Kozintsev, Ramchandran & Moulin 1999).
"""

from collections.abc import Callable
from typing import NamedTuple, Self

import numpy as np

from raytrace.types import Float32s, Float64s, Int32s, Int64s

from ..points.points import Points
from ..rays.gather import BATCH_VARIANCE
from .calibration import distribute_variance, shrunk_to_mean
from .one_ring import Neighbours
from .shrinkage import denoise
from .upsampling import coarsened, nearest_baked, upsample

_LEVELS = 3  # above the points
_CELL = 4  # points, about
_FEWEST = 1024  # points of a level that is worth one above it
_REACH = 4  # cells over which squared residuals are averaged
_AMOUNTS = 2.0, 1.2, 0.8, 0.5, 0.25, 0.0  # times the expected noise may be in residuals
_JUMP = 3.0  # times the noise may be in the mean squared residual of a point and its neighbours
_AVERAGED = 0.8  # of the squared errors of cells, is left of them in planes fitted to several
_CANCELLED = 0.1  # length of a mean normal below which it says nothing
Risk = Callable[[Float64s], float]  # measures the mean square error of w at the checked points, by rays of its own


class _Level(NamedTuple):
    """Points, or cells of them."""

    neighbours: Neighbours
    points: Points  # of cells: centroids with mean normals
    rows: Float64s  # (c, COLUMNS), means
    weight: Float64s  # (c,) points in each

    def denoised(self) -> tuple[Float64s, Float64s]:
        """w by one-rings of this level alone, and the mean square error expected, (c,)."""
        return denoise(self.neighbours, self.points, self.rows, float(np.mean(self.rows[:, BATCH_VARIANCE])))


def denoise_over_scales(
    neighbours: Neighbours, points: Points, rows: Float64s, level: float, checked: Int64s, risk: Risk
) -> tuple[Float64s, Float64s]:
    """w (k,) denoised over all scales, and the mean square error expected of each, (k,).

    Args: level: mean square error of w in `rows` (k, COLUMNS). checked, risk: choose how much noise there is in
        residuals, of cells by what they predict for points, then of points.
    """
    finest = denoise(neighbours, points, rows, level)
    rows = rows.copy()
    rows[:, BATCH_VARIANCE] = distribute_variance(rows[:, BATCH_VARIANCE], level)
    levels, cells = _pyramid(_Level(neighbours, points, rows, np.ones(len(points)))) if level > 0 else ([], [])
    if not cells:
        return finest
    levels[0] = levels[0]._replace(rows=rows[:0].copy())
    del rows  # cells have their means
    said = [coarse.denoised() for coarse in levels[1:]]

    def shrunk_cells(amount: float) -> tuple[Float64s, Float64s]:
        estimate = said[-1]
        for k in range(len(cells) - 1, 0, -1):
            estimate = _Detail.of(said[k - 1], levels[k], levels[k + 1], cells[k], estimate).shrunk(amount)
        return estimate

    def risk_of_cells(estimate: tuple[Float64s, Float64s]) -> float:
        return risk(_predicted(levels[0], levels[1], cells[0], np.column_stack(estimate), checked)[:, 0])

    estimate = min(map(shrunk_cells, _AMOUNTS if len(cells) > 1 else _AMOUNTS[:1]), key=risk_of_cells)
    detail = _Detail.of(finest, levels[0], levels[1], cells[0], estimate).with_jumps(neighbours)
    at_checked = _Detail(*(values[checked] for values in detail))
    w, error = detail.shrunk(min(_AMOUNTS, key=lambda amount: risk(at_checked.shrunk(amount)[0])))
    return w, shrunk_to_mean(error)


class _Detail(NamedTuple):
    """What a level says beyond the prediction of the level above; all (k,)."""

    predicted: Float64s
    predicted_error: Float64s  # squared, expected
    residual: Float64s  # from the prediction
    squared: Float64s  # mean square of the residuals around
    noise: Float64s  # mean square error around that is expected of what the level says

    def with_jumps(self, neighbours: Neighbours) -> Self:
        """Where a point and its neighbours together are far beyond their noise, no wider surroundings count."""
        nearby = neighbours.smooth(self.residual**2, 1)
        return self._replace(squared=np.maximum(self.squared, nearby - _JUMP * self.noise))

    @classmethod
    def of(
        cls,
        said: tuple[Float64s, Float64s],
        fine: _Level,
        coarse: _Level,
        cell: Int32s,
        above: tuple[Float64s, Float64s],
    ) -> Self:
        """Args: said, above: w and its squared error expected, of the `fine` and the `coarse` level."""
        predicted = _predicted(fine, coarse, cell, np.column_stack(above))
        residual = said[0] - predicted[:, 0]
        size = np.bincount(cell)

        def around(values: Float64s) -> Float64s:
            return coarse.neighbours.smooth(np.bincount(cell, values) / size, _REACH)[cell]

        squared = np.maximum(around(residual**2), 1e-12)
        return cls(predicted[:, 0], _AVERAGED * np.maximum(predicted[:, 1], 0.0), residual, squared, around(said[1]))

    def shrunk(self, amount: float) -> tuple[Float64s, Float64s]:
        """w and its squared error expected, if `amount` times the noise is what residuals have of it."""
        share = np.clip(1 - amount * self.noise / self.squared, 0.0, 1.0)
        error = self.predicted_error + share * np.maximum(self.noise - self.predicted_error, 0.0)
        return self.predicted + share * self.residual, error


def _pyramid(points: _Level) -> tuple[list[_Level], list[Int32s]]:
    """The points, cells of them, cells of these, …; and the cell of each of a level's points, of all but the last."""
    levels = [points]
    cells = list[Int32s]()
    while len(cells) < _LEVELS and len(levels[-1].points) >= _FEWEST:
        coarse, cell = _joined(levels[-1])
        if 2 * len(coarse.points) > len(cell):
            break
        levels.append(coarse)
        cells.append(cell)
    return levels, cells


def _joined(fine: _Level) -> tuple[_Level, Int32s]:
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
    return _Level(around, points, rows, count), cell


def _predicted(fine: _Level, coarse: _Level, cell: Int32s, values: Float64s, wanted: Int64s | None = None) -> Float64s:
    """`values` (c, 2) of the cells, w and its squared error, at the points (k, 2), or at those `wanted` (j, 2)."""
    count = len(fine.points)
    cells = np.arange(len(coarse.points))
    both = Points(
        np.concatenate([fine.points.origins, coarse.points.origins]),
        np.concatenate([fine.points.normals, coarse.points.normals]),
        np.concatenate([fine.points.numbers, coarse.points.numbers]),
    )
    of = np.concatenate([cell, cells]).astype(np.int32)
    return upsample(both, np.arange(count) if wanted is None else wanted, coarse.neighbours, count + cells, of, values)
