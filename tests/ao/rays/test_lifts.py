"""Distances count from the place on the surface, not from the origin of rays, which is a little above it."""

import numpy as np
import pytest
from meshes import grid
from scipy.special import expn

from obscurance import ao
from obscurance.raytrace import Mesh
from obscurance.scenes.geometry.polyhedra import generic_rotation, join

GAP = 1e-5  # of the size
PLANES = 2 * expn(3, np.log(2))  # closed below a plane as far away as the half-distance
CELLS = 5


def gap(turn):
    """A floor in the middle below a ceiling, all turned."""
    floor, ceiling = grid(CELLS, 0.2), grid(CELLS)
    vertices, faces = join([floor, (ceiling[0] + [0, 0, GAP], ceiling[1][:, ::-1])])
    return generic_rotation(turn).apply(vertices), faces, len(floor[0])


def values(kind, mesh, count, falloff, options):
    """w of the floor."""
    if kind == "vertices":
        return ao.bake(mesh, falloff, **options).w[:count]
    if kind == "faces":
        return ao.bake(mesh, falloff, at="faces", **options).w[: 2 * CELLS**2]
    if kind == "surface":
        return ao.bake(mesh, falloff, method="surface", samples=options["samples"]).w[:count]
    corners = mesh.vertices[mesh.faces[: 2 * CELLS**2]]
    normal = np.cross(corners[0, 1] - corners[0, 0], corners[0, 2] - corners[0, 0])
    if kind == "points":
        centres = corners.mean(axis=1)
        return ao.bake_points(mesh, centres, np.tile(normal, (len(centres), 1)), falloff=falloff, **options).w
    i, j = np.divmod(np.arange(len(mesh.vertices)) % count, CELLS + 1)
    uv = np.stack([i / CELLS / 2 + 0.5 * (np.arange(len(mesh.vertices)) >= count), j / CELLS], -1)
    texture = ao.bake_texture(mesh, uv[mesh.faces], (16, 8), falloff, close_seams=False, **options)
    return texture.w[1:-1, 1:7]


@pytest.mark.parametrize("kind", ["vertices", "faces", "texels", "points"])
def test_a_ceiling_hardly_above_its_floor(kind):
    for turn in range(3):
        vertices, faces, count = gap(turn)
        mesh = Mesh(vertices, faces)
        options = {"samples": 1024}
        w = values(kind, mesh, count, ao.Exponential(half_distance=GAP), options)
        assert np.mean(w) == pytest.approx(1 - PLANES, abs=0.004)
        within = values(kind, mesh, count, ao.Binary(1.5 * GAP), options)  # all within cos θ > 1/1.5
        assert np.mean(within) == pytest.approx(1 / 1.5**2, abs=0.006)


def test_a_ceiling_hardly_above_its_floor_by_the_surface_method():
    vertices, faces, count = gap(1)
    w = values("surface", Mesh(vertices, faces), count, ao.Exponential(half_distance=GAP), {"samples": 1024})
    assert np.mean(w) == pytest.approx(1 - PLANES, abs=0.004)


def test_several_falloffs_and_bent_directions_count_alike():
    vertices, faces, count = gap(2)
    falloffs = [ao.Exponential(half_distance=GAP), ao.Exponential(half_distance=2 * GAP), ao.Linear(3 * GAP)]
    mesh = Mesh(vertices, faces)
    together = ao.bake(mesh, falloffs, samples=1024, denoise=False).values
    for k, falloff in enumerate(falloffs):
        alone = ao.bake(mesh, falloff, samples=1024, denoise=False)
        assert together[:count, k].mean() == pytest.approx(alone.w[:count].mean(), abs=1e-3)
    assert together[:count, 1].mean() == pytest.approx(1 - 2 * expn(3, np.log(2) / 2), abs=0.004)
