"""Bent normals in tangent space: x along u, y along v upwards, z the smooth normal."""

import numpy as np
import pytest
from uv_meshes import icosphere, quads, rectangle, square

from obscurance import ao

FLOOR = rectangle((0, -2, 0), (4, 0, 0), (0, 4, 0))
WALL = rectangle((0, 20, 0), (0, -40, 0), (0, 0, 20)), square(0, 0.9, 1, 0.95)


def bent(uv, space):
    mesh, coordinates = quads((FLOOR, np.asarray(uv, float)), WALL)
    texture = ao.bake_texture(mesh, coordinates, 32, ao.Binary(), samples=1024, bent_space=space)
    return texture.bent_normals[10:][texture.covered[10:]].mean(axis=0)


@pytest.mark.parametrize(
    ("uv", "away"),
    [
        (square(0, 0, 0.6, 0.6), (1, 0)),  # u along x: away from the wall is +u
        (square(0.6, 0, 0, 0.6), (-1, 0)),  # mirrored
        ([(0.6, 0), (0.6, 0.6), (0, 0.6), (0, 0)], (0, 1)),  # v along x
        ([(0.6, 0.6), (0.6, 0), (0, 0), (0, 0.6)], (0, -1)),
    ],
)
def test_bent_away_from_a_wall(uv, away):
    x, y, z = bent(uv, "tangent")
    a, _, c = bent(uv, "world")
    assert a > 0.3
    assert np.allclose((x, y), np.array(away) * a, atol=0.03)
    assert np.isclose(z, c, atol=0.01)


def test_an_open_surface_is_bent_nowhere():
    texture = ao.bake_texture(*icosphere(2), 96, ao.Binary(), samples=64, bent_space="tangent", normals="area")
    directions = texture.bent_normals[texture.covered]
    assert np.allclose(np.linalg.norm(texture.bent_normals, axis=2), 1, atol=1e-5)
    assert directions[:, 2].min() > 0.9


def test_spaces_are_one_rotation_apart_or_have_green_reversed():
    mesh, uv = icosphere(1)
    world, tangent, directx = (
        ao.bake_texture(mesh, uv, 64, samples=16, bent_space=space).bent_normals
        for space in ("world", "tangent", "tangent-directx")
    )
    assert np.array_equal(directx, tangent * np.float32([1, -1, 1]))
    assert np.allclose(np.linalg.norm(world, axis=2), np.linalg.norm(tangent, axis=2), atol=1e-5)
    assert not np.allclose(world, tangent, atol=0.1)
