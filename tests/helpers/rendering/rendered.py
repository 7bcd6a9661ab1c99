"""Scenes of a few objects for the tests of the renderer."""

import numpy as np
import trimesh

from obscurance.raytrace import BlinnPhong, Lambert, Mesh, Phong
from obscurance.raytrace.camera import Camera
from obscurance.raytrace.lights.sources import AmbientLight, DirectionalLight, PointLight, SpotLight
from obscurance.raytrace.scene import Object, Scene, Shape
from obscurance.raytrace.settings import Settings
from obscurance.scenes.geometry import primitives


def grid(*arguments):
    return primitives.plane(*arguments).mesh


def box(*arguments):
    return primitives.box(*arguments).mesh


ONE = Settings(width=1, height=1, samples=1)


PLANE = Mesh([[-50, 0, 50], [50, 0, 50], [0, 0, -80]], [[0, 1, 2]])


def pixel(frame, layer="beauty"):
    assert frame.layers[layer].shape[:2] == (1, 1)
    return frame.layers[layer][0, 0]


def sphere(radius=1.0, centre=(0.0, 0.0, 0.0), subdivisions=4):
    made = trimesh.creation.icosphere(subdivisions=subdivisions, radius=radius)
    return Mesh(made.vertices + centre, made.faces)


def white(mesh, **fields):
    return Object(Shape(mesh, Lambert(albedo=0.8, **fields)))


def still_scene():
    """A floor, a ball and a box under four lights, with w from 0 to 1."""
    objects = (
        white(grid((-3, -3, -1), (6, 0, 0), (0, 6, 0), 6)),
        Object(Shape(sphere(), Phong(k_d=(0.5, 0.3, 0.2), k_s=0.4, emission=0.05))),
        Object(Shape(box((1.5, 0, -0.5), (0.6, 0.6, 1), 1), BlinnPhong(k_d=0.2, k_s=0.7))),
    )
    lights = (
        AmbientLight(intensity=0.2),
        PointLight(position=(2, -3, 4), intensity=30),
        DirectionalLight(direction=(1, 1, -2), intensity=0.5),
        SpotLight(position=(0, 0, 5), direction=(0, 0, -1), half_angle=17.2, intensity=20),
    )
    w = np.linspace(0, 1, sum(len(item.shape.mesh.vertices) for item in objects))
    return Scene(objects, lights, background=(0.1, 0.2, 0.3)).with_obscurance(w)


CAMERA = Camera((3, -6, 3), (0, 0, 0))


SMALL = Settings(width=96, height=64, samples=16)
