"""Denoising over scales: on dense meshes the noise goes, jumps and creases stay, and the reported error is true."""

import numpy as np
import pytest
import trimesh
from meshes import grid, hills

from obscurance import ao
from obscurance.raytrace import Mesh


def bumpy_ball():
    ball = trimesh.creation.icosphere(subdivisions=6)
    bumps = 1 + 0.12 * np.sin(7 * ball.vertices).prod(axis=1)
    return Mesh(ball.vertices * bumps[:, None], ball.faces)


def ditch():
    """A plane, 160 × 160, with a ditch of vertical walls: creases and dark stripes two edges wide."""
    vertices, faces = grid(159, 2.0)
    vertices[np.abs(vertices[:, 0]) < 0.1, 2] = -0.3
    return Mesh(vertices, faces)


MESHES = {"a height field": Mesh(*hills(200)), "a bumpy ball": bumpy_ball(), "a ditch": ditch()}
MOST = {"a height field": (0.02, 0.013), "a bumpy ball": (0.01, 0.008), "a ditch": (0.016, 0.0095)}
"""Root mean square errors by 8 and by 16 rays; one-rings alone leave two to three times as much of smooth ones."""


@pytest.mark.parametrize("name", MESHES)
def test_few_rays_on_dense_meshes_err_little_and_say_so(name):
    mesh = MESHES[name]
    some = np.random.default_rng(0).random(len(mesh.vertices)) < 0.125  # 3,000 or more: enough for the mean
    truth = ao.bake(mesh, ao.Binary(), 1024, seed=99, only=some).w
    for samples, most in zip((8, 16), MOST[name], strict=True):
        baked = ao.bake(mesh, ao.Binary(), samples)
        true = np.sqrt(np.mean((baked.w - truth)[some] ** 2))
        assert true < most
        assert 1 / 1.7 < true / baked.rmse < 1.3  # a second bake by few rays, which tells it, is noisy itself


def test_a_step_between_dense_vertices_is_not_smeared():
    mesh = MESHES["a ditch"]
    truth = ao.bake(mesh, ao.Binary(), 1024, seed=99).w
    off = np.abs(ao.bake(mesh, ao.Binary(), 64).w - truth)
    edge = np.abs(np.abs(mesh.vertices[:, 0]) - 0.1) < 0.02
    assert np.sqrt(np.mean(off[edge] ** 2)) < 0.03
    assert off.max() < 0.15


def test_where_all_is_open_nothing_is_added():
    assert (ao.bake(Mesh(*grid(59, 2.0)), ao.Binary(), 16).w == 1).all()
