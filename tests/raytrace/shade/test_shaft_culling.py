"""Shaft culling: never a ray that would have met something, and most of those that meet nothing."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from obscurance.raytrace import Lambert, Phong
from obscurance.raytrace.camera import Camera
from obscurance.raytrace.embree import TriangleScene, intersect
from obscurance.raytrace.kernel.arrays import aligned
from obscurance.raytrace.lights.sources import AmbientLight, DirectionalLight, PointLight, SpotLight, pack_lights
from obscurance.raytrace.mesh.mesh import Mesh
from obscurance.raytrace.renderer import render_scene
from obscurance.raytrace.renderer.render import render
from obscurance.raytrace.scene import Object, Scene, Shape
from obscurance.raytrace.settings import Settings
from obscurance.raytrace.shade.shaft_culling import cluster, merged, obstructed, pack_boxes
from obscurance.scenes.geometry import primitives

CAMERA = Camera((3, -6, 3), (0, 0, 0))


def ball(radius=1.0, centre=(0.0, 0.0, 0.0), subdivisions=3):
    made = trimesh.creation.icosphere(subdivisions=subdivisions, radius=radius)
    return Mesh(made.vertices + centre, made.faces)


def turned(angle):
    return trimesh.transformations.rotation_matrix(angle, (1, 2, 3))


def paint(mesh, matrix=None, **fields):
    material = Phong(k_d=0.5, k_s=0.4, exponent=8, **fields)
    return Object(Shape(mesh, material), np.eye(4) if matrix is None else matrix)


LIGHTS = (
    AmbientLight(intensity=0.2),
    PointLight(position=(2, -3, 4), intensity=30),
    PointLight(position=(-4, 0.5, -0.7), intensity=30),
    DirectionalLight(direction=(1, 1, -2), intensity=0.5),
    SpotLight(position=(0, 0, 5), direction=(0, 0, -1), half_angle=17.2, intensity=20),
)
FLOOR = primitives.plane((-3, -3, -1), (6, 0, 0), (0, 6, 0), 6).mesh
FINE = primitives.plane((-3, -3, -1), (6, 0, 0), (0, 6, 0), 0.2).mesh
BOX = primitives.box((1.5, 0, -0.5), (0.6, 0.6, 1), 0.2).mesh
STONE = Shape(ball(0.3), Lambert(albedo=0.7, two_sided=True))
PLACES = [
    trimesh.transformations.translation_matrix(p) @ turned(sum(p)) for p in [(1, 1, 0), (-1, 1, 1), (0, -2, -0.7)]
]
SCENES = {
    "floor": Scene((paint(FLOOR), paint(ball()), paint(BOX)), LIGHTS),
    "fine floor": Scene((paint(FINE), paint(ball(0.5)), paint(BOX)), LIGHTS),
    "tilted": Scene((paint(FLOOR, turned(0.4)), paint(ball(), turned(0.4)), paint(BOX, turned(0.4))), LIGHTS),
    "instances": Scene((paint(FLOOR, two_sided=True), *(Object(STONE, place) for place in PLACES)), LIGHTS),
}


def everywhere():
    boxes = aligned((1, 6, 16), np.float32)
    boxes[0, :3], boxes[0, 3:] = -1e3, 1e3
    return boxes


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("shading", ["constant", "gouraud", "phong"])
def test_the_picture_is_that_of_tracing_every_ray(name, shading, monkeypatch):
    settings = Settings(width=150, height=100, samples=1 if shading == "phong" else 4, shading=shading)
    scene = SCENES[name]
    frame = render(scene, CAMERA, settings)
    made = render_scene.build(scene)
    geometry = replace(made.geometry, arrays=made.geometry.arrays._replace(boxes=everywhere()))
    monkeypatch.setitem(render_scene._scenes, scene, replace(made, geometry=geometry))
    whole = render(scene, CAMERA, settings)
    for layer, values in whole.layers.items():
        np.testing.assert_array_equal(frame.layers[layer], values)
    assert whole.rays_skipped["unobstructed"] == 0
    assert frame.rays["shadow"] + frame.rays_skipped["unobstructed"] == whole.rays["shadow"]
    if name == "floor" and shading == "phong":
        assert frame.rays_skipped["unobstructed"] > 0.3 * whole.rays["shadow"]


def packed(light):
    kinds, rows = pack_lights([light])
    return kinds[0], rows[0]


def box_of(points):
    return tuple(tuple(np.float32(c) for c in corner) for corner in (points.min(axis=0), points.max(axis=0)))


NO_SHIFT = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


@pytest.mark.parametrize("kind", ["point", "near", "directional"])
def test_no_ray_of_an_unobstructed_shaft_meets_anything(kind):
    rng = np.random.default_rng(5)
    free = 0
    for _ in range(60):
        centres = rng.uniform(-0.8, 0.8, (40, 1, 3))
        triangles = (centres + rng.normal(scale=0.03, size=(40, 3, 3))).astype(np.float32)
        vertices, faces = triangles.reshape(-1, 3), np.arange(120, dtype=np.int32).reshape(40, 3)
        boxes = pack_boxes(cluster(vertices, faces, 1))
        embree = TriangleScene(vertices, faces)
        for _ in range(20):
            origins = (rng.uniform(-0.9, 0.9, 3) + rng.uniform(-0.1, 0.1, (64, 3))).astype(np.float32)
            if kind == "directional":
                light = DirectionalLight(direction=tuple(rng.normal(size=3)))
                towards = np.broadcast_to(-8.0 * packed(light)[1][6:9], origins.shape)
            else:
                place = rng.uniform(-1, 1, 3) * (3.0 if kind == "point" else 0.9)
                light = PointLight(position=tuple(place))
                towards = place - origins
            if not obstructed(boxes, 8.0, box_of(origins), NO_SHIFT, *packed(light)):
                free += 1
                assert not (intersect(embree, origins, towards, 1.0).face >= 0).any()
    assert free > 100


def test_a_floor_hides_no_light_from_what_stands_above_it():
    floor = np.float32([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    boxes = pack_boxes(cluster(floor, np.array([[0, 1, 2], [0, 2, 3]], np.int32), 1))
    points = np.float32([[0.1, 0.1, 1e-6], [0.2, 0.3, 2e-6]])
    above, below = PointLight(position=(0.3, 0.1, 0.5)), PointLight(position=(0.3, 0.1, -0.5))
    assert not obstructed(boxes, 8.0, box_of(points), NO_SHIFT, *packed(above))
    assert obstructed(boxes, 8.0, box_of(points), NO_SHIFT, *packed(below))
    assert not obstructed(boxes, 8.0, box_of(-points), NO_SHIFT, *packed(below))


def test_boxes_hold_all_faces():
    mesh = ball(subdivisions=4)
    vertices = mesh.vertices.astype(np.float32)
    for objects in (1, 10, 10_000):
        boxes = cluster(vertices, mesh.faces, objects)
        corners = vertices[mesh.faces]
        inside = (corners[:, None] >= boxes[:, None, 0]) & (corners[:, None] <= boxes[:, None, 1])
        assert inside.all(axis=(2, 3)).any(axis=1).all()
        assert len(boxes) <= max(1, 1200 // objects)


def test_very_many_boxes_become_boxes_around_them():
    corners = np.random.default_rng(3).uniform(0, 1, (20_000, 1, 3))
    boxes = np.concatenate([corners, corners + np.array([0.01, 0.02, 0.03])], axis=1)
    few = merged(boxes)
    assert len(few) < 5000
    low, high = np.ascontiguousarray(few.transpose(1, 2, 0))
    for part in np.split(boxes, 20):
        within = np.True_
        for axis in range(3):
            within = within & (part[:, :1, axis] >= low[axis]) & (part[:, 1:, axis] <= high[axis])
        assert within.any(axis=1).all()
    assert (few[:, 1] - few[:, 0]).max() < 0.12
    np.testing.assert_array_equal(merged(boxes[:1000]), boxes[:1000])


@pytest.mark.parametrize("size", [0.0, 1e-44, 1e-32, 1e-28])
def test_boxes_of_something_tiny(size):
    corners = np.array([[0, 0, 0], [size, 0, 0], [0, size, 0]], np.float32)
    boxes = cluster(corners, np.array([[0, 1, 2]], np.int32), 1)
    np.testing.assert_array_equal(boxes, [[corners.min(axis=0), corners.max(axis=0)]])
