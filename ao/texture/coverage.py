"""The texels that faces cover, and points in them: rays straight down on the page through Embree, four a texel.

Every texel that a face reaches into is covered, however little of it, and all points lie on faces: nothing is ever
extrapolated over the edge of a chart, which is what dark seams come from.
"""

from collections import Counter
from dataclasses import dataclass
from itertools import combinations, pairwise
from typing import NamedTuple, Self

import numpy as np

from raytrace.bvh.bvh16 import BVH16
from raytrace.embree.scene import TriangleScene
from raytrace.sampling.sequences import hash32_array
from raytrace.system.threads import run_blocks, thread_count
from raytrace.types import Bools, Float32s, Float64s, Int32s, Int64s

from ..options import Overlap
from ..rays.ray_packet import RayPacket
from .page_rays import GRID, SLOTS, find_hits, find_layers, layer_counts, look_down
from .slivers import PageTree, find_slivers, is_crowded
from .uv_layout import UVLayout, doubled_areas

_HIGHEST = 0.5  # triangles lie at heights up to this, so that one ray can meet overlapping ones
_STEP = 2.0**-22
_ROUNDED = 1e-6  # of coordinates, in single precision
_BAND = 1 << 13  # texels that a thread covers at once
_BLOCK, _SHARE = 1 << 10, 16  # texels, and blocks at once


@dataclass(frozen=True, eq=False)
class Coverage:
    """The covered texels of a page, ascending, with points on faces, rows of `UVLayout.uv`, by barycentrics."""

    texels: Int64s  # (k,), row · width + column
    face: Int32s  # (k, SLOTS), that each point lies on
    barycentric: Float32s  # (k, SLOTS, 3)
    centre_face: Int32s  # (k,), at the centre, where faces that do not overlap cover the texel as a whole; else −1
    centre: Float32s  # (k, 3)
    overlapping: Bools  # (k,), whether several faces lie over one another
    layers: Int64s  # (k,), points of texels with faces over one another, with parts of several, or much surface; else 0
    layer_face: Int32s  # (j,), of all these points, texel by texel
    layer_barycentric: Float32s  # (j, 3)

    @classmethod
    def of_points(cls, texels: Int64s, face: Int32s, barycentric: Float32s) -> Self:
        """Coverage without centres and layers."""
        centres = np.full(len(texels), -1, np.int32), np.zeros((len(texels), 3), np.float32)
        none = np.zeros(len(texels), np.bool_), np.zeros(len(texels), np.int64)
        return cls(texels, face, barycentric, *centres, *none, np.zeros(0, np.int32), np.zeros((0, 3), np.float32))


class Page(NamedTuple):
    """Faces on a page, for rays down on it."""

    layout: UVLayout
    faces: PageTree
    scene: TriangleScene  # of the faces at heights of their own, the first on top
    step: float  # between these

    @classmethod
    def of(cls, layout: UVLayout, areas: Float64s | None = None) -> Self:
        """Args: areas: (m,), of the faces' surface, so that texels which show much of it have more points.

        Raises: EmbreeError: Embree failed, out of memory for instance.
        """
        count, crowding = len(layout.face), np.zeros(len(layout.face))
        step = min(_STEP, _HIGHEST / max(count, 1))
        heights = np.floor(np.arange(count)[::-1] * step / 2.0**-24) * 2.0**-24
        vertices = np.empty((count, 3, 3), np.float32)
        vertices[:, :, :2], vertices[:, :, 2] = layout.corners, heights[:, None]
        triangles = vertices.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3)
        if areas is not None:
            even = areas[np.unique(layout.face)].sum() / (layout.width * layout.height)
            crowding = areas[layout.face] / (even * np.abs(doubled_areas(layout.corners)) / 2)
        radius = 0.5 + _ROUNDED * (0.5 + float(np.abs(vertices).max()))
        return cls(
            layout, PageTree(layout.corners, crowding, BVH16.of(*triangles), radius), TriangleScene(*triangles), step
        )

    def cover(self, overlap: Overlap, threads: int) -> Coverage:
        """The texels that faces cover; where these overlap, points lie on all of them ("mean"), or on the first."""
        found: dict[int, Coverage] = {}

        def work(first: int, last: int) -> None:
            found[first] = _cover(self, np.arange(first, last), _REGULAR, overlap == "mean", threads)

        run_blocks(self.layout.width * self.layout.height, _BAND, work, threads)
        bands = [band for _, band in sorted(found.items())]
        columns = (np.concatenate([getattr(band, name) for band in bands]) for name in Coverage.__dataclass_fields__)
        return Coverage(*columns)

    def cover_again(self, texels: Int64s, overlap: Overlap, threads: int) -> Coverage:
        """`cover` of some `texels`, ascending, with points elsewhere in them, by chance."""
        return _cover(self, texels, _Places.by_chance(texels), overlap == "mean", threads)


