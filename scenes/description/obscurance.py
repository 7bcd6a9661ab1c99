"""The scene of a description with its w(p): baked for the picture, or from a file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from obscurance import ao
from obscurance.ao.memory import vertex_bytes
from obscurance.raytrace import Camera, EnvironmentLight, SkyLight
from obscurance.raytrace.renderer.render import seen_vertices
from obscurance.raytrace.renderer.render_scene import release
from obscurance.raytrace.scene import Scene
from obscurance.raytrace.system.checks import available_memory

from ..formats.stored_w import read_w
from .description import SceneDescription

if TYPE_CHECKING:
    from obscurance.ao.execute.kept import Kept
    from obscurance.ao.execute.tracer import Progress


def with_obscurance(
    description: SceneDescription,
    threads: int | None = None,
    progress: Progress | None = None,
    checkpoint: Kept | None = None,
    cameras: Sequence[Camera] = (),
) -> tuple[Scene, ao.Bake | None]:
    """The scene with w(p) as `description.w_from` and `description.bake` ask, and the bake if there was one.

    Only vertices that the picture can show are baked; all else gets w = 1, and so do vertices of shapes with an
    occlusion texture. w from a file stands in place of such textures.

    Args: checkpoint: as `ao.bake` takes it. cameras: of several pictures, in place of the description's.
    """
    scene = description.scene
    # w that is known without a bake.
    if description.w_from == "off":
        return scene, None
    if isinstance(description.w_from, Path):  # of all vertices of the scene, or of its mesh files
        file_vertices, total = description.file_vertices()
        w = read_w(description.w_from, total, len(file_vertices), scales=description.scales)
        return scene.without_occlusion().with_obscurance(w[file_vertices] if len(w) == total else w), None
    if all(item.shape.occlusion for item in scene.objects):
        return scene, None
    # Bake what the camera can see of shapes without an occlusion texture.
    views = cameras or [description.camera]
    seen = np.any([seen_vertices(scene, view, description.settings, threads) for view in views], axis=0)
    textured = [item.shape.occlusion is not None for item in scene.objects]
    only = seen & ~np.repeat(textured, [len(item.shape.mesh.vertices) for item in scene.objects])
    # Without the geometry of the picture where both do not fit.
    mesh = scene.flattened()
    room = available_memory()
    options = description.bake
    if room is not None and vertex_bytes(len(mesh.vertices), len(mesh.faces), options.rays) > room:
        release(scene)  # the bake does not fit beside the geometry, which is built again for the picture
    baked = ao.bake(
        mesh,
        options.falloff,
        options.samples,
        options.seed,
        threads,
        description.settings.normals,
        progress=progress,
        only=only,
        denoise=False,
        checkpoint=checkpoint,
    )
    surrounded = any(isinstance(light, SkyLight | EnvironmentLight) for light in scene.lights)
    return scene.with_obscurance(baked.w, baked.bent_normals if surrounded else None), baked
