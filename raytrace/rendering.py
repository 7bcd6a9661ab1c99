"""Render a scene: tiles on threads, each wholly a kernel's work."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from .camera import Camera
from .embree import LANES, aligned, new_packet
from .entries import AMBIENT, LIT, WIDTH
from .frame import LAYERS, Frame
from .lighting import BACKGROUND, BEHIND, BLACK, COUNTERS, CULLED, PRIMARY, RETIRED, SHADOW, UNREACHED
from .parallel import run_blocks, thread_count
from .sampling import mix, owen_sobol, seed_key
from .scene import Scene
from .settings import Settings
from .tile import CAPACITY, FILM, SUMS, TILE, light_vertices, render_tiles
from .view import View, mark_seen
from .world import World, build

Floats = npt.NDArray[np.float64]
Progress = Callable[[int, int], None]

_SHADINGS = ("constant", "gouraud", "phong", "quadratic")
_FORMS = ("off", "ambient", "book")
_SETS = 256
_TILES = 32  # handed to a kernel at once: handing over takes as long as a tile of background
_LIT = LIT + 1 - AMBIENT
_SKIPPED = {"behind": BEHIND, "unreached": UNREACHED, "black": BLACK, "culled": CULLED, "background": BACKGROUND}


def render(
    scene: Scene,
    camera: Camera,
    settings: Settings | None = None,
    layers: bool = True,
    threads: int | None = None,
    progress: Progress | None = None,
) -> Frame:
    """Cast rays, light what they hit, and return the picture.

    Args:
        layers: make every layer of `raytrace.frame.LAYERS`; False: beauty alone, a sixth of the memory.
        threads: None for all cores; the picture is the same bits for any number.
        progress: called with (tiles done, tiles in all).

    Raises:
        OptionError: `threads` out of range.
        EmbreeError: Embree failed, out of memory for instance.
    """
    settings = settings or Settings()
    workers = thread_count(threads)
    start = time.perf_counter()
    world = build(scene)
    built = time.perf_counter()
    renderer = _Renderer(world, scene, camera, settings, layers, workers)
    renderer.run(progress)
    counts = renderer.counts
    return Frame(
        layers=renderer.layers(),
        rays={"primary": int(counts[PRIMARY]), "shadow": int(counts[SHADOW])},
        rays_skipped={name: int(counts[column]) for name, column in _SKIPPED.items()}
        | {"primary_agreed": int(counts[RETIRED])},
        seconds={"build": built - start, "render": time.perf_counter() - built},
    )


def seen_vertices(
    scene: Scene, camera: Camera, settings: Settings, threads: int | None = None
) -> npt.NDArray[np.bool_]:
    """Which vertices of `scene.flattened()` a rendering with these settings may read: bool (n,).

    Errors as `render`.
    """
    world = build(scene)
    view = _view(world, camera, settings)
    left, top, wide, high = settings.crop or (0, 0, settings.width, settings.height)
    seen = np.zeros(len(world.geometry.w), np.bool_)

    def work(first: int, last: int) -> None:
        mark_seen(world.geometry, view, left, left + wide, top + first, top + last, *new_packet(), seen)

    run_blocks(high, 8, work, thread_count(threads))
    return seen


class _Renderer:
    """What the tiles of one picture share."""

    def __init__(
        self, world: World, scene: Scene, camera: Camera, settings: Settings, layers: bool, threads: int
    ) -> None:
        self.world, self.settings, self.threads = world, settings, threads
        self.view = _view(world, camera, settings)
        self.background = scene.background
        self.shading, self.form = _SHADINGS.index(settings.shading), _FORMS.index(settings.obscurance)
        self.left, self.top, wide, high = settings.crop or (0, 0, settings.width, settings.height)
        self.film = np.empty((high, wide, FILM if layers else LAYERS["beauty"]), np.float32)
        self.counts = np.zeros(COUNTERS, np.int64)
        self.vertex_light = np.zeros((0, _LIT))

    def run(self, progress: Progress | None) -> None:
        if self.settings.shading == "gouraud":
            self._light_all_vertices()
        high, wide, _ = self.film.shape
        columns = -(-wide // TILE)
        tiles = columns * -(-high // TILE)
        done = 0

        def advance(count: int) -> None:
            nonlocal done
            done += count
            if progress:
                progress(done, tiles)

        def work(first: int, last: int) -> None:
            scratch, settings, world = _Scratch(len(self.world.lights.kinds)), self.settings, self.world
            render_tiles(
                world.geometry, world.lights, self.view, self.left, self.top, first, last, settings.samples,
                self.shading, self.form, settings.shadows, settings.terminator, self.background, self.vertex_light,
                world.scale, scratch.packet, scratch.valid, scratch.entries, scratch.sums, scratch.todo,
                scratch.active, scratch.queue, scratch.light, self.film, scratch.counts,
            )  # fmt: skip
            finished.append(scratch.counts)

        finished: list[npt.NDArray[np.int64]] = []
        run_blocks(tiles, _TILES, work, self.threads, advance)
        self.counts += np.sum(finished, axis=0)

    def _light_all_vertices(self) -> None:
        world, view = self.world, self.view
        self.vertex_light = np.zeros((len(world.geometry.w), _LIT))
        ends = np.append(world.geometry.first_w[1:], len(world.geometry.w))
        finished: list[npt.NDArray[np.int64]] = []
        for item, (begin, end) in enumerate(zip(world.geometry.first_w, ends, strict=True)):

            def work(first: int, last: int, item: int = item, begin: int = int(begin)) -> None:
                scratch = _Scratch(len(world.lights.kinds))
                light_vertices(
                    world.geometry, world.lights, view.eye, view.forward, view.orthographic, self.form,
                    self.settings.shadows, item, begin + first, begin + last, scratch.packet, scratch.valid,
                    scratch.entries, scratch.active, scratch.queue, scratch.light, self.vertex_light, scratch.counts,
                )  # fmt: skip
                finished.append(scratch.counts)

            run_blocks(int(end - begin), 4 * CAPACITY, work, self.threads)
        self.counts += np.sum(finished, axis=0)

    def layers(self) -> dict[str, npt.NDArray[np.float32]]:
        """The film's channels by layer, as views."""
        found, first = {}, 0
        for name, channels in LAYERS.items():
            if first < self.film.shape[2]:
                found[name] = self.film[..., first : first + channels]
            first += channels
        return found


