"""The strip of docs/profile.md: `python -m benchmarks.pictures.half_distances`, part of `make pictures`.

One bake of the built-in temple with a profile, and w of it at six half-distances: white clay under ambient light alone.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from benchmarks import ROOT
from obscurance import ao
from obscurance.raytrace import AmbientLight, Camera, Lambert, Mesh, Object, Scene, Shape, render
from obscurance.raytrace.image.write import write_image
from obscurance.scenes.geometry.builtin_shapes import temple
from obscurance.scenes.show.look import BACKGROUND, FIELD_OF_VIEW, clay_settings

TARGET = ROOT / "docs" / "profile" / "strip.png"
HALF_DISTANCES = "1%", "4%", "12%", "40%", "100%", "200%"
WIDTH, HEIGHT, ACROSS = 300, 220, 3


def picture(mesh: Mesh, w: np.ndarray, shown: float = 0.62) -> np.ndarray:
    """Linear RGB (HEIGHT, WIDTH, 3) of w (n,). Args: shown: of the angle that the whole mesh takes."""
    whole = Camera.framing(mesh, (0.7, -1, 0.3), aspect=WIDTH / HEIGHT, field_of_view=FIELD_OF_VIEW)
    camera = replace(whole, field_of_view=shown * FIELD_OF_VIEW)
    clay = Object(Shape(mesh, Lambert(albedo=0.8, two_sided="viewer")), w=w)
    lit = Scene((clay,), (AmbientLight(intensity=(1.0,) * 3),), BACKGROUND["dark"])
    return render(lit, camera, clay_settings(WIDTH, HEIGHT), layers=False).layers["beauty"][..., :3]


def main() -> None:
    mesh = temple()
    profile = ao.bake(mesh, samples=256, profile=True).profile
    assert profile is not None
    pictures = [picture(mesh, profile.at(each)) for each in HALF_DISTANCES]
    rows = [np.concatenate(pictures[k : k + ACROSS], axis=1) for k in range(0, len(pictures), ACROSS)]
    TARGET.parent.mkdir(exist_ok=True)
    write_image(TARGET, np.concatenate(rows, axis=0))
    print(TARGET, HALF_DISTANCES)


if __name__ == "__main__":
    main()
