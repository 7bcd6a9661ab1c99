"""Textures against closed forms: means over texels, and convex meshes open to the last texel."""

from functools import partial

import numpy as np
import pytest
import trimesh
from meshes import hills
from uv_meshes import grid_charts, icosphere, inward_cube, rectangle, square

from obscurance import ao
from obscurance.ao import closed_forms
from obscurance.raytrace import Mesh

pytestmark = pytest.mark.usefixtures("w_alone")

POINTS, WEIGHTS = np.polynomial.legendre.leggauss(4)
ALLOWED = 0.01


def mean_over(value, low, high):
    """The mean of value(x, y) over a rectangle, by Gauss's rule."""
    (x0, y0), (x1, y1) = low, high
    total = 0.0
    for a, p in zip(POINTS, WEIGHTS, strict=True):
        for b, q in zip(POINTS, WEIGHTS, strict=True):
            total += p * q / 4 * value((x0 + x1) / 2 + a * (x1 - x0) / 2, (y0 + y1) / 2 + b * (y1 - y0) / 2)
    return total


def test_a_closed_room_is_closed_everywhere():
    mesh, uv, _ = inward_cube(6)
    texture = ao.bake_texture(mesh, uv, 24, ao.Binary(), samples=64)
    assert (texture.w == 0).all()


def test_the_sides_of_a_cube_seen_from_inside():
    cells, tau = 8, 2.0
    mesh, uv, begins = inward_cube(cells)
    texture = ao.bake_texture(mesh, uv, 4 * cells, ao.Exponential(tau=tau), samples=1024, close_seams=False)

    def exact(a, b):
        return closed_forms.box((1 - a, 1 - b, a, b), 1.0, tau)

    step, quarter = 1 / cells, cells // 2
    truth = np.empty((cells, cells))
    for i in range(quarter):
        for j in range(i + 1):
            value = mean_over(exact, (i * step, j * step), ((i + 1) * step, (j + 1) * step))
            for a, b in ((i, j), (j, i)):
                truth[np.ix_([a, -1 - a], [b, -1 - b])] = value
    for x, y in begins:
        side = texture.w[y : y + cells, x : x + cells]
        assert texture.covered[y : y + cells, x : x + cells].all()
        assert np.abs(side - truth).max() < ALLOWED


def test_a_plane_under_a_sphere():
    radius, height, half = 0.5, 1.0, 2.0
    ball = trimesh.creation.icosphere(subdivisions=4, radius=radius)
    plane = rectangle((-half, -half, 0), (2 * half, 0, 0), (0, 2 * half, 0))
    vertices = np.concatenate([plane, ball.vertices + np.array([0, 0, height])])
    mesh = Mesh(vertices, np.concatenate([[[0, 1, 2], [0, 2, 3]], ball.faces + 4]))
    uv = np.zeros((len(mesh.faces), 3, 2))
    uv[:2] = square(0, 0, 1, 0.875)[[[0, 1, 2], [0, 2, 3]]]
    uv[2:] = grid_charts(len(ball.faces)) * [1, 0.1] + [0, 0.89]
    texture = ao.bake_texture(mesh, uv, 32, ao.Binary(), samples=1024, close_seams=False)

    def exact(x, y):
        return closed_forms.sphere(radius, height, float(np.hypot(x, y)))

    columns, rows = 2 * half / 32, 2 * half / 28
    for i in range(16):
        for j in range(0, 14, 3):
            low = -half + i * columns, -half + j * rows
            truth = mean_over(exact, low, (low[0] + columns, low[1] + rows))
            assert abs(texture.w[31 - j, i] - truth) < ALLOWED


def convex_meshes():
    cube = trimesh.creation.box()
    yield Mesh(cube.vertices, cube.faces), grid_charts(len(cube.faces))
    yield icosphere(1)
    yield icosphere(3)
    hull = trimesh.convex.convex_hull(np.random.default_rng(3).normal(size=(60, 3)))
    yield Mesh(hull.vertices, hull.faces), grid_charts(len(hull.faces))


@pytest.mark.parametrize("falloff", [ao.Binary(), ao.Exponential()], ids=["binary", "exponential"])
@pytest.mark.parametrize("mesh_and_uv", list(convex_meshes()), ids=["cube", "coarse sphere", "sphere", "hull"])
def test_convex_meshes_are_open_everywhere(mesh_and_uv, falloff):
    texture = ao.bake_texture(*mesh_and_uv, 64, falloff, samples=64)
    assert (np.round(texture.w * 255) == 255).all()
    assert (texture.w[texture.covered] == 1).all()


def test_a_large_page_begins_with_a_pilot_sample(monkeypatch):
    """Its patches are of texels alone, of those that stand for blocks of texels; here an eighth as many are large."""
    monkeypatch.setattr("obscurance.ao.estimate.rounds._PILOTED", 1 << 14)
    vertices, faces = hills(60)
    uv = (vertices[:, :2] / 2 + 0.5)[faces]
    stages = set()
    mesh = Mesh(vertices * [1, 1, 0.1], faces)
    texture = ao.bake_texture(mesh, uv, 530, tolerance=0.002, progress=lambda *now: stages.add(now[2]))
    assert "rays, pilot sample" in stages
    assert texture.rmse <= 0.002
    again = ao.bake_texture(mesh, uv, 530, tolerance=0.002, seed=1)
    assert np.sqrt(np.mean((texture.w - again.w) ** 2)) < np.sqrt(2) * 0.002


@pytest.fixture(scope="module")
def inside_cube():
    """A function that bakes the inside of a cube, and its w by many rays."""
    mesh, uv, _ = inward_cube(16)
    bake = partial(ao.bake_texture, mesh, uv, 64, ao.Exponential(tau=2.0), close_seams=False)
    return bake, bake(samples=4096, seed=9, denoise=False)


def test_to_a_tolerance_the_error_is_met(inside_cube):
    bake, reference = inside_cube
    tolerance = 0.01
    texture = bake(tolerance=tolerance)
    off = (texture.w - reference.w)[texture.covered]
    assert texture.rmse < 1.05 * tolerance
    assert np.sqrt(np.mean(off**2)) < 1.2 * tolerance
    assert texture.rays < reference.rays / 4


@pytest.mark.parametrize("denoise", [True, False])
def test_the_estimated_error_is_the_true_one(inside_cube, denoise):
    bake, reference = inside_cube
    texture = bake(samples=64, denoise=denoise)
    true = np.sqrt(np.mean((texture.w - reference.w)[texture.covered] ** 2))
    assert true / 1.5 < texture.rmse < 1.5 * true


def test_fewer_points_than_faces_that_touch_others():
    vertices, faces = hills(20)
    mesh = Mesh(np.concatenate([vertices, vertices]), np.concatenate([faces, faces + len(vertices)]))
    texture = ao.bake_texture(mesh, np.concatenate([vertices[:, :2]] * 2) / 4 + 0.5, 4, samples=8)
    assert texture.covered.sum() * 4 < len(mesh.faces)
    assert np.isfinite(texture.w).all()
