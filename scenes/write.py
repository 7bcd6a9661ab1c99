"""The baker's output files."""

from __future__ import annotations

import io
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from raytrace.atomic import atomic_write, check_writable
from raytrace.errors import OptionError

from .load import MeshFile
from .write_glb import glb

_LONGEST = 1e38


class Baked(Protocol):
    """What is written of a bake, per vertex of the mesh and in its order.

    Attributes:
        w: (n,) obscurance, 1 = open.
        error: (n,) estimated standard error of w.
        bent_normals: (n, 3).
        flags: (n,) unsigned bytes.
    """

    @property
    def w(self) -> npt.NDArray[np.floating[Any]]: ...
    @property
    def error(self) -> npt.NDArray[np.floating[Any]]: ...
    @property
    def bent_normals(self) -> npt.NDArray[np.floating[Any]]: ...
    @property
    def flags(self) -> npt.NDArray[np.integer[Any]]: ...


def check_target(path: str | os.PathLike[str]) -> None:
    """Find out before the bake whether `write` will accept `path`.

    Raises:
        OptionError: the ending is none of .npy .npz .ply .glb.
        OutputError: the folder is missing or refuses new files, or `path` is something other than a file.
    """
    _writer(path)
    check_writable(path)


def write(path: str | os.PathLike[str], bake: Baked, mesh_file: MeshFile, *, colors: bool = False) -> None:
    """Write a bake in the format of the ending, whole or not at all; the same input gives the same bytes.

    - `.npy`: w, float32 (n,).
    - `.npz`: `w` float32 (n,), `error` float32 (n,), `bent_normals` float32 (n, 3), `flags` uint8 (n,).
    - `.ply`: binary; the mesh with the float property `obscurance`, the file's own normals if it had some, and grey
      `red green blue` = 255 w, linear: viewers multiply by it as it stands, which is what w is for. Coordinates are
      float where that loses nothing and double otherwise.
    - `.glb`: `_OBSCURANCE` (`write_glb.glb`).

    Args:
        path: the target, replaced if it exists.
        bake: per vertex of `mesh_file.mesh`.
        mesh_file: what was baked.
        colors: also give a .glb the vertex colours `COLOR_0` = w.

    Raises:
        OptionError: unknown ending, or coordinates that a .glb cannot hold.
        OutputError: the file cannot be written; an existing one is untouched.
    """
    content = _writer(path)(bake, mesh_file, colors)
    with atomic_write(path) as file:
        file.write(content)


def _writer(path: str | os.PathLike[str]) -> Callable[[Baked, MeshFile, bool], bytes | memoryview]:
    ending = Path(path).suffix.lower()
    if ending not in _WRITERS:
        raise OptionError("output", "a name ending in " + ", ".join(_WRITERS), os.fspath(path))
    return _WRITERS[ending]


def _npy(bake: Baked, _mesh_file: MeshFile, _colors: bool) -> memoryview:
    content = io.BytesIO()
    np.save(content, bake.w.astype("<f4"), allow_pickle=False)
    return content.getbuffer()


def _npz(bake: Baked, _mesh_file: MeshFile, _colors: bool) -> memoryview:
    content = io.BytesIO()
    np.savez(
        content,
        w=bake.w.astype("<f4"),
        error=bake.error.astype("<f4"),
        bent_normals=bake.bent_normals.astype("<f4"),
        flags=bake.flags.astype(np.uint8),
    )
    return content.getbuffer()


def _ply(bake: Baked, mesh_file: MeshFile, _colors: bool) -> bytes:
    mesh = mesh_file.mesh
    with np.errstate(over="ignore"):
        single = np.array_equal(mesh.vertices.astype(np.float32), mesh.vertices)
    fields = [(axis, "<f4" if single else "<f8") for axis in "xyz"]
    columns = dict(zip("xyz", mesh.vertices.T, strict=True))
    if mesh.normals is not None:
        fields += [(axis, "<f4") for axis in ("nx", "ny", "nz")]
        columns |= zip(("nx", "ny", "nz"), _storable(mesh.normals).T, strict=True)
    fields += [("obscurance", "<f4"), ("red", "u1"), ("green", "u1"), ("blue", "u1")]
    grey = np.rint(np.clip(bake.w, 0, 1) * 255)
    columns |= {"obscurance": bake.w, "red": grey, "green": grey, "blue": grey}
    vertices = np.empty(len(mesh.vertices), dtype=fields)
    for name, column in columns.items():
        vertices[name] = column
    faces = np.empty(len(mesh.faces), dtype=[("count", "u1"), ("indices", "<i4", 3)])
    faces["count"], faces["indices"] = 3, mesh.faces
    names = {"<f4": "float", "<f8": "double", "u1": "uchar"}
    header = [
        "ply",
        "format binary_little_endian 1.0",
        "comment obscurance: 1 = open; red green blue = 255 obscurance",
        f"element vertex {len(vertices)}",
        *(f"property {names[kind]} {name}" for name, kind in fields),
        f"element face {len(faces)}",
        "property list uchar int vertex_indices",
        "end_header\n",
    ]
    return "\n".join(header).encode() + vertices.tobytes() + faces.tobytes()


def _storable(normals: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Normals (n, 3) without NaN, those too long for float32 shortened."""
    finite = np.nan_to_num(normals)
    longest = np.abs(finite).max(axis=1, keepdims=True)
    return finite / np.where(longest > _LONGEST, longest, 1.0)


def _glb(bake: Baked, mesh_file: MeshFile, colors: bool) -> bytes:
    return glb(mesh_file, bake.w, colors)


_WRITERS: dict[str, Callable[[Baked, MeshFile, bool], bytes | memoryview]] = {
    ".npy": _npy,
    ".npz": _npz,
    ".ply": _ply,
    ".glb": _glb,
}
