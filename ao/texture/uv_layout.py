"""Texture coordinates as triangles on a page of texels, and what is unusual about them."""

from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from obscurance.raytrace.errors import MeshError, OptionError
from obscurance.raytrace.mesh.mesh import Mesh
from obscurance.raytrace.types import Bools, Float64s, Int64s

MAX_SIDE = 16384
_FARTHEST = 1e5  # tiles from the unit square; beyond, coordinates of files have no digits left for texels
_TILES = 64  # that one face may reach into
_FLAT = 1e-12  # of a face's squared extent: an area that is none
_TINY, _SHARE = 1e-6, 0.25  # of a tile, and of itself, that a face may reach over a border, for coordinates are rounded


@dataclass(frozen=True, eq=False)
class UVLayout:
    """Faces on a page: x to the right and y down, in texels."""

    width: int
    height: int
    wraps: bool  # whether the page repeats beyond its edges
    uv: Float64s  # (m, 3, 2), corners of every face, before any wrapping
    corners: Float64s  # (t, 3, 2), of triangles that reach into the page
    face: Int64s  # (t,), the row of each in `uv`
    mirrored: int  # how many faces are turned over
    flat: int  # how many faces have no area
    outside: int  # how many faces reach out of the unit square

    @classmethod
    def of(cls, uv: Float64s, size: tuple[int, int], wraps: bool, source: object) -> Self:
        """Faces of texture coordinates `uv` (m, 3, 2), v upwards, on a page of `size`, width and height in texels.

        Faces that are NaN, not on the page, become points at its lower left corner. What lies outside of the unit
        square is taken modulo 1 if it `wraps`, else left out.

        Raises: MeshError: no face has an area on the page, or one reaches over very many tiles.
        """
        is_on_page = on_page(uv)
        uv = np.where(is_on_page[:, None, None], uv, 0.0)
        low = uv.min(axis=1)
        high = uv.max(axis=1)
        first_tiles, end_tiles = tile_ranges(uv)
        area = doubled_areas(uv)
        usable = have_area(uv)
        spans = end_tiles - first_tiles
        outside = usable & ((first_tiles != 0).any(axis=1) | (spans > 1).any(axis=1))
        if wraps:
            faces, tiles = _tiles(usable, first_tiles, spans, source)
        else:
            faces = np.flatnonzero(usable & (low < 1).all(axis=1) & (high > 0).all(axis=1))
            tiles = np.zeros((len(faces), 2), np.int64)
        if not len(faces):
            got = "none" if not usable.any() else "none in the unit square"
            raise MeshError(source, "texture coordinates", "faces with an area on the page", got)
        width, height = size
        placed = uv[faces] - tiles[:, None]
        scale = np.array([width, -height], np.float64)
        origin = np.array([0.0, height])
        counts = (int(np.count_nonzero(which)) for which in (usable & (area < 0), is_on_page & ~usable, outside))
        return cls(width, height, wraps, uv * scale + origin, placed * scale + origin, faces, *counts)


def on_page(uv: Float64s) -> Bools:
    """The faces (m,) whose texture coordinates (m, 3, 2) are not NaN, which are on a page."""
    shown: Bools = np.all(~np.isnan(uv), axis=(1, 2))
    return shown


def tile_ranges(uv: Float64s) -> tuple[Int64s, Int64s]:
    """The first tile (m, 2) that each face of `uv` (m, 3, 2) reaches into, and the tile after the last."""
    low = uv.min(axis=1)
    high = uv.max(axis=1)
    over = np.minimum(_TINY, _SHARE * (high - low))
    first_tiles: Int64s = np.floor(low + over).astype(np.int64)
    end_tiles: Int64s = np.ceil(high - over).astype(np.int64)
    return first_tiles, np.maximum(end_tiles, first_tiles + 1)


def doubled_areas(uv: Float64s) -> Float64s:
    """Twice the area of each face (m,) of `uv` (m, 3, 2), below 0 of mirrored ones."""
    a = uv[:, 1] - uv[:, 0]
    b = uv[:, 2] - uv[:, 0]
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])


def have_area(uv: Float64s) -> Bools:
    """The faces (m,) of `uv` (m, 3, 2) that have an area; faces that are NaN have none."""
    extent = np.ptp(uv, axis=1).max(axis=1)
    large: Bools = np.abs(doubled_areas(uv)) > _FLAT * extent**2
    return large


