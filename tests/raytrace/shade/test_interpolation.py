"""Interpolation over a triangle, against the textbook's example and its own definitions."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from obscurance.raytrace.shade.interaction import phong_normal, quadratic_normal

P = [(2.0, 2.0, 1.0), (6.0, 2.0, 1.0), (4.0, 5.0, 1.0)]
NORMALS = [tuple(np.array(n) / np.linalg.norm(n)) for n in ([-1, -1, 1], [1, 0, 0], [0, 1, 1])]


unit_normals = st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda a: np.linalg.norm(a) > 0.1).map(
    lambda a: tuple(np.array(a) / np.linalg.norm(a)))  # fmt: skip
points = st.tuples(*[st.floats(-5, 5)] * 3)
fractions = st.floats(0, 1)


@settings(deadline=None, max_examples=200, derandomize=True)
@given(points, points, points, unit_normals, unit_normals, unit_normals, fractions)
def test_on_an_edge_the_quadratic_normal_is_the_paper_s(p0, p1, p2, n0, n1, n2, s):
    w = np.subtract(p1, p0)
    if np.linalg.norm(w) < 1e-3:
        return
    a = 3 * (np.add(n0, n1) @ w) / (w @ w) * w
    expected = np.array(n0) + (np.subtract(n1, n0) - a) * s + a * s * s
    if np.linalg.norm(expected) < 1e-6:
        return
    got = np.array(quadratic_normal(p0, p1, p2, n0, n1, n2, s, 0.0))
    np.testing.assert_allclose(got, expected / np.linalg.norm(expected), atol=1e-8)


@settings(deadline=None, max_examples=100, derandomize=True)
@given(points, points, unit_normals, unit_normals)
def test_quadratic_normals_are_on_average_perpendicular_to_the_edge(p0, p1, n0, n1):
    """∫ n(s)·w ds = 0: the defining property, which linear interpolation lacks."""
    w = np.subtract(p1, p0)
    if np.linalg.norm(w) < 1e-3:
        return
    a = 3 * (np.add(n0, n1) @ w) / (w @ w) * w
    b = np.subtract(n1, n0) - a
    s = np.array([0.5 - np.sqrt(3) / 6, 0.5 + np.sqrt(3) / 6])  # Gauss, exact for quadratics
    values = np.array(n0) + np.outer(s, b) + np.outer(s * s, a)
    assert np.mean(values @ w) == pytest.approx(0, abs=1e-9 * (1 + w @ w))


@pytest.mark.parametrize(
    "kernel", [lambda *a: phong_normal(*NORMALS, *a), lambda *a: quadratic_normal(*P, *NORMALS, *a)]
)
def test_corners_keep_their_normals(kernel):
    for (u, v), n in zip([(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)], NORMALS, strict=True):
        np.testing.assert_allclose(kernel(u, v), n, atol=1e-15)


def test_quadratic_shading_turns_where_linear_stays_flat():
    """Equal normals tilted along the edge: linear interpolation sees a flat face, the quadratic one a wave."""
    tilted = (0.6, 0.0, 0.8)
    p = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)]
    assert phong_normal(tilted, tilted, tilted, 0.5, 0.0) == pytest.approx(tilted)
    middle = quadratic_normal(*p, tilted, tilted, tilted, 0.5, 0.0)
    assert middle[0] < -0.3


def test_quadratic_equals_linear_on_a_flat_face():
    for u, v in ((0.2, 0.3), (0.6, 0.1)):
        assert quadratic_normal(*P, *[(0.0, 0.0, 1.0)] * 3, u, v) == pytest.approx((0, 0, 1))


def test_degenerate_triangles_and_cancelling_normals_give_zero_not_nan():
    point = (1.0, 2.0, 3.0)
    assert phong_normal((0.0, 0.0, 1.0), (0.0, 0.0, -1.0), (0.0, 0.0, 1.0), 0.5, 0.0) == (0, 0, 0)
    assert np.isfinite(quadratic_normal(point, point, point, *NORMALS, 0.3, 0.3)).all()
