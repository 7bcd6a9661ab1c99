"""The texels that faces cover, and samples in them, by scan conversion and exact clipping.

Every texel that a face reaches into is covered, however little of it, and all samples lie on faces: nothing is ever
extrapolated over the edge of a chart, which is what dark seams come from.
"""

from collections import Counter
from collections.abc import Iterator
from itertools import combinations, pairwise
from typing import NamedTuple, Self

import numpy as np

from obscurance.raytrace.system.threads import run_blocks, thread_count
from obscurance.raytrace.types import Float64s, Int32s, Int64s

from ..options import Overlap
from ..points.smooth_surface import PointGroups, SurfacePoints
from .covered_texels import Coverage
from .partial_texels import LAYERS, MOST, NOT_SOUGHT, PartialTexels, find_partial, sample_partial
from .places import SLOTS, Places
from .raster import Lists, Marks, count_bands, list_bands, scan_convert
from .uv_layout import UVLayout, doubled_areas

_BAND = 1 << 14  # texels that are scanned at once, about
_BANDS = 64  # of a page, at least, so that all threads have some
_LISTED, _SAMPLED = 1 << 20, 1 << 12  # triangles in lists, and texels, at once


class Page(NamedTuple):
    """Faces on a page, and the triangles listed for each band of its rows."""

    layout: UVLayout
    crowding: (
        Float64s  # (t,), how many texels of an even layout show as much of the surface as a texel of each triangle
    )
    chart: Int32s  # (t,), the number of each triangle's chart
    band_rows: int  # rows of the page in each band
    starts: Int64s  # (b + 1,), of each band in `listed`
    listed: Int64s  # triangles, ascending, of band after band

    @classmethod
    def of(cls, layout: UVLayout, areas: Float64s | None = None, charts: Int64s | None = None) -> Self:
        """List the triangles of a layout by the bands of rows that they reach into.

        Args:
            areas: (m,), of the faces' surface, so that texels which show much of it have more samples.
            charts: (m,), of the faces, so that what two of them show in a texel is measured.
        """
        crowding = np.zeros(len(layout.face))
        if areas is not None:
            even = areas[np.unique(layout.face)].sum() / (layout.width * layout.height)
            evenly = even * np.abs(doubled_areas(layout.corners)) / 2
            np.divide(areas[layout.face], evenly, out=crowding, where=evenly > 0)
        band_rows = max(min(_BAND // layout.width, layout.height // _BANDS), 1)
        counts = np.zeros(-(-layout.height // band_rows), np.int64)
        count_bands(layout.corners, layout.height, band_rows, counts)
        starts = np.concatenate([[0], np.cumsum(counts)])
        listed = np.empty(starts[-1], np.int64)
        list_bands(layout.corners, layout.height, band_rows, starts[:-1].copy(), listed)
        chart = np.zeros(len(layout.face), np.int32) if charts is None else charts[layout.face].astype(np.int32)
        return cls(layout, crowding, chart, band_rows, starts, listed)

    def cover(
        self,
        overlap: Overlap,
        threads: int,
        texels: Int64s | None = None,
        parts: Int64s | None = None,
        key: np.uint32 = np.uint32(0),
    ) -> Coverage:
        """The texels that faces cover, found band by band.

        Args:
            overlap: where faces overlap, samples lie on all ("mean") or on the first of them.
            texels: (n,), ascending, only these, some of them more than once; None: all.
            parts, key: (n,), of `Places`, where points lie in each of these; None: the first part.
        """
        size = self.band_rows * self.layout.width
        bands: dict[int, Coverage] = {}

        def work(start: int, stop: int) -> None:
            triangles = self.listed[self.starts[start // size] : self.starts[start // size + 1]]
            if texels is None:
                rows = band_texels = np.arange(start, stop)
            else:
                rows = np.arange(np.searchsorted(texels, start), np.searchsorted(texels, stop))
                band_texels = texels[rows]
            places = Places(np.zeros(0, np.int64) if parts is None else parts[rows], int(key))
            if len(band_texels) or start == 0:
                bands[start] = _Band(self, band_texels, rows, triangles, places, overlap == "mean").cover()

        run_blocks(self.layout.height * self.layout.width, size, work, threads)
        return Coverage.joined([band for _, band in sorted(bands.items())])


class _Band(NamedTuple):
    """A band of a page's texels, covered on one thread: its texels, the triangles that reach into it, where points
    lie in texels."""

    page: Page
    texels: Int64s  # (n,), ascending
    rows: Int64s  # (n,), of `Coverage`
    triangles: Int64s  # that may reach into the texels
    places: Places  # for each texel, or for all
    layered: bool  # whether all faces share a texel

    def cover(self) -> Coverage:
        """The coverage of the band: texels that have a triangle at one of their points or samples in parts of
        triangles."""
        layout, count = self.page.layout, len(self.texels)
        # Triangles at the texels' points, and texels whose samples are sought in parts of triangles.
        marks = Marks.of(count)
        how = np.empty(count, np.int64)
        triangles = layout.corners, self.page.chart
        scan_convert(self.triangles, triangles, self.texels, layout.width, self.places, marks, None)
        find_partial(marks, self.page.crowding, self.layered, how)
        partial = np.flatnonzero(how != NOT_SOUGHT)
        counts, listed = self._sample(partial, how[partial], marks.reaching)
        listed_of = np.zeros(count, np.int64)
        listed_of[partial] = counts
        # The texels with any.
        all_count = (how == LAYERS) | (listed_of > SLOTS)
        covered = np.flatnonzero((marks.triangle[:, 0] >= 0) | (listed_of > 0))
        starts = np.concatenate([[0], np.cumsum(listed_of[covered])])
        return Coverage(
            layout=layout,
            texels=self.texels[covered],
            rows=self.rows[covered],
            places=self.places.of(covered),
            triangle=marks.triangle[covered],
            overlapping=marks.overlapping[covered],
            listed=PointGroups(starts, *listed),
            all_count=all_count[covered],
        )

    def _sample(self, partial: Int64s, how: Int64s, reaching: Int32s) -> tuple[Int64s, SurfacePoints]:
        """How many samples each of the texels in rows `partial` (h,) has, and the samples."""
        layout = self.page.layout
        counts = np.zeros(len(partial), np.int64)
        samples = [SurfacePoints(np.zeros(0, np.int32), np.zeros((0, 3), np.float32))]
        for start, stop in _portions(reaching[partial]):
            texel_rows = partial[start:stop]
            texels = self.texels[texel_rows]
            lists = self._lists(texels, reaching[texel_rows])
            sought = PartialTexels(texels, how[start:stop], self.places.of(texel_rows))
            triangle = np.empty((len(texels), MOST), np.int32)
            barycentric = np.empty((len(texels), MOST, 3), np.float32)
            triangles = layout.corners, self.page.crowding
            out = counts[start:stop], triangle, barycentric
            sample_partial(triangles, layout.width, self.layered, sought, lists, out)
            there = np.arange(MOST) < counts[start:stop, None]
            samples.append(SurfacePoints(layout.face[triangle[there]].astype(np.int32), barycentric[there]))
        return counts, SurfacePoints(*map(np.concatenate, zip(*samples, strict=True)))

    def _lists(self, texels: Int64s, reaching: Int32s) -> Lists:
        """The triangles that reach into `texels`, ascending. Args: reaching: how many reach into each texel."""
        starts = np.concatenate([[0], np.cumsum(reaching, dtype=np.int64)])
        lists = Lists(starts, np.zeros(len(texels), np.int64), np.empty(starts[-1], np.int32))
        layout = self.page.layout
        triangles = layout.corners, self.page.chart
        scan_convert(self.triangles, triangles, texels, layout.width, self.places, None, lists)
        return lists


def _portions(reaching: Int32s) -> Iterator[tuple[int, int]]:
    """Parts [first, last) of texels whose lists of triangles, `reaching` (h,) long, are made at once."""
    total = np.cumsum(reaching, dtype=np.int64)
    start = 0
    while start < len(total):
        listed = total[start - 1] if start else 0
        stop = int(np.searchsorted(total, listed + _LISTED, "right"))
        stop = min(max(stop, start + 1), start + _SAMPLED)
        yield start, stop
        start = stop


def reaches_into_page(uv: Float64s, source: object) -> bool:
    """Whether a face of `uv` (m, 3, 2) has an area in the unit square, into which its bounds reach."""
    return len(Page.of(UVLayout.of(uv, (1, 1), False, source)).cover("first", 1).texels) > 0


def shared_texels(
    layout: UVLayout, groups: Int64s, threads: int | None = None, texels: Int64s | None = None
) -> tuple[dict[tuple[int, int], int], Int64s]:
    """In how many texels two groups of faces overlap, by pairs (a, b), a < b; and how many texels each group covers.

    Args:
        groups: (m,), from 0, of the faces, which do not overlap where they share an edge.
        texels: (n,), ascending, only these; None: all.
    """
    coverage = Page.of(layout).cover("mean", thread_count(threads), texels)
    samples = coverage.every_sample(thread_count(threads))
    count = int(groups.max()) + 1
    texel = np.repeat(np.arange(len(coverage.texels)), np.diff(samples.starts))
    texel, group = np.divmod(np.unique(groups[samples.face] + count * texel), count)
    overlapping = coverage.overlapping[texel]
    overlap = texel[overlapping]
    alike = group[overlapping].tolist()
    shared = Counter[tuple[int, int]]()
    for start, stop in pairwise([*np.flatnonzero(np.diff(overlap, prepend=-1)).tolist(), len(overlap)]):
        shared.update(combinations(alike[start:stop], 2))
    return dict(shared), np.bincount(group, minlength=count)
