"""Seams: edges of the surface that lie at two places of the page, measured by what bilinear lookups see on both sides.

They are closed by least squares: what lookups see changes little all over the texels beside seams, and the two sides of
an edge agree, the more so the less texels vary there. A page whose texels vary much is coarse for w: a texel moved far
to close a seam would be wrong in all that it shows.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple, Self

import numpy as np
from scipy.sparse import csr_array, diags_array

from obscurance.raytrace.types import AnyFloats, Bools, Float64s, Int32s, Int64s

from ..least_squares.conjugate_gradients import solve_within
from ..least_squares.pattern import shared_edges
from ..points.smooth_surface import PointGroups
from .covered_texels import Coverage
from .uv_layout import UVLayout, doubled_areas

_DENSITY = 2.0  # samples a texel along an edge
_MOST = 1 << 12  # of an edge
_SAME = 1e-4  # texels that places may be apart and be one
_ROUGH = 0.006  # standard deviation of the texels of a lookup, at which a jump counts as a change of a lookup elsewhere
_FIRMEST = 1000.0  # times that, a jump counts at most
_FREE = 0.01  # how much the movement of a texel itself counts
_INSIDE, _LEAST = 0.1, 1e-3  # of the texels away from seams: where fewer are, jumps count less, down to a hundredth
_NEAR = 1e-5  # of texels to the minimum, in the mean


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


class Shown(NamedTuple):
    """Points that texels near seams show."""

    texels: Int64s  # (k,)
    points: PointGroups  # of each texel, on faces of `UVLayout.uv`
    share: Float64s  # (p,), what each counts: the surface that it stands for, in that of a mean texel

    @classmethod
    def near(cls, seams: Seams, coverage: Coverage, areas: Float64s, threads: int) -> Self:
        """The points in those texels of a page of which lookups may see a texel that seams do.

        Args: areas: (m,), of the faces' surface.
        """
        layout = coverage.layout
        near = np.zeros((layout.height, layout.width), np.bool_)
        near.ravel()[seams.sides.texels] = True
        for axis in (0, 1):
            near |= np.roll(near, 1, axis) | np.roll(near, -1, axis)
        rows = np.flatnonzero(near.ravel()[coverage.texels])
        by_centre = np.zeros(len(coverage.texels), np.bool_)
        points = coverage.samples(rows, by_centre, threads)
        on_page = np.abs(doubled_areas(layout.uv)) / 2
        mean = areas[on_page > 0].sum() / on_page.sum()
        counts = np.diff(points.starts)
        stretch = areas[points.face] / (mean * on_page[points.face])
        inside = 1 - len(rows) / len(coverage.texels)  # of charts: next to none where they are hardly wider than texels
        weight = np.maximum(stretch, 1.0) * max(1.0, _INSIDE / max(inside, _LEAST))
        return cls(coverage.texels[rows], points, weight / np.repeat(counts, counts))

    def lookups(self, layout: UVLayout, covered: Bools) -> tuple[Lookups, Float64s]:
        """Lookups (p,) at the points of those texels that are `covered` (h · w,), and the share (p,) of each in its
        texel."""
        counts = np.diff(self.points.starts)
        used = np.repeat(covered[self.texels], counts)
        corners = layout.uv[self.points.face[used]]
        places = np.einsum("pc,pci->pi", self.points.barycentric[used], corners)
        return Lookups.at(places, (layout.width, layout.height), layout.wraps), self.share[used]


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

    def close(self, page: Float64s, shown: Lookups, share: Float64s, threads: int) -> Float64s:
        """The flat `page` in [0, 1], changed beside seams to make both sides agree; as it is if the largest jump grew.

        Args: shown: lookups (p,) at points that texels near seams show. share: (p,), what each counts.
        """
        if not len(self.sides.texels):
            return page
        number = np.full(len(page), -1, np.int32)
        texels = np.unique(self.sides.texels)
        number[texels] = np.arange(len(texels))
        # Minimised is the change of lookups and of texels, and the squared jumps, each by its weight.
        signed = self.sides.weights * [[1], [-1]]
        jumps = _rows(self.sides.texels.reshape(-1, 8), signed.reshape(-1, 8), number)
        changes = _rows(shown.texels, shown.weights * np.sqrt(share)[:, None], number)
        stay = changes.T @ changes + diags_array(np.full(len(texels), _FREE))
        pull = diags_array(self._firmness(page))
        matrix = csr_array(stay + jumps.T @ (pull @ jumps))
        values = page[texels]
        closed = page.copy()
        closed[texels] = solve_within(matrix, stay @ values, values, _NEAR, threads, mean=True)
        return closed if self.jump(closed) <= self.jump(page) else page

    def _firmness(self, page: Float64s) -> Float64s:
        """How much the squared jump at each sample (s,) counts, by how much the texels of its lookups vary."""
        variance = page[self.sides.texels].var(axis=2).mean(axis=1)
        roughness = np.minimum(variance, np.median(variance))
        return np.asarray(_ROUGH**2 / np.maximum(roughness, _ROUGH**2 / _FIRMEST))


def _rows(texels: Int64s, weights: Float64s, number: Int32s) -> csr_array:
    """Lookups as rows of a matrix. Args: texels, weights: (p, t), of each. number: of each texel's column, −1: none."""
    columns = number[texels]
    inside = columns >= 0
    starts = np.zeros(len(texels) + 1, np.int32)
    np.cumsum(inside.sum(axis=1), out=starts[1:])
    return csr_array((weights[inside], columns[inside], starts), shape=(len(texels), int(number.max()) + 1))
