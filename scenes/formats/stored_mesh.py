"""Meshes that stay on the disk, read in runs of rows; for tiles.

Not mapped into memory: to touch a mapped page of a file that has been cut short ends the process.
"""

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from raytrace.errors import MeshError
from raytrace.system.checks import check_regular
from raytrace.types import Float64s, Int64s

from .load import mesh_errors
from .ply.layout import COUNT, PlyElement
from .table import format_of, function

EXPECTED = "a binary PLY of vertices, then triangles, or a binary STL, for tiles"
Rows = Callable[[slice], npt.NDArray[Any]]
"""The rows of a run, with the fields of an element."""


def stored_rows(path: Path, dtype: np.dtype[Any], begin: int) -> Rows:
    """Rows in a file, from byte `begin` on. They raise MeshError: it is gone, cut short, or another than now."""
    before = _state(path)

    def read(run: slice) -> npt.NDArray[Any]:
        with mesh_errors(path), path.open("rb") as file:
            state = _state(file.fileno())
            found = np.fromfile(file, dtype, run.stop - run.start, offset=begin + run.start * dtype.itemsize)
        if state != before or len(found) < run.stop - run.start:
            raise MeshError(path, "file", "one that stays as it is while it is baked", "another, or a part of it")
        return found

    return read


def _state(file: int | Path) -> tuple[int, ...]:
    found = os.stat(file)
    return found.st_dev, found.st_ino, found.st_size, found.st_mtime_ns


@dataclass(frozen=True, eq=False)
class StoredMesh:
    """A mesh on the disk, an `ao.tiles.source.TileSource`."""

    name: str  # the file's
    vertex: PlyElement  # what a PLY file declares of its rows, at least one
    face: PlyElement
    vertex_rows: Rows
    face_rows: Rows
    corners: str  # the property of faces with three indices
    comments: tuple[str, ...] = ()  # lines of a header, for an output that keeps them

    @property
    def vertex_count(self) -> int:
        return self.vertex.count

    @property
    def face_count(self) -> int:
        return self.face.count

    def vertices(self, first: int, last: int) -> Float64s:
        some = self.vertex_rows(slice(first, last))
        return np.stack([some[axis] for axis in "xyz"], axis=1).astype(np.float64)

    def faces(self, first: int, last: int) -> Int64s:
        """Raises: MeshError: a face is no triangle."""
        some = self.face_rows(slice(first, last))
        sizes = some[COUNT + self.corners]
        if not (sizes == 3).all():
            bad = int(np.argmax(sizes != 3))
            raise MeshError(self.name, f"faces[{first + bad}]", "three vertices, for tiles", int(sizes[bad]))
        return some[self.corners].astype(np.int64)


def open_mesh(path: Path) -> StoredMesh:
    """A mesh file without reading it. Raises: MeshError: it is missing, or none that can be read in runs of rows."""
    with mesh_errors(path):
        check_regular(path, "a mesh file", MeshError)
        target = format_of(path).open_rows
        if not target:
            raise MeshError(path, "ending", EXPECTED, path.suffix or "none")
        made: StoredMesh = function(target)(path)
        return made
