"""The texels to bake and their samples: one at the centre where that can stand for all of it, several elsewhere."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from obscurance.raytrace.mesh.mesh import Mesh
from obscurance.raytrace.mesh.morton import morton_order
from obscurance.raytrace.types import Bools, Float32s, Float64s, Int32s, Int64s, UInt8s

from ..estimate.inside import OutsideSampler
from ..estimate.sites import CUT_BY_SOLIDS, ONE_PLACE, PREDICTED, SEVERAL_PLACES
from ..options import TextureOptions
from ..points.points import Points
from ..points.projection import FineMesh, Groups
from ..points.smooth_surface import PointGroups, SmoothSurface, SurfacePoints
from ..points.surface_samples import SurfaceSamples
from ..prepared import Prepared
from .coverage import Page
from .covered_texels import Coverage
from .smooth_texels import smooth_cells
from .uv_surface import UVSurface

_RAYS, _NOISE = 256, 0.004  # rays of a texel, and about how much they err by
_LARGEST = 4  # side of the largest blocks of texels that one stands for
_BENT = 0.2  # by how much normals may differ within a texel: one sample and several then differ by a third of the noise


@dataclass(frozen=True, eq=False)
class Texels:
    """The texels to bake, along a curve that keeps neighbours together, each with one sample or several; then those
    that are predicted between them."""

    texels: Int64s  # (k,), row · width + column
    samples: SurfaceSamples  # of the b to bake
    cut: Bools  # (b,), by solids that hold some of their places
    cell: Int64s  # (k,), the row of the baked texel that stands for each
    points: Points  # k, where they lie
    page_face: Int32s  # (k,), the face on the page at each texel's first sample
    page_barycentric: Float32s  # (k, 3), where on it
    all_inside: bool  # and so left as they are: of a room whose walls face outwards, for instance

    def __len__(self) -> int:
        return len(self.texels)

    @property
    def kinds(self) -> UInt8s:
        """The kinds (k,) of `Sites`."""
        kinds = np.full(len(self), PREDICTED, np.uint8)
        several = np.where(self.cut, CUT_BY_SOLIDS, SEVERAL_PLACES)
        kinds[: len(self.samples)] = np.where(self.samples.counts == 1, ONE_PLACE, several)
        return kinds

    @property
    def stands_for(self) -> Int64s | None:
        """The row (k,) of the texel from which each is predicted; None where all are to bake."""
        return self.cell if len(self) > len(self.samples) else None


@dataclass(frozen=True, eq=False)
class Cage:
    """The reach, and the groups, by which a page's surface is projected onto a fine mesh."""

    reach: float | Mesh  # of `cage_of`
    groups: Groups | None  # of both meshes' vertices


