"""Kernels that run over rows on threads, against the same functions interpreted row by row."""

import numpy as np
import pytest

from obscurance.raytrace.system import parallel as module
from obscurance.raytrace.system.parallel import each, parallel
from obscurance.raytrace.types import Float64Rows, Float64s

ROWS = np.random.default_rng(3).normal(size=(70_001, 3))


@each("rows")
def scaled_sum(row: int, factor: float, rows: Float64Rows, out: Float64s) -> None:
    if rows[row, 0] < 0.0:
        return
    out[row] = factor * (rows[row, 0] + rows[row, 1] + rows[row, 2])


@parallel("out", 1 << 10)
def running_sum(start: int, stop: int, rows: Float64Rows, out: Float64s) -> None:
    total = 0.0
    for row in range(start, stop):
        total += rows[row, 0]
        out[row] = total


@parallel("counts", 8, alone=True)
def histogram(start: int, stop: int, values: Float64s, counts: Float64s) -> None:
    for value in values:
        if start <= value < stop:
            counts[int(value)] += 1


@pytest.mark.parametrize("threads", [None, 1, 2, 5])
@pytest.mark.parametrize("count", [0, 1, 5000, 70_001])
def test_each_row_is_done_once_on_any_number_of_threads(threads, count):
    rows, out = ROWS[:count], np.zeros(count)
    scaled_sum.on(threads)(2.0, rows, out)
    expected = np.where(rows[:, 0] < 0.0, 0.0, 2.0 * (rows[:, 0] + rows[:, 1] + rows[:, 2]))
    np.testing.assert_array_equal(out, expected)
    if threads is None:
        again = np.zeros(count)
        scaled_sum(2.0, rows, again)
        np.testing.assert_array_equal(again, expected)


def parts_of(monkeypatch, kernel, *arguments, threads):
    """The parts [start, stop) that a kernel is called for."""
    parts = []
    monkeypatch.setattr(kernel, "_run", lambda arguments, *_: parts.append(arguments[:2]))
    kernel.on(threads)(*arguments)
    return sorted(parts)


def test_blocks_join_to_all_rows(monkeypatch):
    parts = parts_of(monkeypatch, running_sum, ROWS, np.zeros(len(ROWS)), threads=4)
    assert [start for start, _ in parts] == [0, *(stop for _, stop in parts)][:-1]
    assert parts[-1][1] == len(ROWS)
    assert all(start % (1 << 10) == 0 for start, _ in parts)
    assert len(parts) > 4


def test_a_kernel_that_looks_at_all_rows_gets_a_block_for_each_thread(monkeypatch):
    monkeypatch.setattr(module, "granted", lambda threads: threads)
    for count, threads, blocks in ((100, 3, 3), (100, 64, 12), (7, 4, 1), (0, 4, 0)):
        parts = parts_of(monkeypatch, histogram, np.zeros(3), np.zeros(count), threads=threads)
        assert len(parts) <= blocks
        assert len(parts) > blocks // 2 or not count
        assert all(stop - start >= 8 for start, stop in parts[:-1])
        assert not parts or parts[-1][1] == count


def test_what_all_rows_say_is_counted_once():
    values, counts = np.abs(ROWS[:, 0].copy()) * 20.0, np.zeros(100)
    histogram.on(7)(values, counts)
    np.testing.assert_array_equal(counts, np.bincount(values.astype(int), minlength=100))


def test_rows_of_one_s_own_choice():
    out = np.zeros(len(ROWS))
    scaled_sum.for_rows(1.0, np.abs(ROWS), out)(10, 20)
    assert np.flatnonzero(out).tolist() == list(range(10, 20))


def test_a_kernel_takes_no_names():
    with pytest.raises(TypeError, match="out"):
        scaled_sum(2.0, ROWS, out=np.zeros(3))


def test_a_row_is_documented_as_it_is_written():
    @each("out")
    def ones(i: int, out: Float64s) -> None:
        """Write 1 everywhere."""
        out[i] = 1.0

    assert (ones.__name__, ones.__doc__, ones.__module__) == ("ones", "Write 1 everywhere.", __name__)
    assert ones.function.__annotations__ == {"start": int, "stop": int, "out": Float64s}
