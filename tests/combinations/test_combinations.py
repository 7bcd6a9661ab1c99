"""Combinations drawn by their numbers keep the error that they report."""

import numpy as np
import pytest

from .draws import drawn

FEW, MANY = 12, 500  # tests of ten draws each
TIMES, SLACK = 2.0, 0.004  # of the reported root mean square error, and what is in none that is reported
FARTHEST = 8.0, 0.03
TOGETHER = 0.4, 1.6  # true over reported errors of ten draws, root mean squares: .6 to 1.3 in forty tens


def check(numbers, folder):
    """Each draw by itself, with its command where it fails, and the errors of all together."""
    faults, squared, reported = [], [], []
    for number in numbers:
        here = folder / str(number)
        here.mkdir()
        combination = drawn(number, here)
        if not len(combination.w):
            continue
        off = combination.w - combination.truth
        squared.append(np.mean(off**2 - combination.error**2))
        reported.append(combination.reported**2)
        expected = np.hypot(combination.reported, np.sqrt(np.mean(combination.error**2)))
        true, largest = np.sqrt(np.mean(off**2)), np.abs(off).max()
        if true > TIMES * expected + SLACK or largest > FARTHEST[0] * expected + FARTHEST[1]:
            line = " ".join(map(str, combination.line))
            faults.append(f"{number}: reported {combination.reported:.4f}, true {true:.4f}, most {largest:.3f}: {line}")
    assert faults == []
    assert TOGETHER[0] < np.sqrt(max(sum(squared), 0) / sum(reported)) < TOGETHER[1]


@pytest.mark.parametrize("ten", range(FEW))
def test_reported_errors_are_true(ten, tmp_path):
    check(range(10 * ten, 10 * ten + 10), tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("ten", range(MANY))
def test_reported_errors_are_true_of_many(ten, tmp_path, pytestconfig):
    first = 1000 + pytestconfig.option.mesh_seed % 1_000_000 * 10_000 + 10 * ten
    check(range(first, first + 10), tmp_path)
