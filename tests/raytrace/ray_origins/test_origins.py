"""Origins of rays where surfaces meet: each case once leaked, hit itself, or took the wrong side."""

from __future__ import annotations

import numpy as np
import pytest
from stress.solids import ellipsoid, grid, inward

from obscurance import ao
from obscurance.raytrace import Mesh
from obscurance.raytrace.bvh.bvh16 import BVH16
from obscurance.raytrace.ray_origins.direction import outermost_normals
from obscurance.raytrace.ray_origins.surface import Surface, find_contacts
from obscurance.scenes.geometry.polyhedra import generic_rotation, icosphere, join


def binary(part, turn, samples=256):
    return ao.bake(Mesh(generic_rotation(turn).apply(part[0]), part[1]), ao.Binary(), samples=samples).w


def test_acute_wedges_are_closed():
    """The rim of a lens, one to 10,000: a ray must start clear of both sides."""
    assert (binary(inward(ellipsoid(2000, (1, 1, 1e-4))), 1) == 0).all()


def test_contacts_with_the_files_normals_against_the_winding():
    """A floor and the foot of a wall, all faces wound the wrong way round."""
    floor = grid(1, 8.0)
    wall = np.array([[0, -1, 0], [0, 1, 0], [0, 0, 2.0], [0, 0, 0]]), np.array([[0, 3, 2], [3, 1, 2]])
    vertices, faces = join([wall, floor])
    normals = np.array([[1, 0, 0.0]] * 4 + [[0, 0, 1.0]] * 4)
    for each in (faces, faces[:, ::-1]):
        mesh = Mesh(vertices, each, normals)
        w = ao.bake(mesh, ao.Binary(), samples=4096, normals="file").w
        assert w[3] == pytest.approx(0.5, abs=0.004)


@pytest.mark.parametrize("seed", range(3))
def test_contacts_are_those_of_brute_force(seed):
    rng = np.random.default_rng(seed)
    sphere = icosphere(2)
    needles = rng.normal(size=(40, 1, 3)) + rng.normal(size=(40, 3, 3)) * rng.choice([1e-3, 3.0], size=(40, 1, 3))
    vertices, faces = join([sphere, grid(3, 1.7), (needles.reshape(-1, 3), np.arange(120).reshape(-1, 3))])
    faces = faces.astype(np.int32)
    points = np.concatenate([vertices, rng.normal(size=(200, 3))])
    reach, margin = rng.uniform(0, 0.3, len(points)), rng.uniform(0, 0.1, len(faces)).astype(np.float32)
    tree = BVH16.of(vertices.astype(np.float32), faces)
    surface = Surface.of(vertices, faces, np.zeros(len(faces), np.bool_))._replace(rounding=margin)
    found = find_contacts(tree, surface, points, reach, faces, np.arange(len(points)))
    corners = vertices[faces]
    expected = {
        (i, f)
        for i, p in enumerate(points)
        for f in np.flatnonzero(_distances(p, corners) <= np.maximum(reach[i], margin))
        if i not in faces[f]
    }
    assert len(expected) > 100
    assert set(zip(found.point.tolist(), found.face.tolist(), strict=True)) == expected
    assert (np.diff(found.point) >= 0).all()
    exact = [_distances(points[i], corners[[f]])[0] for i, f in zip(found.point, found.face, strict=True)]
    np.testing.assert_allclose(found.distance, exact, atol=1e-12)


def _distances(p, corners):
    """From a point to triangles (m, 3, 3): the plane where the foot is inside, else the nearest edge."""
    a, b, c = corners.transpose(1, 0, 2)
    normal = np.cross(b - a, c - a)
    length = np.linalg.norm(normal, axis=1)
    height = np.einsum("ij,ij->i", p - a, normal) / length
    inside = np.ones(len(corners), bool)
    nearest = np.full(len(corners), np.inf)
    for q, r in ((a, b), (b, c), (c, a)):
        inside &= np.einsum("ij,ij->i", np.cross(r - q, p - q), normal) >= 0
        along = np.clip(np.einsum("ij,ij->i", p - q, r - q) / ((r - q) ** 2).sum(axis=1), 0, 1)
        nearest = np.minimum(nearest, np.linalg.norm(p - q - along[:, None] * (r - q), axis=1))
    return np.where(inside, np.abs(height), nearest)


@pytest.mark.parametrize("size", [1e-4, 0.5])
@pytest.mark.parametrize("rise", [0.0, 1.0])
def test_a_face_that_rises_from_a_vertex_on_its_edge_is_a_contact_however_small(size, rise):
    floor = grid(2, 2.0)
    beside = np.array([[-1, 0, 0], [1, 0, 0], [0, -0.5, rise]]) * size, np.array([[0, 2, 1]])
    flags = ao.bake(Mesh(*join([floor, beside])), "binary", samples=1).flags
    assert (flags[4] & ao.Flag.CONTACT > 0) == (rise > 0)


def test_normals_of_a_surface_are_those_of_its_fronts():
    vertices, faces = grid(1)
    surface = Surface.of(vertices, faces.astype(np.int32), np.array([False, True]))
    assert surface.normals(np.arange(2)).tolist() == [[0, 0, 1], [0, 0, -1]]
    assert surface.reversed().normals(np.arange(2)).tolist() == [[0, 0, -1], [0, 0, 1]]


def test_no_points_and_no_faces_have_no_contacts():
    nothing = np.zeros((0, 3))
    none = np.zeros((0, 3), np.int32)
    vertices, faces = grid(1)
    faces = faces.astype(np.int32)
    tree = BVH16.of(vertices.astype(np.float32), faces)
    surface = Surface.of(vertices, faces, np.zeros(len(faces), np.bool_))
    assert len(find_contacts(tree, surface, nothing, np.zeros(0), faces, np.arange(0)).point) == 0
    empty = Surface.of(vertices, none, np.zeros(0, np.bool_))
    assert len(find_contacts(tree, empty, vertices, np.ones(len(vertices)), none, np.arange(len(vertices))).point) == 0


def test_clearance_is_asked_for():
    start = np.array([[1.0, 0.0, 0.0]])
    faces = np.array([[1.0, 0, 0], [np.sin(0.05), np.cos(0.05), 0]])
    moved, directions, clearance = outermost_normals(start, np.zeros((2, 1), np.int32), faces)
    assert np.array_equal(moved, start)
    assert clearance[0] == pytest.approx((faces @ directions[0]).min())
    assert clearance[0] >= 0.3
    assert directions[0] @ directions[0] == pytest.approx(1)
