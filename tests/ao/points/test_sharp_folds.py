"""Vertices whose normal hardly clears one of their faces: w from origins close to them, against closed forms.

As an origin approaches the apex of a fan of triangles, they become its horizon, whose height h depends on the azimuth:
w is the mean of cos²h, as far as h is above 0.
"""

import numpy as np
import pytest

from obscurance import ao
from obscurance.raytrace import Mesh
from obscurance.scenes.geometry.polyhedra import generic_rotation

pytestmark = pytest.mark.usefixtures("w_alone")

APART = 0.2  # of fans, in a mesh of size 1: beyond the rays


def fan(rim):
    """Triangles from the origin to each edge of a polygon (k, 3)."""
    k = np.arange(len(rim))
    return np.concatenate([[[0.0, 0, 0]], rim]), np.stack([0 * k, 1 + k, 1 + (k + 1) % len(rim)], axis=1)


def apex(rim):
    """The angle-weighted normal at the apex of a fan, and the cosine by which it clears the nearest face."""
    following = np.roll(rim, -1, axis=0)
    across = np.cross(rim, following)
    size = np.linalg.norm(across, axis=1)
    normals = across / size[:, None]
    normal = np.arctan2(size, np.einsum("ij,ij->i", rim, following)) @ normals
    normal /= np.linalg.norm(normal)
    return normal, float((normals @ normal).min())


def sky(rim):
    """w at the apex of a fan that its normal is in front of, by the middles of small steps of azimuth."""
    normal, total = apex(rim)[0], 0.0
    side = np.cross(normal, rim[0])
    side /= np.linalg.norm(side)
    other = np.cross(normal, side)
    for a, b in zip(rim, np.roll(rim, -1, axis=0), strict=True):
        start, end = (np.arctan2(x @ other, x @ side) for x in (a, b))
        width = (end - start) % (2 * np.pi)
        azimuth = start + width * (np.arange(2000)[:, None] + 0.5) / 2000
        across = np.cross(a, b)
        height = -((np.cos(azimuth) * side + np.sin(azimuth) * other) @ across) / (across @ normal)
        total += width * np.mean(1 / (1 + np.maximum(height, 0) ** 2))
    return total / (2 * np.pi)


def crumpled(rng):
    """A rim about whose apex the surface is as rough as a noisy scan's."""
    while True:
        azimuth = 2 * np.pi * (np.arange(6) + rng.uniform(-0.25, 0.25, 6)) / 6
        rim = np.stack([np.cos(azimuth), np.sin(azimuth), rng.normal(0, 1.5, 6)], axis=1)
        if 0.0 < apex(rim)[1] < 0.05:
            return rim


def groove(cosine):
    """The bottom of a V-groove of two walls, each of which its normal clears by `cosine`."""
    up = np.sqrt(1 - cosine**2)
    return np.array([[0, -1, 0], [cosine, -1, up], [cosine, 1, up], [0, 1, 0], [-cosine, 1, up], [-cosine, -1, up]])


def bake(rims, size, seed, **options):
    """w at the apexes of fans, their estimated errors and what w is."""
    pose = generic_rotation(seed)
    places = APART * np.stack(np.meshgrid(*[np.arange(5)] * 3), axis=-1).reshape(-1, 3)[: len(rims)]
    meshes = [fan(size * rim) for rim in rims]
    starts = np.cumsum([0, *(len(v) for v, _ in meshes)])
    vertices = np.concatenate([v + at for (v, _), at in zip(meshes, places, strict=True)])
    faces = np.concatenate([f + start for (_, f), start in zip(meshes, starts, strict=False)])
    mesh = Mesh(pose.apply(vertices), faces)
    baked = ao.bake(mesh, ao.Binary(max_distance=APART / 2), denoise=False, interior="ignore", seed=seed, **options)
    assert not (baked.flags[starts[:-1]] & (ao.Flag.FOLDED | ao.Flag.OPPOSED)).any()
    exact = [sky(rim) for rim in rims]
    return baked.w[starts[:-1]], baked.error[starts[:-1]], np.array(exact)


@pytest.mark.parametrize("seed", range(4))
def test_w_in_folds_of_rough_surfaces_is_that_at_the_vertex(seed):
    """Squared errors over estimated ones have the mean 1, give or take; origins along the normal had 22 to 46."""
    rng = np.random.default_rng(seed)
    w, error, exact = bake([crumpled(rng) for _ in range(125)], 1e-3, seed, samples=1024)
    assert np.mean(((w - exact) / error) ** 2) < 2
    assert abs(np.mean(w - exact)) < 4 * np.sqrt(np.mean(error**2) / len(w))


@pytest.mark.parametrize("size", [1e-4, 1e-3, 1e-2])
def test_what_a_groove_leaves_of_an_offset_is_in_the_estimated_error(size):
    rims = [groove(cosine) for cosine in np.geomspace(0.003, 0.09, 20) for _ in range(6)]
    w, error, exact = bake(rims, size, 1, samples=1024)
    z = (w - exact) / error
    assert np.abs(z).max() < 4
    assert np.sqrt(np.mean(z**2)) < 1.5


@pytest.mark.parametrize("size", [1e-4, 1e-2])
def test_rays_from_a_ridge_hit_nothing(size):
    rims = [groove(cosine)[::-1] for cosine in np.geomspace(0.003, 0.09, 20) for _ in range(6)]
    assert (bake(rims, size, 2, samples=1024)[0] == 1).all()
