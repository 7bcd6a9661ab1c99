"""The statements of a Wavefront OBJ file: vertices, faces, and the indices at their corners.

Kernels read vertices and faces from blocks of the file's bytes, on all cores; the rest becomes text.

Format: Wavefront Advanced Visualizer manual, appendix B1.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from raytrace.errors import MeshError
from raytrace.system.threads import run_blocks, thread_count
from raytrace.text import lines
from raytrace.text.decimal import POWERS
from raytrace.text.lines import COUNT, LEAST, MOST, NEEDED, NONE, NUMBERED, SLASHES, USABLE, WORDS, F, V
from raytrace.types import Bools, Float64s, Int64s, UInt8s

from ...geometry.detail import PerCorner
from ..number_rows import line_blocks, round_left

_RUN = re.compile(r"^[ \t]*(\w+)(?!\S)[^\n]*(?:\n[ \t]*\1(?!\S)[^\n]*)*+", re.MULTILINE)
_UNMATCHED = "string or file could not be read to its end due to unmatched data"  # as NumPy says


class Run(NamedTuple):
    """Statements of one keyword after one another, a line each, and how many faces come before them."""

    keyword: str
    text: str
    faces: int


class FaceNames(NamedTuple):
    """The names that statements give to the faces after them, (p,) which each has, −1: none, and how many differ."""

    names: tuple[str, ...]
    of: Int64s
    kinds: int


def joined_lines(data: bytes) -> str:
    """The text of an OBJ or MTL file, continued lines joined."""
    text = data.decode("utf-8", "replace").removeprefix("\ufeff").replace("\r\n", "\n").replace("\r", "\n")
    return text.replace("\\\n", " ")


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


@dataclass(frozen=True, eq=False)
class ObjText:
    """An OBJ file's statements and its geometry."""

    runs: list[Run]  # all statements but vertices, their `vt` and `vn`, and faces; continued lines are joined
    source: str  # the file's name for messages
    vertices: Float64s  # (n, 3)
    has_colors: bool  # whether some of their lines have six numbers
    colors: Float64s | None  # (n, 3), what follows the coordinates where every line has six numbers, or None
    sizes: Int64s  # (p,), corners of each face
    indices: dict[str, Int64s]  # (c,) by keyword, of the corners' `vt` and `vn`, from 1 on, or `NONE`
    corners: Int64s  # (c,), the vertex of each
    _blocks: ObjBlocks

    @classmethod
    def parse(cls, data: bytes, source: str) -> ObjText:
        """The geometry of a file's bytes.

        Raises:
            MeshError: a vertex with fewer than three coordinates, a face with fewer than three corners, an index
                outside the file's lines.
            ValueError: text that is not numbers.
        """
        blocks = ObjBlocks.of(data)
        runs = [Run(run[1], run[0], faces) for text, faces in blocks.texts() for run in _RUN.finditer(text)]
        numbers = blocks.numbers("v")
        if short := blocks.short:
            raise MeshError(source, "v", "three coordinates on every line", f"fewer on {short} of them")
        vertices = np.ascontiguousarray(numbers[:, :3])
        colors = numbers[:, 3:] if numbers.shape[1] == 6 else None
        sizes, (own, *others), valid = blocks.faces()
        if (sizes < 3).any():
            raise MeshError(source, f"face {int(np.argmax(sizes < 3)) + 1}", "three corners or more", int(sizes.min()))
        if not valid or any(run.keyword in (*NUMBERED, "f") for run in runs):
            raise ValueError(_UNMATCHED)
        absent: Int64s = np.broadcast_to(np.array(NONE), len(own))
        indices = dict(zip(NUMBERED[1:], others or (absent, absent), strict=True))
        corners = _from_zero(own, len(vertices), source, "v")
        return cls(runs, source, vertices, blocks.has_colors, colors, sizes, indices, corners, blocks)

    def lines(self, keyword: str, runs: list[Run] | None = None) -> str:
        """The text after a keyword, in all runs or in some, a statement a line, without comments."""
        text = "\n".join(run.text for run in runs or self.runs if run.keyword == keyword)
        return re.sub(rf"^[ \t]*{keyword}", "", re.sub(r"#[^\n]*", "", text), flags=re.MULTILINE)

    def of_corners(self, keyword: str) -> PerCorner | None:
        """`vn` of all corners, or `vt`, v upwards; None if some corner has none. Raises: as `parse`."""
        if not self.some(keyword).all():
            return None
        rows = self._numbers(keyword)
        own = self.indices[keyword]
        return PerCorner(rows, _from_zero(own, len(rows), self.source, keyword)) if len(rows) else None

    def some(self, keyword: str) -> Bools:
        """The corners (c,) that have an index of `vt` or `vn`."""
        return np.asarray(self.indices[keyword] != NONE)

    def some_uv(self) -> Float64s:
        """Texture coordinates (c, 2) of the corners, NaN where they have none. Raises: as `parse`."""
        rows, some = self._numbers("vt"), self.some("vt")
        uv = np.full((len(some), 2), np.nan)
        uv[some] = rows[_from_zero(self.indices["vt"][some], len(rows), self.source, "vt")]
        return uv

    def named(self, keyword: str) -> FaceNames:
        """The faces by the statements before them, such as `usemtl`."""
        names: dict[str, int] = {}
        labels, begins = [-1], [0]
        for run in self.runs:
            if run.keyword == keyword:
                for line in self.lines(keyword, [run]).split("\n"):
                    label = names.setdefault(line.strip(), len(names))
                labels.append(label)
                begins.append(run.faces)
        counts = np.diff(np.append(begins, len(self.sizes)))
        of = np.array(labels)
        return FaceNames(tuple(names), np.repeat(of, counts), len(set(of[counts > 0].tolist())))

    def _numbers(self, keyword: str) -> Float64s:
        return np.ascontiguousarray(self._blocks.numbers(keyword)[:, : 3 if keyword == "vn" else 2])


def _from_zero(indices: Int64s, count: int, source: str, keyword: str) -> Int64s:
    """Indices from zero on, of indices from one on."""
    if len(indices) and not 1 <= indices.min() <= indices.max() <= count:
        outside = (indices < 1) | (indices > count)
        raise MeshError(source, "f", f"{keyword} indices from 1 to {count}", int(indices[np.argmax(outside)]))
    return indices - 1
