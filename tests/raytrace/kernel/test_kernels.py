"""Kernels called from Python: every kind of argument and result, against the same function interpreted."""

import ctypes
import sys
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import numpy as np
import pytest

from obscurance.raytrace.kernel import jit
from obscurance.raytrace.kernel.jit import called_back, inline, kernel
from obscurance.raytrace.kernel.simd import rows_at


class Pair(NamedTuple):
    values: Any
    factor: Any


@inline
def scaled(pair):
    return pair.values * pair.factor


@kernel
def total(pair, rows):
    made = np.zeros(rows.shape)
    for i in range(rows.shape[0]):
        for j in range(rows.shape[1]):
            made[i, j] = rows[i, j] * pair.factor
    return made.sum() + scaled(pair).sum()


class Kin(np.ndarray):
    pass


ROWS = np.arange(12.0).reshape(3, 4)
VALUES = np.arange(5.0)


LAYOUTS = [ROWS, ROWS.T, ROWS[:, ::2], ROWS[::-1], ROWS.astype("f"), ROWS.astype("i"), ROWS[:0], ROWS.view(Kin)]
NUMBERS = [-3, np.float32(2.5), np.uint64(3), np.uint8(200), True]


@pytest.mark.parametrize(
    ("rows", "factor"), [*((rows, 2.5) for rows in LAYOUTS), *((ROWS[:, ::2], number) for number in NUMBERS)]
)
def test_arrays_of_any_layout_and_numbers_of_any_type(rows, factor):
    pair = Pair(VALUES, factor)
    assert total(pair, rows) == pytest.approx(rows.sum(dtype=float) * factor + VALUES.sum() * factor)


@kernel
def several(a, b, c, d):
    return a + 1, b > c, c * np.float32(2), d, np.uint64(1) << np.uint64(63)


def test_results_keep_signs_and_precision():
    assert several(-3, 1.5, np.float32(0.1), False) == (-2, True, float(np.float32(0.2)), False, 1 << 63)


@kernel
def nested(a):
    return (a, (a + 1, a > 3)), 2 * a, (a, a)


def test_tuples_of_tuples_come_back_as_they_are():
    assert nested(2.0) == ((2.0, (3.0, False)), 4.0, (2.0, 2.0))


@kernel
def largest(x):
    return x


@pytest.mark.parametrize("number", [-(1 << 63), (1 << 63) - 1, 1 << 63, (1 << 64) - 1])
def test_whole_numbers_of_64_bits(number):
    assert largest(number) == number


@kernel
def write(out, value):
    out[:] = value


def test_results_are_written_in_place():
    out = np.zeros(3)
    assert write(out, 2.0) is None
    assert out.tolist() == [2, 2, 2]


def test_read_only_arrays_share_the_code_of_writable_ones():
    expected, before = total(Pair(VALUES, 2.0), ROWS), len(jit.loaded)
    values, rows = VALUES.copy(), ROWS.copy()
    values.flags.writeable = rows.flags.writeable = False
    assert total(Pair(values, 2.0), rows) == expected
    assert len(jit.loaded) == before


def test_a_helper_can_be_called_from_python_too():
    assert scaled.function(Pair(2, 3)) == 6
    assert largest.function(7) == 7


@kernel
def listed(count):
    return len([k for k in range(count)])


def test_what_needs_numbas_runtime_is_refused_when_it_is_compiled():
    with pytest.raises(TypeError, match=r"listed.*expected no lists"):
        listed(3)


@kernel
def huge(count):
    return np.empty(count)[0]


def test_memory_that_is_not_there_is_an_error():
    with pytest.raises(MemoryError, match="huge"):
        huge(1 << 58)


def test_threads_load_a_kernel_once():
    @kernel
    def fresh(x):
        return x + 1

    before = len(jit.loaded)
    with ThreadPoolExecutor(8) as pool:
        assert list(pool.map(fresh, range(50))) == list(range(1, 51))
    assert len(jit.loaded) == before + 1


@pytest.mark.parametrize("given", ["a", [1.0], {"a": 1}])
def test_arguments_that_no_kernel_takes(given):
    with pytest.raises(TypeError):
        largest(given)


def test_an_array_passed_to_a_kernel_is_let_go():
    rows = np.zeros((2, 2))
    before = sys.getrefcount(rows)
    total(Pair(VALUES, 1.0), rows)
    assert sys.getrefcount(rows) == before


@kernel
def sum_of(rows, more):
    if more is not None:
        return rows.sum() + more.weights.sum()
    return rows.sum()


def test_a_kernel_is_compiled_without_what_it_is_not_given():
    class More(NamedTuple):
        weights: Any

    assert sum_of(np.ones(3), None) == 3.0
    assert sum_of(np.ones(3), More(np.ones(2))) == 5.0


@called_back(0)
def add_up(call, pair, out):
    given = rows_at(call, 1, 4)
    out[0] = pair.factor * given[0, 2] + pair.values.sum() + given[0, 3]


def test_c_functions_call_a_kernel_back_with_their_address_and_words():
    out = np.zeros(1)
    address, words = add_up.callback(Pair(VALUES, 2.0), out)
    given = np.array([words.ctypes.data, 0], np.int64)
    given.view(np.float32)[2:] = 3.0, 0.5
    ctypes.CFUNCTYPE(None, ctypes.c_void_p)(address)(given.ctypes.data)
    assert out[0] == 6.5 + VALUES.sum()


class Record(NamedTuple):
    values: np.ndarray
    factor: float
    absent: None
    pair: Pair
    both: tuple[np.ndarray, int]


@inline
def summed(record):
    """Of the record's arrays: what helpers see of a record, which is its address."""
    if record.absent is not None:
        return 0.0
    whole = record.factor * record.values.sum() + record.pair.factor * record.pair.values[1]
    return whole + record.both[0][0] * record.both[1]


@kernel
def of_a_record(record, out):
    for k in range(len(out)):
        out[k] = summed(record) + k
    record.pair.values[0] = -1.0


def test_the_address_of_a_record_has_its_members():
    values, out = np.array([3.0, 5.0]), np.empty(3)
    of_a_record(Record(np.array([1.0, 2.0]), 0.5, None, Pair(values, 2.0), (np.array([7.0]), 3)), out)
    np.testing.assert_array_equal(out, 0.5 * 3 + 2 * 5 + 7 * 3 + np.arange(3))
    assert values.tolist() == [-1.0, 5.0]
