"""Vertex normals of renders, weighted by choice, and the directions that brushed materials follow."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from rendered import ONE, pixel, white

from obscurance.raytrace import Mesh
from obscurance.raytrace.camera import Camera
from obscurance.raytrace.renderer.render import render
from obscurance.raytrace.scene import Object, Scene, Shape
from obscurance.raytrace.settings import Settings
from obscurance.scenes.description.read import read_scene

RING = np.radians([0, 20, 130, 260])
SLOPE = np.column_stack([np.cos(RING), np.sin(RING), -0.15 * np.array([1, 1.2, 0.7, 1])])
RADII = np.array([1, 3, 0.5, 2])[:, None]
CORNERS = np.concatenate([[[0, 0, 0]], RADII * SLOPE])
FACES = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 1]])
OWN = np.tile([0.6, 0.0, 0.8], (5, 1))
"""A low pyramid of unlike faces; its apex is vertex 0."""


def expected(weighting):
    """The apex's normal, from (12.31), (12.32) and (12.33) as they are written."""
    total = np.zeros(3)
    for _, j, k in FACES:
        a, b = CORNERS[j], CORNERS[k]
        across = np.cross(a, b)
        angle = np.arccos(a @ b / np.linalg.norm(a) / np.linalg.norm(b))
        weight = {"equal": 1, "area": np.linalg.norm(across) / 2, "angle": angle}[weighting]
        total += weight * across / np.linalg.norm(across)
    return total / np.linalg.norm(total)


def apex(mesh, normals, shading="phong", place=None):
    camera = Camera((0, 0, 5), (0, 0, 0), (0, 1, 0), height=1e-7)
    item = white(mesh) if place is None else replace(white(mesh), transform=place)
    frame = render(Scene((item,)), camera, replace(ONE, normals=normals, shading=shading))
    return pixel(frame, "normal")


@pytest.mark.parametrize("own", [None, OWN])
@pytest.mark.parametrize("shading", ["gouraud", "phong", "quadratic"])
@pytest.mark.parametrize("weighting", ["angle", "area", "equal"])
def test_the_weighting_that_was_asked_for(weighting, shading, own):
    """Whatever normals the mesh brings."""
    found = apex(Mesh(CORNERS, FACES, own), weighting, shading)
    np.testing.assert_allclose(found, expected(weighting), atol=1e-5)
    others = {"angle", "area", "equal"} - {weighting}
    assert all(np.abs(expected(weighting) - expected(other)).max() > 0.002 for other in others)


def test_the_mesh_s_own_normals_are_the_default_and_angles_stand_in():
    assert Settings().normals == "file"
    np.testing.assert_allclose(apex(Mesh(CORNERS, FACES, OWN), "file"), OWN[0], atol=1e-5)
    np.testing.assert_allclose(apex(Mesh(CORNERS, FACES), "file"), expected("angle"), atol=1e-5)


def test_one_scene_with_several_normals():
    """What was built for one weighting is not taken for another."""
    scene, camera = Scene((white(Mesh(CORNERS, FACES, OWN)),)), Camera((0, 0, 5), (0, 0, 0), (0, 1, 0), height=1e-7)
    for weighting in ("file", "area", "equal", "file", "area"):
        found = pixel(render(scene, camera, replace(ONE, normals=weighting)), "normal")
        np.testing.assert_allclose(found, OWN[0] if weighting == "file" else expected(weighting), atol=1e-5)


def test_instances_have_them_too():
    shape = Shape(Mesh(CORNERS, FACES, OWN), white(Mesh(CORNERS, FACES)).shape.material)
    far = trimesh.transformations.translation_matrix((9, 0, 0))
    camera = Camera((0, 0, 5), (0, 0, 0), (0, 1, 0), height=1e-6)
    frame = render(Scene((Object(shape), Object(shape, far))), camera, replace(ONE, normals="area"))
    np.testing.assert_allclose(pixel(frame, "normal"), expected("area"), atol=1e-5)


def test_grain_in_scene_files(tmp_path):
    made = []
    for grain in ("[1, 0, 0]", "[0, 0, 1]"):
        (tmp_path / "a.toml").write_text(
            "[camera]\nposition = [0, -3, 1]\ntarget = [0, 0, 0]\n[render]\nwidth = 60\nheight = 40\nsamples = 4\n"
            '[obscurance]\nform = "off"\n[[lights]]\nlight = "directional"\ndirection = [0.3, 1, -0.6]\n'
            f'[[objects]]\nbuiltin = "sphere"\nmaterial = {{ preset = "brushed_aluminium", grain = {grain} }}\n'
        )
        described = read_scene(tmp_path / "a.toml")
        made.append(render(described.scene, described.camera, described.settings).layers["beauty"])
    assert np.abs(made[0] - made[1]).max() > 0.05
