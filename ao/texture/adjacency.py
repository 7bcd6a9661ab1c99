"""The texels next to each texel on the surface: side by side in one chart, or across a seam."""

import numpy as np

from obscurance.raytrace.system.parallel import each
from obscurance.raytrace.types import Float32Rows, Float32s, Float64s, Int32Rows, Int32s, Int64s

from ..estimate.one_ring import Neighbours
from .texels import Texels
from .uv_layout import doubled_areas
from .uv_surface import UVSurface

_NEAR = 3.0  # times the size of a texel on the surface that a neighbour may be away: more is another part of the chart


def texel_neighbours(surface: UVSurface, texels: Texels, most: float, threads: int) -> Neighbours:
    """The one-ring of every texel. Args: most: how far a texel reaches on a face at most, in render space."""
    count, layout, points = len(texels), surface.layout, texels.points
    row_of = np.full(layout.width * layout.height, -1, np.int32)
    row_of[texels.texels] = np.arange(count)
    charts = surface.charts[texels.page_face].astype(np.int32)
    sizes = _texel_sizes(layout.uv, surface.vertices, surface.receivers.faces, most)[texels.page_face]
    # Neighbours on the page, four at most, in the same chart and near on the surface.
    beside = np.empty((count, 4), np.int32)
    starts = np.zeros(count + 1, np.int64)
    page = row_of, layout.width, layout.wraps
    places = charts, sizes.astype(np.float32), points.origins
    _find_beside.on(threads)(texels.texels, page, places, beside, starts)
    # Neighbours across seams.
    texels_at_seams, seam_texels = _across_seams(surface, row_of, count)
    across = np.zeros(count + 1, np.int64)
    np.cumsum(np.bincount(texels_at_seams, minlength=count), out=across[1:])
    # Both in one list.
    starts = np.cumsum(starts) + across
    indices = np.empty(starts[-1], np.int32)
    _write_neighbours.on(threads)(starts, beside, across, seam_texels, indices)
    return Neighbours.weighted(
        starts.astype(np.int32), indices, np.ones(len(indices), np.float32), points.normals, threads
    )


def _across_seams(surface: UVSurface, row_of: Int32s, count: int) -> tuple[Int64s, Int64s]:
    """Texels on both sides of seams, both ways, each pair once, sorted. Args: row_of: of the page's texels."""
    sides = surface.seams.sides
    nearest = np.take_along_axis(sides.texels, sides.weights.argmax(axis=2)[..., None], axis=2)[..., 0]
    left, right = row_of[nearest].astype(np.int64).T
    usable = (left >= 0) & (right >= 0) & (left != right)
    left = left[usable]
    right = right[usable]
    pairs = np.unique(np.concatenate([left, right]) * count + np.concatenate([right, left]))
    here, there = np.divmod(pairs, count)
    return here, there


def _texel_sizes(uv: Float64s, vertices: Float64s, faces: Int32s, most: float) -> Float64s:
    """The size (m,) of a texel on each face, in render space, `most` at most."""
    corners = vertices[faces]
    first_edge = corners[:, 1] - corners[:, 0]
    surface = np.linalg.norm(np.cross(first_edge, corners[:, 2] - corners[:, 0]), axis=1)
    return np.asarray(np.sqrt(surface / np.maximum(np.abs(doubled_areas(uv)), surface / most**2)))


@each("texels")
def _find_beside(
    i: int,
    texels: Int64s,
    page: tuple[Int32s, int, bool],
    surface: tuple[Int32s, Float32s, Float32Rows],
    beside: Int32Rows,
    starts: Int64s,
) -> None:
    """Write the four neighbours of each texel, −1 for none, and how many there are into starts[i + 1]."""
    (row_of, width, wraps), (chart, size, origins) = page, surface
    height = len(row_of) // width
    row, column = divmod(texels[i], width)
    for k in range(4):
        y = row + (k == 0) - (k == 1)
        x = column + (k == 2) - (k == 3)
        beside[i, k] = -1
        if wraps:
            x = x % width
            y = y % height
        elif x < 0 or y < 0 or x >= width or y >= height:
            continue
        j = row_of[y * width + x]
        if j < 0 or j == i or chart[j] != chart[i]:
            continue
        squared = np.float32(0.0)
        for axis in range(3):
            squared += (origins[i, axis] - origins[j, axis]) ** 2
        if squared <= (_NEAR * max(size[i], size[j])) ** 2:
            beside[i, k] = j
            starts[i + 1] += 1


@each("beside")
def _write_neighbours(
    i: int, starts: Int64s, beside: Int32Rows, seam_starts: Int64s, seam_texels: Int64s, indices: Int32s
) -> None:
    """Write the neighbours of each texel: the texels `beside` it, then there[across[i] : across[i + 1]]."""
    entry = starts[i]
    for k in range(4):
        if beside[i, k] >= 0:
            indices[entry] = beside[i, k]
            entry += 1
    for k in range(seam_starts[i], seam_starts[i + 1]):
        indices[entry] = seam_texels[k]
        entry += 1
