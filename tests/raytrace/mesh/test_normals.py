"""Normals of vertices, and those that docs/normals.md computes."""

import re

import numpy as np
import pytest
from meshes import newell_normal
from project import ROOT

from obscurance.raytrace.mesh.normals import vertex_normals

BENT = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.5]])


@pytest.fixture(scope="module")
def documented():
    """The names that the example of docs/normals.md defines."""
    (example,) = re.findall(r"```python\n(.*?)```", (ROOT / "docs/normals.md").read_text(), re.DOTALL)
    names = {}
    exec(example, names)
    return names


def test_the_documented_newell_normal(documented):
    """Of the textbook's polygon, from any corner on, far from the origin; of a concave one with a repeated corner."""
    newell = documented["newell_normal"]
    np.testing.assert_allclose(newell(BENT), [0.235702, -0.235702, 0.942809], atol=5e-7)
    np.testing.assert_allclose(newell(BENT), newell_normal(BENT), atol=1e-15)
    for shift in range(4):
        np.testing.assert_allclose(newell(np.roll(BENT, shift, axis=0)), newell(BENT), atol=1e-15)
    np.testing.assert_allclose(newell(BENT + 1e8), newell(BENT), atol=1e-7)
    np.testing.assert_allclose(newell(BENT[::-1]), -newell(BENT))
    arrow = np.array([[0, 0, 0], [2, 1, 0], [0, 2, 0], [0.5, 1, 0], [0.5, 1, 0]])
    np.testing.assert_allclose(newell(arrow), [0, 0, 1])


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
