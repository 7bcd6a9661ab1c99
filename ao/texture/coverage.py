"""The texels that faces cover, and points in them: rays straight down on the page through Embree, four a texel.

Every texel that a face reaches into is covered, however little of it, and all points lie on faces: nothing is ever
extrapolated over the edge of a chart, which is what dark seams come from.
"""

from collections import Counter
from dataclasses import dataclass
from itertools import combinations, pairwise
from typing import Self

import numpy as np

from raytrace.bvh.bvh16 import BVH16
from raytrace.embree.scene import TriangleScene
from raytrace.system.threads import run_blocks, thread_count
from raytrace.types import Bools, Float32s, Float64s, Int32s, Int64s

from ..options import Overlap
from ..rays.ray_packet import RayPacket
from .page_rays import SLOTS, find_hits, find_layers, layer_counts, look_down
from .slivers import PageTree, find_slivers
from .uv_layout import UVLayout

_FINE = 8  # points across and down of texels that are not whole
_WITHIN = np.array([0.125, 0.625, 0.375, 0.875])  # where to take one from each quarter of them
_FINE_TEXELS = 1 << 14  # together
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
    layers: Int64s  # (k,), points on faces over one another, which share the texel; 0 elsewhere
    layer_face: Int32s  # (j,), of all these points, texel by texel
    layer_barycentric: Float32s  # (j, 3)

    @classmethod
    def of_points(cls, texels: Int64s, face: Int32s, barycentric: Float32s) -> Self:
        """Coverage without centres and layers."""
        centres = np.full(len(texels), -1, np.int32), np.zeros((len(texels), 3), np.float32)
        none = np.zeros(len(texels), np.bool_), np.zeros(len(texels), np.int64)
        return cls(texels, face, barycentric, *centres, *none, np.zeros(0, np.int32), np.zeros((0, 3), np.float32))


def cover(layout: UVLayout, overlap: Overlap, threads: int) -> Coverage:
    """The texels that faces cover; where these overlap, points lie on all of them ("mean"), or on the first.

    Raises: EmbreeError: Embree failed, out of memory for instance.
    """
    count = len(layout.face)
    step = min(_STEP, _HIGHEST / max(count, 1))
    heights = np.floor(np.arange(count)[::-1] * step / 2.0**-24) * 2.0**-24  # the first face on top
    vertices = np.empty((count, 3, 3), np.float32)
    vertices[:, :, :2], vertices[:, :, 2] = layout.corners, heights[:, None]
    triangles = vertices.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3)
    scene, radius = TriangleScene(*triangles), 0.5 + _ROUNDED * (0.5 + float(np.abs(vertices).max()))
    slivers = layout.corners, BVH16.of(*triangles), radius
    found: dict[int, Coverage] = {}

    def work(first: int, last: int) -> None:
        found[first] = _cover_band(layout, scene, slivers, np.arange(first, last), overlap == "mean", step, threads)

    run_blocks(layout.width * layout.height, _BAND, work, threads)
    bands = [band for _, band in sorted(found.items())]
    columns = (np.concatenate([getattr(band, name) for band in bands]) for name in Coverage.__dataclass_fields__)
    return Coverage(*columns)


def shared_texels(
    uv: Float64s, groups: Int64s, size: tuple[int, int], wraps: bool, source: object, threads: int | None = None
) -> tuple[dict[tuple[int, int], int], Int64s]:
    """In how many texels two groups of faces overlap, by pairs (a, b), a < b; and how many texels each group covers.

    Args: groups: (m,), from 0, of the faces, which do not overlap where they share an edge. Others: as `UVLayout.of`.
    """
    coverage = cover(UVLayout.of(uv, size, wraps, source), "mean", thread_count(threads))
    count, rows = int(groups.max()) + 1, np.arange(len(coverage.texels))
    on_layers = np.unique(groups[coverage.layer_face] + count * np.repeat(rows, coverage.layers))
    covering = np.union1d(groups[coverage.face] + count * rows[:, None], on_layers) % count
    several, alike = np.divmod(on_layers, count)
    shared = Counter[tuple[int, int]]()
    for first, last in pairwise([*np.flatnonzero(np.diff(several, prepend=-1)).tolist(), len(several)]):
        shared.update(combinations(alike[first:last].tolist(), 2))
    return dict(shared), np.bincount(covering, minlength=count)


