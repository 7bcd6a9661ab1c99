"""Direction sets that points which follow one another draw together: the parts of one lattice."""

import numpy as np
import pytest

from obscurance.ao.rays.directions import RUN, DirectionTable, choose, number_in_run

SAMPLES, KEY = 50, np.uint32(7)


def drawn(table, number):
    """Places on the disk (2, samples) of a point's directions, and which set they are."""
    chosen, turn = choose(np.uint32(number), table)
    x, y = table.directions[chosen, :2, : len(table.batches)].astype(np.float64)
    return np.array([x * np.cos(turn) - y * np.sin(turn), x * np.sin(turn) + y * np.cos(turn)]), int(chosen)


@pytest.mark.parametrize("leap", [2, 4])
def test_together_they_have_one_direction_in_every_ring_and_a_lattice_around(leap):
    table = DirectionTable.make(SAMPLES, 1000, KEY, leap)
    for first in (0, 40, 84):
        together = np.concatenate([drawn(table, first + slot)[0] for slot in range(leap)], axis=1)
        u = np.sum(together**2, axis=0)
        order = np.argsort(u)
        assert np.floor(u[order] * leap * SAMPLES + 1e-3).astype(int).tolist() == list(range(leap * SAMPLES))
        v = np.arctan2(together[1], together[0])[order] / (2 * np.pi)
        step = (np.diff(v) - 0.36038 + 0.5) % 1 - 0.5
        assert np.abs(step).max() < 1.01 / (leap * SAMPLES)


def test_every_point_draws_every_part_as_often():
    """Or it would look into some of the strata alone, and be wrong in the mean."""
    table = DirectionTable.make(SAMPLES, 1000, KEY, 4)
    parts = np.array([[drawn(table, 4 * owner + slot)[1] % 4 for slot in range(4)] for owner in range(1000)])
    assert (np.sort(parts, axis=1) == np.arange(4)).all()
    counts = np.array([np.bincount(column, minlength=4) for column in parts.T])
    assert np.abs(counts - 250).max() < 60


@pytest.mark.parametrize("count", [4, 16, 64])
def test_any_points_of_a_run_that_follow_one_another_are_even_together(count):
    """The shares of random half planes of the disk err by less than by lattices that know nothing of each other."""
    random = np.random.default_rng(count)
    cuts = random.uniform(-0.8, 0.8, 24)
    turns = random.uniform(0, 2 * np.pi, 24)
    exact = (np.arccos(cuts) - cuts * np.sqrt(1 - cuts**2)) / np.pi
    errors = []
    for leap, number_of in ((RUN, number_in_run), (1, np.uint32)):
        table = DirectionTable.make(32, 1 << 14, KEY, leap)
        off = []
        for first in random.integers(0, 1 << 12, 40):
            x, y = np.concatenate([drawn(table, number_of(first + k))[0] for k in range(count)], axis=1)
            beyond = np.cos(turns)[:, None] * x + np.sin(turns)[:, None] * y > cuts[:, None]
            off.append(beyond.mean(axis=1) - exact)
        errors.append(np.sqrt(np.mean(np.square(off))))
    assert errors[0] < 0.85 * errors[1]


def test_runs_have_every_set_once():
    numbers = np.array([number_in_run(rank) for rank in range(3 * RUN)])
    assert (np.sort(numbers.reshape(3, RUN), axis=1) == np.arange(3 * RUN).reshape(3, RUN)).all()
