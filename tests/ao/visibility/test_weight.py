"""`weight="uniform"`: w as a share of the solid angle, at points of every kind."""

import numpy as np
import pytest
from meshes import grid, hills

from obscurance import ao
from obscurance.ao.rays.below_face import share_below
from obscurance.ao.rays.directions import Lobe
from obscurance.raytrace.mesh.mesh import Mesh, mesh_of

HEIGHT = 0.7
OPEN = HEIGHT / np.hypot(HEIGHT, 1.0)  # cos of the angle that a disk of radius 1 is seen under


def disk(sides=360):
    """A disk of radius 1 above the origin."""
    angles = 2 * np.pi * np.arange(sides) / sides
    rim = np.stack([np.cos(angles), np.sin(angles), 0 * angles + HEIGHT], axis=-1)
    numbers = np.arange(sides)
    return np.vstack([rim, [(0, 0, HEIGHT)]]), np.stack([numbers, (numbers + 1) % sides, 0 * numbers + sides], axis=-1)


def bakes(kind, floor, **options):
    """w of a floor by vertices, faces, texels, points or a fit."""
    if kind == "texels":
        mesh = mesh_of(floor, "floor")
        xy = mesh.vertices[mesh.faces][:, :, :2]
        uv = (xy - xy.min((0, 1))) / np.ptp(xy, axis=(0, 1))
        return ao.bake_texture(floor, uv=uv, size=16, **options)
    if kind == "points":
        taken = {name: value for name, value in options.items() if name != "normals"}
        places = mesh_of(floor, "floor").vertices
        normals = np.tile([0.0, 0.0, 1.0], (len(places), 1))
        (occluder,) = taken.pop("occluders", [None])
        return ao.bake_points(occluder or floor, places, normals, **taken)
    more = {"faces": {"at": "faces"}, "surface": {"method": "surface"}}.get(kind, {})
    return ao.bake(floor, **options, **more)


KINDS = "vertices", "faces", "texels", "points", "surface"


@pytest.mark.parametrize("kind", KINDS)
def test_a_disk_closes_its_share_of_the_solid_angle(kind):
    floor = grid(4, 0.01)
    for weight, exact in (("uniform", OPEN), ("cosine", OPEN**2)):
        baked = bakes(kind, floor, falloff="binary", samples=4096, occluders=[disk()], weight=weight)
        w = baked.w[baked.covered] if kind == "texels" else baked.w
        np.testing.assert_allclose(w, exact, atol=0.01)
    half = 60.0  # of a cone: of its solid angle the disk leaves (cos α − cos β)/(1 − cos β) open
    part = (OPEN - np.cos(np.radians(half))) / (1 - np.cos(np.radians(half)))
    baked = bakes(kind, floor, falloff="binary", samples=4096, occluders=[disk()], weight="uniform", spread=2 * half)
    w = baked.w[baked.covered] if kind == "texels" else baked.w
    np.testing.assert_allclose(w, part, atol=0.015)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("degrees", [20, 50, 75])
def test_slopes_close_what_lies_below_them(kind, degrees):
    vertices, faces = grid(4, 1.0)
    tilt = np.radians(degrees)
    vertices[:, 2] = vertices[:, 0] * np.tan(tilt)
    slope = Mesh(vertices, faces, up="z")
    baked = bakes(kind, slope, falloff="binary", samples=4096, weight="uniform", normals="up")
    inner = np.abs(vertices[:, :2]).max(axis=1) < 0.4  # points at the border of a sheet see below it
    w = {"texels": lambda: baked.w[baked.covered], "points": lambda: baked.w[inner]}.get(kind, lambda: baked.w)()
    np.testing.assert_allclose(w.mean(), 1 - tilt / np.pi, atol=0.01)


@pytest.mark.parametrize("half", [90, 60, 25])
def test_shares_below_a_plane_are_those_of_random_directions(half):
    cone = np.sin(np.radians(half)) ** 2
    share = getattr(share_below, "py_func", share_below)
    rng = np.random.default_rng(half)
    count = 1 << 18
    for is_even in (False, True):
        lobe = Lobe(cone, is_even)
        squared = lobe.squared_sines(rng.random(count))
        z, x = np.sqrt(1 - squared), np.sqrt(squared) * np.cos(2 * np.pi * rng.random(count))
        for angle in (0.3, 1.0, 1.5, 2.0, 2.9):
            below = x * np.sin(angle) + z * np.cos(angle) < 0
            assert share(np.cos(angle), lobe) == pytest.approx(below.mean(), abs=0.005), (lobe, angle)


def test_estimated_errors_and_bent_normals_are_of_the_uniform_w():
    mesh = hills(24)
    exact = ao.bake(mesh, "binary", 1 << 15, weight="uniform", denoise=False)
    baked = ao.bake(mesh, "binary", tolerance=0.01, weight="uniform", seed=4)
    error = np.sqrt(np.mean((baked.w - exact.w) ** 2))
    assert error < 0.011
    assert 0.7 < baked.rmse / error < 1.4
    cosine = ao.bake(mesh, "binary", 1 << 15, denoise=False)
    assert np.abs(cosine.w - exact.w).mean() > 0.02
    assert (np.sum(baked.bent_normals * exact.bent_normals, axis=1) > 0.98).mean() > 0.95
