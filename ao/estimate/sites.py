"""Sites: whatever gets one value, a vertex, a folded vertex, a texel, a face, a point of a cloud."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from obscurance.raytrace.types import Bools, Float64s, Int64s, UInt8s

from ..points.points import Points
from .cells import Cells
from .one_ring import Neighbours
from .upsampling import upsample

KINDS = 5
ONE_PLACE, SEVERAL_PLACES, CUT_BY_SOLIDS, FOLDED, PREDICTED = range(KINDS)  # of sites, by how their errors come about
_UNEXPLAINED = 0.06  # part of the squared distance from a neighbours' mean that typical predictions leave


@dataclass(frozen=True, eq=False)
class Sites:
    """The k sites that get a value each, along a curve that keeps neighbours together.

    Attributes:
        points: (k,), where they are, one point of each. find_neighbours: finds `neighbours`, when they are asked for.
        kinds: uint8 (k,). Those that are `FOLDED` are the last; some places of those `CUT_BY_SOLIDS` are inside.
        cell: int64 (k,), the traced site from which each is predicted, itself if it is traced; None: all are traced.
    """

    points: Points
    find_neighbours: Callable[[], Neighbours]
    kinds: UInt8s
    cell: Int64s | None = None

    @property
    def have_places(self) -> Bools:
        """Which sites (k,) have several places, across which edges run that neighbours know nothing of."""
        return np.isin(self.kinds, (SEVERAL_PLACES, CUT_BY_SOLIDS))

    @classmethod
    def alike(cls, points: Points, find_neighbours: Callable[[], Neighbours], kind: int) -> Sites:
        """Sites of one kind."""
        return cls(points, find_neighbours, np.full(len(points), kind, np.uint8))

    def __len__(self) -> int:
        return len(self.points)

    def only(self, rows: Int64s) -> Sites:
        """Some of the sites, ascending, all traced."""
        neighbours = self.neighbours.among(rows)
        return Sites(self.points[rows], lambda: neighbours, self.kinds[rows])

    @cached_property
    def neighbours(self) -> Neighbours:
        """Of all of the sites."""
        return self.find_neighbours()

    @cached_property
    def _cells(self) -> Cells:
        assert self.cell is not None
        return Cells.of(self.cell)

    @property
    def traced(self) -> Int64s | slice:
        """The rows of the b sites that are traced, ascending."""
        return slice(None) if self.cell is None else self._cells.centres

    @property
    def counts(self) -> Float64s:
        """How many sites each traced one (b,) stands for."""
        return np.broadcast_to(1.0, len(self)) if self.cell is None else np.diff(self._cells.starts).astype(np.float64)

    def traced_of(self, rows: Int64s) -> Int64s:
        """Which of the traced sites each of some `rows` (j,) is or is predicted from."""
        return rows if self.cell is None else self._cells.cell[rows].astype(np.int64)

    def is_traced(self, rows: Int64s) -> Bools:
        """Whether sites of some `rows` (j,) are traced."""
        return np.ones(len(rows), np.bool_) if self.cell is None else self.cell[rows] == rows

    @cached_property
    def traced_points(self) -> Points:
        """The points of the traced sites."""
        return self.points if self.cell is None else self.points[self._cells.centres]

    @cached_property
    def graph(self) -> Neighbours:
        """The neighbours of the traced sites, over which they are denoised: folded ones have none."""
        if self.cell is not None:
            return self._cells.joined(self.neighbours, self.traced_points.normals)
        folded = int(np.count_nonzero(self.kinds == FOLDED))
        if not folded:
            return self.neighbours
        others = self.neighbours.among(np.arange(len(self) - folded))
        return replace(others, starts=np.append(others.starts, np.full(folded, others.starts[-1])))

    def values_at(self, rows: Int64s, values: Float64s) -> Float64s:
        """Values (j, c) at sites of some `rows` (j,) from `values` (b, c) of the traced ones."""
        at_rows: Float64s = values[self.traced_of(rows)]
        predicted = np.flatnonzero(~self.is_traced(rows))
        if len(predicted):
            some = rows[predicted]
            cell = self.traced_of(some).astype(np.int32)
            at_rows[predicted] = upsample(self.points[some], cell, self.graph, self.traced_points, values)
        return at_rows

    def errors_at_all(self, error: Float64s, w: Float64s) -> Float64s:
        """Squared errors (k,) expected from those of the traced sites (b,), whose values are `w` (b,)."""
        if self.cell is None:
            return error
        unlike = np.nan_to_num(w - self.graph.means(w.astype(np.float32), 0.0)) ** 2
        own = self._cells.cell
        return error[own] + np.where(self.kinds == PREDICTED, _UNEXPLAINED * unlike[own], 0.0)

    def broken(self, rows: Int64s) -> tuple[Sites, Int64s]:
        """The sites with all those traced that are predicted from what predicts some `rows`; and which these are."""
        assert self.cell is not None
        predicts = np.zeros(len(self), np.bool_)
        predicts[self.cell[rows]] = True
        freed = np.flatnonzero(predicts[self.cell] & (self.kinds == PREDICTED))
        kinds, cell = self.kinds.copy(), self.cell.copy()
        kinds[freed], cell[freed] = SEVERAL_PLACES, freed
        neighbours = self.neighbours
        return replace(self, find_neighbours=lambda: neighbours, kinds=kinds, cell=cell), freed
