"""The picture of instances in docs/textures.md: `python -m benchmarks.pictures.instances`, after `make viewers`.

Three instances of one vase, in the open, beside a niche and in it, as three.js shows them: with the mean of their w,
with that of the first, with a texture each, and with the charts of everything packed onto one page.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np
import trimesh
from trimesh.visual.material import PBRMaterial

from benchmarks import ROOT
from benchmarks.pictures.browser import missing, shown
from obscurance import scenes
from obscurance.raytrace.image.write import write_image
from obscurance.scenes.bake.options import BakeOptions
from obscurance.scenes.bake.plan import plan_bake
from obscurance.scenes.bake.run import run
from obscurance.scenes.description.description import framing

TARGET = ROOT / "docs" / "textures" / "instances.png"
SIZE = 480, 220
PROFILE = [(0, 0), (0.5, 0), (0.75, 0.5), (0.7, 1), (0.35, 1.5), (0.3, 1.8), (0.5, 2), (0.4, 2), (0.2, 1.7), (0, 0.3)]
PLACES = (-2.7, 0, 0), (0.2, 0, 0), (2.7, 0, -0.2)
WAYS = {"mean": {}, "first": {"instances": "first"}, "own": {"instances": "own"}, "packed": {"uv": "pack"}}


def laid_out(mesh: trimesh.Trimesh, name: str, colour: tuple[float, float, float]) -> trimesh.Trimesh:
    """The mesh with a layout of its own, which fills the page, and smooth normals of its own."""
    uv, corners = scenes.unwrap((mesh.vertices, mesh.faces), 256), mesh.faces.ravel()
    visual = trimesh.visual.TextureVisuals(
        uv.reshape(-1, 2), PBRMaterial(name, baseColorFactor=(*colour, 1.0), metallicFactor=0.0)
    )
    faces, normals = np.arange(len(corners)).reshape(-1, 3), mesh.vertex_normals[corners]
    return trimesh.Trimesh(mesh.vertices[corners], faces, vertex_normals=normals, visual=visual, process=False)


def scene_of_vases() -> trimesh.Scene:
    vase = trimesh.creation.revolve(PROFILE, sections=48)
    vase.apply_transform(trimesh.transformations.rotation_matrix(-np.pi / 2, (1, 0, 0)))
    boxes = {"floor": ((8, 0.2, 3), (0, -0.1, 0.1)), "back": ((2.8, 2.4, 0.2), (2.6, 1.2, -1.3)),
             "left": ((0.2, 2.4, 2.2), (1.3, 1.2, -0.1)), "right": ((0.2, 2.4, 2.2), (3.9, 1.2, -0.1)),
             "roof": ((3.2, 0.2, 2.6), (2.6, 2.5, -0.2))}  # fmt: skip
    scene = trimesh.Scene({"vase": laid_out(vase, "clay", (0.8, 0.55, 0.45))})
    scene.graph.update("vase", matrix=trimesh.transformations.translation_matrix(PLACES[0]))
    for number, place in enumerate(PLACES[1:]):
        matrix = trimesh.transformations.translation_matrix(place)
        scene.graph.update(f"vase {number}", matrix=matrix, geometry="vase")
    for name, (extents, place) in boxes.items():
        box = trimesh.creation.box(extents)
        box.unmerge_vertices()  # flat
        box.apply_translation(place)
        scene.add_geometry(laid_out(box, "plaster", (0.8, 0.8, 0.75)), geom_name=name, node_name=name)
    return scene


def main() -> None:
    if reason := missing():
        sys.exit(reason)
    with tempfile.TemporaryDirectory() as name:
        source, files = Path(name) / "vases.glb", []
        source.write_bytes(scene_of_vases().export(file_type="glb"))
        for way, options in WAYS.items():
            files.append(Path(name) / f"{way}.glb")
            size = "1024" if way == "packed" else "256"
            names = {"mesh": [source], "output": files[-1]}
            given = BakeOptions(**names, occlusion="texture", size=size, falloff="binary", **options)
            for summary in run(plan_bake(given)):
                print(summary.text)
        camera = framing(scenes.load(source).mesh, None, *SIZE, "-0.1,0.3,1")
        pictures = [shown([file], camera, SIZE, ambient=0.9, background=(0.2, 0.25, 0.3))[0] for file in files]
    rows = [np.concatenate(pictures[first : first + 2], axis=1) for first in (0, 2)]
    write_image(TARGET, np.concatenate(rows, axis=0))


if __name__ == "__main__":
    main()