class _Places(NamedTuple):
    """Where points of texels lie, for each (k,) or for all (1,)."""

    grid: Float64s  # (…, SLOTS, 2), in a texel; their mean is the centre, as is that of two of them on a diagonal
    offsets: Float64s  # (…, 2), of `find_slivers`

    @classmethod
    def by_chance(cls, texels: Int64s) -> Self:
        """Of each of the texels its own, from their numbers."""
        numbers = hash32_array(texels)[:, None] + np.arange(6, dtype=np.uint32)
        random: Float64s = hash32_array(numbers).astype(np.float64) * 2.0**-32
        first = GRID[:2] + random[:, :4].reshape(-1, 2, 2) / SLOTS - 1 / (2 * SLOTS)
        return cls(np.concatenate([first, 1 - first[:, ::-1]], axis=1), random[:, 4:])


_REGULAR = _Places(GRID[None], np.array([[0.5, 1 / 128]]))


def reaches_into_page(uv: Float64s, source: object) -> bool:
    """Whether a face of `uv` (m, 3, 2) has an area in the unit square, into which its bounds reach."""
    return len(Page.of(UVLayout.of(uv, (1, 1), False, source)).cover("first", 1).texels) > 0


def shared_texels(
    uv: Float64s, groups: Int64s, size: tuple[int, int], wraps: bool, source: object, threads: int | None = None
) -> tuple[dict[tuple[int, int], int], Int64s]:
    """In how many texels two groups of faces overlap, by pairs (a, b), a < b; and how many texels each group covers.

    Args: groups: (m,), from 0, of the faces, which do not overlap where they share an edge. Others: as `UVLayout.of`.
    """
    coverage = Page.of(UVLayout.of(uv, size, wraps, source)).cover("mean", thread_count(threads))
    count, rows = int(groups.max()) + 1, np.arange(len(coverage.texels))
    at = np.repeat(rows, coverage.layers)
    listed = groups[coverage.layer_face] + count * at
    covering = np.union1d(groups[coverage.face] + count * rows[:, None], listed) % count
    several, alike = np.divmod(np.unique(listed[coverage.overlapping[at]]), count)
    shared = Counter[tuple[int, int]]()
    for first, last in pairwise([*np.flatnonzero(np.diff(several, prepend=-1)).tolist(), len(several)]):
        shared.update(combinations(alike[first:last].tolist(), 2))
    return dict(shared), np.bincount(covering, minlength=count)


