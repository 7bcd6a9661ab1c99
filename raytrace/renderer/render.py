"""Render a scene: tiles on threads, each wholly a kernel's work."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from functools import partial
from typing import get_args

import numpy as np
import numpy.typing as npt

from ..camera import Camera
from ..embree.packets import new_packet
from ..errors import check_type
from ..image.frame import LAYERS, Frame
from ..image.texture import Texture, pack_textures, texture_bytes
from ..kernel.arrays import aligned
from ..kernel.simd import WIDE
from ..lights.layout import AMBIENT as AMBIENT_LIGHT
from ..scene import Scene
from ..settings import Settings, Shading
from ..shade.camera_rays import mark_seen, place_camera
from ..shade.film import EDGE, TILE
from ..shade.interaction import GOURAUD
from ..shade.shading_points import FILM
from ..shade.texturing import Textures
from ..shade.tile import light_vertices, render_tiles
from ..shade.workspace import (
    BACKGROUND,
    BEHIND,
    BLACK,
    COUNTERS,
    CULLED,
    FIRST,
    PACKETS,
    PRIMARY,
    RETIRED,
    SHADOW_RAYS,
    UNOBSTRUCTED,
    UNREACHED,
    Style,
    new_scratch,
)
from ..system.memory import check_memory
from ..system.threads import run_blocks, thread_count
from .render_scene import World, build
from .tiling import tile_count, whole_tiles

Floats = npt.NDArray[np.float64]
Progress = Callable[[int, int], None]

_SHADINGS = get_args(Shading)
_FORMS = ("off", "ambient", "book")
_SHARES = 16  # of a picture for each thread: handing over takes as long as some tiles
_LONGEST = 256  # samples of tiles in a share: what Ctrl-C waits for
_LIT = 14  # columns that lighting makes, see `raytrace.shade.tile.lit_column`
_EDGES = 4 * 4 * TILE * EDGE  # bytes of what tiles know of one another, each
_BASE, _WORLD_VERTEX, _WORLD_FACE = 50 << 20, 64, 104  # bytes, `rendering_bytes`
_SKIPPED = {
    "behind": BEHIND,
    "unreached": UNREACHED,
    "black": BLACK,
    "culled": CULLED,
    "unobstructed": UNOBSTRUCTED,
    "background": BACKGROUND,
}


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
        layers: make every layer of `raytrace.image.frame.LAYERS`; False: beauty alone, a sixth of the memory.
        threads: None for all cores; the picture is the same bits for any number.
        progress: called with (tiles done, tiles in all).

    Raises:
        OptionError: `threads` out of range, or something else than a scene, a camera and settings.
        InputError: a texture that a ray has met cannot be read.
        MemoryLimitError: the scene and the picture would not fit into memory.
        EmbreeError: Embree failed, out of memory for instance.
    """
    settings = Settings() if settings is None else settings
    for field, value, kind in (("scene", scene, Scene), ("camera", camera, Camera), ("settings", settings, Settings)):
        check_type(value, kind, "render", field, f"a raytrace.{kind.__name__}")
    check_memory("scene", rendering_bytes(scene, settings, layers), describe_work(scene, settings))
    workers = thread_count(threads)
    start = time.perf_counter()
    world = build(scene, settings.normals)
    built = time.perf_counter()
    renderer = _Renderer(world, scene, camera, settings, layers, workers)
    renderer.run(progress)
    counts = renderer.counts
    return Frame(
        layers=renderer.layers(),
        rays={"primary": int(counts[PRIMARY]), "shadow": int(counts[SHADOW_RAYS])},
        rays_skipped={name: int(counts[column]) for name, column in _SKIPPED.items()}
        | {"primary_agreed": int(counts[RETIRED])},
        seconds={"build": built - start, "render": time.perf_counter() - built},
        background=scene.background,
    )


def rendering_bytes(scene: Scene, settings: Settings, layers: bool) -> int:
    """Bytes that `render` takes at its peak beside the scene; fitted to measurements (`ao.memory`)."""
    meshes = {id(item.shape): item.shape.mesh for item in scene.objects}.values()
    vertices, faces = sum(len(mesh.vertices) for mesh in meshes), sum(len(mesh.faces) for mesh in meshes)
    lit = sum(len(item.shape.mesh.vertices) for item in scene.objects) * (settings.shading == "gouraud")
    _, _, wide, high = whole_tiles(settings)
    film = 4 * wide * high * (FILM if layers else LAYERS["beauty"])
    film += _EDGES * tile_count(wide, high) * (settings.samples > FIRST)
    textures = texture_bytes(item.shape.texture for item in scene.objects)
    return _BASE + _WORLD_VERTEX * vertices + _WORLD_FACE * faces + 8 * _LIT * lit + film + textures


def describe_work(scene: Scene, settings: Settings) -> str:
    """What a rendering does, for messages about memory."""
    faces = sum(len(item.shape.mesh.faces) for item in scene.objects)
    return f"to render {faces:,} faces in {settings.width:,}×{settings.height:,} pixels"