@dataclass(frozen=True, eq=False)
class TexelSampler:
    """Makes the samples of texels: on faces, moved onto a fine mesh if there is a cage, and outside of solids."""

    page: Page
    surface: UVSurface
    prepared: Prepared  # of what is baked
    options: TextureOptions
    cage: Cage | None

    def find(self, coverage: Coverage) -> tuple[Texels, int, int]:
        """The texels of the page; how many are left out, whose samples are all inside of solids; how many samples the
        cage misses."""
        threads, smooth = self.prepared.threads, self.surface.smooth
        by_centre, cell = self._cells(coverage)
        # The texels to bake, those that stand for themselves, along a curve on the surface.
        order = np.flatnonzero(cell == np.arange(len(cell)))
        single = coverage.samples(order, by_centre, threads, most=1)
        order = order[morton_order(smooth.positions_at(single.face, single.barycentric, threads))]
        samples, missed = self._place(coverage, order, by_centre)
        samples, cut, hidden = self._outside.settle(coverage.texels[order], samples, self.prepared.key)
        all_inside = bool(hidden.all())
        if hidden.any() and not all_inside:
            seen = np.flatnonzero(~hidden)
            order, cut, samples = order[seen], cut[seen], samples.only(seen)
        # The others are predicted from these: their cells' rows, and one point of each.
        baked = np.full(len(cell), -1)
        baked[order] = np.arange(len(order))
        baked_cell = baked[cell]
        predicted = np.flatnonzero((baked_cell >= 0) & (baked < 0))
        coverage_rows = np.append(order, predicted)
        single = coverage.samples(coverage_rows, by_centre, threads, most=1)
        between = slice(len(order), None)
        located = smooth.points_at(single.face[between], single.barycentric[between], threads)
        points = samples.first_points.followed_by(Points.lifted(located.positions, located.positions, located.axes))
        shown = single.face, single.barycentric
        found = coverage.texels[coverage_rows]
        texels = Texels(found, samples, cut, baked_cell[coverage_rows], points, *shown, all_inside)
        return texels, len(by_centre) - len(texels), missed

    def elsewhere(self, texels: Texels, rows: Int64s, parts: Int64s, key: np.uint32) -> SurfaceSamples:
        """Samples of the texels `rows` (n,), by `parts` (n,) 0, 1, … of a sequence that is even over each and shifted
        by a key; where all of these are in solids, the texel's own, or those of what stands for it."""
        hidden = np.full(len(rows), texels.all_inside)
        cut = texels.kinds[rows] == CUT_BY_SOLIDS
        samples, moved = self._outside.elsewhere(texels.texels[rows], parts, key, cut, hidden)
        unmoved = np.setdiff1d(np.arange(len(rows)), moved)
        if not len(unmoved):
            return samples
        together = samples.followed_by(texels.samples.only(texels.cell[rows[unmoved]]))
        return together.only(np.argsort(np.append(moved, unmoved)))

    @property
    def _outside(self) -> OutsideSampler:
        return OutsideSampler(self._draw, self.prepared.inside, self.prepared.near_solids)

    def _draw(self, texels: Int64s, parts: Int64s, key: np.uint32) -> tuple[SurfaceSamples, Int64s]:
        """Samples of some `texels` (n,) of the page, by parts (n,) and a key; and which of them have any, ascending."""
        order = np.argsort(texels, kind="stable")
        coverage = self.page.cover(self.options.overlap, self.prepared.threads, texels[order], parts[order], key)
        of = order[coverage.rows]
        order = np.argsort(of)
        samples, _ = self._place(coverage, order, np.zeros(len(coverage.texels), np.bool_), required=False)
        return samples, of[order]

    def _cells(self, coverage: Coverage) -> tuple[Bools, Int64s]:
        """The texels (k,) with one sample, at their centre, and the row (k,) of the texel that stands for each."""
        options, receivers = self.prepared.options, self.prepared.receivers
        if self.cage:
            return np.zeros(len(coverage.texels), np.bool_), np.arange(len(coverage.texels))
        noise = options.tolerance or _NOISE * (_RAYS / options.rays) ** 0.75
        most_bent = _BENT * min(noise / _NOISE, 1.0)  # so that noise is more than what a texel's only sample misses
        largest = _LARGEST if options.tolerance and options.denoise and not receivers.opacity else 1
        tangent = min(float(np.tan(np.radians(options.spread / 2))), 1.0)
        smooth, threads = self.surface.smooth, self.prepared.threads
        return smooth_cells(coverage, smooth, receivers.hierarchy.tree, most_bent, tangent, largest, threads)

    def _place(
        self, coverage: Coverage, order: Int64s, by_centre: Bools, required: bool = True
    ) -> tuple[SurfaceSamples, int]:
        """Samples of texels in an `order`, and how many samples the cage misses.

        Args: by_centre: texels with one sample. required: see `FineMesh.project`.
        """
        receivers, threads = self.prepared.receivers, self.prepared.threads
        on_faces = coverage.samples(order, by_centre, threads)
        smooth, missed = self.surface.smooth, np.zeros(0, np.int64)
        if self.cage:
            projected, missed = self._project(on_faces, self.cage, required)
            on_faces = PointGroups(on_faces.starts, *projected)
            smooth = SmoothSurface.of(self.prepared.placement.vertices.astype(np.float64), receivers)
        all_count = coverage.all_count[order]
        return SurfaceSamples.place(on_faces, all_count, smooth, receivers, threads), len(missed)

    def _project(self, on_page: PointGroups, cage: Cage, required: bool) -> tuple[SurfacePoints, Int64s]:
        """Points of the page's surface on the fine mesh, and which of them the cage misses."""
        prepared, surface = self.prepared, self.surface
        located = surface.smooth.points_at(on_page.face, on_page.barycentric, prepared.threads)
        corners = surface.receivers.faces[on_page.face]
        reach: float | Float64s = (
            cage.reach
            if isinstance(cage.reach, float)
            else np.einsum("kc,kci->ki", on_page.barycentric, cage.reach.vertices[corners])
        )
        groups = cage.groups and (np.asarray(cage.groups[0])[corners[:, 0]], cage.groups[1])
        fine = FineMesh(
            prepared.mesh.source, prepared.placement, prepared.receivers, prepared.threads, prepared.progress
        )
        return fine.project(located.positions, located.axes, reach, groups, required)
