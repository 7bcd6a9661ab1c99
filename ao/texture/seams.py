"""Seams: edges of the surface that lie at two places of the page, measured by what bilinear lookups see on both sides.

They are closed by moving the texels at charts' borders, and texels next to them, as little as possible in the sense of
least squares: the lookups on both sides then agree all along the edge.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csr_array, diags_array

from raytrace.types import AnyFloats, Bools, Float64s, Int64s

from ..least_squares.conjugate_gradients import solve_within
from ..least_squares.dual_newton import least_change
from ..least_squares.pattern import shared_edges

_DENSITY = 2.0  # samples a texel along an edge
_MOST = 1 << 12  # of an edge
_SAME = 1e-4  # texels that places may be apart and be one
_PULL = 1000.0  # weight of a jump's square, where that of a covered texel's movement is 1
_FREE = 0.05  # and of the movement of a texel beside the charts
_NEAR = 1e-6  # of texels to the least change, in the mean, where conjugate gradients find it


@dataclass(frozen=True, eq=False)
class Lookups:
    """Bilinear lookups on a page: `texels` int64 (…, 4), `weights` float64 (…, 4), of sum 1."""

    texels: Int64s
    weights: Float64s

    @classmethod
    def at(cls, places: Float64s, size: tuple[int, int], wraps: bool) -> Lookups:
        """Lookups at `places` (…, 2), in texels, x to the right and y down. Args: size: width and height."""
        corner = np.floor(places - 0.5).astype(np.int64)
        x, y = np.moveaxis(places - 0.5 - corner, -1, 0)
        beside = corner[..., None, :] + [[0], [1]]
        columns, rows = np.moveaxis((beside % size if wraps else beside).clip(0, np.array(size) - 1), -1, 0)
        weights = np.stack([(1 - x) * (1 - y), x * (1 - y), (1 - x) * y, x * y], axis=-1)
        return cls((rows[..., None] * size[0] + columns[..., None, :]).reshape(weights.shape), weights)

    def values(self, page: AnyFloats) -> Float64s:
        """What the lookups see in a flat `page`."""
        return np.asarray(np.einsum("...t,...t->...", page[self.texels], self.weights))


@dataclass(frozen=True, eq=False)
class Seams:
    """Samples along all seams: `sides` (s, 2), as seen from the left and the right; how many `edges` they are on."""

    sides: Lookups
    edges: int

    @classmethod
    def find(cls, uv: Float64s, points: Int64s, size: tuple[int, int], wraps: bool) -> Seams:
        """The seams of faces of `uv` (m, 3, 2), in texels, which share edges where they share welded `points` (m, 3).

        So hard edges, on which w has two values, are no seams.
        """
        face, corner = np.divmod(shared_edges(points, int(points.max()) + 1), 3)
        turned = points[face, (corner + 1) % 3] > points[face, (corner + 2) % 3]
        end_corners = (corner[..., None] + np.where(turned[..., None], [2, 1], [1, 2])) % 3  # the lower point's first
        ends = uv[face[..., None], end_corners]  # (e, sides, ends, 2)
        apart = ends[:, 0] - ends[:, 1]
        if wraps:
            apart -= np.round(apart / size) * size
        ends = ends[(np.abs(apart) > _SAME).any(axis=(1, 2))]
        lengths = np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=2).max(axis=1)
        count = 1 + np.ceil(_DENSITY * lengths).clip(1, _MOST).astype(np.int64)
        edge = np.repeat(np.arange(len(count)), count)
        along = (np.arange(len(edge)) - np.repeat(np.cumsum(count) - count, count)) / (count[edge] - 1)
        low_end = ends[edge, :, 0]
        high_end = ends[edge, :, 1]
        return cls(Lookups.at(low_end + along[:, None, None] * (high_end - low_end), size, wraps), len(ends))

    def within(self, known: Bools) -> Seams:
        """The samples of which both lookups are among the `known` texels of the page, bool (h · w,)."""
        usable = known[self.sides.texels].all(axis=(1, 2))
        return replace(self, sides=Lookups(self.sides.texels[usable], self.sides.weights[usable]))

    def jump(self, page: AnyFloats) -> float:
        """The largest difference between the two sides of a flat `page`."""
        left, right = self.sides.values(page).T
        return float(np.abs(left - right).max(initial=0.0))

    def close(self, page: Float64s, covered: Bools, threads: int) -> Float64s:
        """The flat `page`, in [0, 1], changed at charts' borders so that both sides agree, most where not `covered`."""
        sample_texels = self.sides.texels.reshape(-1, 8)
        looked_up = np.zeros(len(page), np.bool_)
        if not len(sample_texels):
            return page
        looked_up[sample_texels] = True
        texels = np.flatnonzero(looked_up)
        columns = (np.cumsum(looked_up, dtype=np.int32) - 1)[sample_texels]
        weights = self.sides.weights * [[1], [-1]]
        starts = np.arange(0, columns.size + 1, 8, dtype=np.int32)
        differences = csr_array((weights.ravel(), columns.ravel(), starts), shape=(len(columns), len(texels)))
        values = page[texels]
        stay = np.where(covered[texels], 1.0, _FREE)
        moved = least_change(differences, values, stay, _PULL)
        if moved is None:  # edges much shorter than texels or charts of one face: samples meet in all directions
            matrix = csr_array(_PULL * (differences.T @ differences) + diags_array(stay))
            moved = solve_within(matrix, stay * values, values, _NEAR, threads, mean=True)
        closed = page.copy()
        closed[texels] = moved
        return closed
