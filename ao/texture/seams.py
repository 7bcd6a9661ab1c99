"""Seams: edges of the surface that lie at two places of the page, measured by what bilinear lookups see on both sides.

They are closed by moving the texels at charts' borders, and texels next to them, as little as possible in the sense of
least squares: the lookups on both sides then agree all along the edge.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csr_array, diags_array

from raytrace.types import Bools, Float64s, Int64s

from ..least_squares.conjugate_gradients import solve_within
from ..least_squares.dual_newton import least_change

_DENSITY = 2.0  # samples a texel along an edge
_MOST = 1 << 12  # of an edge
_SAME = 1e-4  # texels that places may be apart and be one
_PULL = 1000.0  # weight of a jump's square, where that of a covered texel's movement is 1
_FREE = 0.05  # and of the movement of a texel beside the charts
_NEAR = 1e-6  # of texels to the least change, in the mean, where conjugate gradients find it


@dataclass(frozen=True, eq=False)
class Lookups:
    """Bilinear lookups on a page: `texels` int64 (s, 4), `weights` float64 (s, 4), of sum 1."""

    texels: Int64s
    weights: Float64s

    @classmethod
    def at(cls, places: Float64s, size: tuple[int, int], wraps: bool) -> Lookups:
        """Lookups at `places` (s, 2), in texels, x to the right and y down. Args: size: width and height."""
        corner = np.floor(places - 0.5).astype(np.int64)
        x, y = (places - 0.5 - corner).T
        columns = np.stack([corner[:, 0], corner[:, 0] + 1], axis=1)
        rows = np.stack([corner[:, 1], corner[:, 1] + 1], axis=1)
        if wraps:
            columns, rows = columns % size[0], rows % size[1]
        columns, rows = columns.clip(0, size[0] - 1), rows.clip(0, size[1] - 1)
        weights = np.stack([(1 - x) * (1 - y), x * (1 - y), (1 - x) * y, x * y], axis=1)
        return cls((rows[:, :, None] * size[0] + columns[:, None]).reshape(-1, 4), weights)

    def values(self, page: Float64s) -> Float64s:
        """The values (s,) of the lookups in a flat `page`."""
        return np.einsum("st,st->s", page[self.texels], self.weights)

    def nearest(self) -> Int64s:
        """The texel of largest weight, (s,)."""
        return self.texels[np.arange(len(self.texels)), self.weights.argmax(axis=1)]

    def only(self, which: Bools) -> Lookups:
        return Lookups(self.texels[which], self.weights[which])


@dataclass(frozen=True, eq=False)
class Seams:
    """Samples along all seams, as seen from the `left` and the `right`; `edges`: how many edges they are on."""

    left: Lookups
    right: Lookups
    edges: int

    @classmethod
    def find(cls, uv: Float64s, points: Int64s, size: tuple[int, int], wraps: bool) -> Seams:
        """The seams of faces.

        Args:
            uv: (m, 3, 2), in texels. points: int64 (m, 3), the welded point at each corner, −1 for none: faces share an
                edge where they share its points, so that hard edges, on which w has two values, are none.
        """
        one, other = _shared_edges(points)
        left, right = _ends(uv, points, one), _ends(uv, points, other)
        apart = left - right
        if wraps:
            apart -= np.round(apart / size) * size
        seam = (np.abs(apart) > _SAME).any(axis=(1, 2))
        left, right = left[seam], right[seam]
        lengths = np.maximum(*(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) for ends in (left, right)))
        count = 1 + np.ceil(_DENSITY * lengths).clip(1, _MOST).astype(np.int64)
        edge = np.repeat(np.arange(len(count)), count)
        along = (np.arange(len(edge)) - np.repeat(np.cumsum(count) - count, count)) / (count[edge] - 1)
        places = (ends[edge, 0] + along[:, None] * (ends[edge, 1] - ends[edge, 0]) for ends in (left, right))
        first, second = (Lookups.at(each, size, wraps) for each in places)
        return cls(first, second, len(left))

    def within(self, known: Bools) -> Seams:
        """The samples of which both lookups are among the `known` texels of the page, bool (h · w,)."""
        each = np.concatenate([self.left.texels, self.right.texels], axis=1)
        usable: Bools = np.all(known[each], axis=1)
        return replace(self, left=self.left.only(usable), right=self.right.only(usable))

    def jump(self, page: Float64s) -> float:
        """The largest difference between the two sides of a flat `page`."""
        return float(np.abs(self.left.values(page) - self.right.values(page)).max(initial=0.0))

    def close(self, page: Float64s, covered: Bools, threads: int) -> Float64s:
        """The flat `page`, changed at charts' borders so that both sides agree; values stay in [0, 1].

        Args: covered: bool (h · w,), texels that are baked; padding gives way more easily.
        """
        if not len(self.left.weights):
            return page
        each, looked_up = np.concatenate([self.left.texels, self.right.texels], axis=1), np.zeros(len(page), np.bool_)
        looked_up[each] = True
        texels, columns = np.flatnonzero(looked_up), (np.cumsum(looked_up, dtype=np.int32) - 1)[each]
        weights = np.concatenate([self.left.weights, -self.right.weights], axis=1)
        starts = np.arange(0, columns.size + 1, 8, dtype=np.int32)
        differences = csr_array((weights.ravel(), columns.ravel(), starts), shape=(len(columns), len(texels)))
        values, stay = page[texels], np.where(covered[texels], 1.0, _FREE)
        moved = least_change(differences, values, stay, _PULL)
        if moved is None:  # edges much shorter than texels or charts of one face: samples meet in all directions
            matrix = csr_array(_PULL * (differences.T @ differences) + diags_array(stay))
            moved = solve_within(matrix, stay * values, values, _NEAR, threads, mean=True)
        closed = page.copy()
        closed[texels] = moved
        return closed


def _shared_edges(points: Int64s) -> tuple[Int64s, Int64s]:
    """Pairs of face edges (e,), (e,) that are one edge of two faces; 3 f + k is face f's from its k-th corner on."""
    ahead = points[:, [1, 2, 0]]
    low, high = np.minimum(points, ahead).ravel(), np.maximum(points, ahead).ravel()
    rows = np.flatnonzero((low >= 0) & (low != high))
    key = low[rows] * (int(points.max(initial=0)) + 1) + high[rows]
    order = np.argsort(key, kind="stable")
    key, rows = key[order], rows[order]
    same = np.concatenate([[False], key[1:] == key[:-1], [False]])
    first = np.flatnonzero(same[1:-1] & ~same[:-2] & ~same[2:])  # more than two faces: no seam, or several
    return rows[first], rows[first + 1]


def _ends(uv: Float64s, points: Int64s, edges: Int64s) -> Float64s:
    """Page coordinates (e, 2, 2) of the ends of face edges, the lower point's first."""
    face, corner = np.divmod(edges, 3)
    ahead = (corner + 1) % 3
    turned = points[face, corner] > points[face, ahead]
    first, last = np.where(turned, ahead, corner), np.where(turned, corner, ahead)
    return np.stack([uv[face, first], uv[face, last]], axis=1)
