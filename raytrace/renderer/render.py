"""Render a scene to a frame: tiles on threads, each by one kernel."""

from __future__ import annotations

import itertools
import threading
import time
from collections.abc import Callable
from functools import partial
from typing import get_args

import numpy as np

from ..camera import Camera
from ..embree.packets import new_packet
from ..errors import OptionError, check_type
from ..image.frame import LAYERS, Frame
from ..image.texture import pack_textures, texture_bytes
from ..kernel.arrays import aligned
from ..kernel.simd import WIDE
from ..lights.environment import EnvironmentLight, SkyLight
from ..lights.layout import AMBIENT as AMBIENT_LIGHT
from ..scene import Scene
from ..settings import Settings, Shading
from ..shade import workspace
from ..shade.camera_rays import mark_seen, place_camera
from ..shade.film import EDGE, TILE
from ..shade.interaction import GOURAUD
from ..shade.records import Film, SceneArrays
from ..shade.shading_points import FILM, LIGHTING
from ..shade.tile import light_vertices, render_tiles
from ..shade.workspace import Scratch, Style, new_scratch
from ..system.memory import check_memory
from ..system.threads import run_blocks, thread_count
from ..types import Bools, Float32s, Int64s
from .geometry import shape_textures
from .render_scene import RenderScene, build
from .tiling import tile_count, whole_tiles

Progress = Callable[[int, int], None]

