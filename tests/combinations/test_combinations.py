"""Combinations drawn by their numbers keep the error that they tell."""

import numpy as np
import pytest

from .draws import drawn

FEW, MANY = 20, 500  # tests of ten draws each
TIMES = {"--at": 8.0, "--size": 3.0}  # of the root mean square error that is told: of tens of sites few are probed
USUAL, SLACK = 2.0, 0.004  # the same of vertices and points; and what is in no error that is told
FARTHEST = 30.0, 0.03


def faults(numbers, folder):
    """What is wrong with draws, each as its command and figures."""
    found = []
    for number in numbers:
        here = folder / str(number)
        here.mkdir()
        combination = drawn(number, here)
        if not len(combination.w):
            continue
        off = combination.w - combination.truth
        expected = np.hypot(combination.told, np.sqrt(np.mean(combination.error**2)))
        true, largest = np.sqrt(np.mean(off**2)), np.abs(off).max()
        times = max([TIMES[word] for word in TIMES if word in combination.line], default=USUAL)
        if true > times * expected + SLACK or largest > FARTHEST[0] * expected + FARTHEST[1]:
            line = " ".join(map(str, combination.line))
            found.append(f"{number}: told {combination.told:.4f}, true {true:.4f}, at most {largest:.3f}: {line}")
    return found


@pytest.mark.parametrize("ten", range(FEW))
def test_what_is_told_is_true(ten, tmp_path):
    assert faults(range(10 * ten, 10 * ten + 10), tmp_path) == []


@pytest.mark.slow
@pytest.mark.parametrize("ten", range(MANY))
def test_what_is_told_is_true_of_many(ten, tmp_path, pytestconfig):
    first = 1000 + pytestconfig.option.mesh_seed % 1_000_000 * 10_000 + 10 * ten
    assert faults(range(first, first + 10), tmp_path) == []
