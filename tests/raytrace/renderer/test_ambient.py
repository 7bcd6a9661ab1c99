"""Ambient light alone: a picture of the baked w against an occlusion image made pixel by pixel, without the baker."""

import numpy as np
import trimesh

from obscurance import ao
from obscurance.raytrace import Camera, Lambert, Mesh, Object, Scene, Settings, Shape, render
from obscurance.raytrace.embree import TriangleScene, intersect
from obscurance.raytrace.lights.sources import AmbientLight
from obscurance.scenes.geometry import primitives

REACH = 1.0
RAYS, AT_ONCE = 4096, 32


def test_ambient_light_is_the_brute_force_occlusion_image():
    ball = trimesh.creation.icosphere(subdivisions=5, radius=0.7)
    meshes = (
        primitives.plane((-2, -2, -1), (4, 0, 0), (0, 4, 0), 0.04).mesh,
        primitives.box((0.9, 0.3, -0.45), (0.8, 0.8, 0.8), 0.04).mesh,
        Mesh(np.add(ball.vertices, (-0.5, -0.2, -0.2)), ball.faces),
    )
    white = tuple(Object(Shape(mesh, Lambert(albedo=1))) for mesh in meshes)
    scene = Scene(white, (AmbientLight(intensity=1),))
    whole = scene.flattened()
    scene = scene.with_obscurance(ao.bake(whole, ao.Binary(max_distance=REACH), samples=1024).w)
    camera = Camera((1.5, -4, 2), (0, 0, -0.5))
    layers = render(scene, camera, Settings(width=24, height=16, samples=1)).layers

    hit = layers["object_id"][..., 0] > 0
    rows, columns = np.nonzero(hit)
    directions = camera.directions((2 * columns + 1 - 24) / 16, 1 - (2 * rows + 1) / 16)
    normals = layers["normal"][hit].astype(float)
    points = camera.position + layers["depth"][..., 0][hit].astype(float)[:, None] * directions + 1e-4 * normals
    embree = TriangleScene(np.float32(whole.vertices), whole.faces)
    rng = np.random.default_rng(0)
    blocked = np.zeros(len(points))
    for _ in range(RAYS // AT_ONCE):
        ball_points = rng.normal(size=(AT_ONCE, *points.shape))
        ball_points /= np.linalg.norm(ball_points, axis=2, keepdims=True)
        directions = (normals + ball_points).reshape(-1, 3)
        hits = intersect(embree, np.tile(points, (AT_ONCE, 1)), directions, REACH / np.linalg.norm(directions, axis=1))
        blocked += (hits.face >= 0).reshape(AT_ONCE, -1).sum(axis=0)
    error = layers["beauty"][..., 0][hit] - (1 - blocked / RAYS)
    assert hit.sum() > 200
    assert np.sqrt(np.mean(error**2)) < 0.01
    assert abs(error.mean()) < 0.002
