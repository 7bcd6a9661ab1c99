"""Values of vertices inside closed parts, extrapolated from the nearest vertices that are traced."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from raytrace.types import Bools, Float64s, Int32s

from ..points.points import Points
from .one_ring import Neighbours
from .upsampling import coarsened, nearest_baked, upsample


@dataclass(frozen=True, eq=False)
class Extrapolation:
    """Extrapolates the values of points that are not traced from the traced points nearest along the surface.

    Attributes:
        traced: bool (k,). points: all points. graph, cell: `ao.estimate.upsampling.coarsened` of the traced points.
    """

    traced: Bools
    points: Points
    graph: Neighbours
    cell: Int32s

    @classmethod
    def of(cls, points: Points, neighbours: Neighbours, inside: Bools) -> Extrapolation:
        """Points `inside` (k,) are not traced, unless no path of edges leads out."""
        nearest = nearest_baked(neighbours, ~inside)
        alone = nearest < 0
        nearest[alone] = np.flatnonzero(alone)
        graph, _, cell = coarsened(neighbours, nearest, points.normals)
        return cls(~inside | alone, points, graph, cell)

    @property
    def sources(self) -> Bools:
        """The traced points (b,) that values are extrapolated from: the nearest ones, and their neighbours."""
        nearest = np.zeros(len(self.graph.starts) - 1, np.bool_)
        nearest[self.cell[~self.traced]] = True
        sources = nearest.copy()
        sources[self.graph.indices[np.repeat(nearest, np.diff(self.graph.starts))]] = True
        return sources

    def extrapolate(self, known: Float64s) -> Float64s:
        """Rows (k, c) of all points, by planes that are extrapolated one edge at most: farther on, noise would grow.

        Args: known: (b, c), the rows of the traced points, the last column their variance.
        """
        traced, filled = np.flatnonzero(self.traced), np.flatnonzero(~self.traced)
        positions, valence = self.points.origins.astype(np.float64), np.diff(self.graph.starts)
        cell, needed = self.cell[filled], np.zeros(len(traced), np.bool_)
        needed[cell] = True
        here, ends = np.repeat(np.flatnonzero(needed), valence[needed]), self.graph.indices[np.repeat(needed, valence)]
        lengths = np.linalg.norm(positions[traced[ends]] - positions[traced[here]], axis=1)
        edge = np.bincount(here, lengths, len(traced)) / np.maximum(valence, 1)
        nearest = positions[traced[cell]]
        away = positions[filled] - nearest
        distance = np.maximum(np.linalg.norm(away, axis=1), 1e-30)
        away *= np.minimum(1.0, edge[cell] / distance)[:, None]
        moved = replace(self.points, origins=self.points.origins.copy())
        moved.origins[filled] = nearest + away
        rows, known = np.empty((len(positions), known.shape[1])), np.ascontiguousarray(known)
        rows[traced], rows[filled] = known, upsample(moved, filled, self.graph, traced, self.cell, known, variances=1)
        return rows
