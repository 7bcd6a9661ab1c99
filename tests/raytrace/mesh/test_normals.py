"""Normals of functions, polygons and vertices."""

import numpy as np
import pytest

from raytrace.errors import OptionError
from raytrace.mesh.analytic_normals import (
    averaged_normal,
    corner_normals,
    implicit_normals,
    newell_normal,
    newell_plane,
    newell_sums,
    parametric_normals,
    plane_through,
)
from raytrace.mesh.normals import vertex_normals

BENT = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.5]])


def test_textbook_polygon():
    """The slide's averaged [.18, −.23, .96] has an arithmetic slip in its third corner normal."""
    np.testing.assert_allclose(newell_sums(BENT), [0.5, -0.5, 2], atol=1e-15)
    np.testing.assert_allclose(newell_normal(BENT), [0.235702, -0.235702, 0.942809], atol=5e-7)
    np.testing.assert_allclose(averaged_normal(BENT), [0.224949, -0.224949, 0.948049], atol=5e-7)
    np.testing.assert_allclose(corner_normals(BENT)[2], np.array([0.5, 0, 1]) / np.sqrt(1.25))


def test_planes_of_polygons_and_points():
    """The slide's polygon holds the origin: d = 0. Moved, both planes of its first three corners are one."""
    np.testing.assert_allclose(newell_plane(BENT), [0.5, -0.5, 2, 0], atol=1e-15)
    moved = np.add(BENT, [3, -2, 4])
    np.testing.assert_allclose(newell_plane(moved), [0.5, -0.5, 2, -10.5], atol=1e-12)
    for size in (1.0, 1e-30, 1e30):
        points = size * moved[1:]
        a, b, c, d = newell_plane(points / size)
        np.testing.assert_allclose(plane_through(points) * size, np.array([a, b, c]) / -d, rtol=1e-12)
        np.testing.assert_allclose(points @ plane_through(points), 1, rtol=1e-12)


@pytest.mark.parametrize("points", [BENT[:3], [[1, 1, 1], [2, 2, 3], [3, 3, 5]], np.zeros((3, 3)), BENT + 1])
def test_points_without_one_plane_clear_of_the_origin_are_refused(points):
    with pytest.raises(OptionError, match="points: expected three points"):
        plane_through(points)


def test_newell_is_indifferent_to_start_place_and_far_origins():
    for shift in range(4):
        np.testing.assert_allclose(newell_normal(np.roll(BENT, shift, axis=0)), newell_normal(BENT), atol=1e-15)
    np.testing.assert_allclose(newell_normal(BENT + 1e8), newell_normal(BENT), atol=1e-7)
    np.testing.assert_allclose(newell_normal(BENT[::-1]), -newell_normal(BENT))


def test_newell_of_concave_and_repeated_corners():
    arrow = np.array([[0, 0, 0], [2, 1, 0], [0, 2, 0], [0.5, 1, 0], [0.5, 1, 0]])
    np.testing.assert_allclose(newell_normal(arrow), [0, 0, 1])
    assert newell_sums(arrow)[2] == pytest.approx(2 * 1.5)
    assert np.isfinite(averaged_normal(arrow)).all()


def test_degenerate_polygons_have_no_normal():
    line = np.array([[0, 0, 0], [1, 1, 1], [2, 2, 2]])
    assert (newell_normal(line) == 0).all()
    assert (averaged_normal(np.zeros((3, 3))) == 0).all()
    with pytest.raises(OptionError, match="k ≥ 3"):
        newell_normal([[0, 0, 0], [1, 0, 0]])


def test_implicit_surfaces():
    rng = np.random.default_rng(0)
    p = rng.normal(size=(50, 3))
    sphere = p / np.linalg.norm(p, axis=1)[:, None] * 3
    np.testing.assert_allclose(implicit_normals(lambda x: np.sum(x * x, axis=-1) - 9, sphere), sphere / 3, atol=1e-9)
    plane = np.array([1, -2, 2.0])
    np.testing.assert_allclose(
        implicit_normals(lambda x: x @ plane + 7, p), np.broadcast_to(plane / 3, p.shape), atol=1e-9
    )


def test_parametric_surfaces():
    u, v = np.random.default_rng(0).uniform(0.2, 2.5, size=(2, 40))

    def torus(u, v):
        ring = 3 + np.cos(v)
        return np.stack([ring * np.cos(u), ring * np.sin(u), np.sin(v)], axis=-1)

    expected = np.stack([np.cos(v) * np.cos(u), np.cos(v) * np.sin(u), np.sin(v)], axis=-1)
    np.testing.assert_allclose(parametric_normals(torus, u, v), expected, atol=1e-8)


CORNER = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
FACES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2]])


@pytest.mark.parametrize("weighting", ["equal", "area", "angle"])
def test_vertex_normal_of_a_symmetric_corner(weighting):
    np.testing.assert_allclose(vertex_normals(CORNER, FACES, weighting)[0], -np.ones(3) / np.sqrt(3), atol=1e-15)


def test_only_angle_weights_survive_cutting_a_face():
    """(12.33): a face of the corner is cut in two through the vertex; the surface is the same."""
    cut = np.vstack([CORNER, [0.5, 0.5, 0]])
    faces = np.array([[0, 2, 4], [0, 4, 1], [0, 1, 3], [0, 3, 2]])
    expected = -np.ones(3) / np.sqrt(3)
    np.testing.assert_allclose(vertex_normals(cut, faces, "angle")[0], expected, atol=1e-15)
    assert np.abs(vertex_normals(cut, faces, "equal")[0] - expected).max() > 0.05


def test_area_weights_follow_the_larger_face():
    stretched = CORNER * [1, 1, 10]
    assert abs(vertex_normals(stretched, FACES, "area")[0, 2]) < abs(vertex_normals(stretched, FACES, "equal")[0, 2])


@pytest.mark.parametrize("weighting", ["equal", "area", "angle"])
def test_degenerate_faces_do_not_count(weighting):
    faces = np.vstack([FACES, [[0, 0, 1], [0, 1, 1]]])
    np.testing.assert_array_equal(vertex_normals(CORNER, faces, weighting), vertex_normals(CORNER, FACES, weighting))
