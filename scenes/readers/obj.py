"""Wavefront OBJ geometry over exactly the file's own `v` lines.

trimesh's reader splits, repeats or drops vertices as texture coordinates, materials and objects ask for, takes
index 0 for 1 and wraps negative ones, so it cannot serve here. Memory is estimated at 7 times the bytes of a
file, where what trimesh reads takes 22 times (docs/reliability.md).
Format: Wavefront Advanced Visualizer manual, appendix B1.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import numpy.typing as npt

from raytrace.errors import MeshError

from ..geometry.detail import PerCorner
from ..geometry.instances import Instance
from ..geometry.polygons import triangulate
from ..geometry.primitives import Origin
from .obj_detail import obj_detail

_VERTEX = re.compile(r"^[ \t]*v[ \t]+(\S+[ \t]+\S+[ \t]+\S+)", re.MULTILINE)
_VERTEX_LINE = re.compile(r"^[ \t]*v[ \t]", re.MULTILINE)
_NORMAL = re.compile(r"^[ \t]*vn[ \t]+(\S+[ \t]+\S+[ \t]+\S+)", re.MULTILINE)
_TEXTURE = re.compile(r"^[ \t]*vt[ \t]+(\S+[ \t]+\S+)", re.MULTILINE)
_FACE = re.compile(r"^[ \t]*f[ \t]+([^#\n]*)", re.MULTILINE)
_STATEMENT = re.compile(r"^[ \t]*(v|vt|vn|f)[ \t]+([^#\n]*)", re.MULTILINE)
_CORNER_WITHOUT_NORMAL = re.compile(r"(?<!\S)(?![^/\s]+/[^/\s]*/[^/\s]+(?!\S))\S")
_CORNER_WITHOUT_UV = re.compile(r"(?<!\S)(?![^/\s]+/[^/\s]+)\S")

Floats = npt.NDArray[np.float64]


def read_obj(data: bytes, name: str, source: str, folder: Path | None = None) -> list[Instance]:
    """All faces of the file, in its order.

    Objects, groups and materials divide no vertices in OBJ, so the whole file is one instance. Polygons become
    triangles. Normals are taken where every face has them and each vertex has only one. Negative indices count back
    from their own line, as the format has it.

    Args:
        data: the file's bytes.
        name: what to call the instance.
        source: the file's name for messages.
        folder: where it is; also texture coordinates, all normals, colours and materials are read, as its detail.

    Raises:
        MeshError: a vertex with fewer than three coordinates, a face with fewer than three corners, an index
            outside the file's lines.
        ValueError: text that is not numbers.
    """
    text = _text(data)
    vertices, normals, faces, sizes = _statements(text, source)
    corners = _indices(re.sub(r"/\S*", "", faces), len(vertices), source, "v")
    vertex_normals = several = None
    if len(normals) and not _CORNER_WITHOUT_NORMAL.search(faces):
        choice = _normal_indices(faces, len(normals), source)
        vertex_normals = _one_each(normals[choice], corners, len(vertices))
        several = PerCorner(normals, choice) if vertex_normals is None else None
    triangles = triangulate(vertices, corners, sizes, source)
    detail, unread = None, tuple[str, ...]()
    if folder is not None:
        uv = _coordinates(text, faces, source)
        has_normals = several is not None or vertex_normals is not None
        detail, unread = obj_detail(text, folder, corners, sizes, triangles, uv, several, has_normals, len(vertices))
    return [Instance(name, vertices, triangles.take(corners), vertex_normals, None, triangles.notes, detail, unread)]


def read_textured_obj(data: bytes, name: str, source: str) -> tuple[Instance, Floats, Origin]:
    """All faces of the file with texture coordinates uv (n, 2), v upwards, and which vertices of the file they have.

    Every combination of a vertex with a texture coordinate, and with a normal where every face has them, becomes a
    vertex of its own, so that seams and hard edges stay.

    Raises:
        MeshError: as `read_obj`, or a corner without texture coordinates.
        ValueError: text that is not numbers.
    """
    text = _text(data)
    vertices, normals, faces, sizes = _statements(text, source)
    coordinates = _coordinates(text, faces, source)
    if coordinates is None:
        raise MeshError(source, "vt", "texture coordinates on every corner of a face", "none on some")
    uv, choice = coordinates
    columns = [_indices(re.sub(r"/\S*", "", faces), len(vertices), source, "v"), choice]
    has_normals = len(normals) > 0 and not _CORNER_WITHOUT_NORMAL.search(faces)
    if has_normals:
        columns.append(_normal_indices(faces, len(normals), source))
    kinds, corners = np.unique(np.stack(columns, axis=1), axis=0, return_inverse=True)
    triangles = triangulate(vertices, columns[0], sizes, source)
    own = normals[kinds[:, 2]] if has_normals else None
    faces_of_kinds = triangles.take(corners.ravel())
    made = Instance(name, vertices[kinds[:, 0]], faces_of_kinds, own, notes=triangles.notes)
    return made, uv[kinds[:, 1]], Origin(kinds[:, 0], len(vertices))


def _coordinates(text: str, faces: str, source: str) -> PerCorner | None:
    """Texture coordinates of all corners, or None if some corner has none."""
    uv = _rows(_TEXTURE.findall(text), 2)
    if not len(uv) or _CORNER_WITHOUT_UV.search(faces):
        return None
    return PerCorner(uv, _indices(re.sub(r"(?<!\S)[^/\s]+/([^/\s]+)\S*", r"\1", faces), len(uv), source, "vt"))


def _text(data: bytes) -> str:
    text = data.decode("utf-8", "replace").removeprefix("\ufeff").replace("\r\n", "\n").replace("\r", "\n")
    return text.replace("\\\n", " ")


def _statements(text: str, source: str) -> tuple[Floats, Floats, str, npt.NDArray[np.int64]]:
    """Vertices, normals, the faces' corners as text with positive indices, and how many each face has."""
    vertices = _rows(_VERTEX.findall(text))
    short = sum(1 for _ in _VERTEX_LINE.finditer(text)) - len(vertices)
    if short:
        raise MeshError(source, "v", "three coordinates on every line", f"fewer on {short} of them")
    normals = _rows(_NORMAL.findall(text))
    faces = "\n".join(_FACE.findall(text))
    if "-" in faces:
        faces = _absolute(text)
    del text
    sizes = np.array([len(line.split()) for line in faces.split("\n")] if faces else [], dtype=np.int64)
    if (sizes < 3).any():
        raise MeshError(source, f"face {int(np.argmax(sizes < 3)) + 1}", "three corners or more", int(sizes.min()))
    return vertices, normals, faces, sizes


