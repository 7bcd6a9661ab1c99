"""The strip of docs/bake.md: `python -m benchmarks.pictures.rays`, part of `make pictures`.

The built-in temple: w, w of a narrower cone, thickness; and w behind the back of a wall that is not shown, which
occludes, then lets rays pass.
"""

from __future__ import annotations

from typing import Any

import numpy as np

import ao
from benchmarks import ROOT
from benchmarks.pictures.half_distances import picture
from raytrace import Mesh
from raytrace.image.write import write_image
from scenes.geometry.builtin_shapes import temple

TARGET = ROOT / "docs" / "rays.png"


def main() -> None:
    mesh = temple()
    y, far = mesh.bounds[0][1] - 0.05 * mesh.radius, 9 * mesh.radius
    corners = [(-far, y, -far), (far, y, -far), (far, y, far), (-far, y, far)]
    wall: dict[str, Any] = {"occluders": [Mesh(corners, [[0, 1, 2], [0, 2, 3]])]}
    options = {}, {"spread": 60}, {"thickness": True}, wall, wall | {"back_faces": "ignore"}
    shown = []
    for each in options:
        falloff = ao.Exponential(half_distance="2%" if "thickness" in each else "40%")
        shown.append(picture(mesh, ao.bake(mesh, falloff, samples=256, **each).w))
    write_image(TARGET, np.concatenate(shown, axis=1))
    print(TARGET)


if __name__ == "__main__":
    main()
