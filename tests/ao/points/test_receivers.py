"""Points that are baked: welding, hard edges, flags and safe origins."""

import numpy as np
import pytest
import trimesh
from meshes import crumpled

from obscurance.ao import Flag
from obscurance.ao.points.receivers import find_receivers
from obscurance.raytrace import Mesh
from obscurance.raytrace.mesh.placement import Placement
from obscurance.raytrace.ray_origins import origins
from obscurance.raytrace.ray_origins.direction import outermost_normals


def receivers(mesh, normals="angle"):
    return find_receivers(mesh, Placement.of(mesh), normals)


def soup(shape):
    """Every face with corners of its own, as STL stores them."""
    return Mesh(shape.triangles.reshape(-1, 3), np.arange(3 * len(shape.faces)).reshape(-1, 3))


def test_a_cube_of_loose_triangles_keeps_its_edges():
    found = receivers(soup(trimesh.creation.box()))
    assert len(found.points) == 24
    assert set(np.abs(found.points.normals).max(axis=1)) == {1.0}


def test_a_sphere_of_loose_triangles_is_smooth_again():
    sphere = trimesh.creation.icosphere(subdivisions=3)
    found = receivers(soup(sphere))
    assert len(found.points) == len(sphere.vertices)
    outward = found.points.origins / np.linalg.norm(found.points.origins, axis=1, keepdims=True)
    assert np.einsum("ij,ij->i", found.points.normals, outward).min() > 0.999


def test_unreferenced_and_degenerate_vertices_are_flagged_and_have_no_receiver():
    vertices = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [5, 5, 5], [2, 0, 0], [3, 0, 0], [4, 0, 0]]
    found = receivers(Mesh(vertices, [[0, 1, 2], [4, 5, 6], [4, 4, 5]]))
    assert found.flags.tolist() == [0, 0, 0, Flag.UNREFERENCED, *[Flag.DEGENERATE] * 3]
    assert found.of_vertex[3:].tolist() == [-1] * 4
    assert len(found.faces) == 1


def test_a_sheet_with_two_opposite_sides_is_flagged_opposed():
    found = receivers(Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 1]]))
    assert found.flags.tolist() == [Flag.OPPOSED] * 3
    np.testing.assert_allclose(np.abs(found.points.normals[:, 2]), 1)


def test_the_files_normals_are_taken_as_they_are():
    normals = [[0, 0, 2.0], [0.6, 0, 0.8], [np.nan, 0, 0]]
    mesh = Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], normals)
    found = receivers(mesh, "file")
    axes = found.points.normals[found.of_vertex]
    np.testing.assert_allclose(axes, [[0, 0, 1], [0.6, 0, 0.8], [0, 0, 1]], atol=1e-7)
    assert found.flags.tolist() == [0, 0, 0]
    assert (found.points.origins[:, 2] > 0).all()


