"""The statements of a Wavefront OBJ file (Advanced Visualizer manual, appendix B1): vertices, faces, corners' indices.

Kernels read vertices and faces from blocks of the file's bytes, on all cores; the rest becomes text.
"""

import re
from typing import NamedTuple

import numpy as np

from obscurance.raytrace.errors import MeshError
from obscurance.raytrace.mesh.mesh import PerCorner
from obscurance.raytrace.text import (
    COUNT,
    LEAST,
    MOST,
    NEEDED,
    NONE,
    NUMBERED,
    SLASHES,
    USABLE,
    WORDS,
    F,
    V,
    read_faces,
    read_numbers,
    survey,
)
from obscurance.raytrace.types import Bools, Float64s, Int64s

from ..number_rows import for_blocks, line_blocks, round_left

_RUN = re.compile(r"^[ \t]*(\w+)(?!\S)[^\n]*(?:\n[ \t]*\1(?!\S)[^\n]*)*+", re.MULTILINE)


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


class ObjText:
    """An OBJ file's statements and its geometry; continued lines are joined.

    Attributes:
        runs: all statements but vertices, their `vt` and `vn`, and faces.
        vertices: (n, 3). colors: (n, 3), where every line has six numbers, or None. has_colors: whether some have.
        sizes: (p,), corners of each face. corners: (c,), the vertex of each.
        indices: (c,) by keyword, of the corners' `vt` and `vn`, from 1 on, or `NONE`.
        notes: warnings about what of the file is ignored.
    """

    def __init__(self, data: bytes, source: str) -> None:
        """Raises: MeshError: too few coordinates or corners, an index of nothing. ValueError: text that is none."""
        # The lines, continued ones joined.
        data = data.removeprefix(b"\xef\xbb\xbf")
        if b"\\" in data:
            for end in (b"\r\n", b"\r", b"\n"):
                data = data.replace(b"\\" + end, b" ")
        self._source, (self._data, self._text, self._blocks) = source, line_blocks(data)
        self._survey()
        # Vertices and their colours.
        numbers = self._numbers("v")
        if short := int(self._before[-1, V, COUNT] - self._before[-1, V, USABLE]):
            raise MeshError(source, "v", "three coordinates on every line", f"fewer on {short} of them")
        self.vertices = np.ascontiguousarray(numbers[:, :3])
        self.colors = numbers[:, 3:] if numbers.shape[1] == 6 else None
        self.has_colors = bool((self._tallies[:, V, LEAST : MOST + 1] == 6).any())
        # Faces, and the indices of their corners.
        self.sizes, (of_vertices, *others), valid = self._faces()
        if (self.sizes < 3).any():
            field = f"face {int(np.argmax(self.sizes < 3)) + 1}"
            raise MeshError(source, field, "three corners or more", int(self.sizes.min()))
        if not valid or any(run.keyword in (*NUMBERED, "f") for run in self.runs):
            raise ValueError("string or file could not be read to its end due to unmatched data")  # as NumPy says
        absent: Int64s = np.broadcast_to(np.array(NONE), len(of_vertices))
        self.indices: dict[str, Int64s] = dict(zip(NUMBERED[1:], others or (absent, absent), strict=True))
        self.notes: tuple[str, ...] = ()
        for keyword, indices in self.indices.items():
            if self.some(keyword).any() and not self._before[-1, NUMBERED.index(keyword), COUNT]:
                self.indices[keyword] = np.full_like(indices, NONE)
                self.notes += (f"indices of {keyword} are ignored: the file has no line {keyword}",)
        self.corners = self._from_zero(of_vertices, len(self.vertices), "v")

    def _survey(self) -> None:
        """`runs`; tallies (blocks, 4, 6) of `lines.survey`, and their sums before each block (blocks + 1, 4, 6)."""
        tallies = np.zeros((len(self._blocks), F + 1, SLASHES + 1), np.int64)
        runs_of = [np.empty((0, 3), np.int64)] * len(tallies)

        def work(block: int) -> None:
            begin, end = self._blocks[block]
            runs_found = np.empty(((end - begin) // 4 + 2, 3), np.int64)
            runs_of[block] = runs_found[: survey(self._text, begin, end, tallies[block], runs_found)].copy()

        for_blocks(len(tallies), work)
        self._tallies = tallies
        self._before = np.cumsum(np.insert(tallies, 0, 0, axis=0), axis=0)
        self.runs: list[Run] = []
        for faces, others in zip(self._before[:, F, COUNT].tolist(), runs_of, strict=False):
            for begin, end, more in others.tolist():
                text = self._data[begin:end].decode("utf-8", "replace").replace("\r", "\n")
                self.runs += [Run(run[1], run[0], faces + more) for run in _RUN.finditer(text)]

    def _numbers(self, keyword: str) -> Float64s:
        """The numbers of a keyword's lines, (k, any): all where lines have equally many, else the first that are
        needed."""
        kind = NUMBERED.index(keyword)
        least = self._tallies[:, kind, LEAST].min()
        needed = int(NEEDED[kind])
        alike = needed <= least == self._tallies[:, kind, MOST].max()
        ends = self._before[:, kind, USABLE]
        values = np.empty((ends[-1], least if alike else needed))

        def work(block: int) -> None:
            if self._tallies[block, kind, COUNT]:
                row = values[ends[block] : ends[block + 1]]
                read_numbers(self._text, *self._blocks[block], kind, row)

        for_blocks(len(self._blocks), work)
        round_left(self._data, values.reshape(-1))
        return values

    def _faces(self) -> tuple[Int64s, Int64s, bool]:
        """Sizes (p,), indices (1 or 3, c), and whether all of these are numbers; see `read_faces`."""
        sizes = np.empty(self._before[-1, F, COUNT], np.int64)
        indices = np.empty((3 if self._before[-1, F, SLASHES] else 1, self._before[-1, F, WORDS]), np.int64)
        valid = [True] * len(self._blocks)

        def work(block: int) -> None:
            if self._tallies[block, F, COUNT]:
                valid[block] = read_faces(self._text, *self._blocks[block], self._before[block], sizes, indices)

        for_blocks(len(valid), work)
        return sizes, indices, all(valid)

    def lines(self, keyword: str, runs: list[Run] | None = None) -> str:
        """The text after a keyword, in all runs or in some, a statement a line, without comments."""
        text = "\n".join(run.text for run in runs or self.runs if run.keyword == keyword)
        return re.sub(rf"^[ \t]*{keyword}", "", re.sub(r"#[^\n]*", "", text), flags=re.MULTILINE)

    def normals(self) -> PerCorner | None:
        """`vn` of the corners, NaN where a corner has none; None if none has. Raises: as the constructor."""
        return self._per_corner("vn") if self.some("vn").any() else None

    def uv(self) -> PerCorner | None:
        """`vt` of the corners, v upwards, NaN where a corner has none; None if none has. Raises: as the constructor."""
        return self._per_corner("vt") if self.some("vt").any() else None

    def some(self, keyword: str) -> Bools:
        """Which corners (c,) have an index of `vt` or `vn`."""
        return np.asarray(self.indices[keyword] != NONE)

    def _per_corner(self, keyword: str) -> PerCorner:
        """`vt` or `vn` by corner, NaN where a corner has none."""
        values = np.ascontiguousarray(self._numbers(keyword)[:, : NEEDED[NUMBERED.index(keyword)]])
        has_index = self.some(keyword)
        of = np.full(len(has_index), len(values))
        of[has_index] = self._from_zero(self.indices[keyword][has_index], len(values), keyword)
        return PerCorner(values if has_index.all() else np.pad(values, ((0, 1), (0, 0)), constant_values=np.nan), of)

    def named(self, keyword: str) -> FaceNames:
        """The faces by the statements before them, such as `usemtl`."""
        names: dict[str, int] = {}
        labels = [-1]
        begins = [0]
        for run in self.runs:
            if run.keyword == keyword:
                for line in self.lines(keyword, [run]).split("\n"):
                    label = names.setdefault(line.strip(), len(names))
                labels.append(label)
                begins.append(run.faces)
        counts = np.diff(np.append(begins, len(self.sizes)))
        of = np.array(labels)
        return FaceNames(tuple(names), np.repeat(of, counts), len(set(of[counts > 0].tolist())))

    def _from_zero(self, indices: Int64s, count: int, keyword: str) -> Int64s:
        """Indices from zero on, of indices from one on."""
        if len(indices) and not 1 <= indices.min() <= indices.max() <= count:
            outside = (indices < 1) | (indices > count)
            raise MeshError(self._source, "f", f"{keyword} indices from 1 to {count}", int(indices[np.argmax(outside)]))
        return indices - 1