def _normal_indices(faces: str, count: int, source: str) -> npt.NDArray[np.int64]:
    return _indices(re.sub(r"(?<!\S)[^/\s]+/[^/\s]*/", "", faces), count, source, "vn")


def _rows(lines: list[str], width: int = 3) -> Floats:
    return np.fromstring(" ".join(lines), sep=" ").reshape(-1, width)


def _absolute(text: str) -> str:
    """The faces with relative indices replaced by absolute ones, each counted at its own line."""
    count = {"v": 0, "vt": 0, "vn": 0}
    faces = []
    for keyword, values in _STATEMENT.findall(text):
        if keyword != "f":
            count[keyword] += 1
            continue
        corners = []
        for corner in values.split():
            indices = zip(corner.split("/"), count.values(), strict=False)
            corners.append("/".join(str(n + 1 + int(i)) if i.startswith("-") else i for i, n in indices))
        faces.append(" ".join(corners))
    return "\n".join(faces)


def _indices(text: str, count: int, source: str, keyword: str) -> npt.NDArray[np.int64]:
    """Zero-based indices from one-based ones in text."""
    indices = np.fromstring(text, dtype=np.int64, sep=" ")
    outside = (indices < 1) | (indices > count)
    if outside.any():
        raise MeshError(source, "f", f"{keyword} indices from 1 to {count}", int(indices[np.argmax(outside)]))
    return indices - 1


def _one_each(
    values: npt.NDArray[np.float64], corners: npt.NDArray[np.int64], vertex_count: int
) -> npt.NDArray[np.float64] | None:
    """Corner values as vertex values (n, 3), NaN at unused vertices; None if some vertex has several."""
    normals = np.full((vertex_count, 3), np.nan)
    normals[corners] = values
    return normals if np.array_equal(normals[corners], values, equal_nan=True) else None
