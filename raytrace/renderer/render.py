"""Render a scene to a frame: tiles on threads, each by one kernel."""

import time
from collections.abc import Callable
from functools import partial

import numpy as np

from ..camera import Camera
from ..embree import new_packet
from ..errors import OptionError, check_type
from ..image.formats import LAYERS
from ..image.frame import Frame
from ..image.texture import texture_bytes
from ..kernel.simd import WIDE
from ..lights.sources import EnvironmentLight, SkyLight
from ..mesh.opacity import opacity_bytes
from ..scene import Scene
from ..settings import Settings
from ..shade.camera_rays import place_camera
from ..shade.film import EDGES, FIRST, TILE
from ..shade.layout import FILM, LIGHTING, Film
from ..shade.transparency import mark_seen
from ..system.checks import check_memory
from ..system.threads import run_blocks, thread_count
from ..types import Bools, Int64s
from .geometry import shape_textures
from .render_job import RenderJob, whole_tiles
from .render_scene import build

Progress = Callable[[int, int], None]

_SHARES = 16  # of a picture for each thread: handing over takes as long as some tiles
_LONGEST = 256  # samples of tiles in a share: what Ctrl-C waits for
_EDGES = 4 * EDGES  # bytes of what tiles know of one another, each
_BASE, _VERTEX, _FACE, _POLYGON = 50 << 20, 64, 104, 104  # bytes, `rendering_bytes`


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
        layers: make every layer of `raytrace.image.formats.LAYERS`; False: beauty alone, a sixth of the memory.
        threads: None for all cores; the picture is the same bits for any number.
        progress: called with (tiles done, tiles in all).

    Raises:
        OptionError: `threads` out of range, something else than a scene, a camera and settings, or Gouraud shading,
            which looks no texture up for light, of a shape whose grain is a texture.
        InputError: a texture that a ray has met cannot be read.
        MemoryLimitError: the scene and the picture would not fit into memory.
        EmbreeError: Embree failed, out of memory for instance.
    """
    workers = thread_count(threads)
    start = time.perf_counter()
    picture = prepare_picture(scene, camera, settings, layers, workers)
    built = time.perf_counter()
    film = picture.film()
    picture.light_vertices(workers)
    _render_tiles(picture, film, workers, progress)
    return picture.frame(film, {"build": built - start, "render": time.perf_counter() - built})


def prepare_picture(
    scene: Scene, camera: Camera, settings: Settings | None, layers: bool, threads: int | None = None
) -> RenderJob:
    """The picture that `render` renders. Errors as there."""
    settings = Settings() if settings is None else settings
    for field, value, kind in (("scene", scene, Scene), ("camera", camera, Camera), ("settings", settings, Settings)):
        check_type(value, kind, "render", field, f"a raytrace.{kind.__name__}")
    if settings.shading == "gouraud" and any(item.shape.grain for item in scene.objects):
        raise OptionError("shading", "another one where a texture has the grain", "gouraud", "render")
    extended = any(getattr(light, "radius", 0) or getattr(light, "angle", 0) for light in scene.lights)
    if settings.shading == "gouraud" and extended:
        raise OptionError("shading", "another one where a light has a radius or an angle", "gouraud", "render")
    check_memory("scene", rendering_bytes(scene, settings, layers, threads), describe_work(scene, settings))
    return RenderJob(build(scene, settings.normals), camera, settings, layers)


def _render_tiles(picture: RenderJob, film: Film, threads: int, progress: Progress | None) -> None:
    """Render all tiles; then once more the pixels that need all samples for a neighbour in another tile."""
    tiles, done = picture.tiles, 0

    def advance(count: int) -> None:
        nonlocal done
        done += count
        if progress:
            progress(done, tiles)

    def work(begin: int, end: int, reopened_only: bool = False) -> None:
        """Render the tiles from `begin` to `end` and keep their counts of rays; arguments as of `RenderJob.render`."""
        finished.append(picture.render(film, picture.scratch(), (begin, end), reopened_only))

    finished: list[Int64s] = []
    share = max(min(tiles // (_SHARES * threads), _LONGEST // picture.style.samples), 1)
    run_blocks(tiles, share, work, threads, advance)
    if picture.adaptive:
        run_blocks(tiles, share, partial(work, reopened_only=True), threads)
    picture.counts += np.sum(finished, axis=0)


def rendering_bytes(scene: Scene, settings: Settings, layers: bool, threads: int | None = None) -> int:
    """Bytes that `render` takes at its peak beside the scene; fitted to measurements (`ao.memory`)."""
    meshes = {id(item.shape): item.shape.mesh for item in scene.objects}.values()
    vertices = sum(len(mesh.vertices) for mesh in meshes)
    faces = sum(len(mesh.faces) for mesh in meshes)
    _, _, wide, high = whole_tiles(settings)
    film = 4 * wide * high * (FILM if layers else LAYERS["beauty"])
    film += _EDGES * -(-wide // TILE) * -(-high // TILE) * (settings.samples > FIRST)
    surrounded = any(isinstance(light, SkyLight | EnvironmentLight) for light in scene.lights)
    vertex_count = sum(len(item.shape.mesh.vertices) for item in scene.objects)
    two_sided = any(item.shape.material.two_sided for item in scene.objects)
    lit = 8 * LIGHTING * vertex_count * (1 + (surrounded or two_sided)) * (settings.shading == "gouraud")
    bent = 12 * vertex_count * surrounded
    alpha = opacity_bytes([mesh.opacity for mesh in meshes if mesh.opacity])
    coloured = 12 * vertices * any(item.shape.colours is not None for item in scene.objects)
    textures = texture_bytes(shape_textures(item.shape for item in scene.objects), thread_count(threads))
    cut = sum(len(mesh.faces) for mesh in meshes if mesh.polygons is not None)
    surfaces = _VERTEX * vertices + _FACE * faces + _POLYGON * cut
    return _BASE + surfaces + lit + bent + coloured + alpha + film + textures


def describe_work(scene: Scene, settings: Settings) -> str:
    faces = sum(len(item.shape.mesh.faces) for item in scene.objects)
    return f"to render {faces:,} faces in {settings.width:,}×{settings.height:,} pixels"


def seen_vertices(scene: Scene, camera: Camera, settings: Settings, threads: int | None = None) -> Bools:
    """Vertices of `scene.flattened()` that a rendering with these settings may read: bool (n,). Errors as `render`."""
    geometry = build(scene, settings.normals).geometry
    view = place_camera(camera, settings, geometry.centre, geometry.scale)
    left, top, wide, high = whole_tiles(settings)
    seen = np.zeros(geometry.arrays.first_w[-1], np.bool_)
    whole_polygons = settings.shading == "gouraud" and len(geometry.arrays.polygons) > 0

    def work(begin: int, end: int) -> None:
        mark_seen(
            geometry.arrays,
            view,
            (left, left + wide),
            (top + begin, top + end),
            *new_packet(WIDE, True, geometry.hit_filter),
            seen,
            whole_polygons,
        )

    run_blocks(high, 8, work, thread_count(threads))
    if settings.normals != "file" or scene.shaded is scene:
        return seen
    # Of vertices that are shaded apart, those of the scene.
    counts = [len(item.shape.mesh.vertices) for item in scene.objects]
    rows = [
        item.shape.split[1] if item.shape.split else np.arange(n) for item, n in zip(scene.objects, counts, strict=True)
    ]
    of_scene = np.zeros(sum(counts), np.bool_)
    of_scene[(np.repeat(np.cumsum([0, *counts[:-1]]), [len(of) for of in rows]) + np.concatenate(rows))[seen]] = True
    return of_scene
