"""Mesh formats that libraries read: COLLADA by pycollada, the rest by meshio."""

from __future__ import annotations

import contextlib
import io
import os
import tempfile
from importlib.util import find_spec
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from raytrace.errors import MeshError

from ..geometry.instances import Instance, check_copies
from ..geometry.polygons import triangulate
from .table import MeshInput
from .threemf.read import check_archive

_OWN = ("dae", "zae")
_MESHIO = (
    "avs", "bdf", "cgns", "dat", "dato", "e", "ele", "ex2", "exo", "f3grid", "fem", "h5m", "hmf", "inp", "mdpa", "med",
    "mesh", "meshb", "msh", "nas", "node", "post", "su2", "tec", "ugrid", "vol", "vtk", "vtu", "wkt", "xdmf", "xmf",
    "xml",
)  # fmt: skip
_SURFACES = ("triangle", "quad")


def library_endings() -> tuple[str, ...]:
    """Endings of files that `read_by_library` takes here; no library is imported."""
    return tuple(f".{ending}" for ending in _OWN + (_MESHIO if find_spec("meshio") else ()))


def read_by_library(given: MeshInput) -> list[Instance]:
    """The placed objects of a file with one of `library_endings`. Raises: Exception: what the libraries raise."""
    file = given.file
    path = given.path
    kind = path.suffix.lower().removeprefix(".")
    if kind == "zae":
        check_archive(file, str(path))
    if kind in _OWN:
        return _collada(file, path)
    if given.is_on_disk:
        return _meshio(path, path)
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / f"mesh.{kind}"
        copy.write_bytes(file.read())
        return _meshio(copy, path)


def _collada(file: BinaryIO, path: Path) -> list[Instance]:
    """Every geometry where its nodes place it, its vertices once, whatever uses them."""
    from collada import Collada
    from collada.common import DaeError
    from collada.polylist import Polylist
    from collada.triangleset import TriangleSet

    content = Collada(file, ignore=[DaeError])
    up = str(content.assetInfo.upaxis or "y")[0].lower()
    made = []
    placed_rows = 0
    for placed in content.scene.objects("geometry") if content.scene else ():
        shape = placed.original
        # Primitives that share vertices are one mesh.
        sets: dict[int, list[Any]] = {}
        for piece in shape.primitives:
            if isinstance(piece, Polylist | TriangleSet) and piece.vertex is not None:
                sets.setdefault(id(piece.vertex), []).append(piece)
        for same in sets.values():
            vertices = np.asarray(same[0].vertex, np.float64)
            corners = np.concatenate([np.ravel(piece.vertex_index) for piece in same]).astype(np.int64)
            counts = [getattr(piece, "vcounts", np.full(len(piece.vertex_index), 3)) for piece in same]
            sizes = np.concatenate(counts).astype(np.int64)
            placed_rows += len(vertices) + len(corners)
            check_copies(placed_rows, file.seek(0, os.SEEK_END), path)
            cut = triangulate(vertices, corners, sizes, str(path))
            matrix = np.asarray(placed.matrix, np.float64)
            name = str(shape.name or shape.id)
            faces = cut.take(corners)
            made.append(Instance(name, vertices, faces, None, matrix, cut.notes, up=up))
    return made


def _meshio(file: Path, path: Path) -> list[Instance]:
    """Triangles and quads. meshio prints what each of its readers has to say, and ends the process if none can."""
    import meshio

    said = io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
        try:
            content = meshio.read(file)
        except SystemExit:
            reason = " ".join(said.getvalue().split()).replace(str(file), path.name) or "another"
            raise MeshError(path, "content", f"a file that meshio reads as {path.suffix}", reason) from None
    blocks = [block for block in content.cells if block.type in _SURFACES]
    corners = np.concatenate([np.empty(0, np.int64), *(np.ravel(block.data) for block in blocks)]).astype(np.int64)
    sizes = np.concatenate([np.empty(0, np.int64), *(np.full(*np.shape(block.data)) for block in blocks)])
    cut = triangulate(content.points, corners, sizes, str(path))
    rest = sorted({block.type for block in content.cells} - {*_SURFACES, "vertex", "line"})
    left_out = (f"{', '.join(rest)} cells are left out: only triangles and quads are read",) if rest else ()
    return [Instance(path.stem, content.points, cut.take(corners), notes=cut.notes + left_out)]