_SHADINGS = get_args(Shading)
_FORMS = ("off", "ambient", "book")
_SHARES = 16  # of a picture for each thread: handing over takes as long as some tiles
_LONGEST = 256  # samples of tiles in a share: what Ctrl-C waits for
_EDGES = 4 * 4 * TILE * EDGE  # bytes of what tiles know of one another, each
_BASE, _VERTEX, _FACE = 50 << 20, 64, 104  # bytes, `rendering_bytes`
_SKIPPED = {
    "behind": workspace.BEHIND,
    "unreached": workspace.UNREACHED,
    "black": workspace.BLACK,
    "culled": workspace.CULLED,
    "unobstructed": workspace.UNOBSTRUCTED,
    "background": workspace.BACKGROUND,
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
        OptionError: `threads` out of range, something else than a scene, a camera and settings, or Gouraud shading,
            which looks no texture up for light, of a shape whose grain is a texture.
        InputError: a texture that a ray has met cannot be read.
        MemoryLimitError: the scene and the picture would not fit into memory.
        EmbreeError: Embree failed, out of memory for instance.
    """
    settings = Settings() if settings is None else settings
    for field, value, kind in (("scene", scene, Scene), ("camera", camera, Camera), ("settings", settings, Settings)):
        check_type(value, kind, "render", field, f"a raytrace.{kind.__name__}")
    if settings.shading == "gouraud" and any(item.shape.grain for item in scene.objects):
        raise OptionError("shading", "another one where a texture has the grain", "gouraud", "render")
    check_memory("scene", rendering_bytes(scene, settings, layers), describe_work(scene, settings))
    workers = thread_count(threads)
    start = time.perf_counter()
    built_scene = build(scene, settings.normals)
    built = time.perf_counter()
    renderer = _Renderer(built_scene, scene, camera, settings, layers, workers)
    renderer.run(progress)
    counts = renderer.counts
    return Frame(
        layers=renderer.layers(),
        rays={"primary": int(counts[workspace.PRIMARY]), "shadow": int(counts[workspace.SHADOW_RAYS])},
        rays_skipped={name: int(counts[column]) for name, column in _SKIPPED.items()}
        | {"primary_agreed": int(counts[workspace.RETIRED])},
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
    film += _EDGES * tile_count(wide, high) * (settings.samples > workspace.FIRST)
    surrounded = any(isinstance(light, SkyLight | EnvironmentLight) for light in scene.lights)
    bent = 12 * sum(len(item.shape.mesh.vertices) for item in scene.objects) * surrounded
    textures = texture_bytes(shape_textures(item.shape for item in scene.objects))
    return _BASE + _VERTEX * vertices + _FACE * faces + 8 * LIGHTING * lit + bent + film + textures


def describe_work(scene: Scene, settings: Settings) -> str:
    """Description of a rendering, for messages about memory."""
    faces = sum(len(item.shape.mesh.faces) for item in scene.objects)
    return f"to render {faces:,} faces in {settings.width:,}×{settings.height:,} pixels"


def seen_vertices(scene: Scene, camera: Camera, settings: Settings, threads: int | None = None) -> Bools:
    """Vertices of `scene.flattened()` that a rendering with these settings may read: bool (n,).

    Errors as `render`.
    """
    geometry = build(scene, settings.normals).geometry
    view = place_camera(camera, settings, geometry.centre, geometry.scale)
    left, top, wide, high = whole_tiles(settings)
    seen = np.zeros(geometry.arrays.first_w[-1], np.bool_)

    def work(first: int, end: int) -> None:
        mark_seen(geometry.arrays, view, (left, left + wide), (top + first, top + end), *new_packet(WIDE, True), seen)

    run_blocks(high, 8, work, thread_count(threads))
    return seen


class _Renderer:
    """The state that all tiles of one picture share."""

    def __init__(
        self, built: RenderScene, scene: Scene, camera: Camera, settings: Settings, layers: bool, threads: int
    ) -> None:
        self.geometry, self.threads = built.geometry, threads
        unread = pack_textures([None] * len(self.geometry.textures))
        self.scene = SceneArrays(
            self.geometry.arrays, built.w, built.bent, built.lights, unread, np.zeros((0, LIGHTING))
        )
        self.reading = threading.Lock()
        self.view = place_camera(camera, settings, self.geometry.centre, self.geometry.scale)
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
        self.tiles = tile_count(wide, high)
        self.film = Film(
            pixels=np.empty((high, wide, FILM if layers else LAYERS["beauty"]), np.float32),
            left=left,
            top=top,
            edges=np.empty((self.tiles if settings.samples > workspace.FIRST else 0, 4, TILE, EDGE), np.float32),
            scale=self.geometry.scale,
        )
        x, y, width, height = settings.crop or (0, 0, settings.width, settings.height)
        self.crop = self.film.pixels[y - top : y - top + height, x - left : x - left + width]
        self.counts = np.zeros(workspace.COUNTERS, np.int64)

    def run(self, progress: Progress | None) -> None:
        if self.style.shading == GOURAUD:
            self._light_all_vertices()
        tiles, done = self.tiles, 0

        def advance(count: int) -> None:
            nonlocal done
            done += count
            if progress:
                progress(done, tiles)

        def work(first: int, end: int, again: bool = False) -> None:
            scratch = self._render(first, end, again)
            while scratch.missing.any():
                self._read(scratch.missing)
                scratch = self._render(first, end, again)
            finished.append(scratch.counts)

        finished: list[Int64s] = []
        share = max(min(tiles // (_SHARES * self.threads), _LONGEST // self.style.samples), 1)
        run_blocks(tiles, share, work, self.threads, advance)
        if len(self.film.edges) > 0:
            run_blocks(tiles, share, partial(work, again=True), self.threads)
        self.counts += np.sum(finished, axis=0)

    def _scratch(self) -> Scratch:
        return new_scratch(len(self.scene.lights.kinds), len(self.geometry.textures))

    def _render(self, first: int, end: int, again: bool) -> Scratch:
        """Render tiles; where the scratch has textures `missing`, they must be read before the tiles can be right.

        Args: again: only the pixels that their neighbours in other tiles reopen.
        """
        scratch = self._scratch()
        render_tiles(self.scene, self.view, self.style, self.film, scratch, (first, end), again)
        return scratch

    def _read(self, missing: Int64s) -> None:
        """Read the missing textures, and those already read again with them."""
        with self.reading:
            unread = self.scene.textures.depth == 0
            if ((missing > 0) & unread).any():
                wanted = (missing > 0) | ~unread
                chosen = [t if take else None for t, take in zip(self.geometry.textures, wanted, strict=True)]
                self.scene = self.scene._replace(textures=pack_textures(chosen))

    def _light_all_vertices(self) -> None:
        lights, first_w = self.scene.lights, self.scene.geometry.first_w
        shadows = self.style.shadows and (lights.kinds != AMBIENT_LIGHT).any()
        origins = self.geometry.vertex_origins if shadows else aligned((0, 3), np.float32)
        self.scene = self.scene._replace(lit_vertices=np.zeros((len(self.scene.w), LIGHTING)))
        finished: list[Int64s] = []
        for item, (begin, stop) in enumerate(itertools.pairwise(first_w.tolist())):

            def work(first: int, end: int, item: int = item, begin: int = begin) -> None:
                scratch = self._scratch()
                light_vertices(self.scene, self.view, self.style, scratch, origins, item, (begin + first, begin + end))
                finished.append(scratch.counts)

            run_blocks(stop - begin, 4 * workspace.PACKETS * WIDE, work, self.threads)
        self.counts += np.sum(finished, axis=0)

    def layers(self) -> dict[str, Float32s]:
        """The crop's channels by layer, as views."""
        found, first = {}, 0
        for name, channels in LAYERS.items():
            if first < self.crop.shape[2]:
                found[name] = self.crop[..., first : first + channels]
            first += channels
        return found
