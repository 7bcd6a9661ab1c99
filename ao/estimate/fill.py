"""Values of vertices inside closed parts, extrapolated from the nearest vertices that are traced."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from raytrace.types import Bools, Float64s, Int32s

from ..points.points import Points
from .one_ring import Neighbours
from .upsampling import coarsened, nearest_baked, upsample


@dataclass(frozen=True, eq=False)
class Fill:
    """How points that are not traced get values from those nearest along the surface that are.

    Attributes:
        traced: bool (k,). points: all of them. near, cell: `ao.estimate.upsampling.coarsened` of the traced ones.
    """

    traced: Bools
    points: Points
    near: Neighbours
    cell: Int32s

    @classmethod
    def of(cls, points: Points, neighbours: Neighbours, inside: Bools) -> Fill:
        """Those `inside` (k,) are not traced, unless no path of edges leads out."""
        owner = nearest_baked(neighbours, ~inside)
        alone = owner < 0
        owner[alone] = np.flatnonzero(alone)
        near, _, cell = coarsened(neighbours, owner, points.normals)
        return cls(~inside | alone, points, near, cell)

    @property
    def sources(self) -> Bools:
        """The traced points (b,) from which others are upsampled: their nearest, and the neighbours of these."""
        owning = np.zeros(len(self.near.starts) - 1, np.bool_)
        owning[self.cell[~self.traced]] = True
        sources = owning.copy()
        sources[self.near.others[np.repeat(owning, np.diff(self.near.starts))]] = True
        return sources

    def extrapolate(self, known: Float64s) -> Float64s:
        """Rows (k, c) of all points, by planes that are followed for about one edge: farther on, noise would grow.

        Args: known: (b, c), the rows of the traced points, the last column their variance.
        """
        traced, valence = np.flatnonzero(self.traced), np.diff(self.near.starts)
        places = self.points.origins.astype(np.float64)
        here = np.repeat(np.arange(len(traced)), valence)
        lengths = np.linalg.norm(places[traced[self.near.others]] - places[traced[here]], axis=1)
        edge = np.bincount(here, lengths, len(traced)) / np.maximum(valence, 1)
        owner = places[traced[self.cell]]
        away = places - owner
        distance = np.maximum(np.linalg.norm(away, axis=1), 1e-30)
        away *= np.minimum(1.0, edge[self.cell] / distance)[:, None]
        moved = replace(self.points, origins=(owner + away).astype(np.float32))
        every = np.arange(len(places))
        return upsample(moved, every, self.near, traced, self.cell, np.ascontiguousarray(known), variances=1)
