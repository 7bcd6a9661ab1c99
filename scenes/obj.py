"""Wavefront OBJ: its text is put into the plainest form, which trimesh then reads without reordering anything."""

from __future__ import annotations

import io
import re
from typing import Any

import numpy as np
import numpy.typing as npt

from raytrace.errors import MeshError

from .flatten import Instance

_VERTEX = re.compile(r"^[ \t]*v[ \t]+(\S+[ \t]+\S+[ \t]+\S+)", re.MULTILINE)
_VERTEX_LINE = re.compile(r"^[ \t]*v[ \t]", re.MULTILINE)
_NORMAL = re.compile(r"^[ \t]*vn[ \t]+(\S+[ \t]+\S+[ \t]+\S+)", re.MULTILINE)
_FACE = re.compile(r"^[ \t]*f[ \t]+([^#\n]*)", re.MULTILINE)
_STATEMENT = re.compile(r"^[ \t]*(v|vt|vn|f)[ \t]+([^#\n]*)", re.MULTILINE)
_WITH_NORMALS = re.compile(r"(?:[^/\s]+/[^/\s]*/[^/\s]+\s*)+")
_OUTSIDE = re.compile(r"(?<!\S)(?:0+|-\d*)(?!\S)")


def read_obj(data: bytes, name: str, source: str) -> list[Instance]:
    """All faces of the file over exactly its `v` lines, in their order.

    Objects, groups and materials divide no vertices in OBJ, so the whole file is one instance. Polygons become
    fans. Normals are taken where every face has them and each vertex has only one. Texture coordinates, colours
    and material files are not read. Negative indices count back from their own line, as the format has it.

    Args:
        data: the file's bytes.
        name: what to call the instance.
        source: the file's name for messages.

    Raises:
        MeshError: a vertex with fewer than three coordinates, a face with fewer than three corners or with index 0.
        Exception: whatever trimesh raises on text that is not numbers.
    """
    text = data.decode("utf-8", "replace").removeprefix("\ufeff").replace("\r\n", "\n").replace("\r", "\n")
    text = text.replace("\\\n", " ")
    positions = _VERTEX.findall(text)
    lines = sum(1 for _ in _VERTEX_LINE.finditer(text))
    if len(positions) != lines:
        raise MeshError(source, "v", "three coordinates on every line", f"fewer on {lines - len(positions)} lines")
    faces = _FACE.findall(text)
    if any("-" in face for face in faces):
        faces = _absolute(text)
    if not positions or not faces:
        return [Instance(name, np.empty((len(positions), 3)), np.empty((0, 3), dtype=np.int64))]
    if any(len(face.split()) < 3 for face in faces):
        raise MeshError(source, "f", "three corners or more on every line", "fewer")
    normals = _NORMAL.findall(text)
    del text
    vertices, triangles = _read_plain(positions, [re.sub(r"/\S*", "", face) for face in faces], source, "v")
    return [Instance(name, vertices, triangles, _vertex_normals(normals, faces, triangles, len(vertices), source))]


def _absolute(text: str) -> list[str]:
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
    return faces


def _read_plain(
    rows: list[str], faces: list[str], source: str, keyword: str
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.int64]]:
    """Rows of three numbers, and triangles that index them, as trimesh reads them."""
    from trimesh.exchange.load import mesh_loaders
    from trimesh.geometry import triangulate_quads

    for face in faces:
        if outside := _OUTSIDE.search(face):
            raise MeshError(source, "f", f"{keyword} indices from 1 to {len(rows)}", outside.group())
    plain = "v " + "\nv ".join(rows) + "\nf " + "\nf ".join(faces) + "\n"
    loaded: dict[str, Any] = mesh_loaders["obj"](file_obj=io.StringIO(plain), maintain_order=True, skip_materials=True)
    (geometry,) = loaded["geometry"].values()
    return geometry["vertices"], triangulate_quads(geometry["faces"])


def _vertex_normals(
    rows: list[str], faces: list[str], triangles: npt.NDArray[np.int64], vertex_count: int, source: str
) -> npt.NDArray[np.float64] | None:
    """Normals (n, 3) of the vertices; None if a corner lacks one or a vertex has several. NaN where unreferenced."""
    if not rows or not all(_WITH_NORMALS.fullmatch(face) for face in faces):
        return None
    values, corners = _read_plain(rows, [re.sub(r"[^/\s]+/[^/\s]*/", "", face) for face in faces], source, "vn")
    normals = np.full((vertex_count, 3), np.nan)
    normals[triangles] = values[corners]
    return normals if np.array_equal(normals[triangles], values[corners], equal_nan=True) else None
