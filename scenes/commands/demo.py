"""`obscurance demo`: bake the built-in temple and render it."""

from __future__ import annotations

from pathlib import Path

import ao
from raytrace import AmbientLight, Camera, Lambert, Object, Scene, Settings, Shape, render
from raytrace.image.write import write_frame
from raytrace.system.outputs import check_outputs, make_folder

from ..formats.load import MeshFile
from ..geometry.temple import temple
from ..jobs.console import KERNELS_OF_BAKE, bake_summary, compiling, progress
from ..write_bake import write

_SETTINGS = Settings(width=960, height=640)
_BACKGROUND = (0.05, 0.05, 0.05)


def targets(folder: Path) -> tuple[Path, Path]:
    """The mesh and the image in a folder, which is made. Raises: OptionError, OutputError: they cannot be written."""
    make_folder(folder)
    mesh, picture = folder / "temple.ply", folder / "temple.png"
    check_outputs({"temple.ply": mesh, "temple.png": picture})
    return mesh, picture


def make_demo(folder: Path, quiet: bool = False) -> None:
    """Bake the temple with the default options; write the mesh with w, and an image of it in ambient light alone.

    Raises: OptionError, OutputError: the files cannot be written.
    """
    mesh_target, image_target = targets(folder)
    mesh = temple()
    with progress(quiet, "rays") as (advance,), compiling(KERNELS_OF_BAKE):
        baked = ao.bake(mesh, progress=advance)
    write(mesh_target, baked, MeshFile.of(mesh))
    white = Object(Shape(mesh, Lambert(albedo=(1, 1, 1))), w=baked.w)
    scene = Scene((white,), (AmbientLight(intensity=(1, 1, 1)),), _BACKGROUND)
    camera = Camera.framing(mesh, (0.8, -1.6, 0.55), aspect=_SETTINGS.width / _SETTINGS.height)
    write_frame(image_target, render(scene, camera, _SETTINGS, layers=False), {"scene": "temple"})
    if not quiet:
        print(bake_summary(baked, mesh_target))
        print(f"image: {image_target}")
