"""Denoising over scales: on a dense mesh, larger cells of points take away the noise that one-rings leave.

Points are joined into cells of four, cells into larger ones, and values averaged over each. Every level is denoised
by its own one-rings (`shrinkage`); from the coarsest down, what a level says is then shrunk towards what the level
above predicts for it, by weights from the residuals around each point (James–Stein): where w bends within a cell, the
residuals exceed the noise and the finer level stays; where it does not, the coarser level is taken, which has less
noise. Like shrinkage of wavelets with local variances (Mıhçak, Kozintsev, Ramchandran & Moulin 1999).
"""

from collections.abc import Callable, Iterator
from functools import partial
from typing import NamedTuple, Self
from weakref import WeakKeyDictionary

import numpy as np

from obscurance.raytrace.kernel.simd import SHORT
from obscurance.raytrace.kernel.vector import add, divide, length, load, scale, store
from obscurance.raytrace.system.parallel import each
from obscurance.raytrace.types import AnyFloats, Float32Rows, Float32s, Float64s, Int32s, Int64s

from ..points.points import PointArrays, Points
from ..rays.gather import BATCH_VARIANCE, COLUMNS
from .calibration import shrunk_to_mean, variance_line
from .cells import Cells
from .one_ring import Neighbours
from .shrinkage import denoise
from .upsampling import upsample

_LEVELS = 3  # above the points
_MANY = 1 << 20  # points whose cells take too much memory to be kept
_FEWEST = 1024  # points of a level that is worth one above it
_BLOCK = 1 << 17  # points or cells that are in memory twice at once
_REACH = 4  # cells over which squared residuals are averaged
_AMOUNTS = 2.0, 1.2, 0.8, 0.5, 0.25, 0.0  # times the expected noise: what may be in residuals
_JUMP = 3.0  # times the noise may be in the mean squared residual of a point and its neighbours
_OUTLIER = 16.0  # times the noise may be in a squared residual; what is beyond, shrinking makes an error
_AVERAGED = 0.8  # of the squared errors of cells: what is left in planes fitted to several cells
_CANCELLED = 0.1  # length of a mean normal below which it says nothing
Risk = Callable[[Float64s], float]  # measures the mean square error of w at the checked points, by rays of its own
Denoised = tuple[Float64s, Float64s]  # w, and its squared error expected


class _Level(NamedTuple):
    """Cells of the points of the level below."""

    neighbours: Neighbours
    points: Points  # centroids with mean normals
    weight: Float32s  # (c,), points of the mesh in each
    cells: Cells

    def means(self, gathered: Float32s, weight: Float32s, slope: float, offset: float) -> Float32s:
        """Rows (c, COLUMNS) from rows (k, COLUMNS) of the points below; variances of the means, from `slope` times
        the points' variances and `offset`. Args: weight: (k,), of the points below."""
        out = np.empty((len(self.points), COLUMNS), np.float32)
        _average.on(self.neighbours.threads)(self.cells, weight, gathered, slope, offset, out)
        return out


_pyramids: WeakKeyDictionary[Neighbours, list[_Level]] = WeakKeyDictionary()


def denoise_over_scales(
    neighbours: Neighbours, points: Points, gathered: Float32s, level: float, checked: Int64s, risk: Risk
) -> Denoised:
    """w (k,) denoised over all scales, and the mean square error expected of each, (k,).

    Args: level: mean square error of w in `gathered` (k, COLUMNS). checked, risk: choose how much noise there is in
        residuals, of cells by what they predict for points, then of points.
    """
    finest = denoise(neighbours, points, gathered, level)
    levels = _pyramid(neighbours, points) if level > 0 else []
    if not levels:
        return finest
    estimates = []
    weight = np.ones(len(points), np.float32)
    line = variance_line(_mean_variance(gathered), level)
    for coarser in levels:
        gathered = coarser.means(gathered, weight, *line)
        estimates.append(denoise(coarser.neighbours, coarser.points, gathered, _mean_variance(gathered)))
        weight = coarser.weight
        line = 1.0, 0.0
    del gathered
    # Cells by all amounts at once, of which the points choose one.
    amounts = np.array(_AMOUNTS if len(levels) > 1 else _AMOUNTS[:1])
    values: AnyFloats = np.repeat(np.column_stack(estimates.pop()), len(amounts), axis=1)
    threads = neighbours.threads
    for fine, coarse in zip(levels[-2::-1], levels[:0:-1], strict=True):
        detail = _Detail.of(estimates.pop(), fine.points, coarse, values)
        values = detail.shrunk(amounts, threads, detail.predicted)
        del detail
    lowest = levels[0]
    cell = lowest.cells.cell[checked]
    predicted = upsample(points[checked], cell, lowest.neighbours, lowest.points, values).astype(np.float64)
    best = min(range(len(amounts)), key=lambda column: risk(predicted[:, column]))
    values = values[:, best :: len(amounts)].copy()
    detail = _Detail.of(finest, points, lowest, values, neighbours)
    del values
    # Points, by the amount that is best at those that are checked.
    some = detail.at(checked)
    by_amount = [some.shrunk(np.array([amount]), 1)[:, 0].astype(np.float64) for amount in _AMOUNTS]
    amount = _AMOUNTS[min(range(len(_AMOUNTS)), key=lambda column: risk(by_amount[column]))]
    w, error = finest
    for start in range(0, len(w), _BLOCK):
        block = slice(start, start + _BLOCK)
        shrunk = detail.at(block).shrunk(np.array([amount]), threads)
        w[block] = shrunk[:, 0]
        error[block] = shrunk[:, 1]
    del finest, detail
    return w, shrunk_to_mean(error)


