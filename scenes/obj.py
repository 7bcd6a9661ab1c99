"""Wavefront OBJ geometry over exactly the file's own `v` lines.

trimesh's reader splits, repeats or drops vertices as texture coordinates, materials and objects ask for, takes
index 0 for 1 and wraps negative ones, so it cannot serve here.
Format: Wavefront Advanced Visualizer manual, appendix B1.
"""

from __future__ import annotations

import re

import numpy as np
import numpy.typing as npt

from raytrace.errors import MeshError

from .flatten import Instance
from .polygons import fan_triangles

_VERTEX = re.compile(r"^[ \t]*v[ \t]+(\S+[ \t]+\S+[ \t]+\S+)", re.MULTILINE)
_VERTEX_LINE = re.compile(r"^[ \t]*v[ \t]", re.MULTILINE)
_NORMAL = re.compile(r"^[ \t]*vn[ \t]+(\S+[ \t]+\S+[ \t]+\S+)", re.MULTILINE)
_FACE = re.compile(r"^[ \t]*f[ \t]+([^#\n]*)", re.MULTILINE)
_STATEMENT = re.compile(r"^[ \t]*(v|vt|vn|f)[ \t]+([^#\n]*)", re.MULTILINE)
_CORNER_WITHOUT_NORMAL = re.compile(r"(?<!\S)(?![^/\s]+/[^/\s]*/[^/\s]+(?!\S))\S")


def read_obj(data: bytes, name: str, source: str) -> list[Instance]:
    """All faces of the file, in its order.

    Objects, groups and materials divide no vertices in OBJ, so the whole file is one instance. Polygons become
    fans. Normals are taken where every face has them and each vertex has only one. Texture coordinates, colours
    and material files are not read. Negative indices count back from their own line, as the format has it.

    Args:
        data: the file's bytes.
        name: what to call the instance.
        source: the file's name for messages.

    Raises:
        MeshError: a vertex with fewer than three coordinates, a face with fewer than three corners, an index
            outside the file's lines.
        ValueError: text that is not numbers.
    """
    text = data.decode("utf-8", "replace").removeprefix("\ufeff").replace("\r\n", "\n").replace("\r", "\n")
    text = text.replace("\\\n", " ")
    vertices = _rows(_VERTEX.findall(text))
    short = sum(1 for _ in _VERTEX_LINE.finditer(text)) - len(vertices)
    if short:
        raise MeshError(source, "v", "three coordinates on every line", f"fewer on {short} of them")
    normals = _rows(_NORMAL.findall(text))
    faces = "\n".join(_FACE.findall(text))
    if "-" in faces:
        faces = _absolute(text)
    del text
    sizes = np.array([len(line.split()) for line in faces.splitlines()], dtype=np.int64)
    if (sizes < 3).any():
        raise MeshError(source, f"face {int(np.argmax(sizes < 3)) + 1}", "three corners or more", int(sizes.min()))
    corners = _indices(re.sub(r"/\S*", "", faces), len(vertices), source, "v")
    vertex_normals = None
    if len(normals) and not _CORNER_WITHOUT_NORMAL.search(faces):
        choice = _indices(re.sub(r"[^/\s]+/[^/\s]*/", "", faces), len(normals), source, "vn")
        vertex_normals = _one_each(normals[choice], corners, len(vertices))
    return [Instance(name, vertices, fan_triangles(corners, sizes), vertex_normals)]


def _rows(lines: list[str]) -> npt.NDArray[np.float64]:
    return np.fromstring(" ".join(lines), sep=" ").reshape(-1, 3)


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
