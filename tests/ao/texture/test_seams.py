"""Seams: found where an edge lies at two places, measured as lookups see them, and closed."""

import numpy as np
import pytest
import trimesh
from scipy.ndimage import binary_erosion
from uv_meshes import quads, rectangle, square

from obscurance import ao
from obscurance.ao.texture.seams import Lookups, Seams
from obscurance.raytrace import Mesh

pytestmark = pytest.mark.usefixtures("w_alone")

SIZE = 16, 16


def folded(apart):
    """A valley of two squares that meet at an edge, side by side on the page or `apart`."""
    left = rectangle((-1, 0, 0.15), (1, 0, -0.15), (0, 1, 0)), square(0.1, 0.1, 0.4, 0.4)
    right = rectangle((0, 0, 0), (1, 0, 0.15), (0, 1, 0)), square(0.4 + apart, 0.1, 0.7 + apart, 0.4)
    return quads(left, right)


def seams_of(uv, points, wraps=True):
    return Seams.find(np.asarray(uv, float), np.asarray(points), SIZE, wraps)


@pytest.mark.parametrize(("apart", "edges"), [(0.0, 0), (0.1, 1)])
def test_only_edges_at_two_places_are_seams(apart, edges):
    mesh, uv = folded(apart)
    texture = ao.bake_texture(mesh, uv, 64, ao.Binary(), samples=64)
    assert texture.facts.seam_edges == edges


def test_a_place_a_whole_page_aside_is_the_same_if_the_page_repeats():
    uv = np.array([[(2, 2), (8, 2), (8, 8)], [(8 + 16, 8), (2 + 16, 8), (2 + 16, 2)]], float)
    points = [[0, 1, 2], [2, 3, 0]]
    assert (seams_of(uv, points).edges, seams_of(uv, points, wraps=False).edges) == (0, 1)


def test_edges_of_three_faces_and_of_no_points_are_left_out():
    uv = np.random.default_rng(0).uniform(0, 16, (3, 3, 2))
    assert seams_of(uv, [[0, 1, 2], [1, 0, 3], [0, 1, 4]]).edges == 0
    assert seams_of(uv, [[-1, 1, 2], [1, -1, 3], [5, 6, 7]]).edges == 0
    assert seams_of(uv[:2], [[0, 1, 2], [1, 0, 3]]).edges == 1


def test_both_sides_are_sampled_at_the_same_points_of_the_edge():
    uv = np.array([[(2, 2), (8, 2), (5, 8)], [(3, 12), (3, 9), (9, 9)]], float)
    seams = seams_of(uv, [[0, 1, 2], [1, 0, 3]])
    x, y = np.meshgrid(np.arange(16) + 0.5, np.arange(16) + 0.5)
    left_x, right_y = seams.sides.values(x.ravel())[:, 0], seams.sides.values(y.ravel())[:, 1]
    assert np.allclose((left_x - 2) / 6, (right_y - 9) / 3)  # point 0 is at (2, 2) and at (3, 9)


@pytest.fixture(scope="module")
def ball():
    """A bumpy ball in 8 charts of different sizes and turns."""
    made = trimesh.creation.icosphere(subdivisions=3)
    bumps = 1 + 0.25 * np.sin(5 * made.vertices).prod(axis=1)
    mesh = Mesh(made.vertices * bumps[:, None], made.faces)
    centre = made.vertices[made.faces].mean(axis=1)
    octant = (centre > 0) @ [1, 2, 4]
    uv = np.empty((len(made.faces), 3, 2))
    for number in range(8):
        sign = np.array([1 if number >> axis & 1 else -1 for axis in range(3)])
        own = octant == number
        corners = made.vertices[made.faces[own]] * sign
        u, v = corners @ np.array([1, -1, 0]) / 2, corners @ np.array([1, 1, -2]) / 12**0.5
        turn = 0.5 * number
        c, s = np.cos(turn), np.sin(turn)
        scale = 0.17 + 0.02 * (number % 3)
        place = np.array([(number % 3 + 0.5) / 3, (number // 3 + 0.5) / 3])
        uv[own] = place + scale * np.stack([c * u - s * v, s * u + c * v], axis=-1)
    return mesh, uv


def test_closing_makes_both_sides_agree(ball):
    open_, closed = (ao.bake_texture(*ball, 256, samples=64, close_seams=close) for close in (False, True))
    assert open_.facts.seam_edges > 50
    assert open_.facts.seam_jump > 0.02
    assert closed.facts.seam_jump < 0.01
    assert closed.facts.seam_jump_before == open_.facts.seam_jump_before


def test_closing_moves_little_and_only_at_the_borders_of_charts(ball):
    open_, closed = (ao.bake_texture(*ball, 256, samples=64, close_seams=close) for close in (False, True))
    covered = open_.covered
    inside = binary_erosion(covered, np.ones((5, 5)))
    assert np.array_equal(open_.w[inside], closed.w[inside])
    assert np.abs(open_.w - closed.w)[covered].mean() < 1e-3
    assert closed.w.min() >= 0
    assert closed.w.max() <= 1


def test_no_texel_at_a_border_stands_out(ball):
    texture = ao.bake_texture(*ball, 256, samples=256)
    page = texture.w
    around = np.stack([np.roll(page, (y, x), (0, 1)) for y in (-1, 0, 1) for x in (-1, 0, 1)])
    mean = np.median(around, axis=0)
    border = np.zeros_like(texture.covered)
    for axis in (0, 1):
        for step in (-1, 1):
            border |= np.roll(texture.covered, step, axis) != texture.covered
    assert np.abs(page - mean)[border].max() < 0.1


@pytest.mark.parametrize("size", [16, 32, 64])
def test_lookups_are_as_true_with_closed_seams_as_with_open_ones(ball, size):
    """Against rays from points all over the surface; on coarse pages whatever closes seams fully is far off."""
    mesh, uv = ball
    rng = np.random.default_rng(0)
    face = rng.choice(len(mesh.faces), 2500, p=areas(mesh) / areas(mesh).sum())
    weights = rng.dirichlet(np.ones(3), len(face))
    points, axes = (
        np.einsum("pc,pci->pi", weights, rows[mesh.faces[face]]) for rows in (mesh.vertices, vertex_normals(mesh))
    )
    truth = ao.bake_points(mesh, points, axes, falloff=ao.Binary(), samples=1024, denoise=False).w
    places = np.einsum("pc,pci->pi", weights, uv[face]) * [size, -size] + [0, size]
    lookups = Lookups.at(places, (size, size), True)

    def error(close):
        page = ao.bake_texture(mesh, uv, size, ao.Binary(), samples=512, close_seams=close).w
        return np.sqrt(np.mean((lookups.values(page.ravel()) - truth) ** 2))

    assert error(True) < 1.005 * error(False)


def areas(mesh):
    first, second, third = mesh.vertices[mesh.faces].transpose(1, 0, 2)
    return np.linalg.norm(np.cross(second - first, third - first), axis=1) / 2


def vertex_normals(mesh):
    return np.asarray(trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).vertex_normals)
