"""Direction sets that points which follow one another draw together: the parts of one lattice."""

import numpy as np
import pytest

from obscurance.ao.rays.directions import DirectionTable, choose

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
