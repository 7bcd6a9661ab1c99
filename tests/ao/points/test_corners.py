"""Vertices that share no hemisphere with their faces: w as the mean over their corners."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from interrupted_bakes import bake, folders, interrupted
from meshes import crumpled
from reference import corner_means, folded
from stress.solids import grid

from obscurance import ao
from obscurance.raytrace import Mesh
from obscurance.raytrace.mesh.normals import own_vertex_normals
from obscurance.scenes.geometry.polyhedra import icosphere, join
from obscurance.scenes.validation.reference import reference

TORN = ao.Flag.FOLDED | ao.Flag.OPPOSED
FALLOFFS = [(None, ao.Binary()), (2.0, ao.Exponential(tau=2.0))]


@pytest.fixture(scope="module")
def noisy():
    return crumpled(icosphere(2), 0.45, 1)


@pytest.fixture(scope="module")
def brute_force(noisy):
    """w at every fourth folded vertex as a function of τ, computed once for each."""
    return cache(lambda tau: corner_means(*noisy, folded(*noisy)[::4], tau, rays=12))


def split(baked):
    return (baked.flags & TORN) != 0


def test_every_vertex_with_a_face_behind_its_normal_is_flagged_and_no_other(noisy):
    baked = ao.bake(Mesh(*noisy), samples=8)
    assert np.flatnonzero(split(baked)).tolist() == folded(*noisy).tolist()
    assert baked.flagged["folded"] > 10
    assert baked.flagged["opposed"] > 0


@pytest.mark.parametrize(("tau", "falloff"), FALLOFFS)
@pytest.mark.parametrize("options", [{"samples": 256}, {"samples": 256, "denoise": False}, {"tolerance": 0.01}])
def test_folded_vertices_are_the_mean_over_their_corners(noisy, brute_force, tau, falloff, options):
    which = folded(*noisy)[::4]
    off = np.abs(ao.bake(Mesh(*noisy), falloff, **options).w[which] - brute_force(tau))
    assert off.mean() <= 0.025
    assert (off > 0.15).mean() <= 0.02
    assert (off > 0.3).mean() <= 0.01


@cache
def crumpled_ball():
    """A mesh with very many folds, and a bake of it by many rays."""
    mesh = Mesh(*crumpled(icosphere(4), 0.35, 5))
    return mesh, ao.bake(mesh, ao.Binary(), samples=8192, seed=1)


@pytest.mark.parametrize("options", [{"samples": 64}, {"samples": 256}, {"tolerance": 0.02}])
def test_their_errors_are_estimated(options):
    mesh, truth = crumpled_ball()
    bakes = [ao.bake(mesh, ao.Binary(), seed=seed, **options) for seed in range(2)]
    which = split(bakes[0])
    assert which.sum() > 500
    off = np.array([((baked.w - truth.w) / np.hypot(baked.error, truth.error))[which] for baked in bakes])
    assert 1 / 1.3 < np.sqrt(np.mean(off**2)) < 1.3
    assert np.quantile(np.abs(off), 0.999) < 6


def test_some_are_baked_like_all_by_any_number_of_threads(noisy):
    mesh = Mesh(*noisy)
    only = np.arange(len(mesh.vertices)) % 3 == 0
    whole = ao.bake(mesh, samples=64, denoise=False, threads=1)
    some = ao.bake(mesh, samples=64, denoise=False, threads=3, only=only)
    np.testing.assert_array_equal(some.w[only], whole.w[only])
    np.testing.assert_array_equal(some.bent_normals[only], whole.bent_normals[only])
    assert some.rays < whole.rays


def test_a_bake_interrupted_among_corners_continues_to_the_same_bits(noisy, tmp_path):
    mesh, output, options = Mesh(*noisy), tmp_path / "w.npy", {"samples": 4096}
    whole = ao.bake(mesh, **options)
    interrupted(output, 0.9, mesh=mesh, options=options)
    assert folders(output)
    again = bake(output, mesh=mesh, options=options)
    for one, other in ((again.w, whole.w), (again.error, whole.error), (again.bent_normals, whole.bent_normals)):
        assert one.tobytes() == other.tobytes()


def two_sided(side):
    vertices, faces = grid(2)
    return vertices, np.concatenate([faces, faces[:, ::-1]][::side])


@pytest.mark.parametrize("side", [1, -1])
def test_a_sheet_with_both_sides_welded_is_the_mean_of_both(side):
    """Whichever side comes first in the file: the upper one is open, the lower one closed by a floor."""
    sheet, floor = two_sided(side), grid(1, 1e3)
    mesh = Mesh(*join([(sheet[0] + [0, 0, 1e-3], sheet[1]), floor]))
    baked = ao.bake(mesh, ao.Binary(), samples=256)
    assert baked.flagged["opposed"] == 9
    assert baked.w[4] == pytest.approx(0.5, abs=0.002)


@pytest.mark.parametrize("tolerance", [0.02, 0.1])
def test_a_mesh_of_nothing_but_such_vertices_is_baked_to_a_tolerance(tolerance):
    sheet, lid = two_sided(1), two_sided(1)
    mesh = Mesh(*join([sheet, (lid[0] + [0, 0, 0.5], lid[1])]))
    baked, truth = (ao.bake(mesh, ao.Binary(), **kind) for kind in ({"tolerance": tolerance}, {"samples": 1 << 14}))
    assert split(baked).all()
    assert np.sqrt(np.mean((baked.w - truth.w) ** 2)) < tolerance
    assert baked.rays < truth.rays / 20


def test_bent_normals_are_means_too(noisy):
    mesh = Mesh(*noisy)
    few, many = (ao.bake(mesh, ao.Binary(), samples=samples) for samples in (128, 8192))
    which = split(few) & (many.w > 0.1)
    np.testing.assert_allclose(np.linalg.norm(few.bent_normals, axis=1), 1)
    assert np.quantile(np.einsum("ij,ij->i", few.bent_normals, many.bent_normals)[which], 0.1) > 0.97


def test_the_reference_of_benchmarks_is_the_same_quantity(noisy):
    mesh = Mesh(*noisy)
    truth = reference(mesh, [ao.Binary().resolve(mesh.radius)], 4096)
    baked = ao.bake(mesh, ao.Binary(), samples=4096, denoise=False)
    assert np.abs(baked.w[truth.vertices] - truth.w[0]).max() < 0.02


def test_hidden_ones_are_filled(noisy):
    outer = icosphere(3)
    mesh = Mesh(*join([(noisy[0] * 0.2, noisy[1]), (outer[0], outer[1])]))
    plain, marked = (ao.bake(mesh, samples=16, interior=policy) for policy in ("ignore", "mark"))
    np.testing.assert_array_equal(plain.w, marked.w)
    both = (marked.flags & TORN != 0) & (marked.flags & ao.Flag.HIDDEN != 0)
    assert both.any()


def test_the_files_normals_are_obeyed_where_they_are_in_front_of_the_faces(noisy):
    """Vertices whose own normal is behind a face are as they are without it, folded or not."""
    normals = noisy[0] / np.linalg.norm(noisy[0], axis=1, keepdims=True)
    mesh = Mesh(*noisy, normals)
    own = own_vertex_normals(mesh).any(axis=1)
    assert own.any()
    flags = ao.bake(mesh, samples=8).flags
    assert not (flags[own] & TORN).any()
    np.testing.assert_array_equal(flags[~own] & TORN, ao.bake(Mesh(*noisy), samples=8).flags[~own] & TORN)
