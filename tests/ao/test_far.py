"""What is far away: vertices that no face uses count for nothing, triangles cost what is near no digits."""

from __future__ import annotations

import numpy as np
import pytest
from meshes import soup_over_floor

from obscurance import ao
from obscurance.raytrace import Camera, DirectionalLight, Lambert, Mesh, Object, Scene, Settings, Shape, render
from obscurance.raytrace.mesh.warnings import outlier_warnings

pytestmark = pytest.mark.usefixtures("w_alone")

VERTICES, FACES = soup_over_floor(3, 6)
COUNT = len(VERTICES)
SAMPLES = 1 << 16
FALLOFFS = {"binary": ao.Binary(), "limited": ao.Binary(max_distance=2.0), "exponential": ao.Exponential(tau=1.0)}
NOWHERE = [[1e3, 0, 0], [0, -1e8, 0], [1e60, 1e60, 0], [0.5, 0.5, 0.5]]


def with_far_triangle(factor: float) -> Mesh:
    """The small mesh and a triangle under its floor, a hundredth as large as far away."""
    size = np.ptp(VERTICES, axis=0).max()
    corner = factor * size * np.array([0.6, 0.48, -0.64])
    away = corner + 0.01 * factor * size * np.eye(3)
    return Mesh(np.vstack([VERTICES, away]), np.vstack([FACES, [[COUNT, COUNT + 1, COUNT + 2]]]))


def with_unused_vertices() -> Mesh:
    return Mesh(np.vstack([VERTICES, NOWHERE]), FACES)


@pytest.fixture(scope="module")
def alone():
    return {name: ao.bake(Mesh(VERTICES, FACES), falloff, SAMPLES).w for name, falloff in FALLOFFS.items()}


@pytest.mark.parametrize("method", ["vertex", "surface"])
def test_unused_vertices_change_no_bit(method):
    meshes = Mesh(VERTICES, FACES), with_unused_vertices()
    one, other = (ao.bake(mesh, samples=64, method=method) for mesh in meshes)
    assert one.mu == other.mu
    assert np.array_equal(one.w, other.w[:COUNT])
    assert np.array_equal(one.error, other.error[:COUNT])
    assert (other.flags[COUNT:] == ao.Flag.UNREFERENCED).all()


@pytest.mark.parametrize("factor", [1e2, 1e4, 1e6, 1e8])
@pytest.mark.parametrize("name", FALLOFFS)
def test_a_far_triangle_leaves_what_is_near_right(alone, name, factor):
    w = ao.bake(with_far_triangle(factor), FALLOFFS[name], SAMPLES).w[:COUNT]
    assert np.abs(w - alone[name]).max() < 1e-3


def test_a_far_triangle_occludes():
    """One that is as large as far away takes the same share of the sky at every distance."""
    small, faces = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0.0]]), [[0, 1, 2], [1, 3, 2], [4, 5, 6]]
    roof = np.array([[-1, -1, 0.5], [2, -1, 0.5], [-1, 2, 0.5]])
    found = []
    for factor in (1e3, 1e5, 1e8):
        mesh = Mesh(np.vstack([small, factor * roof]), faces)
        found.append(ao.bake(mesh, ao.Binary(), SAMPLES).w[:4])
    assert found[0].max() < 0.9
    assert np.ptp(found, axis=0).max() < 3e-3  # seen from the corners of the small square, not from its middle


def picture(mesh: Mesh) -> np.ndarray:
    """From nearby, with shadows."""
    shape = Shape(mesh, Lambert(albedo=(0.8, 0.8, 0.8), two_sided="viewer"))
    scene = Scene((Object(shape),), (DirectionalLight(direction=(0.3, 0.2, -1.0), intensity=(3, 3, 3)),))
    camera = Camera((0.5, -6.0, 5.0), (0.0, 0.0, 0.0), (0, 0, 1))
    return render(scene, camera, Settings(width=64, height=48), layers=False).layers["beauty"][..., :3]


def test_far_geometry_leaves_pictures_right():
    wanted = picture(Mesh(VERTICES, FACES))
    assert wanted.max() > 0.1
    assert (wanted.min(axis=2) == 0).any()
    assert np.array_equal(picture(with_unused_vertices()), wanted)
    for factor in (1e2, 1e5, 1e8):
        apart = np.abs(picture(with_far_triangle(factor)) - wanted).max(axis=2)
        assert (apart > 1e-3).mean() <= 2 / apart.size  # at a shadow's edge


def test_a_radius_that_few_vertices_make_is_warned_of():
    assert outlier_warnings(Mesh(VERTICES, FACES)) == outlier_warnings(with_unused_vertices()) == []
    (line,) = outlier_warnings(with_far_triangle(1e4))
    assert "--half-distance" in line
