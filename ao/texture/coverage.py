"""Which texels the faces cover, and where: rays straight down on the page through Embree, four a texel.

Every texel that a face reaches into is covered, however little of it, and all points lie on faces: nothing is ever
extrapolated over the edge of a chart, which is what dark seams come from.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from raytrace.embree.packets import (
    DIR_X,
    DIR_Y,
    DIR_Z,
    GEOM_ID,
    INVALID,
    LANES,
    ORG_X,
    ORG_Y,
    ORG_Z,
    PRIM_ID,
    TFAR,
    U,
    V,
    intersect8,
)
from raytrace.embree.rays import intersect
from raytrace.embree.scene import TriangleScene
from raytrace.kernel.borrow import borrow
from raytrace.kernel.jit import inline, kernel
from raytrace.system.threads import run_blocks
from raytrace.types import Bools, Float32s, Float64s, Int32s, Int64s

from ..gather.ray_packet import RayPacket
from .slivers import find_slivers
from .uv_layout import UVLayout

Overlap = Literal["mean", "first", "refuse"]
SLOTS = 4  # points of a texel
_GRID = np.array([[0.375, 0.125], [0.125, 0.625], [0.875, 0.375], [0.625, 0.875]])
"""A rotated grid: means of what is linear over a texel are exact, and so are those over a diagonal: the first and the
last point, or the other two. Two faces over one another take turns so that each has a diagonal; of other texels the
first two points are one."""
DEEP = 16  # points of a texel in which more than two faces lie over one another
_FINE = 8  # points across and down of texels that are not whole
_WITHIN = np.array([0.125, 0.625, 0.375, 0.875])  # where to take one from each quarter of them
_FINE_TEXELS = 1 << 14  # together
_TURNS = np.array([0, 2, 3, 1])  # of slots, so that the first two take different ones of two faces
_HIGHEST = 0.5  # triangles lie at heights up to this, so that one ray can meet those below
_STEP = 2.0**-22
_ABOVE = 1.0
_LAYERS = 16
_INSIDE = 1e-4  # least barycentric coordinate of what counts as inside: neighbours share their edges
_BAND = 1 << 17  # texels
_BLOCK = 1 << 13


@dataclass(frozen=True, eq=False)
class Coverage:
    """The covered texels of a page, ascending.

    Attributes:
        texels: int64 (k,), row · width + column.
        face: int32 (k, SLOTS), the face that each point lies on, a row of `UVLayout.uv`.
        barycentric: float32 (k, SLOTS, 3).
        centre_face: int32 (k,), the face at the centre of each texel that is covered as a whole by faces that do not
            overlap, −1 for others. centre: float32 (k, 3), barycentric.
        overlapping: bool (k,), whether several faces lie over one another.
        deep: bool (k,), whether these are more than two at some point, and share the texel.
        deep_face: int32 (j, DEEP), deep_barycentric: float32 (j, DEEP, 3), of the j deep texels: points on all faces.
    """

    texels: Int64s
    face: Int32s
    barycentric: Float32s
    centre_face: Int32s
    centre: Float32s
    overlapping: Bools
    deep: Bools
    deep_face: Int32s
    deep_barycentric: Float32s

    @classmethod
    def of_points(cls, texels: Int64s, face: Int32s, barycentric: Float32s, overlapping: Bools) -> Coverage:
        """Coverage without centres and deep texels. Arguments as the attributes."""
        centres = np.full(len(texels), -1, np.int32), np.zeros((len(texels), 3), np.float32)
        none = np.zeros((0, DEEP), np.int32), np.zeros((0, DEEP, 3), np.float32)
        return cls(texels, face, barycentric, *centres, overlapping, np.zeros(len(texels), np.bool_), *none)


def cover(layout: UVLayout, overlap: Overlap, threads: int) -> Coverage:
    """The texels that the faces of `layout` cover.

    Args: overlap: where faces overlap, points lie on all of them in turn ("mean"), or on the first ("first").

    Raises:
        EmbreeError: Embree failed, out of memory for instance.
    """
    count = len(layout.face)
    step = min(_STEP, _HIGHEST / max(count, 1))
    heights = np.floor(np.arange(count)[::-1] * step / 2.0**-24) * 2.0**-24  # the first face on top
    vertices = np.empty((count, 3, 3), np.float32)
    vertices[:, :, :2], vertices[:, :, 2] = layout.corners, heights[:, None]
    scene = TriangleScene(vertices.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3))
    size = layout.width * layout.height
    bands = [
        _cover_band(layout, scene, np.arange(first, min(first + _BAND, size)), overlap, step, threads)
        for first in range(0, size, _BAND)
    ]
    columns = (np.concatenate([getattr(band, name) for band in bands]) for name in Coverage.__dataclass_fields__)
    return Coverage(*columns)


def _cover_band(
    layout: UVLayout, scene: TriangleScene, texels: Int64s, overlap: Overlap, step: float, threads: int
) -> Coverage:
    """`cover` of some texels."""
    shape = len(texels), SLOTS
    triangle, barycentric = np.full(shape, -1), np.zeros((*shape, 3), np.float32)
    overlapping, deep = np.zeros((2, len(texels)), np.bool_)
    deep_triangle, deep_place = np.empty((len(texels), DEEP), np.int64), np.empty((len(texels), DEEP, 3), np.float32)

    def work(first: int, last: int) -> None:
        some = slice(first, last)
        found = triangle[some], barycentric[some], overlapping[some]
        layered = deep[some], deep_triangle[some], deep_place[some]
        _find_hits(RayPacket.of(scene), texels[some], layout.width, step, overlap == "mean", found, layered)

    run_blocks(len(texels), _BLOCK, work, threads)
    hit = triangle >= 0
    whole = np.flatnonzero(hit.all(axis=1) & ~overlapping)
    centre_face, centre = np.full(len(texels), -1), np.zeros((len(texels), 3), np.float32)
    centre_face[whole], centre[whole] = _at_centres(
        scene, texels[whole], layout.width, triangle[whole], barycentric[whole], threads
    )
    missed = np.flatnonzero(~hit.any(axis=1))
    slivers = find_slivers(layout.corners, texels[missed], layout.width, threads)
    triangle[missed] = slivers.face[:, None]
    barycentric[missed] = slivers.barycentric[:, None]
    refill(hit, triangle, barycentric)
    parts = np.flatnonzero(~(hit.all(axis=1) | (triangle[:, 0] < 0) | overlapping))
    for first in range(0, len(parts), _FINE_TEXELS):
        some = parts[first : first + _FINE_TEXELS]
        _spread_over_part(scene, texels[some], layout.width, some, triangle, barycentric, threads)
    covered = triangle[:, 0] >= 0
    number = np.append(layout.face, -1).astype(np.int32)
    face, centre_face = number[triangle[covered]], number[centre_face[covered]]
    return Coverage(
        texels[covered],
        face,
        barycentric[covered],
        centre_face,
        centre[covered],
        overlapping[covered],
        deep[covered],
        number[deep_triangle[deep]],
        deep_place[deep],
    )


def _at_centres(
    scene: TriangleScene, texels: Int64s, width: int, triangle: Int64s, barycentric: Float32s, threads: int
) -> tuple[Int64s, Float32s]:
    """The triangle (k,) at the centre of each of the `texels`, −1 for none, and where on it (k, 3).

    Args: triangle, barycentric: of the points about it, (k, SLOTS) and (k, SLOTS, 3).
    """
    found, place = triangle[:, 0].copy(), barycentric.sum(axis=1) / np.float32(SLOTS)
    several = np.flatnonzero((triangle != triangle[:, :1]).any(axis=1))
    middles = np.stack([texels[several] % width, texels[several] // width], axis=1) + np.array([0.5, 0.5])
    hits = intersect(scene, _at_height(middles, _ABOVE), [[0.0, 0.0, -1.0]], np.inf, threads)
    found[several], place[several] = hits.face, hits.barycentric
    return found, place


def _spread_over_part(
    scene: TriangleScene,
    texels: Int64s,
    width: int,
    rows: Int64s,
    triangle: Int64s,
    barycentric: Float32s,
    threads: int,
) -> None:
    """Spread the points of texels that are covered in part over that part, in place, unless it is too small for that.

    Args: rows: int64 (k,), where each of `texels` (k,) is in `triangle` and `barycentric`, of all texels of the band.
    """
    cells = np.arange(_FINE**2)
    bits = [(cells >> shift) & 1 for shift in range(6)]
    column, row = (sum(bit << place for place, bit in enumerate(bits[first::2])) for first in (0, 1))  # Morton order
    fine = (np.stack([column, row], axis=1) + 0.5) / _FINE
    places = np.stack([texels % width, texels // width], axis=1)[:, None] + fine
    hits = intersect(scene, _at_height(places.reshape(-1, 2), _ABOVE), [[0.0, 0.0, -1.0]], np.inf, threads)
    face, weights = hits.face.reshape(-1, _FINE**2), hits.barycentric.reshape(-1, _FINE**2, 3)
    count: Int64s = np.sum(face >= 0, axis=1)
    order = np.argsort(face < 0, axis=1, kind="stable")
    chosen = np.take_along_axis(order, ((np.arange(SLOTS) + _WITHIN) * count[:, None] / SLOTS).astype(np.int64), axis=1)
    some = np.flatnonzero(count)
    triangle[rows[some]] = face[some[:, None], chosen[some]]
    barycentric[rows[some]] = weights[some[:, None], chosen[some]]


def refill(good: Bools, *tables: Int32s | Int64s | Float32s) -> None:
    """Give slots that are not `good`, bool (k, slots), what the good ones of their texel have, in turn and in place.

    Args: tables: (k, slots, …). Texels without good slots stay as they are.
    """
    found: Int64s = np.sum(good, axis=1, dtype=np.int64)
    slots = good.shape[1]
    rows = np.flatnonzero((found > 0) & (found < slots))
    count = found[rows]
    order = np.argsort(~good[rows], axis=1, kind="stable")
    source = np.take_along_axis(order, np.arange(slots) % count[:, None], axis=1)
    for table in tables:
        table[rows] = table[rows[:, None], source]


@kernel
def _find_hits(packet, texels, width, step, in_turn, found, layered):
    """Find the triangle at each point of some texels by rays straight down.

    Args:
        in_turn: whether points at which several lie over one another take turns among all of them, or have the first.
        found: triangles, int64 (k, SLOTS), where on them, float32 (k, SLOTS, 3), and whether there are several at any
            point, bool (k,); written where there are any.
        layered: whether there are more than two, bool (k,), and points on all of them, int64 (k, DEEP) and float32
            (k, DEEP, 3); written likewise.
    """
    scene, rays, valid = borrow(packet)
    triangle, barycentric, overlapping = found
    deep, deep_triangle, deep_place = layered
    ids, count = rays.view(np.uint32), SLOTS * len(texels)
    height, layers, several = np.zeros(LANES), np.zeros(LANES, np.int64), np.zeros(LANES, np.bool_)
    face, weights = np.zeros((LANES, _LAYERS), np.int64), np.zeros((LANES, _LAYERS, 3), np.float32)
    for first in range(0, count, LANES):
        for lane in range(LANES):
            i, k = divmod(min(first + lane, count - 1), SLOTS)
            valid[lane] = -1 if first + lane < count else 0
            height[lane], layers[lane], several[lane] = _ABOVE, 0, False
            rays[ORG_X, lane], rays[ORG_Y, lane] = texels[i] % width + _GRID[k, 0], texels[i] // width + _GRID[k, 1]
            rays[DIR_X, lane], rays[DIR_Y, lane], rays[DIR_Z, lane] = 0.0, 0.0, -1.0
        depth, going = 0, True
        while going and depth < _LAYERS:
            for lane in range(LANES):
                rays[ORG_Z, lane], rays[TFAR, lane] = height[lane], np.inf
            intersect8(scene, rays, valid)
            going = False
            for lane in range(LANES):
                if valid[lane] == 0:
                    continue
                if ids[GEOM_ID, lane] == INVALID:
                    valid[lane] = 0
                    continue
                met, u, v = np.int64(ids[PRIM_ID, lane]), rays[U, lane], rays[V, lane]
                place = np.float32(1.0) - u - v, u, v
                i, k = divmod(first + lane, SLOTS)
                if depth == 0:
                    triangle[i, k] = met
                    for corner in range(3):
                        barycentric[i, k, corner] = place[corner]
                if min(place[0], place[1], place[2]) > _INSIDE:
                    if depth == 1:
                        several[lane] = layers[lane] == 1 and face[lane, 0] != met
                    face[lane, layers[lane]] = met
                    for corner in range(3):
                        weights[lane, layers[lane], corner] = place[corner]
                    layers[lane] += 1
                height[lane] -= rays[TFAR, lane] + step / 2.0
                if depth > 0 and not (several[lane] and in_turn):
                    valid[lane] = 0
                going = going or valid[lane] != 0
            depth += 1
        for lane in range(min(LANES, count - first)):
            if several[lane]:
                i, k = divmod(first + lane, SLOTS)
                overlapping[i] = True
                deep[i] |= in_turn and layers[lane] > 2
                if in_turn:
                    chosen = (_TURNS[k] * layers[lane] // SLOTS + texels[i]) % layers[lane]
                    triangle[i, k] = face[lane, chosen]
                    for corner in range(3):
                        barycentric[i, k, corner] = weights[lane, chosen, corner]
        for begin in range(0, min(LANES, count - first), SLOTS):
            i = (first + begin) // SLOTS
            if not (overlapping[i] and in_turn):
                _bring_forward(triangle[i], barycentric[i])
            if deep[i]:
                total = layers[begin : begin + SLOTS].sum()
                for point in range(DEEP):
                    lane, layer = begin, point * total // DEEP
                    while layer >= layers[lane]:
                        layer -= layers[lane]
                        lane += 1
                    deep_triangle[i, point] = face[lane, layer]
                    for corner in range(3):
                        deep_place[i, point, corner] = weights[lane, layer, corner]


@inline
def _bring_forward(triangle, barycentric):
    """Put the last point of a texel in the second place."""
    last, a, b, c = triangle[SLOTS - 1], barycentric[SLOTS - 1, 0], barycentric[SLOTS - 1, 1], barycentric[SLOTS - 1, 2]
    for k in range(SLOTS - 1, 1, -1):
        triangle[k] = triangle[k - 1]
        for corner in range(3):
            barycentric[k, corner] = barycentric[k - 1, corner]
    triangle[1], barycentric[1, 0], barycentric[1, 1], barycentric[1, 2] = last, a, b, c


def _at_height(places: Float64s, height: Float64s | float) -> Float32s:
    origins = np.empty((len(places), 3), np.float32)
    origins[:, :2], origins[:, 2] = places, height
    return origins
