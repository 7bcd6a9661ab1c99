"""Tiles of a picture for processes that render only some of them: rows of arrays, with the edges of their neighbours.

Whether a pixel that was retired early needs all samples after all is decided by its neighbours in other tiles
(`raytrace.shade.tile`): their edges come along.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..shade.film import EDGE, TILE
from ..shade.layout import COUNTERS, Film
from ..shade.tile import mark_reopened
from ..types import Bools, Float32s, Int64s
from .render_job import RenderJob


class TileRows(NamedTuple):
    """Rendered tiles, a row each.

    Attributes:
        pixels: float32 (k, TILE, TILE, channels), 0 beyond the picture. edges: float32 (k, 4, TILE, EDGE), or (k, 0, 0,
        0) where no pixel is retired early. counts: int64 (k, COUNTERS), of rays.
    """

    pixels: Float32s
    edges: Float32s
    counts: Int64s

    @classmethod
    def empty(cls, tiles: int, channels: int, adaptive: bool) -> TileRows:
        edges = (4, TILE, EDGE) if adaptive else (0, 0, 0)
        pixels = np.zeros((tiles, TILE, TILE, channels), np.float32)
        return cls(pixels, np.zeros((tiles, *edges), np.float32), np.zeros((tiles, COUNTERS), np.int64))


def render_numbered(picture: RenderJob, numbers: Int64s, around: Float32s | None, out: TileRows) -> None:
    """Render the tiles `numbers`, int64 (k,).

    Args:
        around: `edges_around` each, (k, 5, 4, TILE, EDGE): only pixels that they reopen are rendered, again.
        out: written.
    """
    columns, again = picture.columns, around is not None
    first, end = int(numbers.min()) // columns - again, int(numbers.max()) // columns + 1 + again
    first, end = max(first, 0), min(end, picture.rows)
    film, scratch = picture.film(first, end), picture.scratch()
    for row, number in enumerate(numbers):
        tile = int(number) - first * columns
        if around is not None:
            film.edges[_around(picture, numbers[row : row + 1])[0] - first * columns] = around[row]
        out.counts[row] = picture.render(film, scratch, (tile, tile + 1), again)
        part = _part(film, tile)
        out.pixels[row, : len(part), : part.shape[1]] = part
        if out.edges.size:
            out.edges[row] = film.edges[tile]


def paste(film: Film, numbers: Int64s, pixels: Float32s, marks: Bools | None = None) -> None:
    """Put the pixels of tiles, (k, TILE, TILE, channels), on a film. Args: marks: bool (k, TILE, TILE), these alone."""
    for row, number in enumerate(numbers):
        part = _part(film, int(number))
        high, wide = part.shape[:2]
        mask = True if marks is None else marks[row, :high, :wide, None]
        np.copyto(part, pixels[row, :high, :wide], where=mask)


def reopened(picture: RenderJob, film: Film) -> Bools:
    """The pixels of each tile that are to be rendered again, bool (tiles, TILE, TILE)."""
    marks = np.zeros((picture.tiles, TILE * TILE), np.bool_)
    mark_reopened(film, picture.scratch(), marks)
    return marks.reshape(-1, TILE, TILE)


def edges_around(picture: RenderJob, film: Film, numbers: Int64s) -> Float32s:
    """Edges of tiles and of the tiles beside them, float32 (k, 5, 4, TILE, EDGE)."""
    around: Float32s = film.edges[_around(picture, numbers)]
    return around


def _around(picture: RenderJob, numbers: Int64s) -> Int64s:
    """Numbers of tiles and of the tiles left, right, above and below, (k, 5); the tile's own where there is none."""
    columns = picture.columns
    left, right = numbers % columns > 0, (numbers + 1) % columns > 0
    above, below = numbers >= columns, numbers + columns < picture.tiles
    return numbers[:, None] + np.stack([0 * left, -1 * left, 1 * right, -columns * above, columns * below], axis=1)


def _part(film: Film, tile: int) -> Float32s:
    """The pixels of a tile of a film, as a view."""
    columns = -(-film.pixels.shape[1] // TILE)
    x, y = tile % columns * TILE, tile // columns * TILE
    return film.pixels[y : y + TILE, x : x + TILE]
