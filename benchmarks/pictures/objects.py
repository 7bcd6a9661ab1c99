"""The strip of docs/bake.md: `python -m benchmarks.pictures.objects`, part of `make pictures`.

w of a plate with a ball and a ring on it: as it is, with only the plate receiving, with a ring that casts nothing, and
without the ring.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import trimesh

import ao
from benchmarks import ROOT
from benchmarks.pictures.half_distances import picture
from raytrace.image.write import write_image
from scenes.formats.load import MeshFile
from scenes.formats.objects import select_objects
from scenes.geometry.instances import Instance, flatten
from scenes.geometry.polyhedra import icosphere

TARGET = ROOT / "docs" / "objects.png"
OPTIONS = ((), (), ()), (("plate",), (), ()), ((), ("!ring",), ()), ((), (), ("ring",))
"""Of each picture: what receives, casts and is excluded."""


def main() -> None:
    plate = trimesh.creation.box((4.4, 3.2, 0.2)).subdivide_loop(5).apply_translation((0.5, 0, -0.1))
    ring = trimesh.creation.torus(0.8, 0.22, 96, 48).apply_translation((1.5, 0, 0.25))
    ball = icosphere(5)[0] * 0.8 + (-0.6, 0, 0.82), icosphere(5)[1]
    shapes = (plate.vertices, plate.faces), ball, (ring.vertices, ring.faces)
    placed = [Instance(name, *shape, up="z") for name, shape in zip(("plate", "ball", "ring"), shapes, strict=True)]
    source = MeshFile(Path("table.obj"), *flatten(placed, "table.obj"))
    chosen = [select_objects(source, *options) for options in OPTIONS]
    bakes = [ao.bake(each.mesh, samples=256, only=each.only) for each in chosen]
    shown = [picture(replace(each.mesh, opacity=None), each.w, 1.0) for each in bakes]
    write_image(TARGET, np.concatenate(shown, axis=1))
    print(TARGET)


if __name__ == "__main__":
    main()
