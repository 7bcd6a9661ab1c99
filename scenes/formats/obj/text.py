"""The statements of a Wavefront OBJ file: vertices, faces, and the indices at their corners.

Format: Wavefront Advanced Visualizer manual, appendix B1.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from raytrace.errors import MeshError
from raytrace.types import Float64s, Int64s

from ...geometry.detail import PerCorner


def statements(keyword: str, rest: str = r"([^#\n]*)") -> re.Pattern[str]:
    """Lines that begin with `keyword`, a pattern, and go on with `rest`."""
    return re.compile(rf"^[ \t]*{keyword}[ \t]+{rest}", re.MULTILINE)


_VERTEX = statements("v", r"(\S+[ \t]+\S+[ \t]+\S+)")
_VERTEX_LINE = statements("v", "")
_NORMAL = statements("vn", r"(\S+[ \t]+\S+[ \t]+\S+)")
_TEXTURE = statements("vt", r"(\S+[ \t]+\S+)")
_FACE = statements("f")
_INDEXED = statements("(v|vt|vn|f)")
_CORNER_WITHOUT_NORMAL = re.compile(r"(?<!\S)(?![^/\s]+/[^/\s]*/[^/\s]+(?!\S))\S")
_CORNER_WITHOUT_UV = re.compile(r"(?<!\S)(?![^/\s]+/[^/\s]+)\S")


@dataclass(frozen=True, eq=False)
class ObjText:
    """An OBJ file's text and its geometry.

    Attributes:
        text: continued lines joined. source: the file's name for messages.
        vertices: float64 (n, 3). sizes: int64 (p,), corners of each face.
        faces: the corners, a face a line, with positive indices.
        corners: int64 (c,), the vertex of each.
    """

    text: str
    source: str
    vertices: Float64s
    sizes: Int64s
    faces: str
    corners: Int64s

    @classmethod
    def parse(cls, data: bytes, source: str) -> ObjText:
        """The geometry of a file's bytes.

        Raises:
            MeshError: a vertex with fewer than three coordinates, a face with fewer than three corners, an index
                outside the file's lines.
            ValueError: text that is not numbers.
        """
        text = data.decode("utf-8", "replace").removeprefix("\ufeff").replace("\r\n", "\n").replace("\r", "\n")
        text = text.replace("\\\n", " ")
        vertices = _rows(_VERTEX.findall(text), 3)
        short = sum(1 for _ in _VERTEX_LINE.finditer(text)) - len(vertices)
        if short:
            raise MeshError(source, "v", "three coordinates on every line", f"fewer on {short} of them")
        faces = "\n".join(_FACE.findall(text))
        if "-" in faces:
            faces = _absolute(text)
        sizes = np.array([len(line.split()) for line in faces.split("\n")] if faces else [], dtype=np.int64)
        if (sizes < 3).any():
            raise MeshError(source, f"face {int(np.argmax(sizes < 3)) + 1}", "three corners or more", int(sizes.min()))
        corners = _indices(re.sub(r"/\S*", "", faces), len(vertices), source, "v")
        return cls(text, source, vertices, sizes, faces, corners)

    def normals(self) -> PerCorner | None:
        """Normals of all corners, or None if some corner has none. Raises: as `parse`."""
        normals = _rows(_NORMAL.findall(self.text), 3)
        if not len(normals) or _CORNER_WITHOUT_NORMAL.search(self.faces):
            return None
        chosen = re.sub(r"(?<!\S)[^/\s]+/[^/\s]*/", "", self.faces)
        return PerCorner(normals, _indices(chosen, len(normals), self.source, "vn"))

    def uv(self) -> PerCorner | None:
        """Texture coordinates of all corners, v upwards, or None if some corner has none. Raises: as `parse`."""
        uv = _rows(_TEXTURE.findall(self.text), 2)
        if not len(uv) or _CORNER_WITHOUT_UV.search(self.faces):
            return None
        chosen = re.sub(r"(?<!\S)[^/\s]+/([^/\s]+)\S*", r"\1", self.faces)
        return PerCorner(uv, _indices(chosen, len(uv), self.source, "vt"))

    def some_uv(self) -> Float64s:
        """Texture coordinates (c, 2) of the corners, NaN where they have none. Raises: as `parse`."""
        uv = np.append(_rows(_TEXTURE.findall(self.text), 2), [[np.nan, np.nan]], axis=0)
        none = str(len(uv))
        chosen = re.sub(r"(?<!\S)[^/\s]+(?:/([^/\s]*))?\S*", lambda found: found[1] or none, self.faces)
        return uv[_indices(chosen, len(uv), self.source, "vt")]


def _rows(lines: list[str], width: int) -> Float64s:
    return np.fromstring(" ".join(lines), sep=" ").reshape(-1, width)


def _absolute(text: str) -> str:
    """The faces with relative indices replaced by absolute ones, each counted at its own line."""
    count = {"v": 0, "vt": 0, "vn": 0}
    faces = []
    for keyword, values in _INDEXED.findall(text):
        if keyword != "f":
            count[keyword] += 1
            continue
        corners = []
        for corner in values.split():
            indices = zip(corner.split("/"), count.values(), strict=False)
            corners.append("/".join(str(n + 1 + int(i)) if i.startswith("-") else i for i, n in indices))
        faces.append(" ".join(corners))
    return "\n".join(faces)


def _indices(text: str, count: int, source: str, keyword: str) -> Int64s:
    """Zero-based indices from one-based ones in text."""
    indices = np.fromstring(text, dtype=np.int64, sep=" ")
    outside = (indices < 1) | (indices > count)
    if outside.any():
        raise MeshError(source, "f", f"{keyword} indices from 1 to {count}", int(indices[np.argmax(outside)]))
    return indices - 1
