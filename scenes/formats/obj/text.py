"""The statements of a Wavefront OBJ file: vertices, faces, and the indices at their corners.

Programs write thousands of lines of a kind after one another: such runs are found once and their numbers read together.

Format: Wavefront Advanced Visualizer manual, appendix B1.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from raytrace.errors import MeshError
from raytrace.types import Bools, Float64s, Int64s, UInt8s

from ...geometry.detail import PerCorner

_RUN = re.compile(r"^[ \t]*(\w+)(?!\S)[^\n]*(?:\n[ \t]*\1(?!\S)[^\n]*)*+", re.MULTILINE)
_INDEXED = "v", "vt", "vn"
_NONE = 1 << 62  # the index of a corner that has none


class Run(NamedTuple):
    """Statements of one keyword after one another, a line each."""

    keyword: str
    text: str
    lines: int


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
class ObjText:
    """An OBJ file's statements and its geometry.

    Attributes:
        runs: all statements, `v` and `f` without their text; continued lines are joined.
        source: the file's name for messages.
        vertices: float64 (n, 3). widths: int64 (n,), numbers on the line of each.
        colors: float64 (n, 3), what follows the coordinates where every line has six numbers, or None.
        sizes: int64 (p,), corners of each face.
        indices: int64 (c,) by keyword, of the corners' vertices, `vt` and `vn`, from 1 on, or `_NONE`.
        corners: int64 (c,), the vertex of each.
    """

    runs: list[Run]
    source: str
    vertices: Float64s
    widths: Int64s
    colors: Float64s | None
    sizes: Int64s
    indices: dict[str, Int64s]
    corners: Int64s

    @classmethod
    def parse(cls, data: bytes, source: str) -> ObjText:
        """The geometry of a file's bytes.

        Raises:
            MeshError: a vertex with fewer than three coordinates, a face with fewer than three corners, an index
                outside the file's lines.
            ValueError: text that is not numbers.
        """
        text = joined_lines(data)
        runs = [Run(run[1], run[0], run[0].count("\n") + 1) for run in _RUN.finditer(text)]
        del text
        lines = _lines(runs, "v")
        widths = _words(*_layout(lines))
        numbers = _rows(lines, 3, widths)
        if short := len(widths) - len(numbers):
            raise MeshError(source, "v", "three coordinates on every line", f"fewer on {short} of them")
        vertices = np.ascontiguousarray(numbers[:, :3])
        colors = numbers[:, 3:] if numbers.shape[1] == 6 else None
        lines = _lines(runs, "f")
        runs = [run._replace(text="") if run.keyword in ("v", "f") else run for run in runs]
        layout = _layout(lines)
        sizes = _words(*layout)
        if (sizes < 3).any():
            raise MeshError(source, f"face {int(np.argmax(sizes < 3)) + 1}", "three corners or more", int(sizes.min()))
        indices = dict(zip(_INDEXED, _indices(lines, *layout), strict=True))
        if "-" in lines:
            for keyword, seen in zip(_INDEXED, _seen(runs).T, strict=True):
                relative = indices[keyword]
                indices[keyword] = np.where(relative < 0, relative + 1 + np.repeat(seen, sizes), relative)
        corners = _from_zero(indices["v"], len(vertices), source, "v")
        return cls(runs, source, vertices, widths, colors, sizes, indices, corners)

    def lines(self, keyword: str) -> str:
        """The text after a keyword, a statement a line, without comments."""
        return _lines(self.runs, keyword)

    def normals(self) -> PerCorner | None:
        """Normals of all corners, or None if some corner has none. Raises: as `parse`."""
        return self._of_corners("vn", 3)

    def uv(self) -> PerCorner | None:
        """Texture coordinates of all corners, v upwards, or None if some corner has none. Raises: as `parse`."""
        return self._of_corners("vt", 2)

    def some(self, keyword: str) -> Bools:
        """The corners (c,) that have an index of `vt` or `vn`."""
        return np.asarray(self.indices[keyword] != _NONE)

    def some_uv(self) -> Float64s:
        """Texture coordinates (c, 2) of the corners, NaN where they have none. Raises: as `parse`."""
        rows, some = self._numbers("vt", 2), self.some("vt")
        uv = np.full((len(some), 2), np.nan)
        uv[some] = rows[_from_zero(self.indices["vt"][some], len(rows), self.source, "vt")]
        return uv

    def named(self, keyword: str) -> FaceNames:
        """The faces by the statements before them, such as `usemtl`."""
        names: dict[str, int] = {}
        labels, counts, label = [], [], -1
        for run in self.runs:
            if run.keyword == keyword:
                for line in _lines([run], keyword).split("\n"):
                    label = names.setdefault(line.strip(), len(names))
            elif run.keyword == "f":
                labels.append(label)
                counts.append(run.lines)
        return FaceNames(
            tuple(names), np.repeat(np.array(labels, np.int64), np.array(counts, np.int64)), len(set(labels))
        )

    def _numbers(self, keyword: str, width: int) -> Float64s:
        lines = self.lines(keyword)
        return np.ascontiguousarray(_rows(lines, width, _words(*_layout(lines)))[:, :width])

    def _of_corners(self, keyword: str, width: int) -> PerCorner | None:
        if not self.some(keyword).all():
            return None
        rows = self._numbers(keyword, width)
        own = self.indices[keyword]
        return PerCorner(rows, _from_zero(own, len(rows), self.source, keyword)) if len(rows) else None


def _lines(runs: list[Run], keyword: str) -> str:
    text = "\n".join(run.text for run in runs if run.keyword == keyword)
    if "#" in text:
        text = re.sub(r"#[^\n]*", "", text)
    if text.count(keyword) == text.count("\n") + 1:
        return text.replace(keyword, "")
    return re.sub(rf"^[ \t]*{keyword}", "", text, flags=re.MULTILINE)


def _layout(lines: str) -> tuple[UInt8s, Bools]:
    """The bytes of lines, each after its line feed, and where a word starts."""
    data = np.frombuffer(f"\n{lines}".encode() if lines else b"", np.uint8)
    blank, starts = data <= 32, np.zeros(len(data), np.bool_)
    np.greater(blank[:-1], blank[1:], out=starts[1:])
    return data, starts


def _words(data: UInt8s, starts: Bools) -> Int64s:
    """The number of words of each line."""
    begins, ones = np.flatnonzero(data == ord("\n")), starts.view(np.uint8)
    words = np.add.reduceat(ones, begins, dtype=np.uint8).astype(np.int64)
    if words.sum() < np.count_nonzero(starts):  # a line has more than 255
        words = np.add.reduceat(ones, begins, dtype=np.int64)
    return words


def _rows(lines: str, width: int, words: Int64s) -> Float64s:
    """All numbers of lines that have equally many, and `width` of them or more; else the first `width` of each line.

    Args: words: how many each line has.
    """
    if len(words) and words[0] >= width and (words == words[0]).all():
        numbers = np.fromstring(lines, sep=" ")
        if len(numbers) == words.sum():
            return numbers.reshape(len(words), -1)
    found = re.findall(r"^[ \t]*(\S+" + r"[ \t]+\S+" * (width - 1) + ")", lines, re.MULTILINE)
    return np.fromstring(" ".join(found), sep=" ").reshape(-1, width)


def _indices(faces: str, data: UInt8s, starts: Bools) -> list[Int64s]:
    """Indices (c,) of `_INDEXED` as they are written, `_NONE` where there is none."""
    slash, count = data == ord("/"), int(np.count_nonzero(starts))
    values = np.fromstring(faces.replace("/", " "), np.int64, sep=" ")
    marks = slash[slash | starts]
    width = len(marks) // max(count, 1)
    if 1 <= width <= 3 and len(marks) == width * count:
        alike = bool((marks.reshape(-1, width) == (np.arange(width) > 0)).all())
        empty = faces.count("//")
        columns = (0, 2) if width == 3 and empty else range(width)
        if alike and empty in (0, count) and len(values) == count * len(columns):
            found = dict(zip(columns, values.reshape(count, -1).T, strict=True))
            absent: Int64s = np.broadcast_to(np.array(_NONE), count)
            return [found.get(column, absent) for column in range(3)]
    corners = (corner[0].split("/") for corner in re.finditer(r"\S+", faces))
    each = (int(index or _NONE) for corner in corners for index in [*corner, "", ""][:3])
    return list(np.fromiter(each, np.int64, 3 * count).reshape(count, 3).T)


def _seen(runs: list[Run]) -> Int64s:
    """Numbers (p, 3) of `_INDEXED` statements before each face: relative indices count back from there."""
    seen, rows, counts = dict.fromkeys(_INDEXED, 0), [], []
    for run in runs:
        if run.keyword == "f":
            rows.append(list(seen.values()))
            counts.append(run.lines)
        elif run.keyword in seen:
            seen[run.keyword] += run.lines
    return np.repeat(np.array(rows), counts, axis=0)


def _from_zero(indices: Int64s, count: int, source: str, keyword: str) -> Int64s:
    """Indices from zero on, of indices from one on."""
    outside = (indices < 1) | (indices > count)
    if outside.any():
        raise MeshError(source, "f", f"{keyword} indices from 1 to {count}", int(indices[np.argmax(outside)]))
    return indices - 1
