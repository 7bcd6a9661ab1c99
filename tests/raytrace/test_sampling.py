"""Points and warps: nets stay nets under scrambling, densities are what they say."""

import numpy as np
import pytest
from scipy import stats
from scipy.stats import qmc

from obscurance.raytrace.sampling import (
    cosine_hemisphere,
    jittered_lattice,
    owen_sobol,
    seed_key,
    shuffled_owen_sobol,
    sobol,
)
from obscurance.raytrace.sampling import hash32_array as hash32


def test_sobol_points_are_the_published_ones():
    ours = np.stack(sobol(256), axis=1) * 2.0**-32
    published = qmc.Sobol(2, scramble=False).random(256)
    assert {tuple(p) for p in ours} == {tuple(p) for p in published}


@pytest.mark.parametrize("log_count", [0, 3, 6, 8])
def test_every_scrambled_set_is_a_net(log_count):
    """Every elementary interval of area 1/n holds one point, as for the unscrambled (0, m, 2)-net."""
    count = 1 << log_count
    u, v = owen_sobol(50, count, seed_key(3))
    for split in range(log_count + 1):
        cell = np.floor(u * 2**split) * 2 ** (log_count - split) + np.floor(v * 2 ** (log_count - split))
        np.testing.assert_array_equal(np.sort(cell, axis=1), np.broadcast_to(np.arange(count), cell.shape))


@pytest.mark.parametrize("count", [4, 16, 64, 256])
def test_shuffled_sets_have_the_same_points_and_even_runs(count):
    """Aligned runs of 2^k points hold a point in each 2^-k of either coordinate."""
    u, v = shuffled_owen_sobol(50, count, seed_key(3))
    for expected, found in zip(owen_sobol(50, count, seed_key(3)), (u, v), strict=True):
        assert np.array_equal(np.sort(expected, axis=1), np.sort(found, axis=1))
        for run in (4, 16, count):
            runs = np.sort(np.floor(found.reshape(50, -1, min(run, count)) * min(run, count)), axis=2)
            assert (runs == np.arange(min(run, count))).all()


def test_pairs_with_a_shuffled_set_fill_four_dimensions():
    """Numbers of 256 points in the sixteen squares of a coordinate of one set and one of the other. Unshuffled sets of
    two keys fill four of these squares alone."""
    one, other = owen_sobol(200, 256, seed_key(1)), shuffled_owen_sobol(200, 256, seed_key(2))
    for a in one:
        for b in other:
            square = 4 * np.floor(4 * a).astype(int) + np.floor(4 * b).astype(int)
            counts = np.stack([np.bincount(each, minlength=16) for each in square])
            assert stats.chisquare(counts.sum(axis=0)).pvalue > 1e-4
            assert counts.min() > 0
            assert counts.max() < 48


def test_each_point_of_a_set_is_uniform_over_scrambles():
    u, v = owen_sobol(20_000, 4, seed_key(1))
    for values in (u[:, 0], u[:, 3], v[:, 0], v[:, 2]):
        assert stats.kstest(values, "uniform").pvalue > 1e-4
    assert abs(np.corrcoef(u[:, 0], v[:, 0])[0, 1]) < 0.03


def test_seeds_and_sets_differ():
    first, second = owen_sobol(4, 64, seed_key(0))[0], owen_sobol(4, 64, seed_key(1))[0]
    assert len(np.unique(np.concatenate([first, second]), axis=0)) == 8
    assert seed_key(2**40) != seed_key(0)


def test_hash_is_a_bijection_on_a_sample():
    assert len(np.unique(hash32(np.arange(1 << 20)))) == 1 << 20


def test_directions_have_density_cosine_over_pi():
    u, v = owen_sobol(64, 1024, seed_key(5))
    d = np.moveaxis(cosine_hemisphere(u, v), 1, -1).reshape(-1, 3)
    np.testing.assert_allclose(np.linalg.norm(d, axis=1), 1, atol=1e-12)
    assert (d[:, 2] > 0).all()
    # Under cosθ/π: E z = 2/3, E z² = 1/2, E x = 0, E x² = 1/4.
    np.testing.assert_allclose(d.mean(axis=0), [0, 0, 2 / 3], atol=1e-3)
    np.testing.assert_allclose((d**2).mean(axis=0), [0.25, 0.25, 0.5], atol=1e-3)
    # A uniform hemisphere has E z = 1/2 and must not pass.
    assert abs(d[:, 2].mean() - 0.5) > 0.1


@pytest.mark.parametrize("count", [1, 7, 64])
def test_a_lattice_has_one_point_in_every_stratum(count):
    u, v = jittered_lattice(50, count, seed_key(3))
    np.testing.assert_array_equal(np.floor(u * count), np.broadcast_to(np.arange(count), u.shape))
    # v of the unjittered lattice: neighbours are at least 1/(√5 count) apart, so each gap holds at most 3 points.
    order = np.sort(v, axis=1)
    assert (order[:, 3:] - order[:, :-3] > 1 / (3 * count)).all()


def test_each_stratum_is_even_over_all_lattices_and_strata_are_independent():
    u, _ = jittered_lattice(64, 7, seed_key(3))
    within = 7 * u - np.arange(7)
    np.testing.assert_array_equal(
        np.sort(np.floor(64 * within), axis=0), np.broadcast_to(np.arange(64)[:, None], u.shape)
    )
    many = np.concatenate([7 * jittered_lattice(64, 7, seed_key(seed))[0] - np.arange(7) for seed in range(200)])
    assert np.abs(np.corrcoef(many.T) - np.eye(7)).max() < 0.04  # 4.5 standard errors


def test_each_point_of_a_lattice_is_uniform_once_it_is_turned():
    u, v = jittered_lattice(20_000, 4, seed_key(1))
    turned = (v[:, 1] + np.random.default_rng(0).random(len(v))) % 1
    for values in (4 * u[:, 0], 4 * u[:, 3] - 3, turned):
        assert stats.kstest(values, "uniform").pvalue > 1e-4
