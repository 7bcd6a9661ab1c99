"""Cones of directions narrower than the hemisphere, against closed forms of disks and of a half space."""

from math import cos, pi, radians, sin, tan

import numpy as np
import pytest
from meshes import grid
from scipy.integrate import dblquad

from obscurance import ao
from obscurance.ao import closed_forms as analytic
from obscurance.raytrace import Mesh
from obscurance.scenes.geometry.polyhedra import icosphere, join, patches, polygon

pytestmark = pytest.mark.usefixtures("w_alone")

FALLOFFS = {
    "binary": (ao.Binary(), None, np.inf),
    "near": (ao.Binary(0.7), None, 0.7),
    "exponential": (ao.Exponential(tau=1.5), 1.5, np.inf),
    "limited": (ao.Exponential(tau=1.5, max_distance=0.8), 1.5, 0.8),
    "linear": (ao.Linear(0.9), "linear", 0.9),
    "smooth": (ao.Smooth(0.9), "smooth", 0.9),
}
HEIGHT = 0.6


def under_disk(radius, normals=None):
    """Patches at one point, under a disk of 256 corners about the axis through it. Returns: the mesh, and how many."""
    angle = 2 * pi * np.arange(256) / 256
    rim = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.full(256, HEIGHT)], axis=-1)
    floor = patches(1e-4 * np.random.default_rng(1).normal(size=(16, 3)) * [1, 1, 0], 1e-4)
    return Mesh(*join([floor, polygon(rim)])), len(floor[0])


def in_cone(radius, spread, rate, limit):
    """w under the disk: what a cone has of it is a disk too, and the cone sin² of the hemisphere."""
    half = radians(spread / 2)
    seen = min(radius, HEIGHT * tan(half)) if spread < 180 else radius
    return 1 - (1 - analytic.disk(HEIGHT, seen, rate, limit)) / sin(half) ** 2


@pytest.mark.parametrize("spread", [180, 120, 60, 10])
@pytest.mark.parametrize("falloff", FALLOFFS)
def test_under_a_disk(falloff, spread):
    form, rate, limit = FALLOFFS[falloff]
    for radius in (0.3, 20.0):
        mesh, count = under_disk(radius)
        w = ao.bake(mesh, form, 512, spread=spread, denoise=False).w[:count]
        assert abs(w.mean() - in_cone(radius, spread, rate, limit)) < 0.002


def test_a_normal_that_leans_towards_a_wall():
    """Of density cosθ about the leaning normal, by quadrature."""
    lean, half, wall, tau = radians(35), radians(40), 0.5, 1.2
    floor = patches([[0.0, 0.0, 0.0]], 1e-3)
    quad = np.array([[wall, -50, -50], [wall, -50, 50], [wall, 50, 50], [wall, 50, -50]], float)
    vertices, faces = join([floor, polygon(quad)])
    normals = np.zeros_like(vertices)
    normals[:3] = sin(lean), 0, cos(lean)
    mesh = Mesh(vertices, faces, normals)
    options = {"normals": "file", "spread": 80, "denoise": False}
    w = ao.bake(mesh, ao.Exponential(tau=tau), 4096, **options).w[0]

    def mu(azimuth, angle):
        x = sin(angle) * cos(azimuth) * cos(lean) + cos(angle) * sin(lean)
        up = -sin(angle) * cos(azimuth) * sin(lean) + cos(angle) * cos(lean)
        return (-np.expm1(-tau * wall / x) if x > 0 and up > 0 else 1.0) * cos(angle) * sin(angle)

    exact = 2 * dblquad(mu, 0, half, 0, pi)[0] / (pi * sin(half) ** 2)
    assert abs(w - exact) < 0.003


@pytest.mark.parametrize("options", [{"method": "surface"}, {"profile": True}])
def test_fits_and_profiles(options):
    """A floor whose cones all end on one ceiling."""
    ceiling = 3.0 * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) + [0, 0, HEIGHT]
    mesh = Mesh(*join([grid(4, 2.0), polygon(ceiling)]))
    exact = in_cone(np.inf, 100, 1.5, np.inf)
    baked = ao.bake(mesh, ao.Exponential(tau=1.5), spread=100, **options)
    assert np.abs(baked.w[:25] - exact).max() < 0.01


def test_convex_shapes_are_open_and_bent_normals_stay_in_the_cone():
    ball = Mesh(*icosphere(2))
    baked = ao.bake(ball, samples=64, spread=30)
    assert (baked.w == 1).all()
    assert (np.einsum("ij,ij->i", baked.bent_normals, ball.vertices) > cos(radians(1))).all()


def test_what_no_cone_meets_is_open():
    mesh, count = under_disk(0.3)
    aside = mesh.vertices + np.array([1.0, 0, 0])
    moved = Mesh(np.concatenate([mesh.vertices[:count], aside[count:]]), mesh.faces)
    narrow = 2 * np.degrees(np.arctan2(0.69, HEIGHT))
    assert (ao.bake(moved, "binary", 256, spread=narrow).w[:count] == 1).all()
    assert ao.bake(moved, "binary", 256, spread=narrow + 6).w[:count].mean() < 1