class _Scratch:
    """One thread's working memory."""

    def __init__(self, lights: int) -> None:
        self.packet, self.valid = new_packet()
        self.entries = aligned((CAPACITY, WIDTH), np.float64)
        self.sums = aligned((TILE * TILE, SUMS), np.float64)
        self.todo = np.zeros(TILE * TILE, np.int64)
        self.active = np.zeros(max(lights, 1), np.int64)
        self.queue = np.zeros(LANES, np.int64)
        self.light = np.zeros((LANES, 6))
        self.counts = np.zeros(COUNTERS, np.int64)


def _view(world: World, camera: Camera, settings: Settings) -> View:
    right, above, forward = camera.axes()
    position = np.array(camera.position)
    distance = camera.focus or float(np.linalg.norm(np.subtract(camera.target, position)))
    perspective = float(np.tan(np.radians(camera.field_of_view / 2)))
    return View(
        eye=(position - world.centre) * world.scale,
        right=right,
        above=above,
        forward=forward,
        half=perspective if camera.height is None else camera.height / 2 * world.scale,
        orthographic=camera.height is not None,
        lens=camera.aperture / 2 * world.scale,
        focus=distance * world.scale,
        width=settings.width,
        height=settings.height,
        offsets=_offsets(settings.samples, settings.seed),
        key=seed_key(settings.seed),
    )


def _offsets(samples: int, seed: int) -> Floats:
    """Places of a pixel's samples (sets, 4, samples): under a tent filter of radius 1 pixel, and on the unit lens.

    One sample a pixel falls on its centre.
    """
    key = seed_key(seed)
    x, y = (_tent(u) for u in owen_sobol(_SETS, samples, key))
    if samples == 1:
        x, y = np.zeros_like(x), np.zeros_like(y)
    u, v = owen_sobol(_SETS, samples, mix([key ^ np.uint32(0x5BD1E995)])[0])
    radius, angle = np.sqrt(u), 2 * np.pi * v
    return np.stack([x, y, radius * np.cos(angle), radius * np.sin(angle)], axis=1)


def _tent(u: Floats) -> Floats:
    """u in (0, 1) to a place with density 1 − |x| on (−1, 1)."""
    return np.where(u < 0.5, np.sqrt(2 * u) - 1, 1 - np.sqrt(2 - 2 * u))