def _cover_band(
    layout: UVLayout, scene: TriangleScene, slivers: PageTree, texels: Int64s, layered: bool, step: float, threads: int
) -> Coverage:
    """`cover` of some texels. Args: layered: whether all faces share a texel. step: as `find_hits` has it."""
    shape, width = (len(texels), SLOTS), layout.width
    corner = np.stack([texels % width, texels // width], axis=1)
    triangle, barycentric = np.full(shape, -1), np.zeros((*shape, 3), np.float32)
    overlapping = np.zeros(len(texels), np.bool_)

    def work(first: int, last: int) -> None:
        block = slice(first, last)
        found = triangle[block], barycentric[block], overlapping[block]
        find_hits(RayPacket.of(scene), texels[block], width, step, *found)

    run_blocks(len(texels), _BLOCK, work, threads, most=_SHARE)
    layers = np.zeros(len(texels), np.int64)
    shared = np.flatnonzero(overlapping) if layered else np.zeros(0, np.int64)
    layers[shared], layer_triangle, layer_place = _points_on_layers(scene, texels[shared], width, step, threads)
    hit = triangle >= 0
    whole = np.flatnonzero(hit.all(axis=1) & ~overlapping)
    centre_face, centre = np.full(len(texels), -1), np.zeros((len(texels), 3), np.float32)
    centre_face[whole] = triangle[whole, 0]
    centre[whole] = barycentric[whole].sum(axis=1) / np.float32(SLOTS)
    several = whole[(triangle[whole] != triangle[whole, :1]).any(axis=1)]
    hits = look_down(scene, corner[several] + 0.5, threads)
    centre_face[several], centre[several] = hits.face, hits.barycentric
    missed = np.flatnonzero(~hit.any(axis=1))
    sliver, where = find_slivers(slivers, texels[missed], width, threads)
    triangle[missed], barycentric[missed] = sliver[:, None], where[:, None]
    some = np.flatnonzero(hit.any(axis=1) & ~hit.all(axis=1))
    hits_first = np.argsort(~hit[some], axis=1, kind="stable")
    source = np.take_along_axis(hits_first, np.arange(SLOTS) % hit[some].sum(axis=1)[:, None], axis=1)
    for table in (triangle, barycentric):  # what the points have that met a face, in turn
        table[some] = table[some[:, None], source]
    parts = np.flatnonzero(~(hit.all(axis=1) | (triangle[:, 0] < 0) | overlapping))
    for first in range(0, len(parts), _FINE_TEXELS):
        block = parts[first : first + _FINE_TEXELS]
        _spread_over_part(scene, corner[block], block, triangle, barycentric, threads)
    covered = triangle[:, 0] >= 0
    number = np.append(layout.face, -1).astype(np.int32)
    face, centre_face = number[triangle[covered]], number[centre_face[covered]]
    return Coverage(
        texels[covered], face, barycentric[covered], centre_face, centre[covered], overlapping[covered],
        layers[covered], number[layer_triangle], layer_place,
    )  # fmt: skip


def _points_on_layers(
    scene: TriangleScene, texels: Int64s, width: int, step: float, threads: int
) -> tuple[Int64s, Int64s, Float32s]:
    """Of texels (k,) in which faces overlap: how many points they have (k,), and their triangles and barycentrics."""
    depths, counts = np.zeros((len(texels), SLOTS), np.int64), np.zeros(len(texels), np.int64)

    def count(first: int, last: int) -> None:
        find_layers(RayPacket.of(scene), texels[first:last], width, step, depths[first:last], None)
        layer_counts(texels[first:last], depths[first:last], counts[first:last])

    run_blocks(len(texels), _BLOCK, count, threads, most=_SHARE)
    starts = np.concatenate([[0], np.cumsum(counts)])
    triangle, place = np.empty(starts[-1], np.int64), np.empty((starts[-1], 3), np.float32)

    def find(first: int, last: int) -> None:
        points = starts[first : last + 1], triangle, place
        find_layers(RayPacket.of(scene), texels[first:last], width, step, depths[first:last], points)

    run_blocks(len(texels), _BLOCK, find, threads, most=_SHARE)
    return counts, triangle, place


def _spread_over_part(
    scene: TriangleScene, corner: Int64s, rows: Int64s, triangle: Int64s, barycentric: Float32s, threads: int
) -> None:
    """Spread points of texels at `corner` (k, 2), of these `rows`, over the part covered, unless it is too small."""
    cells = np.arange(_FINE**2)
    bits = [(cells >> shift) & 1 for shift in range(6)]
    column, row = (sum(bit << place for place, bit in enumerate(bits[first::2])) for first in (0, 1))  # Morton order
    fine = (np.stack([column, row], axis=1) + 0.5) / _FINE
    hits = look_down(scene, (corner[:, None] + fine).reshape(-1, 2), threads)
    face, weights = hits.face.reshape(-1, _FINE**2), hits.barycentric.reshape(-1, _FINE**2, 3)
    count: Int64s = np.sum(face >= 0, axis=1)
    order = np.argsort(face < 0, axis=1, kind="stable")
    chosen = np.take_along_axis(order, ((np.arange(SLOTS) + _WITHIN) * count[:, None] / SLOTS).astype(np.int64), axis=1)
    some = np.flatnonzero(count)
    triangle[rows[some]] = face[some[:, None], chosen[some]]
    barycentric[rows[some]] = weights[some[:, None], chosen[some]]
