"""Pictures whose tiles are rendered by the workers of a cluster: the pixels that one process makes."""

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np

from obscurance.raytrace.camera import Camera
from obscurance.raytrace.image.frame import Frame
from obscurance.raytrace.renderer.render import Progress, prepare_picture
from obscurance.raytrace.renderer.render_job import RenderJob, paste, retired_pixels
from obscurance.raytrace.scene import Scene
from obscurance.raytrace.settings import Settings
from obscurance.raytrace.shade.film import EDGES, TILE
from obscurance.raytrace.shade.layout import COUNTERS
from obscurance.raytrace.system.threads import thread_count
from obscurance.raytrace.types import Float32s, Int64s

from ..execute.work import Outputs, blocks
from .workers import Workers


@dataclass(frozen=True, eq=False)
class Tiles:
    """Tiles of a picture to be rendered.

    Attributes:
        numbers: int64 (k,). rays: of a tile, about. channels: of its pixels. adaptive: whether edges are wanted.
        around: edges of the tiles `beside` each, for those to be rendered again.
    """

    numbers: Int64s
    rays: float
    channels: int
    adaptive: bool
    around: Float32s | None = None
    block_rays: ClassVar = 1 << 15

    def __len__(self) -> int:
        return len(self.numbers)

    def __getitem__(self, rows: slice) -> Self:
        return replace(self, numbers=self.numbers[rows], around=None if self.around is None else self.around[rows])

    def tables(self) -> Outputs:
        pixels = np.zeros((len(self), TILE, TILE, self.channels), np.float32)
        edges = np.zeros((len(self), EDGES if self.adaptive else 0), np.float32)
        return pixels, edges, np.zeros((len(self), COUNTERS), np.int64)

    def writer(self, scene: RenderJob, tables: Outputs) -> Callable[[int, int], None]:
        def write(start: int, stop: int) -> None:
            around = None if self.around is None else self.around[start:stop]
            pixels, edges, counts = tables
            outputs = pixels[start:stop], edges[start:stop], counts[start:stop]
            scene.render_numbered(self.numbers[start:stop], around, outputs)

        return write


def render_on(
    workers: Workers,
    scene: Scene,
    camera: Camera,
    settings: Settings | None = None,
    layers: bool = True,
    threads: int | None = None,
    progress: Progress | None = None,
) -> Frame:
    """`raytrace.render` by workers: the same bits.

    The scene goes to workers with its textures. Vertices are lit for Gouraud shading here.

    Raises: as `raytrace.render`, and as `Workers.map`.
    """
    # The scene as workers get it, and the picture that their tiles go into.
    began = time.perf_counter()
    picture = prepare_picture(scene, camera, settings, layers)
    built = time.perf_counter()
    picture.light_vertices(thread_count(threads))
    film, samples, channels = picture.film(), picture.style.samples, picture.channels

    def render_tiles(tiles: Tiles) -> None:
        """Render tiles by workers and paste them on the film as they come, of tiles done again the reopened pixels
        alone."""
        done = 0
        is_second_pass = tiles.around is not None
        for (start, stop), (pixels, edges, counts) in workers.made(tiles, picture, blocks(tiles)):
            numbers = tiles.numbers[start:stop]
            reopened = retired_pixels(film.edges[numbers]) & ~retired_pixels(edges) if is_second_pass else None
            paste(film, numbers, pixels, reopened)
            if tiles.adaptive:
                film.edges[numbers] = edges
            picture.counts += counts.sum(axis=0)
            done += stop - start
            if progress and not is_second_pass:
                progress(done, picture.tiles)

    # All tiles, and once more those with pixels that turned out to need more samples.
    render_tiles(Tiles(np.arange(picture.tiles), TILE * TILE * samples, channels, picture.adaptive))
    if picture.adaptive:  # some pixels need all samples for a neighbour in another tile
        numbers = picture.reopened(film)
        if len(numbers):
            around = film.edges[picture.beside(numbers)]
            render_tiles(Tiles(numbers, TILE * samples, channels, True, around))
    return picture.frame(film, {"build": built - began, "render": time.perf_counter() - built})
