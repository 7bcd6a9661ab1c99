"""Seams are closed by the bounded minimum of changes and jumps, by the conditions for it in dense matrices."""

import numpy as np
import pytest

from obscurance.ao.texture.seams import _FIRMEST, _FREE, _ROUGH, Lookups, Seams

SIZE = 64, 32


def network(rng):
    """The spokes and the rim of a wheel as seams; it lies at two places of the page, turned and of two sizes."""
    along, sides = np.linspace(0, 1, 30)[:, None], []
    for hub in ((16, 16), (48, 16)):
        turns = rng.uniform(0, 2 * np.pi) + np.arange(5) * 2 * np.pi / 5
        rim = hub + rng.uniform(12, 15) * np.stack([np.cos(turns), np.sin(turns)], axis=1)
        ends = [*((np.array(hub), end) for end in rim), *zip(rim, np.roll(rim, 1, axis=0), strict=True)]
        sides.append(np.concatenate([first + along * (last - first) for first, last in ends]))
    return np.stack(sides, axis=1)


def everywhere(rng):
    """Samples that meet in all directions."""
    return rng.uniform(0, SIZE, (1400, 2, 2))


def slit(rng):
    """An edge that meets itself: both sides lie within the same texels, or even at the same place."""
    along = rng.uniform(4, 28, (60, 1)) * [1, 0.7]
    apart = rng.choice([0.0, 1e-3, 0.2], (60, 1))
    return np.stack([along, along + apart], axis=1)


def twice(rng):
    """Every sample twice, and once more from the other side."""
    places = network(rng)
    return np.concatenate([places, places, places[:, ::-1]])


def corner(rng):
    """Samples beyond a corner of the page, whose lookups see one texel four times; both sides of some see the same."""
    return rng.choice([-5.0, -2.0, 20.0], (40, 2, 2))


def dense(lookups):
    """Lookups as rows of a dense matrix over all of the page."""
    rows = np.zeros((len(lookups.texels), SIZE[0] * SIZE[1]))
    np.add.at(rows, (np.arange(len(rows))[:, None], lookups.texels), lookups.weights)
    return rows


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("places", [network, everywhere, slit, twice, corner])
def test_closed_seams_are_the_bounded_minimum(places, seed):
    rng = np.random.default_rng(seed)
    seams = Seams(Lookups.at(places(rng), SIZE, places is not corner), 1)
    page = np.clip(rng.normal(0.5, 0.5, SIZE[0] * SIZE[1]), 0, 1)
    shown, share = Lookups.at(rng.uniform(0, SIZE, (3000, 2)), SIZE, True), rng.uniform(0.1, 2, 3000)
    closed = seams.close(page, shown, share, 1)
    # The conditions: no step down the gradient, scaled by the diagonal and clamped, moves a texel that seams look up.
    texels = np.unique(seams.sides.texels)
    left, right = (dense(Lookups(seams.sides.texels[:, k], seams.sides.weights[:, k]))[:, texels] for k in (0, 1))
    seen = dense(shown)[:, texels]
    rough = page[seams.sides.texels].var(axis=2).mean(axis=1)
    pull = _ROUGH**2 / np.minimum(rough, np.median(rough)).clip(_ROUGH**2 / _FIRMEST)
    stay = seen.T * share @ seen + _FREE * np.eye(len(texels))
    matrix = stay + (left - right).T * pull @ (left - right)
    step = np.clip(closed[texels] - (matrix @ closed[texels] - stay @ page[texels]) / np.diag(matrix), 0, 1)
    assert np.abs(step - closed[texels]).max() < 2e-3
    assert np.sqrt(np.mean((step - closed[texels]) ** 2)) < 2e-4
    others = np.setdiff1d(np.arange(len(page)), texels)
    assert np.array_equal(closed[others], page[others])
    assert seams.close(page, shown, share, 2).tobytes() == closed.tobytes()


def test_an_edge_on_a_smooth_page_is_closed_and_one_among_rough_texels_stays_near():
    """A step of .2 between two smooth charts goes; random texels keep the most of what lookups see of them."""
    rng = np.random.default_rng(0)
    edges = [np.stack([np.full(80, x), np.linspace(3, 29, 80)], axis=1) for x in (16, 48)]
    seams = Seams(Lookups.at(np.stack(edges, axis=1), SIZE, True), 1)
    inside = np.stack(np.meshgrid(np.arange(64) + 0.5, np.arange(32) + 0.5), axis=-1).reshape(-1, 2)
    shown, share = Lookups.at(inside, SIZE, True), np.ones(len(inside))
    smooth = np.where(inside[:, 0] < 32, 0.4, 0.6) + 0.001 * inside[:, 1]
    rough = rng.random(len(inside))
    assert seams.jump(smooth) > 0.19
    assert seams.jump(seams.close(smooth, shown, share, 1)) < 0.005
    changed = seams.close(rough, shown, share, 1)
    assert seams.jump(changed) < seams.jump(rough)
    assert np.sqrt(np.mean((changed - rough)[np.unique(seams.sides.texels)] ** 2)) < 0.02


def test_without_samples_nothing_changes():
    page = np.random.default_rng(0).random(SIZE[0] * SIZE[1])
    seams = Seams(Lookups.at(np.zeros((0, 2, 2)), SIZE, True), 0)
    nothing = Lookups.at(np.zeros((0, 2)), SIZE, True)
    assert np.array_equal(seams.close(page, nothing, np.zeros(0), 1), page)
    one = Seams(Lookups.at(np.full((1, 2, 2), 5.0), SIZE, True), 1)  # a row that cancels, and no texel that shows
    assert np.array_equal(one.close(page, nothing, np.zeros(0), 1), page)