def _mean_variance(gathered: Float32s) -> float:
    return float(np.mean(gathered[:, BATCH_VARIANCE], dtype=np.float64))


class _Detail(NamedTuple):
    """What a level of k points says beyond what the cells above it predict by each of some amounts."""

    w: Float64s  # (k,), as the level says it
    error: Float64s  # (k,), its squared error expected
    predicted: Float32Rows  # (k, 2 a), w by each amount, then their squared errors expected
    cell: Int32s  # (k,)
    around: Float32Rows  # (c, 1 + a), means around each cell: the noise expected, then squared residuals by each amount
    jump: Float32s  # (k,), what squared residuals are at least

    @classmethod
    def of(
        cls, estimates: Denoised, points: Points, coarse: _Level, above: AnyFloats, finest: Neighbours | None = None
    ) -> Self:
        """Args: estimates: of the `points`. above: (c, 2 a), of the cells, as `predicted`. finest: of the points, by
        which jumps are found, where no wider surroundings count; None: none are sought."""
        cell = coarse.cells.cell
        predicted = upsample(points, cell, coarse.neighbours, coarse.points, above)
        around = np.empty((len(coarse.points), 1 + above.shape[1] // 2), np.float32)
        for block in coarse.neighbours.blocks(_BLOCK, _REACH):
            means = np.zeros((len(block.rows), SHORT), np.float32)
            _compare.on(block.neighbours.threads)(block.rows, coarse.cells, *estimates, predicted, means)
            means = block.neighbours.smooth(means, _REACH)
            around[block.of_all] = means[block.of_rows, : around.shape[1]]
        if finest is None:
            return cls(*estimates, predicted, cell, around, np.zeros(len(points), np.float32))
        # A point and its neighbours together are far beyond their noise.
        squared = np.empty(len(points), np.float32)
        _square.on(finest.threads)(estimates[0], predicted, squared)
        jump = finest.means(squared, 1.0, then=partial(_beyond_noise.for_rows, cell, around))
        return cls(*estimates, predicted, cell, around, jump)

    def at(self, point_rows: Int64s | slice) -> Self:
        """The detail at some of the points."""
        kept = {name: getattr(self, name)[point_rows] for name in ("w", "error", "predicted", "cell", "jump")}
        return self._replace(**kept)

    def shrunk(self, amounts: Float64s, threads: int, out: Float32s | None = None) -> Float32s:
        """w by each of the `amounts` (a,) of noise in residuals, and its squared errors expected: (k, 2 a).

        Args: out: what they are written to, maybe `predicted`.
        """
        out = np.empty_like(self.predicted) if out is None else out
        _shrink.on(threads)(self, amounts, out)
        return out


@each("out")
def _average(
    c: int, cells: Cells, weight: Float32s, gathered: Float32Rows, slope: float, offset: float, out: Float32Rows
) -> None:
    """Fill in `_Level.means`."""
    total = 0.0
    out[c] = 0.0
    for k in range(cells.starts[c], cells.starts[c + 1]):
        i = cells.members[k]
        share = np.float64(weight[i])
        total += share
        for column in range(COLUMNS):
            if column == BATCH_VARIANCE:
                out[c, column] += share * share * (slope * gathered[i, column] + offset)
            else:
                out[c, column] += share * gathered[i, column]
    for column in range(COLUMNS):
        out[c, column] /= total * total if column == BATCH_VARIANCE else total


@each("rows")
def _compare(
    row: int, rows: Int64s, cells: Cells, w: Float64s, error: Float64s, predicted: Float32Rows, means: Float32Rows
) -> None:
    """Fill in the first columns of `means`, over each of some cells."""
    c = rows[row]
    size = np.float32(cells.starts[c + 1] - cells.starts[c])
    for k in range(cells.starts[c], cells.starts[c + 1]):
        i = cells.members[k]
        means[row, 0] += error[i] / size
        for a in range(predicted.shape[1] // 2):
            means[row, 1 + a] += (w[i] - predicted[i, a]) ** 2 / size


@each("w")
def _square(i: int, w: Float64s, predicted: Float32Rows, squared: Float32s) -> None:
    """Write squared residuals of w from its prediction by the first amount."""
    squared[i] = (w[i] - predicted[i, 0]) ** 2


@each("cell")
def _beyond_noise(i: int, cell: Int32s, around: Float32Rows, nearby: Float32s) -> None:
    """Subtract `_JUMP` times the noise expected around each point's cell from `nearby` mean squared residuals."""
    nearby[i] -= _JUMP * around[cell[i], 0]


@each("out")
def _shrink(i: int, detail: _Detail, amounts: Float64s, out: Float32Rows) -> None:
    """Fill in `_Detail.shrunk`; one prediction serves all amounts."""
    noise = np.float64(detail.around[detail.cell[i], 0])
    for a in range(len(amounts)):
        squared = max(detail.around[detail.cell[i], 1 + a], detail.jump[i], 1e-12)
        share = min(max(1.0 - amounts[a] * noise / squared, 0.0), 1.0)
        predicted = detail.predicted[i, a]
        error = _AVERAGED * max(detail.predicted[i, len(amounts) + a], 0.0)
        residual = detail.w[i] - predicted
        unexplained = max(residual * residual - _OUTLIER * noise, 0.0)
        out[i, a] = predicted + share * residual
        out[i, len(amounts) + a] = error + share * max(noise - error, 0.0) + (1.0 - share) ** 2 * unexplained


def _pyramid(neighbours: Neighbours, points: Points) -> list[_Level]:
    """Cells of the points, cells of cells, …; joined once for the same points, unless they are many."""
    if len(points) > _MANY:
        return list(_cells_of_cells(neighbours, points))
    if neighbours not in _pyramids:
        _pyramids[neighbours] = list(_cells_of_cells(neighbours, points))
    return _pyramids[neighbours]


def _cells_of_cells(graph: Neighbours, points: Points) -> Iterator[_Level]:
    """The levels above the points, the finest first, until there are few points or cells hold little more than one."""
    weight = np.ones(len(points), np.float32)
    for _ in range(_LEVELS):
        cells = Cells.about_four(graph)
        if len(points) < _FEWEST or 2 * len(cells.centres) > len(points):
            break
        centres = cells.centres
        no_lifts = points.lifts[:0]  # no ray starts from cells
        coarse = Points(points.origins[centres], points.normals[centres], points.numbers[centres], no_lifts)
        cell_weight = np.empty(len(coarse), np.float32)
        _centre.on(graph.threads)(cells, weight, points.arrays, coarse.arrays, cell_weight)
        points, weight = coarse, cell_weight
        graph = cells.joined(graph, points.normals)
        yield _Level(graph, points, weight, cells)


@each("cell_weight")
def _centre(
    c: int, cells: Cells, weight: Float32s, points: PointArrays, coarse: PointArrays, cell_weight: Float32s
) -> None:
    """Fill in the centroids, mean normals and weights of cells; a normal that means nothing stays the centre's."""
    total = 0.0
    origin = (0.0, 0.0, 0.0)
    normal = (0.0, 0.0, 0.0)
    for k in range(cells.starts[c], cells.starts[c + 1]):
        i = cells.members[k]
        share = np.float64(weight[i])
        total += share
        origin = add(origin, scale(share, load(points.origins, i)))
        normal = add(normal, scale(share, load(points.normals, i)))
    cell_weight[c] = total
    store(coarse.origins, c, divide(origin, total))
    size = length(normal)
    if size > _CANCELLED * total:
        store(coarse.normals, c, divide(normal, size))