def _cover(page: Page, texels: Int64s, places: _Places, layered: bool, threads: int) -> Coverage:
    """`cover` of some texels. Args: layered: whether all faces share a texel."""
    layout, faces, scene, step = page
    shape, width = (len(texels), SLOTS), layout.width
    corner = np.stack([texels % width, texels // width], axis=1)
    triangle, barycentric = np.full(shape, -1), np.zeros((*shape, 3), np.float32)
    overlapping = np.zeros(len(texels), np.bool_)

    def work(first: int, last: int) -> None:
        block = slice(first, last)
        found, grid = (triangle[block], barycentric[block], overlapping[block]), _of(places.grid, block)
        find_hits(RayPacket.of(scene), texels[block], grid, width, step, *found)

    run_blocks(len(texels), _BLOCK, work, threads, most=_SHARE)
    hit = triangle >= 0
    crowded = is_crowded(np.append(faces.crowding, 0)[triangle].max(axis=1)) & (layered | ~overlapping)
    layers = np.zeros(len(texels), np.int64)
    shared = np.flatnonzero(overlapping & ~crowded) if layered else np.zeros(0, np.int64)
    points = scene, texels[shared], _of(places.grid, shared), width, step, threads
    layers[shared], layer_triangle, layer_place = _points_on_layers(*points)
    whole = np.flatnonzero(hit.all(axis=1) & ~overlapping)
    centre_face, centre = np.full(len(texels), -1), np.zeros((len(texels), 3), np.float32)
    centre_face[whole] = triangle[whole, 0]
    centre[whole] = barycentric[whole].sum(axis=1) / np.float32(SLOTS)
    several = whole[(triangle[whole] != triangle[whole, :1]).any(axis=1)]
    hits = look_down(scene, corner[several] + 0.5, threads)
    centre_face[several], centre[several] = hits.face, hits.barycentric
    parts = np.flatnonzero(~hit.all(axis=1) & ~overlapping | crowded)
    counts, sliver, where = find_slivers(faces, texels[parts], width, _of(places.offsets, parts), threads)
    if not layered:
        first = look_down(scene, np.einsum("kc,kcd->kd", where, layout.corners[sliver]), threads)
        there = first.face >= 0
        sliver[there], where[there] = first.face[there], first.barycentric[there]
    begins, met = np.cumsum(counts) - counts, counts > 0
    few = begins[met, None] + counts[met, None] * (2 * np.arange(SLOTS) + 1) // (2 * SLOTS)
    found = parts[met]
    triangle[found], barycentric[found] = sliver[few], where[few]
    hit[found] = True
    more = np.where(counts > SLOTS, counts, 0)
    layers[parts] += more
    rows = np.append(np.repeat(shared, layers[shared]), np.repeat(parts, more))
    listed = np.repeat(counts > SLOTS, counts)
    order = np.argsort(rows, kind="stable")
    layer_triangle = np.append(layer_triangle, sliver[listed])[order]
    layer_place = np.append(layer_place, where[listed], axis=0)[order]
    some = np.flatnonzero(hit.any(axis=1) & ~hit.all(axis=1))
    hits_first = np.argsort(~hit[some], axis=1, kind="stable")
    source = np.take_along_axis(hits_first, np.arange(SLOTS) % hit[some].sum(axis=1)[:, None], axis=1)
    for table in (triangle, barycentric):  # what the points have that met a face, in turn
        table[some] = table[some[:, None], source]
    covered = triangle[:, 0] >= 0
    number = np.append(layout.face, -1).astype(np.int32)
    face, centre_face = number[triangle[covered]], number[centre_face[covered]]
    return Coverage(
        texels[covered], face, barycentric[covered], centre_face, centre[covered], overlapping[covered],
        layers[covered], number[layer_triangle], layer_place,
    )  # fmt: skip


def _of(places: Float64s, rows: Int64s | slice) -> Float64s:
    return places[rows] if len(places) > 1 else places


def _points_on_layers(
    scene: TriangleScene, texels: Int64s, places: Float64s, width: int, step: float, threads: int
) -> tuple[Int64s, Int64s, Float32s]:
    """Of texels (k,) in which faces overlap: how many points they have (k,), and their triangles and barycentrics."""
    depths, counts = np.zeros((len(texels), SLOTS), np.int64), np.zeros(len(texels), np.int64)

    def count(first: int, last: int) -> None:
        grid = _of(places, slice(first, last))
        find_layers(RayPacket.of(scene), texels[first:last], grid, width, step, depths[first:last], None)
        layer_counts(texels[first:last], depths[first:last], counts[first:last])

    run_blocks(len(texels), _BLOCK, count, threads, most=_SHARE)
    starts = np.concatenate([[0], np.cumsum(counts)])
    triangle, place = np.empty(starts[-1], np.int64), np.empty((starts[-1], 3), np.float32)

    def find(first: int, last: int) -> None:
        points, grid = (starts[first : last + 1], triangle, place), _of(places, slice(first, last))
        find_layers(RayPacket.of(scene), texels[first:last], grid, width, step, depths[first:last], points)

    run_blocks(len(texels), _BLOCK, find, threads, most=_SHARE)
    return counts, triangle, place
