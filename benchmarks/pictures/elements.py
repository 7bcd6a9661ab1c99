"""More pictures of docs/gallery: `python -m benchmarks.pictures.elements`, part of `make pictures`.

w of vertices and of faces; a shell cut open, with all its faces and without those that nobody sees; clouds of few and
many points; and the shadows of a hard light and of two with an extent.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import trimesh

from benchmarks import ROOT
from benchmarks.pictures.half_distances import picture
from obscurance import ao, scenes
from obscurance.ao.points.discs import discs
from obscurance.raytrace import AmbientLight, Camera, Lambert, Mesh, Object, PointLight, Scene, Shape, render
from obscurance.raytrace.image.colour import decode_srgb
from obscurance.raytrace.image.write import write_image
from obscurance.raytrace.settings import Settings
from obscurance.scenes.geometry.builtin_shapes import temple
from obscurance.scenes.geometry.polyhedra import RawMesh, join

FOLDER = ROOT / "docs" / "gallery"
VIEW = 0.7, -1.0, 0.3  # of `picture`, from the middle of the mesh
SECTORS = 64  # of the shell, from −180° on
COUNTS = 40_000, 400_000
RADII = 0.0, 0.15, 0.5


def by_face(mesh: Mesh, w: np.ndarray, shown: float = 0.8) -> np.ndarray:
    """A picture of w (m,), one grey a face."""
    corners = mesh.vertices[mesh.faces].reshape(-1, 3)
    apart = Mesh(corners, np.arange(len(corners)).reshape(-1, 3), up="z")
    return picture(apart, np.repeat(w, 3), shown)


def faces() -> list[np.ndarray]:
    mesh = scenes.Temple(fineness=0.5).geometry().mesh
    return [picture(mesh, ao.bake(mesh, samples=1024).w, 0.8), by_face(mesh, ao.bake(mesh, samples=256, at="faces").w)]


def raw(made: trimesh.Trimesh) -> RawMesh:
    return made.vertices, made.faces


def shell() -> list[np.ndarray]:
    ring = trimesh.creation.torus(0.5, 0.14, 64, 32)
    parts = [trimesh.creation.icosphere(3, 0.25), trimesh.creation.cylinder(0.08, 1.5, sections=32), ring]
    outside = trimesh.creation.uv_sphere(count=[32, SECTORS + 1])
    mesh = Mesh(*join(map(raw, [outside, *parts])), up="z")
    falloff = ao.Exponential(half_distance="80%")
    baked = ao.bake(mesh, falloff, samples=256, at="faces", both_sides=True)
    middle = mesh.vertices[mesh.faces].mean(axis=1)
    sector = np.floor((np.arctan2(middle[:, 1], middle[:, 0]) / np.pi + 1) * SECTORS / 2)
    turn = 360 * (sector + 0.5) / SECTORS - 180
    is_outside = np.arange(len(mesh.faces)) < len(outside.faces)
    w = np.where(is_outside & (middle @ VIEW < 0), baked.below.w, baked.w)
    kept = ~is_outside | (np.abs(turn + 28) > 65)
    chosen = kept, kept & ~ao.unseen_faces(mesh).faces
    return [by_face(Mesh(mesh.vertices, mesh.faces[shown], up="z"), w[shown], 1.0) for shown in chosen]


def cloud() -> list[np.ndarray]:
    mesh = temple()
    solid = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    pictures = []
    for count in COUNTS:
        points, face = trimesh.sample.sample_surface(solid, count, seed=1)
        normals = solid.face_normals[face]
        w = ao.bake_points(None, points, normals, samples=256).w
        shape = discs(points, normals)[0]
        seen = Mesh(shape.vertices, shape.faces, up="z")
        corners = np.diff(np.unique(shape.faces[:, 0]), append=len(shape.vertices))  # of each disc
        greys = decode_srgb(np.repeat(w, corners))
        pictures.append(picture(seen, greys, 0.8))
    return pictures


def shadows() -> list[np.ndarray]:
    plate = Object(Shape(scenes.Plane(size=(8, 8)).geometry().mesh, Lambert(albedo=0.7)))
    box = trimesh.creation.box((0.5, 0.5, 1.4)).apply_translation((0, 0, 0.7))
    post = Object(Shape(Mesh(*raw(box), up="z"), Lambert(albedo=(0.75, 0.45, 0.3))))
    camera = Camera((2.2, -3.6, 2.6), (0.5, 0.3, 0.35), field_of_view=38.0)
    lamp = PointLight(position=(-2.0, -1.2, 3.0), intensity=14.0)
    settings = Settings(width=260, height=220, samples=256, obscurance="off")
    lit = [Scene((plate, post), (replace(lamp, radius=radius), AmbientLight(intensity=0.12))) for radius in RADII]
    return [render(scene, camera, settings, layers=False).layers["beauty"][..., :3] for scene in lit]


STRIPS = {"faces": faces, "shell": shell, "points": cloud, "soft_shadows": shadows}


def main() -> None:
    for name, make in STRIPS.items():
        write_image(FOLDER / f"{name}.png", np.concatenate(make(), axis=1))
        print(FOLDER / f"{name}.png", flush=True)


if __name__ == "__main__":
    main()
