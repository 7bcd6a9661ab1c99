"""A described scene with its w(p): baked for the picture, read from a file, or left open."""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np
import numpy.typing as npt

import ao
from ao.bake import Progress
from raytrace.errors import SceneError
from raytrace.rendering import seen_vertices
from raytrace.scene import Scene

from .description import SceneDescription


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
        return scene.with_obscurance(_read(options.source, count)), None
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


def _read(path: Path, count: int) -> npt.NDArray[np.float64]:
    """w (count,) of a `.npy` file, or of the array `w` of a `.npz` file."""
    try:
        with path.open("rb") as file:
            loaded = np.load(file, allow_pickle=False)
            w = np.asarray(loaded["w"] if path.suffix.lower() == ".npz" else loaded, np.float64)
    except (OSError, ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile) as reason:
        raise SceneError(path, "content", "w as obscurance bake writes it", " ".join(str(reason).split())) from None
    if w.shape != (count,):
        raise SceneError(path, "w", f"shape ({count},), one value a vertex of the scene", w.shape)
    if not ((w >= 0) & (w <= 1)).all():
        raise SceneError(path, "w", "values in [0, 1]", "others")
    return w