def covered_texels(uv: Float64s, size: tuple[int, int]) -> int:
    """About how many texels of a page of `size` faces of `uv` (m, 3, 2) cover, if they do not overlap."""
    share = float(np.abs(doubled_areas(uv[on_page(uv)])).sum()) / 2
    return int(size[0] * size[1] * min(share, 1.0))


def page_size(size: Any) -> tuple[int, int]:
    """Width and height of a page. Raises: OptionError: neither a whole number nor two from 1 to 16384."""
    given = (size, size) if isinstance(size, int | np.integer) else size
    sides = tuple(given) if isinstance(given, list | tuple) else ()
    whole = all(isinstance(side, int | np.integer) and not isinstance(side, bool) for side in sides)
    if len(sides) != 2 or not whole or not all(1 <= side <= MAX_SIDE for side in sides):
        raise OptionError("size", f"one or two whole numbers of texels from 1 to {MAX_SIDE}", repr(size))
    return int(sides[0]), int(sides[1])


def corner_uv(uv: Any, mesh: Mesh) -> Float64s:
    """Texture coordinates (m, 3, 2) of faces, NaN of faces without, from `uv` like them or by vertex (n, 2).

    Raises: MeshError: another shape, or coordinates that are not finite or lie very far out.
    """
    try:
        values = np.asarray(uv, np.float64)
    except (TypeError, ValueError):
        values = np.empty(0)
    shapes = (len(mesh.vertices), 2), (len(mesh.faces), 3, 2)
    if values.shape not in shapes:
        expected = f"shape {shapes[0]}, by vertex, or {shapes[1]}, by face and corner"
        raise MeshError(mesh.source, "texture coordinates", expected, values.shape)
    corners = values[mesh.faces] if values.ndim == 2 else values
    usable = (np.abs(corners) <= _FARTHEST) | np.isnan(corners).all(axis=(1, 2), keepdims=True)
    bad: Bools = np.any(~usable, axis=(1, 2))
    if bad.any():
        first_bad = int(np.argmax(bad))
        got = f"{corners[first_bad].tolist()} ({bad.sum()} such)"
        field = f"texture coordinates of face {first_bad}"
        raise MeshError(mesh.source, field, f"finite numbers up to {_FARTHEST:g}", got)
    return corners


def texels_across(uv: Float64s, areas: Float64s, texel_size: float) -> int:
    """The side of a square page, a power of two, on which a texel covers `texel_size` or less of the surface.

    Args:
        areas: (m,), of the faces, in squared mesh units.

    Raises: OptionError: `texel_size` is not positive, or so small that the page would be too large.
    """
    if not (np.isfinite(texel_size) and texel_size > 0):
        raise OptionError("texel_size", "a length above 0", texel_size)
    mapped = float(np.abs(doubled_areas(uv)).sum() / 2)
    across = np.sqrt(float(areas.sum()) / mapped) if mapped > 0 else 0.0
    power = int(np.ceil(np.log2(max(across / texel_size, 1.0)) - 1e-9))
    if power > np.log2(MAX_SIDE):
        least = across / MAX_SIDE
        raise OptionError("texel_size", f"at least {least:.3g}, for a page of {MAX_SIDE} texels", f"{texel_size:g}")
    return 1 << power


def _tiles(usable: Bools, first_tiles: Int64s, spans: Int64s, source: object) -> tuple[Int64s, Int64s]:
    """Every usable face once for each tile that it reaches into: rows (t,), and the tile (t, 2)."""
    widths = np.where(usable, spans.max(axis=1), 0)
    if widths.max(initial=0) > _TILES:
        widest = int(np.argmax(widths))
        expected = f"faces that reach over at most {_TILES} tiles"
        raise MeshError(source, f"texture coordinates of face {widest}", expected, int(spans[widest].max()))
    faces = np.flatnonzero(usable)
    counts = spans[faces].prod(axis=1)
    copies = np.repeat(faces, counts)
    number = np.arange(len(copies)) - np.repeat(np.cumsum(counts) - counts, counts)
    across = spans[copies, 0]
    return copies, first_tiles[copies] + np.stack([number % across, number // across], axis=1)
