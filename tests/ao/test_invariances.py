"""Invariances of w, monotonic changes of it, and how fast its error falls: the bare estimator."""

from __future__ import annotations

from itertools import pairwise
from math import inf

import numpy as np
import pytest
from meshes import MESHES, hills, soup_over_floor

from obscurance import ao
from obscurance.ao import closed_forms as analytic
from obscurance.ao.falloff import Falloff
from obscurance.raytrace import Mesh
from obscurance.scenes.geometry.polyhedra import generic_rotation, hull, join

FALLOFFS = [ao.Binary(), ao.Binary(0.8), ao.Exponential(tau=1.5), ao.Exponential(tau=1.5, max_distance=0.8)]
NAMES = ["binary", "binary limited", "exponential", "exponential limited"]


SAMPLES = 128

falloffs = pytest.mark.parametrize("falloff", FALLOFFS, ids=NAMES)
meshes = pytest.mark.parametrize("name", ["soup", "torus"])


@falloffs
@meshes
def test_normals_behind_all_faces_are_as_none(name: str, falloff: Falloff) -> None:
    vertices, faces = MESHES[name]
    a, b, c = vertices[faces].transpose(1, 0, 2)
    behind = np.cross(c - a, b - a), np.repeat(np.arange(len(faces)), 3).reshape(-1, 3)
    mesh = Mesh(vertices, faces, corner_normals=behind)
    w, without = (ao.bake(m, falloff, samples=SAMPLES, denoise=False).w for m in (mesh, Mesh(vertices, faces)))
    np.testing.assert_array_equal(w, without)


@meshes
def test_monotone_in_rate_and_limit(name: str) -> None:
    mesh = Mesh(*MESHES[name])

    def w(falloff: Falloff) -> np.ndarray:
        return ao.bake(mesh, falloff, samples=SAMPLES, denoise=False).w

    rising = [w(ao.Binary())] + [w(ao.Exponential(tau=tau)) for tau in (0.01, 0.3, 1.0, 4.0, 50.0)] + [np.ones(1)]
    falling_in_limit = [w(ao.Binary(limit)) for limit in (inf, 3.0, 1.0, 0.3, 0.05)]
    falling_too = [w(ao.Exponential(tau=1.0, max_distance=limit)) for limit in (inf, 3.0, 1.0, 0.3, 0.05)]
    for ordered in (rising, falling_in_limit, falling_too):
        for low, high in pairwise(ordered):
            assert (low <= high + 1e-9).all()
        assert (ordered[0] < ordered[-1] - 0.01).any()


def test_another_seed_is_another_result() -> None:
    mesh = Mesh(*soup_over_floor(1))
    results = {ao.bake(mesh, ao.Binary(), samples=64, seed=seed).w.tobytes() for seed in (0, 1, 2**32, 2**64 - 1)}
    assert len(results) == 4


def slope(counts: np.ndarray, rmse: np.ndarray) -> float:
    """Exponent of rmse ∝ N^slope by least squares."""
    return float(np.polyfit(np.log(counts), np.log(rmse), 1)[0])


def test_smooth_error_falls_as_fast_as_promised() -> None:
    """At the centres of closed cubes' floors; τ = 5 leaves less to gain and falls as N^(−1.1)."""
    floor = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0.5, 0.5, 0)]
    corners, faces = hull([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)])
    others = faces[:, ::-1][(corners[faces][:, :, 2] > 0).any(axis=1)]
    fan = np.array([(k, (k + 1) % 4, 4) for k in range(4)])
    cube, within = join([(np.array(floor, float), fan), (corners, others)])
    vertices, faces = join([(cube + 1.5 * np.array(place), within) for place in np.ndindex(5, 5, 4)])
    mesh = ao.PreparedMesh(generic_rotation(8).apply(vertices), faces)
    truth = analytic.box((0.5, 0.5, 0.5, 0.5), 1.0, 1.0)
    only = np.arange(len(vertices)) % len(cube) == 4
    counts = 2 ** np.arange(4, 11, 2)

    def errors(samples: int, seed: int) -> np.ndarray:
        return ao.bake(mesh, ao.Exponential(tau=1.0), samples=samples, seed=seed, only=only).w[only] - truth

    found = [[errors(int(n), seed) for seed in range(4)] for n in counts]
    assert slope(counts, np.sqrt(np.mean(np.square(found), axis=(1, 2)))) <= -1.2


def test_error_at_edges_falls_as_fast_as_promised() -> None:
    mesh = Mesh(*hills())
    counts = 2 ** np.arange(4, 11, 2)
    truth = np.mean([ao.bake(mesh, ao.Binary(), samples=8192, seed=900 + k).w for k in range(4)], axis=0)
    errors = [[ao.bake(mesh, ao.Binary(), samples=int(n), seed=seed).w - truth for seed in range(6)] for n in counts]
    assert slope(counts, np.sqrt(np.mean(np.square(errors), axis=(1, 2)))) <= -0.7