def test_a_file_normal_behind_its_face_is_of_no_use():
    vertices, faces = [[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]
    for normal, axis in (([0, 0, -1], [0, 0, 1]), ([0.1, 0, -0.99], [0, 0, 1]), ([1, 0, -1e-4], [1, 0, -1e-4])):
        found = receivers(Mesh(vertices, faces, [normal] * 3), "file")
        np.testing.assert_allclose(found.points.normals, [axis] * 3, atol=1e-7)


def test_a_normal_behind_one_of_its_faces_is_moved_in_front_of_all():
    tilt = np.radians(88)
    faces = np.array(
        [[0, 0, 1.0], *[[np.sin(tilt) * np.cos(a), np.sin(tilt) * np.sin(a), np.cos(tilt)] for a in (0, 2, 4)]]
    )
    start = np.array([[-0.8, 0.0, -0.6]])
    moved, directions, clearance = outermost_normals(start, np.zeros((4, 3), np.int32), faces)
    assert (faces @ moved[0]).min() > 0
    assert (faces @ directions[0]).min() == pytest.approx(clearance[0])


@pytest.mark.parametrize("offset", [0, 1, 1e3])
def test_no_ray_hits_the_faces_it_starts_on(offset):
    """A small bumpy sphere beside a far triangle, so that float32 is coarse where the sphere is."""
    from obscurance.raytrace.embree import intersect

    sphere = trimesh.creation.icosphere(subdivisions=4, radius=1 / max(offset, 1))
    rng = np.random.default_rng(0)
    bumpy = sphere.vertices * rng.uniform(0.97, 1.03, (len(sphere.vertices), 1)) + min(offset, 1)
    far = np.array([[-1, -1, -1], [-1, -1, -1.01], [-1, -1.01, -1]])
    count = len(bumpy)
    mesh = Mesh(np.vstack([bumpy, far]), np.vstack([sphere.faces, [[count, count + 1, count + 2]]]))
    placement = Placement.of(mesh)
    found = receivers(mesh)
    chosen = rng.integers(0, len(found.points), 300_000)
    normal = found.points.normals[chosen].astype(float)
    direction = rng.normal(size=(len(chosen), 3))
    direction *= np.sign(np.einsum("ij,ij->i", direction, normal))[:, None]
    hits = intersect(found.embree(), found.points.origins[chosen], direction)
    corners = placement.vertices[found.faces[hits.face]].astype(float)
    geometric = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    own = (found.of_vertex[found.faces[hits.face]] == chosen[:, None]).any(axis=1) & (hits.face >= 0)
    in_front = np.einsum("ij,ij->i", geometric, direction) > 0
    assert np.count_nonzero(own & in_front) == 0


def test_origins_in_blocks_have_the_bits_of_the_whole(monkeypatch):
    ball = trimesh.creation.icosphere(3)
    mesh = Mesh(*crumpled((ball.vertices, ball.faces), 0.3, 2))
    whole = receivers(mesh)
    monkeypatch.setattr(origins, "_BLOCK", 100)
    parts = receivers(mesh)
    np.testing.assert_array_equal(parts.points.origins, whole.points.origins)
    np.testing.assert_array_equal(parts.displaced, whole.displaced)
    np.testing.assert_array_equal(parts.flags, whole.flags)


def test_faces_and_vertices_of_any_order_keep_their_numbers():
    chance = np.random.default_rng(3)
    ball = trimesh.creation.icosphere(subdivisions=3)
    vertices, faces = crumpled((ball.vertices, ball.faces), 0.45, 3)
    unused, flat = np.full((5, 3), 0.5), chance.integers(0, len(vertices), (40, 1)).repeat(3, axis=1)
    order = chance.permutation(len(vertices) + len(unused))
    place = np.argsort(order)
    faces = chance.permutation(place[np.concatenate([faces, flat])])
    mesh = Mesh(np.concatenate([vertices, unused])[order], faces)
    placement, found = Placement.of(mesh), receivers(mesh)

    assert found.faces.tolist() == [face for face in faces.tolist() if len(set(face)) == 3]
    there = found.hierarchy.tree.leaf_faces >= 0
    corners = found.hierarchy.tree.triangles.reshape(-1, 3, 3, 16).transpose(0, 3, 1, 2)[there]
    assert (corners == placement.vertices[found.faces[found.hierarchy.tree.leaf_faces[there]]]).all()
    used = found.of_vertex >= 0
    assert np.flatnonzero(found.flags & Flag.UNREFERENCED).tolist() == np.flatnonzero(~used).tolist()
    away = found.points.origins[found.of_vertex[used]] - placement.vertices[used]
    assert np.abs(away).max() < 1e-3
    split = (found.flags & (Flag.FOLDED | Flag.OPPOSED)) != 0
    assert found.corners.point_rows.tolist() == np.unique(found.of_vertex[split]).tolist()
    assert found.corners.point_rows.tolist() == list(range(len(found.points) - len(found.corners), len(found.points)))
    assert len(found.corners) > 10
