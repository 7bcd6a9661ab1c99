"""The texels that faces cover, with points and samples in them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np

from obscurance.raytrace.kernel.jit import inline
from obscurance.raytrace.sampling import hash32_array
from obscurance.raytrace.system.parallel import parallel
from obscurance.raytrace.types import Bools, Float64Grid, Float64s, Int32Rows, Int32s, Int64s

from ..points.smooth_surface import PointGroups
from .partial_texels import MOST
from .raster import EDGE, GRID, POINTS, SLOTS, set_up_edges, store_barycentric
from .uv_layout import UVLayout


class Places(NamedTuple):
    """Where points of texels lie, for each (k, …) or for all (1, …)."""

    points: Float64s  # (…, POINTS, 2); two and two have the centre for their mean; the last is the centre
    offsets: Float64s  # (…, 2), see `PartialTexels`

    @classmethod
    def by_chance(cls, texels: Int64s, key: np.uint32) -> Self:
        """Random places, of each texel its own, by the texel's number and a key."""
        numbers = hash32_array(hash32_array(texels) ^ key)[:, None] + np.arange(6, dtype=np.uint32)
        random: Float64s = hash32_array(numbers).astype(np.float64) * 2.0**-32
        points = np.full((len(texels), POINTS, 2), 0.5)
        points[:, 0:SLOTS:2] = GRID[0:SLOTS:2] + random[:, :4].reshape(-1, 2, 2) / SLOTS - 1 / (2 * SLOTS)
        points[:, 1:SLOTS:2] = 1 - points[:, 0:SLOTS:2]
        return cls(points, random[:, 4:])

    def of(self, texels: Int64s) -> Self:
        """The places in some `texels`, rows."""
        return self if self is REGULAR else type(self)(self.points[texels], self.offsets[texels])


REGULAR = Places(np.append(GRID, [[0.5, 0.5]], axis=0)[None], np.array([[0.5, 1 / 128]]))


class PagePoints(NamedTuple):
    """The points of k texels on a page, as kernels take them: of `Coverage` and its layout."""

    texels: Int64s
    triangle: Int32Rows
    points: Float64Grid
    corners: Float64Grid
    face: Int64s
    width: int


@dataclass(frozen=True, eq=False)
class Coverage:
    """The covered texels of a page, ascending, k, with the faces at their points."""

    layout: UVLayout
    texels: Int64s  # (k,), row · width + column
    places: Places  # of the points
    triangle: Int32s  # (k, POINTS), row of `UVLayout.corners`; −1 where a point has none, and at overlaps' centres
    overlapping: Bools  # (k,), whether several faces lie over one another
    listed: PointGroups  # samples of texels whose points will not do, on faces of `UVLayout.uv`
    all_count: Bools  # (k,), whether all listed samples are needed, however few the rays

    @classmethod
    def joined(cls, bands: Sequence[Coverage]) -> Self:
        """Coverage of several bands of a page, one after another."""
        places = REGULAR
        if bands[0].places is not REGULAR:
            points = np.concatenate([band.places.points for band in bands])
            places = Places(points, np.concatenate([band.places.offsets for band in bands]))
        return cls(
            layout=bands[0].layout,
            texels=np.concatenate([band.texels for band in bands]),
            places=places,
            triangle=np.concatenate([band.triangle for band in bands]),
            overlapping=np.concatenate([band.overlapping for band in bands]),
            listed=PointGroups.joined([band.listed for band in bands]),
            all_count=np.concatenate([band.all_count for band in bands]),
        )

    @property
    def points(self) -> PagePoints:
        """The texels' points as kernels take them."""
        layout = self.layout
        return PagePoints(self.texels, self.triangle, self.places.points, layout.corners, layout.face, layout.width)

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
    at = points.points[row if len(points.points) > 1 else 0, k]
    x = points.texels[row] % points.width + at[0]
    y = points.texels[row] // points.width + at[1]
    store_barycentric(edges, x, y, out)
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
