"""Welding: vertices stored apart that are one place, to the tolerance of contacts."""

import numpy as np
import pytest

from obscurance import ao
from obscurance.raytrace import Mesh
from obscurance.raytrace.mesh.placement import Placement, contact_radius
from obscurance.raytrace.mesh.solids import closed_parts
from obscurance.raytrace.mesh.weld import CREASE, coincident, weld
from obscurance.scenes.geometry.polyhedra import generic_rotation

AROUND, UP = 24, 12
RING = np.arange((AROUND + 1) * (UP + 1)).reshape(UP + 1, AROUND + 1)


def seamed_sphere(slivers=False):
    """A sphere of latitudes and longitudes, of one vertex more around, as texture coordinates need.

    At the seam and the poles sin 2π and sin π leave copies 10⁻¹⁶ apart; `slivers`: with faces between those of a pole.
    """
    u, t = np.meshgrid(np.arange(AROUND + 1) / AROUND, np.arange(UP + 1) / UP)
    azimuth, height = 2 * np.pi * u.ravel(), np.pi * t.ravel()
    vertices = np.stack([-np.cos(azimuth) * np.sin(height), -np.sin(azimuth) * np.sin(height), np.cos(height)], axis=1)
    a, b, c, d = (corner.ravel() for corner in (RING[:-1, 1:], RING[:-1, :-1], RING[1:, :-1], RING[1:, 1:]))
    faces = np.concatenate([np.stack([a, b, d], -1), np.stack([b, c, d], -1)])
    if not slivers:
        at_pole = np.minimum(t, 1 - t).ravel()[faces] == 0
        faces = faces[at_pole.sum(axis=1) < 2]
    return vertices, faces


def beside_a_wall(part, seed, single=False):
    """A mesh in the middle of a larger one, to which it is small, turned and moved; both in one."""
    vertices, faces = part
    rng = np.random.default_rng(seed)
    wall = np.array(
        [[-4.0, -40, -40], [-4, 40, -40], [-4, 40, 40], [-4, -40, 40], [4, 39, 40], [4, 40, 39], [4, 39, 39]]
    )
    placed = np.concatenate([vertices * rng.uniform(0.01, 3), wall])
    if seed:
        placed = generic_rotation(seed).apply(placed) + rng.normal(size=3) * rng.choice([0, 1, 100])
    if single:
        placed = placed.astype(np.float32)
    return Mesh(placed, np.concatenate([faces, len(vertices) + np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6]])]))


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("single", [False, True])
def test_w_does_not_jump_across_a_seam(seed, single):
    baked = ao.bake(beside_a_wall(seamed_sphere(), seed, single), ao.Binary(), samples=64)
    assert np.array_equal(baked.w[RING[1:-1, 0]], baked.w[RING[1:-1, -1]])
    for pole in (RING[0, :-1], RING[-1, 1:]):
        assert len(np.unique(baked.w[pole])) == 1


@pytest.mark.parametrize("slivers", [False, True])
def test_a_part_whose_seam_is_not_exact_is_closed(slivers):
    mesh = beside_a_wall(seamed_sphere(slivers), 0)
    part, volume = closed_parts(Placement.of(mesh).vertices, mesh.faces)
    assert (volume > 0)[part[mesh.faces[:, 0]]].tolist() == [True] * (len(mesh.faces) - 3) + [False] * 3


@pytest.mark.parametrize("seed", range(8))
def test_places_are_one_within_the_radius_of_contact_and_not_beyond(seed):
    """Against all distances; faces are large."""
    rng = np.random.default_rng(seed)
    sparse = rng.uniform(-1, 1, (120, 3)) * rng.choice([1, 1e-2, 1e-4, 1e-8], (120, 1)) * rng.choice([0, 1], (120, 3))
    sparse = sparse[np.abs(sparse).max(axis=1) > 0]
    way = rng.normal(size=sparse.shape)
    way *= (contact_radius(sparse) / np.linalg.norm(way, axis=1))[:, None]
    copies = [
        sparse,
        sparse,
        sparse + 0.6 * way,
        sparse - 3 * way,
        [[0, 0, 0], [1e-17, 0, 0], [0, -0.0, 1e-12], [0, 1e-11, 0]],
    ]
    positions = rng.permutation(np.concatenate(copies)).astype(np.float32)
    far = np.array([[9, 0, 0], [0, 9, 0]], np.float32)
    faces = np.stack(
        [np.arange(len(positions)), *np.full((2, len(positions)), [[len(positions)], [len(positions) + 1]])], 1
    )
    place = coincident(np.concatenate([positions, far]), faces)
    p = positions.astype(np.float64)
    apart = np.linalg.norm(p[:, None] - p, axis=2)
    radius = contact_radius(p)
    one = apart <= np.minimum(radius[:, None], radius)
    while (one != (linked := one @ one)).any():
        one = linked
    assert np.array_equal(place[: len(p), None] == place[: len(p)], one)
    assert (np.diff(np.unique(place, return_index=True)[1]) > 0).all()


def test_what_is_as_fine_as_the_tolerance_is_not_melted():
    """A sphere a few roundings across."""
    vertices, faces = seamed_sphere()
    tiny = (vertices * 3e-6 + 0.7).astype(np.float32)
    normals = vertices / np.linalg.norm(vertices, axis=1, keepdims=True)
    assert len(np.unique(weld(tiny, faces, normals, CREASE))) >= len(np.unique(tiny, axis=0))


def test_a_thousand_copies_are_one():
    rng = np.random.default_rng(1)
    positions = np.concatenate([np.full((1000, 3), 0.3), rng.uniform(-1, 1, (1000, 3))]).astype(np.float32)
    group = weld(positions, np.arange(1998).reshape(-1, 3), np.tile([0.0, 0, 1], (2000, 1)), CREASE)
    assert np.array_equal(group[:1000], np.zeros(1000))
    assert np.array_equal(group[1000:], np.arange(1, 1001))
