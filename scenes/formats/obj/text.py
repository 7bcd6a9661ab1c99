"""The statements of a Wavefront OBJ file: vertices, faces, and the indices at their corners.

Kernels read vertices and faces from blocks of the file's bytes, on all cores; the rest becomes text.

Format: Wavefront Advanced Visualizer manual, appendix B1.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from raytrace.errors import MeshError
from raytrace.text.lines import NONE, NUMBERED
from raytrace.types import Bools, Float64s, Int64s

from ...geometry.detail import PerCorner
from .blocks import ObjBlocks

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
