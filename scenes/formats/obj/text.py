"""The statements of a Wavefront OBJ file (Advanced Visualizer manual, appendix B1): vertices, faces, corners' indices.

Kernels read vertices and faces from blocks of the file's bytes, on all cores; the rest becomes text.
"""

import re
from codecs import BOM_UTF8, BOM_UTF16_BE, BOM_UTF16_LE
from collections.abc import Iterable
from functools import cached_property
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

from ...asset.asset import Stored
from ..number_rows import for_blocks, line_blocks, round_left

_KEPT = "o", "g", "s", "usemtl", "mtllib"
_RUN = re.compile(r"^[ \t]*(\w+)(?!\S)[^\n]*(?:\n[ \t]*\1(?!\S)[^\n]*)*+", re.MULTILINE)


class Run(NamedTuple):
    """Statements of one keyword after one another, a line each, and how many faces come before them."""

    keyword: str
    text: str
    faces: int


class Obj(Stored):
    """The statements of a file that name the faces after them, and those of its material libraries."""

    def __init__(self, runs: Iterable[Run]) -> None:
        self.runs = [run for run in runs if run.keyword in _KEPT]


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
        notes: warnings about what of the file is ignored, also of `uv` once that was used.
    """

    def __init__(self, data: bytes, source: str) -> None:
        """Raises: MeshError: too few coordinates, an index of no vertex. ValueError: text that is none."""
        # The lines, continued ones joined.
        if data.startswith((BOM_UTF16_LE, BOM_UTF16_BE)):
            data = data.decode("utf-16", "replace").encode()
        data = data.removeprefix(BOM_UTF8)
        if b"\\" in data:
            for end in (b"\r\n", b"\r", b"\n"):
                data = data.replace(b"\\" + end, b" ")
        self._data, self._text, self._blocks = line_blocks(data)
        self.runs: list[Run] = []
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
        if not valid or any(run.keyword in (*NUMBERED, "f") for run in self.runs):
            raise ValueError("corners of faces that are no numbers")
        self.notes: tuple[str, ...] = ()
        absent: Int64s = np.broadcast_to(np.array(NONE), len(of_vertices))
        self.indices: dict[str, Int64s] = dict(zip(NUMBERED[1:], others or (absent, absent), strict=True))
        for keyword, indices in self.indices.items():
            count = int(self._before[-1, NUMBERED.index(keyword), COUNT])
            wrong = self.some(keyword) & ((indices < 1) | (indices > count))
            if wrong.any():
                self.indices[keyword] = np.where(wrong, NONE, indices)
                of = f"{int(wrong.sum()):,} of {int(self.some(keyword).sum() + wrong.sum()):,} indices of {keyword}"
                self.notes += (f"{of} are ignored: the file has {count:,} lines {keyword}",)
        if len(of_vertices) and not 1 <= of_vertices.min() <= of_vertices.max() <= len(self.vertices):
            outside = (of_vertices < 1) | (of_vertices > len(self.vertices))
            got = int(of_vertices[np.argmax(outside)])
            raise MeshError(source, "f", f"v indices from 1 to {len(self.vertices)}", got)
        self.corners = of_vertices - 1

    def _survey(self) -> None:
        """`runs`; tallies (blocks, 4, 6) of `survey`, and their sums before each block (blocks + 1, 4, 6)."""
        tallies = np.zeros((len(self._blocks), F + 1, SLASHES + 1), np.int64)
        runs_of = [np.empty((0, 3), np.int64)] * len(tallies)

        def work(block: int) -> None:
            begin, end = self._blocks[block]
            runs_found = np.empty(((end - begin) // 4 + 2, 3), np.int64)
            runs_of[block] = runs_found[: survey(self._text, begin, end, tallies[block], runs_found)].copy()

        for_blocks(len(tallies), work)
        self._tallies = tallies
        self._before = np.cumsum(np.insert(tallies, 0, 0, axis=0), axis=0)
        for faces, others in zip(self._before[:, F, COUNT].tolist(), runs_of, strict=False):
            for begin, end, more in others.tolist():
                text = self._data[begin:end].decode("utf-8", "replace").replace("\r", "\n")
                self.runs += [Run(run[1], run[0], faces + more) for run in _RUN.finditer(text)]

    def _numbers(self, keyword: str) -> Float64s:
        """The numbers of a keyword's lines, (k, any): all where lines have equally many, else the first that are
        needed, infinite where one is none. Raises: ValueError: coordinates of vertices that are no numbers."""
        kind = NUMBERED.index(keyword)
        least = self._tallies[:, kind, LEAST].min()
        needed = int(NEEDED[kind])
        alike = needed <= least == self._tallies[:, kind, MOST].max()
        ends = self._before[:, kind, COUNT]
        values = np.empty((ends[-1], least if alike else needed))

        def work(block: int) -> None:
            if self._tallies[block, kind, COUNT]:
                row = values[ends[block] : ends[block + 1]]
                read_numbers(self._text, *self._blocks[block], kind, row)

        for_blocks(len(self._blocks), work)
        round_left(self._data, values.reshape(-1), None if keyword == "v" else np.inf)
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
        """`vn` of the corners, NaN where a corner has none; None if none has."""
        return self._per_corner("vn")[0] if self.some("vn").any() else None

    @cached_property
    def uv(self) -> PerCorner | None:
        """`vt` of the corners, v upwards, NaN where a corner has none; None if none has."""
        if not self.some("vt").any():
            return None
        uv, wrong = self._per_corner("vt")
        if wrong:
            self.notes += (
                f"texture coordinates of {wrong:,} corners are ignored: their vt are not two finite numbers",
            )
        return uv

    def some(self, keyword: str) -> Bools:
        """Which corners (c,) have an index of `vt` or `vn`."""
        return np.asarray(self.indices[keyword] != NONE)

    def _per_corner(self, keyword: str) -> tuple[PerCorner, int]:
        """`vt` or `vn` by corner, NaN where a corner has none, and of how many they are not finite."""
        values = np.ascontiguousarray(self._numbers(keyword)[:, : NEEDED[NUMBERED.index(keyword)]])
        lacks = ~self.some(keyword)
        of = np.where(lacks, len(values), self.indices[keyword] - 1)
        is_wrong = ~np.isfinite(values).all(axis=1)
        wrong = 0
        if is_wrong.any():
            of_wrong = np.append(is_wrong, False)[of]
            wrong = int(of_wrong.sum())
            of[of_wrong], values[is_wrong] = len(values), 0.0
        if wrong or lacks.any():
            values = np.pad(values, ((0, 1), (0, 0)), constant_values=np.nan)
        return PerCorner(values, of), wrong

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
