"""The faces of a bake as a file that workers load, named by its content.

A file and not data that the scheduler holds: what is scattered to workers is lost with them (distributed #3149, #5704).
"""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import NamedTuple

import numpy as np

from raytrace.system.atomic import atomic_write
from raytrace.types import Float32s, Int64s

from ..trace.ray_scene import RayScene


class SceneFile(NamedTuple):
    """Attributes: path: absolute. digest: hash of the vertices and faces in it, 32 hex digits."""

    path: str
    digest: str


def write_scene(folder: Path, name: str, scene: RayScene) -> SceneFile:
    """Write the faces of `scene` into `folder`, if they are not there yet.

    Args: name: of one bake, which removes the file in the end: another of the same mesh may still need its own.

    Raises:
        OutputError: the file cannot be written.
    """
    digest = _digest(scene.vertices, scene.faces)
    path = folder.absolute() / f".{name}-{digest}.scene"
    if not path.exists():
        with atomic_write(path) as file:
            np.savez(file, vertices=scene.vertices, faces=scene.faces)
    return SceneFile(str(path), digest)


def load_scene(file: SceneFile) -> RayScene:
    """The scene that was written.

    Raises:
        OSError: there is no such file here, or it cannot be read.
        ValueError: it holds something else.
    """
    with np.load(file.path, allow_pickle=False) as stored:
        vertices, faces = stored["vertices"], stored["faces"]
    if _digest(vertices, faces) != file.digest:
        raise ValueError("other content than its name says")
    return RayScene.of(vertices, faces)


def _digest(vertices: Float32s, faces: Int64s) -> str:
    digest = hashlib.blake2b(repr((vertices.shape, faces.shape)).encode(), digest_size=16)
    for array in (vertices, faces):
        digest.update(np.ascontiguousarray(array).data)
    return digest.hexdigest()
