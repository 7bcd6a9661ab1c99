"""The picture of docs/textures.md: `python -m benchmarks.pictures.occlusion`, after `make viewers`.

The temple's w as an attribute, a ramp and vertex colours. Above as three.js shows the three files, below as our own
renderer shows no w, the ramp, and w as a factor of diffuse light too, which is what vertex colours come to.
"""

from __future__ import annotations

import sys
import tempfile
from math import pi
from pathlib import Path

import numpy as np

from benchmarks import ROOT
from benchmarks.pictures.browser import missing, shown
from obscurance import ao
from obscurance.raytrace import AmbientLight, DirectionalLight, Scene, Settings, render
from obscurance.raytrace.image.write import write_image
from obscurance.raytrace.types import Float32s
from obscurance.scenes.asset.asset import Asset
from obscurance.scenes.description.description import framing
from obscurance.scenes.description.mesh_scene import placed, read_source
from obscurance.scenes.formats.write import write
from obscurance.scenes.geometry.builtin_shapes import Temple

TARGET = ROOT / "docs" / "textures" / "viewers.png"
WIDTH, HEIGHT = 320, 240
AMBIENT, SUN, TOWARDS_SUN, BACKGROUND = 0.45, 0.5, (-0.5, -0.6, 0.7), (0.2, 0.25, 0.3)
FILES = {"attribute": {"occlusion": "none"}, "ramp": {}, "colours": {"colors": "rgb"}}
FORMS = ("off", "ambient", "ambient and diffuse")


def pictures(folder: Path) -> tuple[list[Float32s], list[Float32s]]:
    """Three pictures (height, width, 3) of three.js, and three of ours."""
    mesh = Temple(fineness=0.05).geometry().mesh
    baked = ao.bake(mesh, samples=1024)
    source = Asset.of(mesh)
    files = [folder / f"{name}.glb" for name in FILES]
    for file, options in zip(files, FILES.values(), strict=True):
        write(file, baked, source, **options)
    camera = framing(mesh, None, WIDTH, HEIGHT)
    lights = {"ambient": AMBIENT, "sun": SUN, "towards_sun": TOWARDS_SUN, "background": BACKGROUND}
    theirs = shown(files, camera, (WIDTH, HEIGHT), **lights)
    objects = [item for item, _ in placed(read_source(files[1]))]
    own_lights = (
        AmbientLight(intensity=(AMBIENT,) * 3),
        DirectionalLight(direction=tuple(-c for c in TOWARDS_SUN), intensity=(pi * SUN,) * 3),
    )
    ours = []
    for form in FORMS:
        settings = Settings(WIDTH, HEIGHT, obscurance=form, shadows=False)
        frame = render(Scene(objects, own_lights, BACKGROUND), camera, settings)
        ours.append(frame.layers["beauty"][..., :3])
    return theirs, ours


def main() -> None:
    if reason := missing():
        sys.exit(reason)
    with tempfile.TemporaryDirectory() as folder:
        theirs, ours = pictures(Path(folder))
    TARGET.parent.mkdir(exist_ok=True)
    write_image(TARGET, np.concatenate([np.concatenate(row, axis=1) for row in (theirs, ours)], axis=0))
    for name, one, other in zip(FILES, theirs, ours, strict=True):
        print(f"{name}: mean difference {np.abs(one - np.clip(other, 0, 1)).mean():.4f}")


if __name__ == "__main__":
    main()
