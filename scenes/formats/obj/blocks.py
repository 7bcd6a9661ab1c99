"""The bytes of a Wavefront OBJ file in blocks, which kernels read on all cores."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from raytrace.system.threads import run_blocks, thread_count
from raytrace.text import lines
from raytrace.text.decimal import POWERS
from raytrace.text.lines import COUNT, LEAST, MOST, NEEDED, NUMBERED, SLASHES, USABLE, WORDS, F, V
from raytrace.types import Float64s, Int64s, UInt8s

from ..number_rows import line_blocks, round_left


@dataclass(frozen=True, eq=False)
class ObjBlocks:
    """An OBJ file, continued lines joined."""

    data: bytes  # ends with a line
    text: UInt8s  # the same
    bounds: list[tuple[int, int]]  # where each block of lines begins and ends
    tallies: Int64s  # (blocks, 4, 6), of `survey`
    before: Int64s  # (blocks + 1, 4, 6), sums of the tallies before each block
    rest: list[Int64s]  # by block, its runs of other statements

    @classmethod
    def of(cls, data: bytes) -> ObjBlocks:
        data = data.removeprefix(b"\xef\xbb\xbf")
        if b"\\" in data:
            for end in (b"\r\n", b"\r", b"\n"):
                data = data.replace(b"\\" + end, b" ")
        data, text, bounds = line_blocks(data)
        tallies = np.zeros((len(bounds), F + 1, SLASHES + 1), np.int64)
        rest = [np.empty((0, 3), np.int64)] * len(bounds)

        def work(block: int, _: int) -> None:
            begin, end = bounds[block]
            found = np.empty(((end - begin) // 4 + 2, 3), np.int64)
            rest[block] = found[: lines.survey(text, begin, end, tallies[block], found)].copy()

        run_blocks(len(bounds), 1, work, thread_count(None))
        before = np.cumsum(np.insert(tallies, 0, 0, axis=0), axis=0)
        return cls(data, text, bounds, tallies, before, rest)

    @property
    def short(self) -> int:
        """How many vertices have fewer numbers than they need."""
        return int(self.before[-1, V, COUNT] - self.before[-1, V, USABLE])

    @property
    def has_colors(self) -> bool:
        """Whether some vertices have six numbers."""
        return bool((self.tallies[:, V, LEAST : MOST + 1] == 6).any())

    def texts(self) -> Iterator[tuple[str, int]]:
        """Other statements, and how many faces come before them."""
        for faces, runs in zip(self.before[:, F, COUNT].tolist(), self.rest, strict=False):
            for begin, end, more in runs.tolist():
                yield self.data[begin:end].decode("utf-8", "replace").replace("\r", "\n"), faces + more

    def numbers(self, keyword: str) -> Float64s:
        """All numbers of a keyword's lines (k, any) where they have equally many, enough; else the first of each line.

        Raises: ValueError: text that is not numbers.
        """
        kind = NUMBERED.index(keyword)
        least, needed = self.tallies[:, kind, LEAST].min(), int(NEEDED[kind])
        alike = needed <= least == self.tallies[:, kind, MOST].max()
        ends = self.before[:, kind, USABLE]
        rows = np.empty((ends[-1], least if alike else needed))

        def work(block: int, _: int) -> None:
            if self.tallies[block, kind, COUNT]:
                own = rows[ends[block] : ends[block + 1]]
                lines.read_numbers(self.text, *self.bounds[block], kind, POWERS, own)

        run_blocks(len(self.bounds), 1, work, thread_count(None))
        round_left(self.data, rows.reshape(-1))
        return rows

    def faces(self) -> tuple[Int64s, Int64s, bool]:
        """Sizes (p,), indices (1 or 3, c), and whether all of these are numbers; see `read_faces`."""
        sizes = np.empty(self.before[-1, F, COUNT], np.int64)
        indices = np.empty((3 if self.before[-1, F, SLASHES] else 1, self.before[-1, F, WORDS]), np.int64)
        valid = [True] * len(self.bounds)

        def work(block: int, _: int) -> None:
            if self.tallies[block, F, COUNT]:
                found = self.before[block], sizes, indices
                valid[block] = lines.read_faces(self.text, *self.bounds[block], *found)

        run_blocks(len(valid), 1, work, thread_count(None))
        return sizes, indices, all(valid)