def seen_vertices(
    scene: Scene, camera: Camera, settings: Settings, threads: int | None = None
) -> npt.NDArray[np.bool_]:
    """Which vertices of `scene.flattened()` a rendering with these settings may read: bool (n,).

    Errors as `render`.
    """
    world = build(scene, settings.normals, keep=False)  # what is baked for them makes another scene of it
    view = place_camera(camera, settings, world.centre, world.scale)
    left, top, wide, high = whole_tiles(settings)
    seen = np.zeros(len(world.geometry.w), np.bool_)

    def work(first: int, last: int) -> None:
        mark_seen(world.geometry, view, left, left + wide, top + first, top + last, *new_packet(WIDE, True), seen)

    run_blocks(high, 8, work, thread_count(threads))
    return seen


class _Renderer:
    """What the tiles of one picture share."""

    def __init__(
        self, world: World, scene: Scene, camera: Camera, settings: Settings, layers: bool, threads: int
    ) -> None:
        self.world, self.threads = world, threads
        self.view = place_camera(camera, settings, world.centre, world.scale)
        self.style = Style(
            settings.samples,
            _SHADINGS.index(settings.shading),
            _FORMS.index(settings.obscurance),
            settings.shadows,
            settings.terminator,
            layers,
            layers or settings.obscurance != "off",
            scene.background,
        )
        left, top, wide, high = whole_tiles(settings)
        self.corner = left, top
        x, y, self.width, self.height = settings.crop or (0, 0, settings.width, settings.height)
        self.margin = x - left, y - top
        self.film = np.empty((high, wide, FILM if layers else LAYERS["beauty"]), np.float32)
        self.counts = np.zeros(COUNTERS, np.int64)
        self.vertex_light = np.zeros((0, _LIT))
        self.textures = _pack([None] * len(world.textures))
        self.reading = threading.Lock()

    def run(self, progress: Progress | None) -> None:
        if self.style.shading == GOURAUD:
            self._light_all_vertices()
        high, wide, _ = self.film.shape
        tiles = tile_count(wide, high)
        self.edges = np.empty((tiles if self.style.samples > FIRST else 0, 4, TILE, EDGE), np.float32)
        done = 0

        def advance(count: int) -> None:
            nonlocal done
            done += count
            if progress:
                progress(done, tiles)

        def work(first: int, last: int, again: bool = False) -> None:
            wanted = np.zeros(len(self.world.textures), np.int64)
            counts = self._tiles(first, last, wanted, again)
            while wanted.any():
                self._read(wanted)
                wanted[:] = 0
                counts = self._tiles(first, last, wanted, again)
            finished.append(counts)

        finished: list[npt.NDArray[np.int64]] = []
        share = max(min(tiles // (_SHARES * self.threads), _LONGEST // self.style.samples), 1)
        run_blocks(tiles, share, work, self.threads, advance)
        if len(self.edges) > 0:
            run_blocks(tiles, share, partial(work, again=True), self.threads)
        self.counts += np.sum(finished, axis=0)

    def _tiles(self, first: int, last: int, wanted: npt.NDArray[np.int64], again: bool) -> npt.NDArray[np.int64]:
        """Render tiles and return their counts; `wanted` is set for textures to be read before they can be right.

        Args: again: only the pixels that their neighbours in other tiles recall.
        """
        world, scratch = self.world, new_scratch(len(self.world.lights.kinds))
        render_tiles(
            world.geometry, world.lights, self.textures, self.view, self.style, self.vertex_light, scratch,
            self.corner, (first, last), world.scale, wanted, self.film, self.edges, again,
        )  # fmt: skip
        return scratch.counts

    def _read(self, wanted: npt.NDArray[np.int64]) -> None:
        """Read the wanted textures, and those already read again with them."""
        with self.reading:
            missing = (wanted > 0) & (self.textures.depth == 0)
            if missing.any():
                keep = missing | (self.textures.depth > 0)
                self.textures = _pack([t if kept else None for t, kept in zip(self.world.textures, keep, strict=True)])

    def _light_all_vertices(self) -> None:
        geometry, lights = self.world.geometry, self.world.lights
        shadows = self.style.shadows and (lights.kinds != AMBIENT_LIGHT).any()
        origins = self.world.vertex_origins if shadows else aligned((0, 3), np.float32)
        self.vertex_light = np.zeros((len(geometry.w), _LIT))
        ends = np.append(geometry.first_w[1:], len(geometry.w))
        finished: list[npt.NDArray[np.int64]] = []
        for item, (begin, end) in enumerate(zip(geometry.first_w, ends, strict=True)):

            def work(first: int, last: int, item: int = item, begin: int = int(begin)) -> None:
                scratch, span = new_scratch(len(lights.kinds)), (begin + first, begin + last)
                light_vertices(geometry, lights, self.view, self.style, scratch, origins, item, span, self.vertex_light)
                finished.append(scratch.counts)

            run_blocks(int(end - begin), 4 * PACKETS * WIDE, work, self.threads)
        self.counts += np.sum(finished, axis=0)

    def layers(self) -> dict[str, npt.NDArray[np.float32]]:
        """The crop's channels by layer, as views."""
        found, first = {}, 0
        x, y = self.margin
        crop = self.film[y : y + self.height, x : x + self.width]
        for name, channels in LAYERS.items():
            if first < self.film.shape[2]:
                found[name] = crop[..., first : first + channels]
            first += channels
        return found


def _pack(textures: list[Texture | None]) -> Textures:
    packed = pack_textures(textures)
    return Textures(packed.texels, packed.levels, packed.first, packed.count, packed.wrap)
