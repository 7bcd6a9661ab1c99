"""The least change that closes seams within [0, 1], by the conditions for its minimum in dense matrices."""

import numpy as np
import pytest
from scipy.sparse import csr_array

from ao.least_squares.dual_newton import least_change
from ao.texture.seams import _FREE, _PULL, Lookups, Seams

SIZE = 64, 32


def network(rng):
    """The spokes and the rim of a wheel as seams; it lies at two places of the page, turned and of two sizes."""
    along, sides = np.linspace(0, 1, 30)[:, None], []
    for hub in ((16, 16), (48, 16)):
        turns = rng.uniform(0, 2 * np.pi) + np.arange(5) * 2 * np.pi / 5
        rim = hub + rng.uniform(12, 15) * np.stack([np.cos(turns), np.sin(turns)], axis=1)
        ends = [*((np.array(hub), end) for end in rim), *zip(rim, np.roll(rim, 1, axis=0), strict=True)]
        sides.append(np.concatenate([first + along * (last - first) for first, last in ends]))
    return Seams(Lookups.at(np.stack(sides, axis=1), SIZE, True), 10)


def everywhere(rng):
    """Samples that meet in all directions, whose factors would be full."""
    return Seams(Lookups.at(rng.uniform(0, SIZE, (1400, 2, 2)), SIZE, True), 1)


def problem(seams, rng):
    """A page, what is covered of it, the texels that are looked up, and D, v and s of these."""
    page, covered = np.clip(rng.normal(0.5, 0.5, 64 * 32), 0, 1), rng.random(64 * 32) < 0.7
    each, weights = seams.sides.texels.reshape(-1, 8), seams.sides.weights * [[1], [-1]]
    texels, columns = np.unique(each.ravel(), return_inverse=True)
    starts = np.arange(0, columns.size + 1, 8, dtype=np.int32)
    differences = csr_array((weights.ravel(), columns.astype(np.int32), starts), shape=(len(each), len(texels)))
    return page, covered, texels, (differences, page[texels], np.where(covered[texels], 1.0, _FREE))


def off_minimum(x, matrix, right):
    """How far a step down the gradient, scaled by the diagonal and clamped, moves x: 0 at the bounded minimum alone."""
    return np.abs(x - np.clip(x - (matrix @ x - right) / np.diag(matrix), 0, 1)).max()


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize(("samples", "bound"), [(network, 1e-6), (everywhere, 5e-4)])
def test_closed_seams_are_the_bounded_minimum(samples, bound, seed):
    rng = np.random.default_rng(seed)
    seams = samples(rng)
    page, covered, texels, (differences, values, stay) = problem(seams, rng)
    closed = seams.close(page, covered, 1)
    dense = differences.toarray()
    matrix, right = np.diag(stay) + _PULL * dense.T @ dense, stay * values
    assert off_minimum(closed[texels], matrix, right) < bound
    assert off_minimum(np.clip(np.linalg.solve(matrix, right), 0, 1), matrix, right) > 0.1  # a clamp would not do
    others = np.setdiff1d(np.arange(len(page)), texels)
    assert np.array_equal(closed[others], page[others])


def test_only_samples_that_meet_in_all_directions_are_left_to_conjugate_gradients():
    rng = np.random.default_rng(0)
    factored, filled = (problem(samples(rng), rng)[3] for samples in (network, everywhere))
    assert least_change(*factored, _PULL) is not None
    assert least_change(*filled, _PULL) is None
    crowded = filled[0].copy()
    crowded.indices %= 16  # D Dᵀ is full
    assert least_change(crowded, *filled[1:], _PULL) is None
