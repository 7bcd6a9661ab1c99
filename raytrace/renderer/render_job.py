"""The rendering of a picture tile by tile: data that all tiles share, for threads here or other processes."""

from __future__ import annotations

import itertools
from typing import get_args

import numpy as np

from ..brdf.material import TWO_SIDED
from ..camera import Camera
from ..embree import new_packet
from ..image.formats import LAYERS
from ..image.frame import Frame
from ..image.texture import LazyTextures
from ..kernel.arrays import aligned
from ..kernel.simd import WIDE
from ..settings import Settings, Shading
from ..shade import layout
from ..shade.camera_rays import place_camera
from ..shade.film import CELLS, EDGES, FIRST, MASKS, PACKETS, RANGE, SUMS, TILE
from ..shade.gouraud import GROUP, light_vertices
from ..shade.interaction import GOURAUD
from ..shade.layout import FILM, LIGHTING, Film, SceneArrays, Scratch, Style
from ..shade.tile import mark_reopened, render_tiles
from ..system.threads import run_blocks
from ..types import Bools, Float32s, Float64s, Int64s
from .render_scene import RenderScene

_SHADINGS = get_args(Shading)
_FORMS = ("off", "ambient", "ambient and diffuse")
_TRACED = ("primary", "shadow")  # counts of rays, in the order of the counters; and of those that were not needed
_SKIPPED = ("behind", "unreached", "black", "culled", "unobstructed", "background", "primary_agreed")


