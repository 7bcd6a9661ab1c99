"""The texels that faces cover, with points and samples in them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np

from obscurance.raytrace.kernel.jit import inline
from obscurance.raytrace.system.parallel import parallel
from obscurance.raytrace.types import Bools, Float64Grid, Int32Rows, Int32s, Int64s

from ..points.smooth_surface import PointGroups
from .partial_texels import MOST
from .places import SLOTS, Places, point_in_texel
from .raster import EDGE, set_up_edges, store_barycentric
from .uv_layout import UVLayout


class PagePoints(NamedTuple):
    """The points of k texels on a page, as kernels take them: of `Coverage` and its layout."""

    texels: Int64s
    triangle: Int32Rows
    places: Places
    corners: Float64Grid
    face: Int64s
    width: int


@dataclass(frozen=True, eq=False)
class Coverage:
    """The covered texels of a page, ascending, k, with the faces at their points."""

    layout: UVLayout
    texels: Int64s  # (k,), row · width + column
    rows: Int64s  # (k,), which of the texels that were looked at
    places: Places  # of the points
    triangle: Int32s  # (k, POINTS), row of `UVLayout.corners`; −1 where a point has none, and at overlaps' centres
    overlapping: Bools  # (k,), whether several faces lie over one another
    listed: PointGroups  # samples of texels whose points will not do, on faces of `UVLayout.uv`
    all_count: Bools  # (k,), whether all listed samples are needed, however few the rays

    @classmethod
    def joined(cls, bands: Sequence[Coverage]) -> Self:
        """Coverage of several bands of a page, one after another."""
        return cls(
            layout=bands[0].layout,
            texels=np.concatenate([band.texels for band in bands]),
            rows=np.concatenate([band.rows for band in bands]),
            places=bands[0].places._replace(parts=np.concatenate([band.places.parts for band in bands])),
            triangle=np.concatenate([band.triangle for band in bands]),
            overlapping=np.concatenate([band.overlapping for band in bands]),
            listed=PointGroups.joined([band.listed for band in bands]),
            all_count=np.concatenate([band.all_count for band in bands]),
        )

    @property
    def points(self) -> PagePoints:
        """The texels' points as kernels take them."""
        layout = self.layout
        return PagePoints(self.texels, self.triangle, self.places, layout.corners, layout.face, layout.width)

    def samples(self, order: Int64s, by_centre: Bools, threads: int, most: int = MOST) -> PointGroups:
        """Samples of the texels in an `order` (j,).

        A texel that is `by_centre` (k,) has one, at its centre; others have the samples that are listed for them, or
        else their points, `most` at most.
        """
        counts = np.diff(self.listed.starts)
        counts[counts == 0] = SLOTS
        counts[by_centre] = 1
        starts = np.concatenate([[0], np.cumsum(np.minimum(counts[order], most))])
        samples = PointGroups(starts, np.empty(starts[-1], np.int32), np.empty((starts[-1], 3), np.float32))
        _write_samples.on(threads)(order, by_centre, self.points, self.listed, samples)
        return samples

    def every_sample(self, threads: int) -> PointGroups:
        """`samples` of all texels, ascending, none of them by their centre."""
        count = len(self.texels)
        return self.samples(np.arange(count), np.zeros(count, np.bool_), threads)


@inline
def locate(points, row, k, known_triangle, edges, out):
    """Write barycentric coordinates of point k of a texel, row of `PagePoints`, in its triangle; returns the triangle.

    Args: known_triangle: the triangle of which `edges` are set up already, −1 for none.
    """
    triangle = np.int64(points.triangle[row, k])
    if triangle != known_triangle:
        set_up_edges(points.corners[triangle], edges)
    texel = points.texels[row]
    x, y = point_in_texel(points.places, row, texel, k)
    store_barycentric(edges, texel % points.width + x, texel // points.width + y, out)
    return triangle


@parallel("order")
def _write_samples(
    start: int,
    stop: int,
    order: Int64s,
    by_centre: Bools,
    points: PagePoints,
    listed: PointGroups,
    samples: PointGroups,
) -> None:
    """Write samples of texels in order, as `Coverage.samples` has them."""
    edges = np.empty((3, EDGE))
    for i in range(start, stop):
        row = order[i]
        known_triangle = -1
        for k in range(samples.starts[i + 1] - samples.starts[i]):
            to = samples.starts[i] + k
            source = listed.starts[row] + k
            if by_centre[row] or source >= listed.starts[row + 1]:
                known_triangle = locate(
                    points, row, SLOTS if by_centre[row] else k, known_triangle, edges, samples.barycentric[to]
                )
                samples.face[to] = points.face[known_triangle]
                continue
            samples.face[to] = listed.face[source]
            for corner in range(3):
                samples.barycentric[to, corner] = listed.barycentric[source, corner]
