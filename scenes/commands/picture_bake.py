"""Obscurance w(p) for a described scene: baked for its picture, read from a file, or left at 1."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

import ao
from ao.execute.tracer import Progress
from ao.memory import vertex_bytes
from raytrace import EnvironmentLight, SkyLight
from raytrace.renderer.render import seen_vertices
from raytrace.renderer.render_scene import release
from raytrace.scene import Scene
from raytrace.system.checks import available
from raytrace.types import Float64s

from ..description.description import SceneDescription
from ..formats.stored_w import read_w
from ..jobs.remote import cluster_checkpoint

if TYPE_CHECKING:
    from ao.cluster.session import ClusterSession


def with_obscurance(
    description: SceneDescription,
    threads: int | None = None,
    progress: Progress | None = None,
    session: ClusterSession | None = None,
) -> tuple[Scene, ao.Bake | None]:
    """The scene with w(p) as `description.w_from` and `description.bake` ask, and the bake if there was one.

    Only vertices that the picture can show are baked; all else gets w = 1, and so do vertices of shapes with an
    occlusion texture. w from a file stands in place of such textures.

    Args: threads, progress: as `ao.bake` takes them. session: workers who trace the rays.

    Raises:
        SceneError: the baked file cannot be read, or is another scene's.
        OptionError, EmbreeError: as `ao.bake`.
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
