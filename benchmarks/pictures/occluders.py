"""The strips of docs/bake.md: `python -m benchmarks.pictures.occluders`, part of `make pictures`.

w of a ring: alone, over a ground plane, and with a wall behind it, which occludes and is not shown. And w of a plate
with a ball and a ring on it: as it is, with only the plate receiving, with a ring that casts nothing, and without it.
And of the built-in temple: w, w of a narrower cone, thickness; and w behind the back of a wall that is not shown, which
occludes, then lets rays pass.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from benchmarks import ROOT
from benchmarks.pictures.half_distances import picture
from obscurance import ao
from obscurance.raytrace import Mesh
from obscurance.raytrace.image.write import write_image
from obscurance.scenes.asset.asset import Asset, Node
from obscurance.scenes.asset.objects import select_objects
from obscurance.scenes.asset.primitive import Primitive
from obscurance.scenes.geometry.builtin_shapes import temple
from obscurance.scenes.geometry.polyhedra import icosphere

TURN = trimesh.transformations.rotation_matrix(np.pi / 2, (1, 0, 0))
OPTIONS = ((), (), ()), (("plate",), (), ()), ((), ("!ring",), ()), ((), (), ("ring",))
"""Of each picture: what receives, casts and is excluded."""


def ground() -> list[np.ndarray]:
    made = trimesh.creation.torus(1.0, 0.3, 96, 48)
    made.apply_transform(TURN)
    ring = Mesh(made.vertices, made.faces, up="z")
    wall = Mesh([(-9, 0.4, -9), (9, 0.4, -9), (9, 0.4, 9), (-9, 0.4, 9)], [[0, 1, 2], [0, 2, 3]])
    occluders = [], [ao.ground(ring)], [ao.ground(ring), wall]
    return [picture(ring, ao.bake(ring, samples=1024, occluders=each).w, 1.0) for each in occluders]


def objects() -> list[np.ndarray]:
    plate = trimesh.creation.box((4.4, 3.2, 0.2)).subdivide_loop(5).apply_translation((0.5, 0, -0.1))
    ring = trimesh.creation.torus(0.8, 0.22, 96, 48).apply_translation((1.5, 0, 0.25))
    ball = icosphere(5)[0] * 0.8 + (-0.6, 0, 0.82), icosphere(5)[1]
    shapes = (plate.vertices, plate.faces), ball, (ring.vertices, ring.faces)
    primitives = tuple(Primitive.of(vertices, np.ravel(faces)) for vertices, faces in shapes)
    nodes = tuple(Node(name, (number,)) for number, name in enumerate(("plate", "ball", "ring")))
    source = Asset(Path("table.obj"), primitives, nodes, up="z")
    chosen = [select_objects(source, *options) for options in OPTIONS]
    bakes = [ao.bake(each.mesh, samples=256, only=each.only) for each in chosen]
    return [picture(replace(each.mesh, opacity=None), each.w, 1.0) for each in bakes]


def rays() -> list[np.ndarray]:
    mesh = temple()
    y, far = mesh.bounds[0][1] - 0.05 * mesh.radius, 9 * mesh.radius
    corners = [(-far, y, -far), (far, y, -far), (far, y, far), (-far, y, far)]
    wall: dict[str, Any] = {"occluders": [Mesh(corners, [[0, 1, 2], [0, 2, 3]])]}
    options = {}, {"spread": 60}, {"thickness": True}, wall, wall | {"back_faces": "ignore"}
    shown = []
    for each in options:
        falloff = ao.Exponential(half_distance="2%" if "thickness" in each else "40%")
        shown.append(picture(mesh, ao.bake(mesh, falloff, samples=256, **each).w))
    return shown


def main() -> None:
    for name, strip in (("ground", ground()), ("objects", objects()), ("rays", rays())):
        target = ROOT / "docs" / f"{name}.png"
        write_image(target, np.concatenate(strip, axis=1))
        print(target)


if __name__ == "__main__":
    main()
