"""Hemispheres stand on the normals that a mesh is shaded with: each side of a hard edge on its own."""

import numpy as np
import pytest
from hard_edges import CORNERS, OPENING, SIDES, box, charts
from uv_meshes import icosphere

from obscurance import ao
from obscurance.ao.closed_forms import polygon_form_factor, tilted_normal
from obscurance.raytrace import Mesh
from obscurance.raytrace.mesh.corners import with_hard_edges

CELLS = 8


def exact(side, u, v):
    """w at a point of a side of the open box: what it sees of the opening."""
    a, b, _, d = CORNERS[list(SIDES[side])]
    point = a + u * (b - a) + v * (d - a)
    return polygon_form_factor(OPENING, point, np.cross(b - a, d - a))


@pytest.mark.parametrize("form", ["shared", "apart", "corners", "zero", "behind", "nan"])
@pytest.mark.parametrize("normals", ["file", "angle"])
def test_an_open_box_is_right_however_it_is_stored(form, normals):
    """Vertices shared or not, with normals at corners, or with some of no use: w is the part of the opening seen."""
    mesh = box(form)
    texture = ao.bake_texture(mesh, charts(CELLS), 4 * CELLS, ao.Binary(), samples=1024, seed=7, normals=normals)
    assert 0 < texture.rmse < 0.01
    inner = np.arange(1, CELLS - 1)
    for side in range(len(SIDES)):
        row, column = 4 * CELLS - 1 - (side // 3 * (CELLS + 4) + inner), side % 3 * (CELLS + 2) + inner
        truth = [[exact(side, (u + 0.5) / CELLS, (v + 0.5) / CELLS) for u in inner] for v in inner]
        wrong = texture.w[np.ix_(row, column)] - truth
        assert np.sqrt(np.mean(wrong**2)) < 3 * texture.rmse


def test_a_texture_stands_on_the_files_normals_at_corners():
    """Two halves of a floor beside a wall, each with a tilted normal: w is what the wall leaves of the part of
    its hemisphere above the floor."""
    vertices = [[0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0], [1, 0, 0], [1, 1, 0]]
    faces = [[0, 4, 5], [0, 5, 3], [4, 1, 2], [4, 2, 5]]
    tilts = np.radians([-60, 40])
    tilted = np.stack([np.sin(tilts), 0 * tilts, np.cos(tilts)], axis=1)
    mesh = Mesh(vertices, faces, corner_normals=(tilted, np.repeat([0, 0, 1, 1], 3).reshape(-1, 3)))
    wall = np.array([[-0.5, -3, 0], [-0.5, 4, 0], [-0.5, 4, 2], [-0.5, -3, 2]])
    options = {"occluders": [Mesh(wall, [[0, 1, 2], [0, 2, 3]])], "samples": 4096, "close_seams": False}
    uv = mesh.vertices[mesh.faces][..., :2] / 2
    for normals, axes in (("file", tilted), ("angle", [[0, 0, 1]] * 2)):
        texture = ao.bake_texture(mesh, uv, 16, ao.Binary(), normals=normals, **options)
        for columns, axis in ((range(7), axes[0]), (range(9, 16), axes[1])):
            places = [((column + 0.5) / 8, 0.5 / 8, 0) for column in columns]
            above = tilted_normal(np.arccos(axis[2]))
            open_ = [above - polygon_form_factor(wall, place, axis) for place in places]
            np.testing.assert_allclose(texture.w[15, list(columns)], open_, atol=0.012)


def test_a_smooth_surface_is_baked_as_it_is():
    mesh, uv = icosphere(3)
    assert with_hard_edges(mesh) is mesh
    normals = mesh.vertices / np.linalg.norm(mesh.vertices, axis=1, keepdims=True)
    own = Mesh(mesh.vertices, mesh.faces, normals)
    assert with_hard_edges(own) is own
    plain, angle = (ao.bake_texture(mesh, uv, 64, samples=16, normals=normals) for normals in ("file", "angle"))
    np.testing.assert_array_equal(plain.w, angle.w)
    np.testing.assert_array_equal(ao.bake(mesh, samples=16).w, ao.bake(mesh, samples=16, normals="angle").w)


def test_vertices_that_are_shared_have_one_value_and_those_of_a_split_mesh_one_a_side():
    mesh = box("shared")
    split = with_hard_edges(mesh)
    np.testing.assert_array_equal(split.vertices[: len(mesh.vertices)], mesh.vertices)
    np.testing.assert_array_equal(split.vertices[split.faces], mesh.vertices[mesh.faces])
    assert len(split.vertices) == 4 * len(SIDES)
    one = ao.bake(mesh, ao.Binary(), samples=1024)
    assert len(one.w) == len(mesh.vertices)
    apart = ao.bake(split, ao.Binary(), samples=4096)
    for side in range(len(SIDES)):
        a, b, _, d = CORNERS[list(SIDES[side])]
        at = np.unique(split.faces[2 * side : 2 * side + 2])
        places = (split.vertices[at] - a) @ np.stack([b - a, d - a], axis=1)
        truth = [exact(side, *uv) for uv in np.clip(places, 1e-6, 1 - 1e-6)]
        at_rim = split.vertices[at, 2] == 1  # which sees all that is above
        np.testing.assert_allclose(apart.w[at], np.where(at_rim, 0.5, truth), atol=0.02)
