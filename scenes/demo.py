"""The demonstration: bake the temple and take its picture."""

from __future__ import annotations

from pathlib import Path

import ao
from ao.bake import Progress
from raytrace.camera import Camera
from raytrace.image import write_image
from raytrace.picture import picture

from .load import MeshFile
from .temple import temple
from .write import write

TARGETS = ("temple.ply", "temple.png")
_WIDTH, _HEIGHT = 960, 640
_BACKGROUND = 0.05


def make(mesh_target: Path, picture_target: Path, progress: Progress | None = None) -> ao.Bake:
    """Bake the temple with the default options; write the mesh with w, and a picture of w as a grey value."""
    mesh = temple()
    baked = ao.bake(mesh, progress=progress)
    write(mesh_target, baked, MeshFile.of(mesh))
    camera = Camera.framing(mesh, (0.8, -1.6, 0.55), aspect=_WIDTH / _HEIGHT)
    write_image(picture_target, picture(mesh, baked.w, camera, _WIDTH, _HEIGHT, background=_BACKGROUND))
    return baked
