"""PLY files that stay on the disk: read, and written with w, in runs of rows."""

from dataclasses import replace
from pathlib import Path
from typing import BinaryIO

import numpy as np

from ao.tiles.source import runs
from raytrace.errors import MeshError
from raytrace.types import Float64s

from ..stored_mesh import EXPECTED, StoredMesh, StoredRows
from .detail import RGB, grey_of, is_profile
from .layout import INDICES, read_header, write_header
from .write import GREY, OWN

_LONGEST_HEADER = 1 << 16


def open_ply(path: Path) -> StoredMesh:
    """Raises: MeshError, ValueError, KeyError: it cannot be read in runs of rows."""
    with path.open("rb") as file:
        header = read_header(file.read(_LONGEST_HEADER))
    if header.text or [element.name for element in header.elements] != ["vertex", "face"]:
        raise MeshError(path, "content", EXPECTED, "a text file" if header.text else "other elements")
    vertex, face = header.elements
    lists = [name for name, (_, counted) in face.properties.items() if counted]
    if lists not in ([name] for name in INDICES) or any(counted for _, counted in vertex.properties.values()):
        raise MeshError(path, "content", EXPECTED, "other lists than one of each face's vertices")
    if not (vertex.count and face.count):
        raise MeshError(path, "faces", "at least one triangle", "none")
    vertex_type, face_type = vertex.row({}, header.order), face.row({lists[0]: 3}, header.order)
    end = header.start + vertex.count * vertex_type.itemsize
    if end + face.count * face_type.itemsize != path.stat().st_size:
        raise MeshError(path, "content", EXPECTED, "polygons, or an end elsewhere than its header says")
    vertices, faces = StoredRows.of(path, vertex_type, header.start), StoredRows.of(path, face_type, end)
    return StoredMesh(str(path), vertex, face, vertices, faces, lists[0], header.comments)


def write_stored_ply(file: BinaryIO, w: Float64s, mesh: StoredMesh) -> None:
    """w (n,) beside the properties of a mesh on the disk; grey, too, if its vertices have no colours."""
    columns = mesh.vertex.properties.items()
    kept = {name: types for name, types in columns if name != "obscurance" and not is_profile(name)}
    grey = not set(RGB) <= set(kept)
    made = {"obscurance": ("f", ""), **({name: ("B", "") for name in RGB} if grey else {})}
    kept = {name: types for name, types in kept.items() if name not in made}
    vertex = replace(mesh.vertex, properties=kept | made)
    counted = {mesh.corners: (mesh.face.properties[mesh.corners][0], "B")}
    face = replace(mesh.face, properties=mesh.face.properties | counted)
    file.write(write_header([vertex, face], [OWN + (GREY if grey else ""), *mesh.comments]))
    for run in runs(vertex.count):
        rows, stored = np.empty(run.stop - run.start, vertex.row({})), mesh.vertex_rows[run]
        for name in kept:
            rows[name] = stored[name]
        for name in made:
            rows[name] = w[run] if name == "obscurance" else grey_of(w[run])
        file.write(rows.tobytes())
    for run in runs(face.count):
        rows, stored = np.empty(run.stop - run.start, face.row({mesh.corners: 3})), mesh.face_rows[run]
        for name in rows.dtype.names or ():
            rows[name] = stored[name]
        file.write(rows.tobytes())
