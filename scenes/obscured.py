"""A described scene with its w(p): baked for the picture, read from a file, or left open."""

from __future__ import annotations

import warnings
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

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
    settings = description.settings
    wanted = seen_vertices(scene, description.camera, settings, threads)
    made = ao.bake(
        scene.flattened(),
        options.falloff,
        options.samples,
        options.seed,
        threads,
        "angle" if settings.normals == "file" else settings.normals,
        progress,
        only=wanted,
    )
    return scene.with_obscurance(made.w), made


def _read(path: Path, count: int) -> npt.NDArray[np.float64]:
    """w (count,) of a `.npy` file, or of the array `w` of a `.npz` file. Only its header is read if that is another."""
    try:
        with _member(path) as file, warnings.catch_warnings():
            warnings.simplefilter("ignore")
            version = np.lib.format.read_magic(file)
            headers = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}
            shape, _, kind = headers[version](file)
            if shape != (count,):
                raise SceneError(path, "w", f"shape ({count},), one value a vertex of the scene", shape)
            if kind.kind not in "fiu" or kind.itemsize > 16:
                raise SceneError(path, "w", "numbers", kind)
            data = file.read(count * kind.itemsize)
            w = np.frombuffer(data, kind, count).astype(np.float64)
    except SceneError:
        raise
    except Exception as reason:  # NumPy's and zipfile's are of a dozen kinds
        raise SceneError(path, "content", "w as obscurance bake writes it", " ".join(str(reason).split())) from None
    if not ((w >= 0) & (w <= 1)).all():
        raise SceneError(path, "w", "values in [0, 1]", "others")
    return w


@contextmanager
def _member(path: Path) -> Iterator[IO[bytes]]:
    """The bytes of the array's `.npy` file, which a `.npz` file holds as a member."""
    if path.suffix.lower() != ".npz":
        with path.open("rb") as file:
            yield file
        return
    with zipfile.ZipFile(path) as archive, archive.open("w.npy") as member:
        yield member
