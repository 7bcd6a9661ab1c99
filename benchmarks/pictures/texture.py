"""The picture of textures in docs/textures.md: `python -m benchmarks.pictures.texture`.

The temple, coarse and unwrapped: its covered texels, the whole page, and our render by that texture.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

from benchmarks import ROOT
from obscurance import ao
from obscurance.raytrace import AmbientLight, Scene, Settings, render
from obscurance.raytrace.image.write import write_image
from obscurance.raytrace.types import Float32s
from obscurance.scenes import unwrap
from obscurance.scenes.asset.asset import Asset
from obscurance.scenes.description.description import framing
from obscurance.scenes.description.mesh_scene import placed, read_source
from obscurance.scenes.formats.gltf.textured import textured_glb
from obscurance.scenes.geometry.builtin_shapes import Temple

TARGET = ROOT / "docs" / "textures" / "page.png"
PAGE, WIDTH, HEIGHT = 1024, 480, 360


def main() -> None:
    mesh = Temple(fineness=1.0).geometry().mesh
    uv = unwrap(mesh, PAGE)
    baked = ao.bake_texture(mesh, uv, PAGE, samples=256)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "temple.glb"
        file.write_bytes(textured_glb(Asset.of(mesh), [baked])[0])
        objects = [item for item, _ in placed(read_source(file))]
        scene = Scene(objects, (AmbientLight(intensity=(0.9,) * 3),), (0.2, 0.25, 0.3))
        picture = render(scene, framing(mesh, None, WIDTH, HEIGHT), Settings(WIDTH, HEIGHT)).layers["beauty"][..., :3]
    covered = np.where(baked.covered, baked.w, 0.0)
    write_image(TARGET, np.concatenate([_small(covered), _small(baked.w), picture], axis=1).clip(0, 1))
    print(TARGET, baked, baked.facts)


def _small(page: Float32s) -> Float32s:
    """Means over texels of a page, as grey of the picture's height."""
    rows = (np.arange(HEIGHT) * PAGE) // HEIGHT
    return np.repeat(page[np.ix_(rows, rows)][..., None], 3, axis=2)


if __name__ == "__main__":
    main()