def whole_tiles(settings: Settings) -> tuple[int, int, int, int]:
    """Left, top, width and height, in pixels, of what is rendered: the whole picture.

    For a crop, the tiles that it touches and their neighbours, whose pixels decide about pixels on its edges.
    """
    x, y, wide, high = settings.crop or (0, 0, settings.width, settings.height)
    left = max(x // TILE - 1, 0) * TILE
    top = max(y // TILE - 1, 0) * TILE
    right = min((-(-(x + wide) // TILE) + 1) * TILE, settings.width)
    bottom = min((-(-(y + high) // TILE) + 1) * TILE, settings.height)
    return left, top, right - left, bottom - top


class RenderJob:
    """A picture to be rendered. Pickled, it goes to other processes, which make the same bits of it."""

    def __init__(
        self, built: RenderScene, camera: Camera, settings: Settings, layers: bool, lit: Float64s | None = None
    ) -> None:
        self._given = built, camera, settings, layers
        self.geometry = built.geometry
        self._textures = LazyTextures(self.geometry.textures)
        lit = np.zeros((0, LIGHTING)) if lit is None else lit  # vertices, if they are lit already
        self.scene = SceneArrays(self.geometry.arrays, built.w, built.bent, built.lights, self._textures.packed, lit)
        self.view = place_camera(camera, settings, self.geometry.centre, self.geometry.scale)
        shading = _SHADINGS.index(settings.shading)
        form = _FORMS.index(settings.obscurance)
        self.style = Style(
            settings.samples,
            shading,
            form,
            settings.shadows,
            settings.terminator,
            layers,
            layers or form != layout.OFF,
            built.background,
        )
        self._left, self._top, self._wide, self._high = whole_tiles(settings)
        self._crop = settings.crop or (0, 0, settings.width, settings.height)
        self.columns = -(-self._wide // TILE)  # of tiles
        self.rows = -(-self._high // TILE)  # of tiles
        self.tiles = self.columns * self.rows
        self.adaptive = settings.samples > FIRST  # whether pixels may be retired early
        self.channels = FILM if layers else LAYERS["beauty"]
        self.counts = np.zeros(layout.COUNTERS, np.int64)

    def __reduce__(self) -> tuple[type[RenderJob], tuple[object, ...]]:
        return RenderJob, (*self._given, self.scene.lit_vertices)

    def film(self, first_row: int = 0, end_row: int | None = None) -> Film:
        """A film for the tiles of the rows [first_row, end_row), None: all."""
        end_row = self.rows if end_row is None else end_row
        high = min(end_row * TILE, self._high) - first_row * TILE
        tiles = self.columns * (end_row - first_row) if self.adaptive else 0
        pixels = np.empty((high, self._wide, self.channels), np.float32)
        edges = np.empty((tiles, EDGES), np.float32)
        return Film(pixels, self._left, self._top + first_row * TILE, edges, self.geometry.scale)

    def scratch(self) -> Scratch:
        """Arrays that a thread writes while it renders a tile."""
        lights, hit_filter = max(len(self.scene.lights.kinds), 1), self.geometry.hit_filter
        pixels = np.arange(TILE * TILE, dtype=np.int32)  # blocks of 4×4 make a packet
        return Scratch(
            *new_packet(WIDE, True, hit_filter),
            points=aligned((PACKETS, layout.WIDTH, WIDE), np.float32),
            items=aligned((PACKETS, WIDE), np.int32),
            sums=aligned((TILE * TILE, SUMS), np.float64),
            cells=aligned((CELLS * CELLS, RANGE), np.float32),
            retired=np.zeros(TILE * TILE, np.bool_),
            order=pixels.reshape(TILE // 4, 4, TILE // 4, 4).transpose(0, 2, 1, 3).ravel(),
            todo=aligned((TILE * TILE + WIDE,), np.int32),
            active=np.zeros(lights, np.int64),
            hidden=np.zeros(lights, np.bool_),
            layers=aligned((PACKETS if hit_filter else 0, layout.COVER + 1, WIDE), np.float32),
            active_rays=aligned((PACKETS, WIDE), np.int32),
            missing=np.zeros(len(self.geometry.textures), np.int64),
            counts=np.zeros(layout.COUNTERS, np.int64),
        )

    def render(self, film: Film, scratch: Scratch, tiles: tuple[int, int], reopened_only: bool = False) -> Int64s:
        """Render the tiles [first, end) of a film; returns counts of rays, int64 (COUNTERS,).

        Args:
            reopened_only: render only the pixels that their neighbours in other tiles reopen, by the film's `edges`.
        """
        edges = film.edges[slice(*tiles)].copy()
        while True:
            scratch.counts[:] = scratch.missing[:] = 0
            render_tiles(self.scene, self.view, self.style, film, scratch, tiles, reopened_only)
            if not scratch.missing.any():
                return scratch.counts.copy()
            film.edges[slice(*tiles)] = edges
            self._textures.read(np.flatnonzero(scratch.missing).tolist())

    def render_numbered(self, numbers: Int64s, around: Float32s | None, out: tuple[Float32s, Float32s, Int64s]) -> None:
        """Render the tiles `numbers`, int64 (k,), to rows of arrays, for processes that render only some tiles of a
        picture.

        Args:
            around: edges of the tiles `beside` each, (k, 9, EDGES): only pixels that these reopen are rendered. None:
                all.
            out: pixels (k, TILE, TILE, channels), 0 beyond the picture, edges (k, EDGES) and counts (k, COUNTERS), to
                be written.
        """
        pixels, edges, counts = out
        reopened_only = around is not None
        first_row = max(int(numbers.min()) // self.columns - reopened_only, 0)
        film = self.film(first_row, min(int(numbers.max()) // self.columns + 1 + reopened_only, self.rows))
        scratch = self.scratch()
        for row, number in enumerate(numbers):
            tile = int(number) - first_row * self.columns
            if around is not None:
                film.edges[self.beside(numbers[row : row + 1])[0] - first_row * self.columns] = around[row]
            counts[row] = self.render(film, scratch, (tile, tile + 1), reopened_only)
            part = _part(film, tile)
            pixels[row, : len(part), : part.shape[1]] = part
            if edges.size:
                edges[row] = film.edges[tile]

    def reopened(self, film: Film) -> Int64s:
        """Numbers of the tiles of which some pixels are to be rendered again, (k,)."""
        marks = np.zeros(self.tiles, np.bool_)
        mark_reopened(film, self.scratch(), marks)
        return np.flatnonzero(marks)

    def beside(self, numbers: Int64s) -> Int64s:
        """Numbers of tiles and of those around them, (k, 9); the tile's own where there is none."""
        right, down = np.meshgrid([-1, 0, 1], [-1, 0, 1])
        tile_columns = numbers[:, None] % self.columns + right.ravel()
        tile_rows = numbers[:, None] // self.columns + down.ravel()
        there = (tile_columns >= 0) & (tile_columns < self.columns) & (tile_rows >= 0) & (tile_rows < self.rows)
        return np.where(there, tile_rows * self.columns + tile_columns, numbers[:, None])

    def light_vertices(self, threads: int) -> None:
        """Light all vertices, if the shading is Gouraud's: fronts, and backs if they may reflect more than them."""
        if self.style.shading != GOURAUD:
            return
        lights, vertices = self.scene.lights, len(self.scene.w)
        shadows = self.style.shadows and len(lights.kinds)
        origins = self.geometry.vertex_origins if shadows else aligned((0, 3), np.float32)
        surrounded = len(lights.skies) + len(lights.harmonics) > 0
        sides = 2 if surrounded or self.scene.geometry.materials[:, TWO_SIDED].any() else 1
        self.scene = self.scene._replace(lit_vertices=np.zeros((sides * vertices, LIGHTING)))
        finished: list[Int64s] = []
        # Groups of vertices of one object and side, a share of work each.
        objects = itertools.pairwise(self.scene.geometry.first_w.tolist())
        front = np.concatenate([np.arange(*span, GROUP) for span in objects])
        groups = np.concatenate([front + side * vertices for side in range(sides)])

        def work(start: int, stop: int) -> None:
            scratch = self.scratch()
            light_vertices(self.scene, self.view, self.style, scratch, origins, groups[start:stop])
            finished.append(scratch.counts)

        run_blocks(len(groups), 4, work, threads, most=16)
        self.counts += np.sum(finished, axis=0)

    def frame(self, film: Film, seconds: dict[str, float]) -> Frame:
        """The finished picture: the crop of a film with its layers apart, and the rays that it took."""
        x, y, width, height = self._crop
        crop = film.pixels[y - self._top : y - self._top + height, x - self._left : x - self._left + width]
        parts = np.split(crop, np.cumsum([*LAYERS.values()])[:-1], axis=2)
        layers = {name: part for name, part in zip(LAYERS, parts, strict=True) if part.shape[2]}
        counts = self.counts.tolist()
        rays = dict(zip(_TRACED, counts[:2], strict=True))
        skipped = dict(zip(_SKIPPED, counts[2:], strict=True))
        return Frame(layers, rays, skipped, seconds, self.style.background, (x, y))


def paste(film: Film, numbers: Int64s, pixels: Float32s, marks: Bools | None) -> None:
    """Put the pixels of tiles, (k, TILE, TILE, channels), on a film. Args: marks: bool (k, TILE, TILE), these alone."""
    for row, number in enumerate(numbers):
        part = _part(film, int(number))
        high, wide = part.shape[:2]
        mask = True if marks is None else marks[row, :high, :wide, None]
        np.copyto(part, pixels[row, :high, :wide], where=mask)


def retired_pixels(edges: Float32s) -> Bools:
    """The pixels of tiles with these edges (k, EDGES) that got no more than a few samples: bool (k, TILE, TILE)."""
    return (edges[:, MASKS:, None].astype(np.int64) >> np.arange(TILE) & 1).astype(np.bool_)


def _part(film: Film, tile: int) -> Float32s:
    """The pixels of a tile of a film, as a view."""
    columns = -(-film.pixels.shape[1] // TILE)
    x = tile % columns * TILE
    y = tile // columns * TILE
    return film.pixels[y : y + TILE, x : x + TILE]
