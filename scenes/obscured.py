"""A described scene with its w(p): baked for the picture, read from a file, or left open."""

from __future__ import annotations

from pathlib import Path

import ao
from ao.bake import Progress
from raytrace.rendering import seen_vertices
from raytrace.scene import Scene

from .description import SceneDescription
from .stored_w import read_w


def obscured(
    description: SceneDescription, threads: int | None = None, progress: Progress | None = None
) -> tuple[Scene, ao.Bake | None]:
    """The scene with w(p) as `description.bake` asks, and the bake if there was one.

    Only vertices that the picture can show are baked; the others get w = 1.

    Args: threads, progress: as `ao.bake` takes them.

    Raises:
        SceneError: the baked file cannot be read, or is another scene's.
        OptionError, EmbreeError: as `ao.bake`.
    """
    scene, options = description.scene, description.bake
    if options.source == "off":
        return scene, None
    if isinstance(options.source, Path):
        count = sum(len(item.shape.mesh.vertices) for item in scene.objects)
        return scene.with_obscurance(read_w(options.source, count)), None
    wanted = seen_vertices(scene, description.camera, description.settings, threads)
    made = ao.bake(
        scene.flattened(),
        options.falloff,
        options.samples,
        options.seed,
        threads,
        progress=progress,
        only=wanted,
    )
    return scene.with_obscurance(made.w), made
