"""Gouraud shading against an independent one: (12.25) at vertices, barycentric weights at pixels, in NumPy."""

from functools import cache

import numpy as np
import pytest
import trimesh

from obscurance.raytrace import BlinnPhong
from obscurance.raytrace.camera import Camera
from obscurance.raytrace.lights.sources import AmbientLight, DirectionalLight, PointLight
from obscurance.raytrace.mesh.mesh import Mesh
from obscurance.raytrace.renderer.render import render
from obscurance.raytrace.scene import Object, Scene, Shape
from obscurance.raytrace.settings import Settings

EYE, HALF, WIDTH, HEIGHT = np.array([0.4, -2.6, 0.7]), 1 / 3, 180, 180
LAMP, SUN = np.array([-2.0, -0.5, 3.0]), np.array([2.0, 0.3, -1.0]) / np.linalg.norm([2.0, 0.3, -1.0])
PAINT = {"k_d": (0.5, 0.4, 0.3), "k_s": 0.45, "exponent": 6, "k_a": 0.2}


def first_hits(vertices, faces):
    """Face (−1: none) and barycentrics of what the pixels' centres see: (h, w), (h, w, 3)."""
    forward = -EYE / np.linalg.norm(EYE)
    right = np.cross(forward, [0, 0, 1])
    right /= np.linalg.norm(right)
    up = np.cross(right, forward)
    x, y = np.meshgrid((2 * np.arange(WIDTH) + 1 - WIDTH) / HEIGHT, (HEIGHT - 2 * np.arange(HEIGHT) - 1) / HEIGHT)
    rays = (forward + HALF * (x[..., None] * right + y[..., None] * up)).reshape(-1, 3).T
    face, weights, nearest = np.full(x.size, -1), np.zeros((x.size, 3)), np.full(x.size, np.inf)
    for number, corners in enumerate(vertices[faces]):
        a, b, c = solved = np.linalg.inv((corners - EYE).T) @ rays  # t⁻¹ times the weights
        total = a + b + c
        closer = (a >= 0) & (b >= 0) & (c >= 0) & (total > 0) & (total * nearest > 1)
        face[closer], nearest[closer] = number, 1 / total[closer]
        weights[closer] = (solved[:, closer] / total[closer]).T
    return face.reshape(x.shape), weights.reshape(*x.shape, 3)


def vertex_light(points, normals):
    """(12.25) with a lamp, a sun and ambient light, (n, 3)."""
    total = 0.3 * PAINT["k_a"] * np.ones((len(points), 3))
    v = EYE - points
    v /= np.linalg.norm(v, axis=1, keepdims=True)
    away = LAMP - points
    distance = np.linalg.norm(away, axis=1, keepdims=True)
    for l, intensity in ((away / distance, 12 / distance**2), (np.broadcast_to(-SUN, points.shape), 0.8)):
        h = (l + v) / np.linalg.norm(l + v, axis=1, keepdims=True)
        cosine = (normals * l).sum(axis=1, keepdims=True)
        highlight = np.maximum(0, (normals * h).sum(axis=1, keepdims=True)) ** PAINT["exponent"]
        total += intensity * np.where(cosine > 0, np.array(PAINT["k_d"]) * cosine + PAINT["k_s"] * highlight, 0)
    return total


@cache
def expected(mesh, two_sided):
    face, weights = first_hits(mesh.vertices, mesh.faces)
    corners = mesh.vertices[mesh.faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    behind = (normal * (EYE - corners[:, 0])).sum(axis=1) < 0
    front = vertex_light(mesh.vertices, mesh.normals)
    back = vertex_light(mesh.vertices, -mesh.normals) if two_sided else np.full_like(front, 0.3 * PAINT["k_a"])
    lit = np.where(behind[face][..., None, None], back[mesh.faces[face]], front[mesh.faces[face]])
    return np.where(face[..., None] < 0, 0, (weights[..., None] * lit).sum(axis=2)), face


def ball(subdivisions, part=slice(None)):
    made = trimesh.creation.icosphere(subdivisions=subdivisions)
    return Mesh(made.vertices, made.faces[part], made.vertices)


BOWL = np.flatnonzero(trimesh.creation.icosphere(subdivisions=2).triangles_center @ [0.1, -0.8, 0.6] < 0.3)


@pytest.mark.parametrize("instanced", [False, True])
@pytest.mark.parametrize(
    ("mesh", "two_sided"),
    [(ball(1), False), (ball(2), False), (ball(1), "viewer"), (ball(2, BOWL), False), (ball(2, BOWL), "viewer")],
)
def test_vertices_are_lit_on_the_side_of_the_faces_that_are_seen(mesh, two_sided, instanced):
    """Also those just over the horizon, whose normals point away from the viewer: (12.25) has no n·v."""
    shape = Shape(mesh, BlinnPhong(**PAINT, two_sided=two_sided))
    behind_the_viewer = np.eye(4)
    behind_the_viewer[:3, 3] = 3 * EYE
    objects = (Object(shape), Object(shape, behind_the_viewer))[: 1 + instanced]
    lights = AmbientLight(intensity=0.3), PointLight(position=tuple(LAMP), intensity=12)
    scene = Scene(objects, (*lights, DirectionalLight(direction=tuple(SUN), intensity=0.8)))
    camera = Camera(tuple(EYE), (0, 0, 0), field_of_view=float(np.degrees(2 * np.arctan(HALF))))
    settings = Settings(width=WIDTH, height=HEIGHT, samples=1, shading="gouraud", shadows=False)
    frame = render(scene, camera, settings)
    picture, face = expected(mesh, two_sided)
    both = (face >= 0) & (frame.layers["object_id"][..., 0] == 1)
    assert both.mean() > 0.5
    assert (both != (face >= 0)).mean() < 1e-3  # a ray through an edge
    off = np.abs(frame.layers["beauty"][..., :3] - picture).max(axis=2)[both]
    assert (off > 1e-4).mean() < 1e-3
