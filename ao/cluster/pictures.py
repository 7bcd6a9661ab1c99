"""Pictures whose tiles are rendered by the workers of a cluster: the pixels that one process makes."""

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np

from raytrace.camera import Camera
from raytrace.image.frame import Frame
from raytrace.renderer.remote_tiles import TileRows, edges_around, paste, render_numbered, reopened
from raytrace.renderer.render import Progress, prepare_picture
from raytrace.renderer.render_job import RenderJob
from raytrace.scene import Scene
from raytrace.settings import Settings
from raytrace.shade.film import TILE
from raytrace.system.threads import thread_count
from raytrace.types import Bools, Float32s, Int64s

from ..execute.work import Tables
from .session import ClusterSession


@dataclass(frozen=True, eq=False)
class Tiles:
    """Tiles of a picture to be rendered.

    Attributes:
        numbers: int64 (k,). rays: of a tile, about. channels: of its pixels. adaptive: whether edges are wanted.
        around: `edges_around` them, for those to be rendered again.
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

    def tables(self) -> Tables:
        return tuple(TileRows.empty(len(self), self.channels, self.adaptive))

    def writer(self, scene: RenderJob, tables: Tables) -> Callable[[int, int], None]:
        def write(first: int, last: int) -> None:
            around = None if self.around is None else self.around[first:last]
            render_numbered(scene, self.numbers[first:last], around, TileRows(*(table[first:last] for table in tables)))

        return write


def render_on(
    session: ClusterSession,
    scene: Scene,
    camera: Camera,
    settings: Settings | None = None,
    layers: bool = True,
    threads: int | None = None,
    progress: Progress | None = None,
) -> Frame:
    """`raytrace.render` by the workers of a session: the same bits.

    The scene goes to workers with its textures. Vertices are lit for Gouraud shading here.

    Raises: as `raytrace.render`, and as `ClusterSession.trace`.
    """
    workers, start = thread_count(threads), time.perf_counter()
    picture = prepare_picture(scene, camera, settings, layers)
    built = time.perf_counter()
    picture.light_vertices(workers)
    film, samples, channels = picture.film(), picture.style.samples, picture.channels

    def render_tiles(tiles: Tiles, marks: Bools | None = None) -> None:
        done = 0
        for first, last, (pixels, edges, counts) in session.rows(tiles, picture, workers):
            numbers = tiles.numbers[first:last]
            paste(film, numbers, pixels, None if marks is None else marks[numbers])
            if tiles.adaptive:
                film.edges[numbers] = edges
            picture.counts += counts.sum(axis=0)
            done += last - first
            if progress and marks is None:
                progress(done, picture.tiles)

    render_tiles(Tiles(np.arange(picture.tiles), TILE * TILE * samples, channels, picture.adaptive))
    if picture.adaptive:  # some pixels need all samples for a neighbour in another tile
        marks = reopened(picture, film)
        numbers = np.flatnonzero(marks.any(axis=(1, 2)))
        if len(numbers):
            rays = samples * int(np.count_nonzero(marks)) / len(numbers)
            render_tiles(Tiles(numbers, rays, channels, False, edges_around(picture, film, numbers)), marks)
    return picture.frame(film, {"build": built - start, "render": time.perf_counter() - built})
