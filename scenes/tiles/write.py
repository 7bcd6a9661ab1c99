"""w of a mesh on the disk, written in runs of rows."""

from __future__ import annotations

from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from ao.tiles.source import runs
from raytrace.errors import OptionError
from raytrace.system.atomic import atomic_write
from raytrace.types import Float64s

from ..formats.ply.detail import RGB, grey_of
from ..formats.ply.encode import NAMES
from ..formats.ply.read import COUNT
from ..formats.ply.write import GREY, OWN
from .stored import StoredMesh

ENDINGS = ".npy", ".ply"


def write_tiled(path: Path, w: Float64s, mesh: StoredMesh) -> None:
    """Write w (n,) as `.npy` or `.ply`, as `scenes.write` does.

    Vertex colours of a PLY stay what they are; else w is also written as grey.

    Raises:
        OptionError: another ending.
        OutputError: the file cannot be written.
    """
    if path.suffix.lower() not in ENDINGS:
        raise OptionError("output", "a name ending in " + " or ".join(ENDINGS) + ", with tiles", path)
    with atomic_write(path) as file:
        if path.suffix.lower() == ".npy":
            header = {"descr": "<f4", "fortran_order": False, "shape": (len(w),)}
            np.lib.format.write_array_header_1_0(file, header)
            for run in runs(len(w)):
                file.write(w[run].astype("<f4").tobytes())
        else:
            _write_ply(file, w, mesh)


def _write_ply(file: BinaryIO, w: Float64s, mesh: StoredMesh) -> None:
    kept = _kept(mesh)
    grey = not set(RGB) <= {name for name, _ in kept}
    fields = [*kept, ("obscurance", "f"), *((name, "B") for name in RGB if grey)]
    row = np.dtype([(name, "<" + kind) for name, kind in fields])
    faces = _face_fields(mesh)
    lines = ["ply", "format binary_little_endian 1.0", OWN + (GREY if grey else ""), *mesh.comments]
    lines += [f"element vertex {mesh.vertex_count}", *(f"property {NAMES[kind]} {name}" for name, kind in fields)]
    lines.append(f"element face {mesh.face_count}")
    lines += [f"property {'list uchar ' if size else ''}{NAMES[kind]} {name}" for name, kind, size in faces]
    file.write("\n".join([*lines, "end_header\n"]).encode("latin-1", "replace"))
    for run in runs(mesh.vertex_count):
        rows = np.empty(run.stop - run.start, row)
        stored: Any = mesh.vertices(run.start, run.stop) if mesh.vertex_rows is None else mesh.vertex_rows[run]
        for number, (name, _) in enumerate(kept):
            rows[name] = stored[:, number] if mesh.vertex_rows is None else stored[name]
        rows["obscurance"] = w[run]
        for name in RGB if grey else ():
            rows[name] = grey_of(w[run])
        file.write(rows.tobytes())
    face = np.dtype([part for name, kind, size in faces for part in _face_parts(name, kind, size)])
    for run in runs(mesh.face_count):
        rows = np.empty(run.stop - run.start, face)
        for name, _, size in faces:
            rows[name] = mesh.faces(run.start, run.stop) if size else mesh.face_rows[run][name]
            if size:
                rows[COUNT + name] = size
        file.write(rows.tobytes())


def _kept(mesh: StoredMesh) -> list[tuple[str, str]]:
    """Names and types of the vertices' properties that an output keeps."""
    if mesh.vertex_rows is None:
        return [(axis, "f") for axis in "xyz"]
    names = mesh.vertex_rows.dtype.names or ()
    return [(name, mesh.vertex_rows.dtype[name].char) for name in names if name != "obscurance"]


def _face_fields(mesh: StoredMesh) -> list[tuple[str, str, int]]:
    """Names, types and lengths, 0 for a single value, of the faces' properties."""
    if mesh.vertex_rows is None:
        return [("vertex_indices", "i", 3)]
    row = mesh.face_rows.dtype
    names = [name for name in row.names or () if not name.startswith(COUNT)]
    return [(name, row[name].base.char, 3 if name == mesh.corners else 0) for name in names]


def _face_parts(name: str, kind: str, size: int) -> list[tuple[Any, ...]]:
    return [(COUNT + name, "<u1"), (name, "<" + kind, (size,))] if size else [(name, "<" + kind)]
