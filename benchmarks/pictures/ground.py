"""The strip of docs/bake.md: `python -m benchmarks.pictures.ground`, part of `make pictures`.

w of a ring: alone, over a ground plane, and with a wall behind it, which occludes and is not shown.
"""

from __future__ import annotations

import numpy as np
import trimesh

import ao
from benchmarks import ROOT
from benchmarks.pictures.half_distances import picture
from raytrace import Mesh
from raytrace.image.write import write_image

TARGET = ROOT / "docs" / "ground.png"
TURN = trimesh.transformations.rotation_matrix(np.pi / 2, (1, 0, 0))


def main() -> None:
    made = trimesh.creation.torus(1.0, 0.3, 96, 48)
    made.apply_transform(TURN)
    ring = Mesh(made.vertices, made.faces, up="z")
    wall = Mesh([(-9, 0.4, -9), (9, 0.4, -9), (9, 0.4, 9), (-9, 0.4, 9)], [[0, 1, 2], [0, 2, 3]])
    occluders = [], [ao.ground(ring)], [ao.ground(ring), wall]
    shown = [picture(ring, ao.bake(ring, samples=1024, occluders=each).w, 1.0) for each in occluders]
    write_image(TARGET, np.concatenate(shown, axis=1))
    print(TARGET)


if __name__ == "__main__":
    main()
