"""`obscurance demo`: bake the built-in temple and render it, without w and with it."""

from pathlib import Path

import numpy as np

from obscurance import ao
from obscurance import raytrace as rt
from obscurance.raytrace.image.write import write_image
from obscurance.raytrace.system.checks import check_outputs, make_folder
from obscurance.raytrace.types import Float64s

from ..asset.asset import Asset
from ..bake.console import bake_summary
from ..formats.write import write
from ..geometry.builtin_shapes import temple
from ..show.progress import progress

_HALF = rt.Settings(width=720, height=560)
_GAP = 6  # pixels between the halves
_CAMERA = rt.Camera(position=(7.0, -14.6, 4.2), target=(0.1, 0.3, 1.4), field_of_view=29)
_KEY = rt.DirectionalLight(direction=(0.85, 0.5, -0.6), intensity=(2.9, 2.15, 1.35))
_SKY = rt.SkyLight(intensity=0.7, zenith=(0.72, 0.92, 1.25), horizon=(1.0, 0.97, 0.94), ground=(0.6, 0.5, 0.38))
_STONE = rt.OrenNayar(albedo=(0.82, 0.77, 0.7), sigma=0.4)
_GROUND = rt.Lambert(albedo=(0.5, 0.52, 0.53))
_ABOVE = (0.3, 0.42, 0.6)  # colour of the backdrop at the upper edge


def make_demo(folder: Path, quiet: bool) -> None:
    """Bake the temple with the default options; write the mesh with w, and a picture: left without, right with w."""
    make_folder(folder)
    mesh_target = folder / "temple.ply"
    image_target = folder / "temple.png"
    check_outputs({"temple.ply": mesh_target, "temple.png": image_target})
    with progress(quiet, "rays") as (advance,):
        mesh = temple()
        baked = ao.bake(mesh, progress=advance)
        shape = rt.Shape(mesh, _STONE)
        halves = (
            _render_half(rt.Object(shape)),
            _render_half(rt.Object(shape, w=baked.w, bent_normals=baked.bent_normals)),
        )
    write(mesh_target, baked, Asset.of(mesh))
    write_image(image_target, np.concatenate([halves[0], np.ones((_HALF.height, _GAP, 3)), halves[1]], axis=1))
    if not quiet:
        print(f"{bake_summary(baked, mesh_target)}\nimage: {image_target}")


def _render_half(temple: rt.Object) -> Float64s:
    """Half of the picture, linear RGB (h, w, 3): the temple on a wide ground before a backdrop that begins in the
    ground's colour."""
    far = 500.0
    corners = np.array([(x, y, -0.1) for x, y in ((-far, -far), (far, -far), (far, far), (-far, far))])
    ground = rt.Object(rt.Shape(rt.Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]])), _GROUND))
    frame = rt.render(rt.Scene((temple, ground), (_KEY, _SKY)), _CAMERA, _HALF, layers=False)
    pixels = frame.layers["beauty"].astype(np.float64)
    edge = int(np.argmax(pixels[:, 0, 3] == 1))
    above = np.maximum(1 - np.arange(_HALF.height) / edge, 0)[:, None, None]
    backdrop = pixels[edge, 0, :3] + above * (np.array(_ABOVE) - pixels[edge, 0, :3])
    picture: Float64s = pixels[..., :3] + (1 - pixels[..., 3:]) * backdrop
    return picture
