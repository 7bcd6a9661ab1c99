"""Make the picture of a scene file: bake what it needs, render it, write it, report it."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import ao
from ao.execute.tracer import Progress
from ao.memory import vertex_bytes
from ao.report import SCHEMA_VERSION, calibration_facts, versions
from raytrace import EnvironmentLight, Frame, Settings, SkyLight
from raytrace.errors import ConflictError, printable
from raytrace.image.write import check_image_target, write_frame
from raytrace.renderer.render import describe_work, render, rendering_bytes, seen_vertices
from raytrace.renderer.render_scene import release
from raytrace.scene import Scene
from raytrace.system.checks import available, check_memory
from raytrace.types import Float64s

from ..description.description import SceneDescription
from ..falloffs import Scales
from ..formats.stored_w import read_w
from ..jobs.options import Record
from ..jobs.remote import cluster_checkpoint

if TYPE_CHECKING:
    from ao.cluster.session import ClusterSession

_SETTINGS = ("samples", "shading", "normals", "obscurance", "shadows", "seed")
PREVIEW = 4  # a preview's sides are that much shorter
PREVIEW_BAKE = 32  # and it bakes with that many rays a vertex


@dataclass(frozen=True)
class RenderedPicture:
    frame: Frame  # the layers that the file's format holds, and the renderer's counts
    bake: ao.Bake | None
    seconds: dict[str, float]  # bake, build, render, write

    def summary(self, target: Path, settings: Settings) -> str:
        """The line after a rendering: file, size, rays, times."""
        traced, skipped = sum(self.frame.rays.values()), sum(self.frame.rays_skipped.values())
        rays = f"{traced / 1e6:.1f} M rays traced and {skipped / 1e6:.1f} M skipped in {self.seconds['render']:.2f} s"
        baked = f", baked in {self.seconds['bake']:.2f} s" if self.bake else ""
        size = f"{settings.width}×{settings.height}"
        return f"{printable(str(target))}: {size}, {rays}; obscurance {settings.obscurance}{baked}"


def adjusted(description: SceneDescription, given: Record, scales: Scales | None) -> SceneDescription:
    """The description as the options have it; a preview: a quarter as wide and high, few rays. Raises: OptionError."""
    changes = {name: getattr(given, name) for name in ("crop", *_SETTINGS) if getattr(given, name) is not None}
    settings = replace(description.settings, **changes)
    w_from, bake, files = description.w_from, description.bake, description.files
    if settings.obscurance == "off" and given.baked is not None:
        raise ConflictError("baked", "does not go with", ("obscurance", "off"))
    if settings.obscurance == "off":
        w_from = "off"
    elif given.baked is not None:
        w_from, files = given.baked, (*files, given.baked)
    elif w_from == "off":
        w_from = "bake"
    if given.preview:
        settings = _quarter(settings)
        bake = replace(bake, samples=min(bake.rays, PREVIEW_BAKE))
    scene = description.scene if given.own_occlusion else description.scene.without_occlusion()
    if given.alpha == "ignore":
        scene = scene.without_alpha()
    if scales and not isinstance(w_from, Path):
        raise ConflictError("half_distance", "needs", "baked")
    scales = scales or (None if given.baked else description.scales)
    return replace(description, scene=scene, settings=settings, w_from=w_from, bake=bake, files=files, scales=scales)


def _quarter(settings: Settings) -> Settings:
    width, height = max(settings.width // PREVIEW, 1), max(settings.height // PREVIEW, 1)
    crop = settings.crop
    if crop:
        x, y = min(crop[0] // PREVIEW, width - 1), min(crop[1] // PREVIEW, height - 1)
        crop = x, y, min(max(crop[2] // PREVIEW, 1), width - x), min(max(crop[3] // PREVIEW, 1), height - y)
    return replace(settings, width=width, height=height, crop=crop, samples=min(settings.samples, 4))


def with_obscurance(
    description: SceneDescription,
    threads: int | None = None,
    progress: Progress | None = None,
    session: ClusterSession | None = None,
) -> tuple[Scene, ao.Bake | None]:
    """The scene with w(p) as `description.w_from` and `description.bake` ask, and the bake if there was one.

    Only vertices that the picture can show are baked; all else gets w = 1, and so do vertices of shapes with an
    occlusion texture. w from a file stands in place of such textures.
    """
    scene, options = description.scene, description.bake
    if description.w_from == "off":
        return scene, None
    if isinstance(description.w_from, Path):
        return scene.without_occlusion().with_obscurance(_stored(description, description.w_from)), None
    settings = description.settings
    seen = seen_vertices(scene, description.camera, settings, threads)
    textured = [item.shape.occlusion is not None for item in scene.objects]
    seen &= ~np.repeat(textured, [len(item.shape.mesh.vertices) for item in scene.objects])
    if all(textured):
        return scene, None
    mesh, room = scene.flattened(), available()
    if room is not None and vertex_bytes(len(mesh.vertices), len(mesh.faces), options.rays) > room:
        release(scene)  # the bake does not fit beside the geometry, which is built again for the picture
    normals = "angle" if settings.normals == "file" else settings.normals
    kept = cluster_checkpoint(session, False, None) if session else None
    bake = ao.bake(
        mesh, options.falloff, options.samples, options.seed, threads, normals, progress=progress, only=seen,
        denoise=False, checkpoint=kept,
    )  # fmt: skip
    surrounded = any(isinstance(light, SkyLight | EnvironmentLight) for light in scene.lights)
    return scene.with_obscurance(bake.w, bake.bent_normals if surrounded else None), bake


def _stored(description: SceneDescription, path: Path) -> Float64s:
    """w of all vertices of the scene, from a file that has one for each, or one for each vertex of its mesh files."""
    counts = [len(item.shape.mesh.vertices) for item in description.scene.objects]
    origins = description.origins or (None,) * len(counts)
    of_files = [origin.total if origin else count for origin, count in zip(origins, counts, strict=True)]
    w = read_w(path, sum(of_files), sum(counts), scales=description.scales)
    if len(w) != sum(of_files):
        return w
    parts = np.split(w, np.cumsum(of_files)[:-1])
    return np.concatenate([part[origin.of] if origin else part for origin, part in zip(origins, parts, strict=True)])


def make_picture(
    given: Record, description: SceneDescription, output: Path, progress: Sequence[Progress | None],
    session: ClusterSession | None,
) -> RenderedPicture:  # fmt: skip
    """Make the picture of a described scene and write it. Args: progress: of baking, and of rendering."""
    source, threads, half = given.scene, given.threads, given.half
    layers = check_image_target(output, half)
    needed = rendering_bytes(description.scene, description.settings, layers is None, threads)
    check_memory(source, needed, describe_work(description.scene, description.settings))
    start = time.perf_counter()
    scene, baked = with_obscurance(description, threads, progress[0], session)
    prepared = time.perf_counter()
    renderer = render
    if session:
        from ao.cluster.pictures import render_on

        renderer = partial(render_on, session)
    frame = renderer(scene, description.camera, description.settings, layers is None, threads, progress[1])
    rendered = time.perf_counter()
    names = ("samples", "seed", "shading", "normals", "obscurance")
    settings = {name: str(getattr(description.settings, name)) for name in names}  # nothing that changes between runs
    write_frame(output, frame, {"scene": source.name, "version": versions()["obscurance"], **settings}, half)
    seconds = {"bake": prepared - start, **frame.seconds, "write": time.perf_counter() - rendered}
    return RenderedPicture(frame, baked, seconds)


def render_report(
    source: Path, settings: Settings, picture: RenderedPicture, threads: int, warnings: Sequence[str] = ()
) -> dict[str, Any]:
    """The report of a rendering as JSON-ready values."""
    bake, frame = picture.bake, picture.frame
    beauty = frame.layers["beauty"]
    skipped = {f"bake_{reason}": count for reason, count in bake.rays_skipped.items()} if bake else {}
    return {
        "schema_version": SCHEMA_VERSION,
        "scene": str(source),
        "layers": {name: layer.shape[2] for name, layer in frame.layers.items()},
        "picture": {
            "covered": float(beauty[..., 3].mean()),
            "brightest": float(beauty[..., :3].max()),
            "clipped": float((beauty[..., :3] > 1).any(axis=2).mean()),
        },
        "settings": vars(settings) | {"threads": threads},
        "rays": frame.rays | ({"bake": bake.rays} if bake else {}),
        "rays_skipped": frame.rays_skipped | skipped,
        "seconds": picture.seconds,
        "rmse_estimate": bake.rmse if bake else None,
        "error_calibration": calibration_facts(bake.calibration) if bake else None,
        "warnings": list(warnings),
        "versions": versions(),
    }
