"""Text files as rows of numbers, read by kernels from blocks of their bytes, on all cores."""

from __future__ import annotations

import re
from collections.abc import Callable
from contextlib import suppress
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from obscurance.raytrace.system.threads import run_blocks, thread_count
from obscurance.raytrace.text import read_rows
from obscurance.raytrace.types import Float64s, Int64s, UInt8s

_END = re.compile(rb"[\r\n]")
_LINE_END = re.compile(rb"\r\n?|\n")
_WORD = re.compile(rb"[^#\s]+")
BLOCK = 1 << 18  # bytes, and the rest of the last line
_ODD = 1 << 16  # words that become text at once
_PLACE = (1 << 51) - 1  # the bits of a kernel's NaN that say where its word is


def line_blocks(data: bytes, begin: int = 0) -> tuple[bytes, UInt8s, list[tuple[int, int]]]:
    """The data, ending with a line, as bytes and as array, and begin and end of each block of lines after `begin`."""
    if data[-1:] not in (b"\r", b"\n"):
        data += b"\n"
    ends = [begin]
    while ends[-1] < len(data):
        ends.append(next(_END.finditer(data, min(ends[-1] + BLOCK, len(data)) - 1)).end())
    return data, np.frombuffer(data, np.uint8), list(pairwise(ends))


def for_blocks(count: int, work: Callable[[int], None]) -> None:
    """Call `work` with the number of each block, on all cores."""
    run_blocks(count, 1, lambda block, _: work(block), thread_count(None))


def round_left(data: bytes, values: Float64s, other: float | None = None) -> None:
    """Fill in the values (k,) that kernels have left as NaNs, of numbers that they cannot round.

    Args: data: the text. other: what stands for text that is not numbers. Raises: ValueError: there is such text.
    """
    odd = np.flatnonzero(np.isnan(values))
    for start in range(0, len(odd), _ODD):
        block = odd[start : start + _ODD]
        offsets = (values.view(np.int64)[block] & _PLACE).tolist()
        words = [next(_WORD.finditer(data, at))[0] for at in offsets]
        if other is None:
            try:
                values[block] = np.fromstring(b" ".join(words), sep=" ")
            except ValueError:
                raise _no_number(data, offsets, words) from None
            continue
        for place, word in zip(block, words, strict=True):
            values[place] = other
            with suppress(ValueError):
                values[place] = np.fromstring(word, sep=" ").item()


def _no_number(data: bytes, offsets: list[int], words: list[bytes]) -> ValueError:
    """An error that names the first of the words, at these offsets in the data, that is no number, and its line."""
    for at, word in zip(offsets, words, strict=True):
        try:
            np.fromstring(word, sep=" ").item()
        except ValueError:
            line = 1 + len(_LINE_END.findall(data[:at]))
            return ValueError(f"{word.decode('utf-8', 'replace')} in line {line:,}, which is no number")
    return ValueError("words that are no numbers")


class NumberRows(NamedTuple):
    """The lines of a text file that have words, what follows a # left out."""

    data: bytes  # of the file
    numbers: Float64s  # (k,), all words, with NaNs for `round_left`
    bounds: Int64s  # (rows + 1,), where the numbers of each row begin, and the last one's end

    @classmethod
    def of(cls, data: bytes, begin: int = 0) -> NumberRows:
        """The lines of `data` from byte `begin` on."""
        data, text, blocks = line_blocks(data, begin)
        numbers = [np.empty(0)] * len(blocks)
        counts = [np.zeros(1, np.int64)] * (1 + len(blocks))

        def work(block: int) -> None:
            begin, end = blocks[block]
            most = (end - begin) // 2 + 1
            words = np.empty(most)
            by_row = np.empty(most, np.int64)
            by_row = by_row[: read_rows(text, begin, end, words, by_row)].copy()
            numbers[block] = words[: by_row.sum()].copy()
            counts[1 + block] = by_row

        for_blocks(len(blocks), work)
        return cls(data, np.concatenate([np.empty(0), *numbers]), np.cumsum(np.concatenate(counts)))

    def words(self, at: Int64s) -> Int64s:
        """Where in the data the words at these places begin, of words that are no numbers."""
        return self.numbers.view(np.int64)[at] & _PLACE

    def starting_with(self, word: bytes) -> Int64s:
        """The rows whose first word is this one, in letters of either case."""
        candidates = np.flatnonzero(np.isnan(self.numbers[self.bounds[:-1]]))
        text = np.frombuffer(self.data, np.uint8)
        for offset, letter in enumerate(word):
            letters_at = self.words(self.bounds[candidates]) + offset
            candidates = candidates[text[np.minimum(letters_at, len(text) - 1)] | 32 == letter]
        after = text[self.words(self.bounds[candidates]) + len(word)]
        return np.asarray(candidates[(after <= 32) | (after == 35)])

    @property
    def lengths(self) -> Int64s:
        """How many words each row has."""
        return np.diff(self.bounds)

    def take(self, rows: slice | Int64s, skip: int | Int64s, sizes: int | Int64s, fault: Exception) -> Float64s:
        """So many numbers of each of some rows, one row after the other.

        Args:
            skip: how many words to leave out at the beginning of each row.
            sizes: how many numbers to take, of all rows or of each.

        Raises: `fault`: a row has fewer. ValueError: text that is not numbers.
        """
        at = self.bounds[:-1][rows] + skip  # of each row's first number in `numbers`
        counts = np.broadcast_to(sizes, at.shape)
        if ((counts < 0) | (counts > self.bounds[1:][rows] - at)).any():
            raise fault
        # Rows of one length, evenly spaced, are a view of the numbers; others are indexed one by one.
        stride = int(at[1] - at[0]) if len(at) > 1 else 0
        if len(at) and not np.ptp(counts) and (np.diff(at) == stride).all():
            shape = len(at), int(counts[0])
            values = np.lib.stride_tricks.as_strided(self.numbers[at[0] :], shape, (8 * stride, 8)).ravel()
        else:
            indices = np.repeat(at - np.cumsum(counts) + counts, counts)
            values = self.numbers[indices + np.arange(len(indices))]
        round_left(self.data, values)
        return values

    def take_lists(self, rows: slice, skip: int | Int64s, fault: Exception) -> tuple[Int64s, Float64s]:
        """Sizes and values of lists, each a size and so many numbers. Raises: as `take`; ValueError: other sizes."""
        numbers = self.take(rows, skip, 1, fault)
        sizes = numbers.astype(np.int64)
        if (wrong := sizes != numbers).any():
            raise ValueError(f"a list of {numbers[wrong][0]} values")
        return sizes, self.take(rows, skip + 1, sizes, fault)


def whole(numbers: Float64s) -> Int64s:
    """Numbers as indices of vertices. Raises: ValueError: some are no whole numbers."""
    indices = numbers.astype(np.int64)
    if numbers.dtype.kind == "f" and not (indices == numbers).all():
        raise ValueError("vertex indices that are no whole numbers")
    return indices
