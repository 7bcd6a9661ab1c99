"""High to low: w of a fine mesh on the texture of a coarse one."""

import numpy as np
import pytest
import trimesh
from uv_meshes import floor_and_wall, grid_charts, icosphere, quads, rectangle, square

from obscurance import ao
from obscurance.ao import closed_forms
from obscurance.ao.points.receivers import find_receivers
from obscurance.raytrace import Mesh, MeshError
from obscurance.raytrace.bvh.closest import closest_on_triangle, closest_points
from obscurance.raytrace.mesh.placement import Placement

FLOOR = rectangle((0, -2, 0), (4, 0, 0), (0, 4, 0)), square(0, 0, 1, 1)


@pytest.mark.parametrize("height", [-0.01, 0.01])
def test_w_is_that_of_the_fine_mesh_alone(height):
    mesh, uv = quads(FLOOR)
    falloff = ao.Exponential(tau=1.0)
    texture = ao.bake_texture(mesh, uv, 16, falloff, samples=1024, high=floor_and_wall(height), cage=0.05)
    exact = [closed_forms.wall(0.5 + (k + 0.5) / 4, tau=1.0) for k in range(16)]
    assert texture.facts.missed == 0
    assert np.abs(texture.w - exact).max() < 0.01


def test_a_mesh_onto_itself_is_the_mesh():
    mesh, uv = icosphere(2)
    bumps = Mesh(mesh.vertices * (1 + 0.3 * np.sin(4 * mesh.vertices).prod(axis=1))[:, None], mesh.faces)
    alone, onto = (ao.bake_texture(bumps, uv, 96, samples=512, high=high) for high in (None, bumps))
    assert np.array_equal(alone.covered, onto.covered)
    assert np.abs(alone.w - onto.w)[alone.covered].mean() < 0.005


def test_a_coarse_ball_shows_the_bumps_of_a_fine_one():
    fine = trimesh.creation.icosphere(subdivisions=4)
    bumps = Mesh(fine.vertices * (1 + 0.15 * np.sin(6 * fine.vertices).prod(axis=1))[:, None], fine.faces)
    mesh, uv = icosphere(2)
    texture = ao.bake_texture(mesh, uv, 128, ao.Binary(), samples=256, high=bumps, cage="20%")
    baked = ao.bake(bumps, ao.Binary(), samples=256)
    assert texture.facts.missed == 0
    assert abs(texture.w[texture.covered].mean() - baked.w.mean()) < 0.02
    assert texture.w[texture.covered].std() > 0.5 * baked.w.std()


def test_what_the_cage_misses_takes_the_closest_point_and_is_counted():
    mesh, uv = quads(FLOOR)
    half, _ = quads((rectangle((0, -2, 0.01), (2, 0, 0), (0, 4, 0)), square(0, 0, 1, 1)))
    texture = ao.bake_texture(mesh, uv, 16, samples=8, high=half, cage=0.05)
    assert texture.facts.missed == 16 * 8 * 4
    assert (texture.w == 1).all()


def test_a_cage_that_misses_everything():
    mesh, uv = quads(FLOOR)
    with pytest.raises(MeshError, match="expected some of it within the cage"):
        ao.bake_texture(mesh, uv, 16, samples=8, high=floor_and_wall(-1.0), cage="1%")


@pytest.mark.parametrize("p", np.random.default_rng(0).normal(size=(20, 3)) * 2)
def test_the_closest_point_of_a_triangle(p):
    triangle = np.array([[0, 0, 0], [1, 0.2, 0], [0.3, 1, 0.1]])
    away, u, v = closest_on_triangle(tuple(p), *map(tuple, triangle))
    near = trimesh.triangles.closest_point(triangle[None], p[None])[0]
    assert np.allclose((1 - u - v) * triangle[0] + u * triangle[1] + v * triangle[2], near, atol=1e-12)
    assert np.isclose(away, np.linalg.norm(near - p))


def test_the_fine_mesh_needs_no_texture_coordinates_and_the_coarse_one_does():
    mesh, _ = quads(FLOOR)
    with pytest.raises(MeshError, match="texture coordinates"):
        ao.bake_texture(mesh, grid_charts(7), 16, high=floor_and_wall())


def stages_of(mesh, uv, high):
    """The stages of a bake, and the error that it ends with."""
    stages = []
    with pytest.raises(MeshError) as refused:
        ao.bake_texture(mesh, uv, 32, samples=4, high=high, progress=lambda *now: stages.append(now[2]))
    return set(stages), str(refused.value)


@pytest.mark.parametrize(("times", "shift"), [(1, 2.5), (50, 55), (50, -55)])
def test_meshes_that_are_apart_are_refused_before_any_work(times, shift):
    mesh, uv = icosphere(2)
    stages, line = stages_of(mesh, uv, Mesh(mesh.vertices * times + np.array([0, shift, 0]), mesh.faces))
    assert "within the cage" in line
    assert not stages


def test_what_the_cage_misses_is_sought_in_small_steps_that_are_told():
    mesh, uv = icosphere(2)
    one = mesh.vertices[mesh.faces[0]]
    fine = Mesh(
        np.concatenate([mesh.vertices * 50, one]),
        np.append(mesh.faces, len(mesh.vertices) + np.arange(3)[None], axis=0),
    )
    told = []
    ao.bake_texture(mesh, uv, 64, samples=1, high=fine, progress=lambda *now: told.append(now))
    sought = np.array([now[:2] for now in told if now[2] == "closest points beyond the cage"])
    assert np.diff(sought[:, 0], prepend=0).max() <= 64
    assert sought[-1, 0] == sought[-1, 1]


@pytest.mark.parametrize("radius", [0.01, 0.3])
def test_closest_points_are_those_of_all_faces(radius):
    random = np.random.default_rng(4)
    mesh = Mesh(random.uniform(-1, 1, (120, 3)), random.integers(0, 40, (80, 3)) + np.arange(80)[:, None])
    receivers = find_receivers(mesh, placement := Placement.of(mesh))
    vertices = placement.vertices.astype(np.float64)
    points = random.uniform(-1.5, 1.5, (200, 3))
    groups = np.zeros(len(points), np.int64), np.zeros(len(receivers.faces), np.int64)
    corners = vertices[receivers.faces]
    distances = np.array([[closest_on_triangle(tuple(p), *map(tuple, face))[0] for face in corners] for p in points])
    done = []
    for farther in (None, done.append):
        surface = vertices, receivers.faces
        face, weights = closest_points(receivers.hierarchy.tree, surface, points, radius, groups, 1, farther)
        near = (distances.min(axis=1) <= radius) | (farther is not None)
        assert np.array_equal(face >= 0, near)
        at = np.einsum("kc,kci->ki", weights, corners[face])
        found = np.linalg.norm(at - points, axis=1)
        assert np.allclose(found[near], distances.min(axis=1)[near], atol=1e-6)
    assert sum(done) == len(points)
