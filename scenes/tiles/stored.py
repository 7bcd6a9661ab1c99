"""Binary PLY and STL files as meshes that stay on the disk, read in runs of rows.

Not mapped into memory: to touch a mapped page of a file that has been cut short ends the process.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from raytrace.errors import MeshError
from raytrace.system.inputs import check_regular
from raytrace.types import Float64s, Int64s

from ..formats.load import mesh_errors
from ..formats.ply.read import (
    COUNT,
    INDICES,
    ORDERS,
    UP_COMMENT,
    PlyElement,
    ply_comments,
    ply_elements,
    ply_header,
    row_fields,
)
from ..formats.stl import HEADER, TRIANGLE

_EXPECTED = "a binary PLY of vertices, then triangles, or a binary STL, for tiles"
_LONGEST_HEADER = 1 << 16


@dataclass(frozen=True)
class StoredRows:
    """Rows of `dtype` in a file, from byte `begin` on; `state`: what tells that the file is still the same."""

    path: Path
    dtype: np.dtype[Any]
    begin: int
    state: tuple[int, ...]

    def __getitem__(self, rows: slice) -> npt.NDArray[Any]:
        """Raises: MeshError: the file is gone, cut short, or another."""
        with mesh_errors(self.path), self.path.open("rb") as file:
            state, begin = _state(file.fileno()), self.begin + rows.start * self.dtype.itemsize
            found = np.fromfile(file, self.dtype, rows.stop - rows.start, offset=begin)
        if state != self.state or len(found) < rows.stop - rows.start:
            raise MeshError(self.path, "file", "one that stays as it is while it is baked", "another, or a part of it")
        return found


def _state(file: int | Path) -> tuple[int, ...]:
    found = os.stat(file)
    return found.st_dev, found.st_ino, found.st_size, found.st_mtime_ns


@dataclass(frozen=True, eq=False)
class StoredMesh:
    """A mesh on the disk, an `ao.tiles.source.TileSource`.

    Attributes:
        name: the file's. vertex_count, face_count: at least 1.
        vertex_rows: n, with the fields of a PLY's vertices, or None. face_rows: m, as stored.
        corners: the field of `face_rows` with three indices, or with three vertices where `vertex_rows` is None.
        comments: lines of the header, for an output that keeps them.
    """

    name: str
    vertex_count: int
    face_count: int
    vertex_rows: StoredRows | None
    face_rows: StoredRows
    corners: str
    comments: tuple[str, ...] = ()

    def vertices(self, first: int, last: int) -> Float64s:
        if self.vertex_rows is not None:
            some = self.vertex_rows[first:last]
            return np.stack([some[axis] for axis in "xyz"], axis=1).astype(np.float64)
        faces = self.face_rows[first // 3 : -(-last // 3)][self.corners]
        return faces.reshape(-1, 3)[first % 3 :][: last - first].astype(np.float64)

    def faces(self, first: int, last: int) -> Int64s:
        """Raises: MeshError: a face is no triangle."""
        if self.vertex_rows is None:
            return np.arange(3 * first, 3 * last).reshape(-1, 3)
        some = self.face_rows[first:last]
        sizes = some[COUNT + self.corners]
        if not (sizes == 3).all():
            bad = int(np.argmax(sizes != 3))
            raise MeshError(self.name, f"faces[{first + bad}]", "three vertices, for tiles", int(sizes[bad]))
        return some[self.corners].astype(np.int64)


def open_mesh(path: Path) -> StoredMesh:
    """A mesh file without reading it.

    Raises:
        MeshError: it is missing, or none that can be read in runs of rows.
    """
    with mesh_errors(path):
        check_regular(path, "a mesh file", MeshError)
        kind = path.suffix.lower()
        if kind == ".stl":
            return _stl(path)
        if kind == ".ply":
            return _ply(path)
        raise MeshError(path, "ending", _EXPECTED, path.suffix or "none")


def _stl(path: Path) -> StoredMesh:
    with path.open("rb") as file:
        announced = int.from_bytes(file.read(HEADER)[HEADER - 4 :], "little")
    if path.stat().st_size != HEADER + announced * TRIANGLE.itemsize or not announced:
        raise MeshError(path, "content", _EXPECTED, "a text file, an incomplete or an empty one")
    rows = StoredRows(path, TRIANGLE, HEADER, _state(path))
    return StoredMesh(str(path), 3 * announced, announced, None, rows, "vertices", (UP_COMMENT + "z",))


def _ply(path: Path) -> StoredMesh:
    with path.open("rb") as file:
        lines, order, start = ply_header(file.read(_LONGEST_HEADER))
    elements = ply_elements(lines)
    if order == "ascii" or [element.name for element in elements] != ["vertex", "face"]:
        raise MeshError(path, "content", _EXPECTED, "a text file" if order == "ascii" else "other elements")
    vertex, face = elements
    lists = [name for name, (_, counted) in face.properties.items() if counted]
    if lists not in ([name] for name in INDICES) or any(counted for _, counted in vertex.properties.values()):
        raise MeshError(path, "content", _EXPECTED, "other lists than one of each face's vertices")
    if not (vertex.count and face.count):
        raise MeshError(path, "faces", "at least one triangle", "none")
    vertex_type, face_type = _row(vertex, ORDERS[order], {}), _row(face, ORDERS[order], {lists[0]: 3})
    end = start + vertex.count * vertex_type.itemsize
    if end + face.count * face_type.itemsize != path.stat().st_size:
        raise MeshError(path, "content", _EXPECTED, "polygons, or an end elsewhere than its header says")
    vertex_rows, face_rows = (
        StoredRows(path, kind, begin, _state(path)) for kind, begin in ((vertex_type, start), (face_type, end))
    )
    return StoredMesh(str(path), vertex.count, face.count, vertex_rows, face_rows, lists[0], ply_comments(lines))


def _row(element: PlyElement, order: str, lengths: dict[str, int]) -> np.dtype[Any]:
    fields = [
        field
        for name, (kind, counted) in element.properties.items()
        for field in row_fields(name, order + kind, order + counted, lengths.get(name))
    ]
    return np.dtype(fields)
