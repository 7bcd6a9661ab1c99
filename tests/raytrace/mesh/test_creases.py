"""Normals by fans of faces between creases."""

import numpy as np
import pytest
from uv_meshes import icosphere

from obscurance.raytrace import Mesh, MeshError
from obscurance.raytrace.mesh.corners import on_hard_edges, split_creases
from obscurance.raytrace.mesh.normals import (
    corner_normals,
    face_normals,
    own_vertex_normals,
    useless_normals,
    vertex_normals,
)

CUBE = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
SIDES = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
TRIANGLES = np.array([each for a, b, c, d in SIDES for each in ((a, b, c), (a, c, d))])


def kinds(mesh, of):
    """How many vertices there are once each normal of a vertex is a vertex."""
    return len(np.unique(np.stack([mesh.faces.ravel(), of.ravel()]), axis=1).T)


def test_sides_of_a_cube_have_their_own_normals():
    mesh = Mesh(CUBE, TRIANGLES)
    normals, of = corner_normals(mesh)
    across, _ = face_normals(mesh.vertices, mesh.faces)
    np.testing.assert_allclose(normals[of], np.repeat(across[:, None], 3, axis=1), atol=1e-15)
    assert kinds(mesh, of) == 24


def test_a_round_surface_has_no_creases():
    mesh = icosphere(3)[0]
    normals, of = corner_normals(mesh)
    assert kinds(mesh, of) == len(mesh.vertices)
    np.testing.assert_allclose(normals[of], vertex_normals(mesh.vertices, mesh.faces)[mesh.faces], atol=1e-6)


@pytest.mark.parametrize(("degrees", "creased"), [(29, False), (31, True)])
@pytest.mark.parametrize("apart", [False, True])
def test_an_edge_is_a_crease_beyond_thirty_degrees_however_it_is_stored(degrees, creased, apart):
    angle = np.radians(degrees)
    vertices = np.array([[0, 0, 0], [0, 1, 0], [-1, 0, 0], [np.cos(angle), 0, -np.sin(angle)]])
    faces = np.array([[0, 1, 2], [1, 0, 3]])
    mesh = Mesh(vertices[faces].reshape(-1, 3), np.arange(6).reshape(2, 3)) if apart else Mesh(vertices, faces)
    normals, of = corner_normals(mesh)
    ridge = normals[of][[0, 0, 1, 1], [0, 1, 1, 0]]
    np.testing.assert_allclose(np.arccos(ridge[0] @ ridge[2]), angle if creased else 0, atol=1e-6)


def test_a_crease_that_ends_within_the_surface_splits_only_its_other_end():
    """Eight faces about the origin, one corner of their rim raised: the edge that leads there is a crease."""
    rim = np.arange(8) * np.pi / 4
    corners = np.vstack([np.zeros(3), np.stack([np.cos(rim), np.sin(rim), 0.35 * (rim == 0)], axis=1)])
    faces = np.array([[0, k + 1, (k + 1) % 8 + 1] for k in range(8)])
    _, of = corner_normals(Mesh(corners, faces))
    across, _ = face_normals(corners, faces)
    assert across[0] @ across[7] < np.cos(np.radians(30)) < across[0] @ across[1]
    assert len(np.unique(of[:, 0])) == 1
    assert of[0, 1] != of[7, 2]


def test_faces_without_area_split_nothing_and_have_normals():
    sphere = icosphere(2)[0]
    vertices = np.vstack([sphere.vertices, [[5, 0, 0]]])
    faces = np.vstack([sphere.faces, [[0, 0, 1], [len(sphere.vertices)] * 3]])
    normals, of = corner_normals(Mesh(vertices, faces))
    assert normals[of[:-1]].any(axis=2).all()
    assert not normals[of[-1]].any()
    assert kinds(Mesh(vertices, faces[:-1]), of[:-1]) == len(vertices) - 1


def test_normals_of_a_mesh_stay_and_those_of_no_use_are_ours():
    """Zero ones, and those behind a face; one that lies in its face stays."""
    given = np.tile([0, 0, 2.0], (8, 1))
    given[3] = 0
    mesh = Mesh(CUBE, TRIANGLES, given)
    normals, of = corner_normals(mesh)
    across, _ = face_normals(mesh.vertices, mesh.faces)
    is_useless = (mesh.faces == 3) | (across[:, 2] < 0)[:, None]
    expected = np.where(is_useless[..., None], across[:, None], [0, 0, 1])
    np.testing.assert_allclose(normals[of], expected, atol=1e-15)
    assert useless_normals(mesh) == is_useless.sum()
    np.testing.assert_allclose(
        corner_normals(mesh, own=False)[0][corner_normals(mesh, own=False)[1]], across[:, None].repeat(3, 1)
    )
    own = own_vertex_normals(mesh)
    touches_below = np.isin(np.arange(8), mesh.faces[across[:, 2] < 0]) | (np.arange(8) == 3)
    np.testing.assert_array_equal(own, np.where(touches_below[:, None], 0, [0, 0, 1]))


def test_normals_at_corners_split_their_vertices_and_no_others():
    rng = np.random.default_rng(3)
    across, _ = face_normals(CUBE, TRIANGLES)
    values = np.concatenate([across + rng.normal(size=across.shape) / 8, [[0, 0, 0]]])
    of = np.repeat(np.arange(12), 3).reshape(12, 3)
    of[4] = 12
    mesh = Mesh(CUBE, TRIANGLES, corner_normals=(values, of))
    split, at_vertices, vertices, like = split_creases(mesh)
    unit = values[:12] / np.linalg.norm(values[:12], axis=1, keepdims=True)
    unit[4] = across[4]
    np.testing.assert_allclose(at_vertices[split.faces], unit[:, None].repeat(3, 1), atol=1e-12)
    np.testing.assert_array_equal(vertices[split.faces], TRIANGLES)
    np.testing.assert_array_equal(TRIANGLES.ravel()[like], vertices)
    assert len(vertices) == 36
    assert len(on_hard_edges(mesh)) == 8
    assert not len(on_hard_edges(split))


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"corner_normals": ([[0, 0, 1]], np.full((12, 3), 1))}, "indices from 0 to 0"),
        ({"corner_normals": ([[0, 0, 1]], np.zeros((11, 3), int))}, r"shape \(11, 3\)"),
        ({"corner_normals": ([[0, 0, 1]], np.zeros((12, 3), int)), "normals": CUBE}, "no normals of vertices besides"),
    ],
)
def test_normals_at_corners_are_checked(given, words):
    with pytest.raises(MeshError, match=f"corner_normals: expected .*{words}"):
        Mesh(CUBE, TRIANGLES, **given)
