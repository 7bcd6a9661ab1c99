"""A bake as a file, in the format of its ending."""

from __future__ import annotations

import io
import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from raytrace.errors import OptionError
from raytrace.system.atomic import atomic_write, check_writable

from ..readers.load import MeshFile
from .ply import ply

if TYPE_CHECKING:
    from ao import Bake


def check_target(path: str | os.PathLike[str]) -> None:
    """Find out before the bake whether `write` will accept `path`.

    Raises:
        OptionError: the ending is none of .npy .npz .ply .glb.
        OutputError: the folder is missing or refuses new files, or `path` is something other than a file.
    """
    _writer(path)
    check_writable(path)


def write(path: str | os.PathLike[str], bake: Bake, mesh_file: MeshFile, *, colors: bool = False) -> None:
    """Write a bake in the format of the ending, whole or not at all; the same input gives the same bytes.

    - `.npy`: w, float32 (n,).
    - `.npz`: `w` float32 (n,), `error` float32 (n,), `bent_normals` float32 (n, 3), `flags` uint8 (n,).
    - `.ply`: `obscurance`, and grey `red green blue` = 255 w, linear: viewers multiply by it as it stands, which is
      what w is for (`ply.ply`). Coordinates are float where that loses nothing and double otherwise.
    - `.glb`: `_OBSCURANCE` (`glb.glb`).

    What the source holds besides is kept if it was loaded for this target (`load`); `losses.lost` lists what is not.

    Args:
        path: the target, replaced if it exists.
        bake: per vertex of `mesh_file.mesh`.
        mesh_file: what was baked.
        colors: give a .glb the vertex colours `COLOR_0` = w, and a .ply the grey, in place of the source's colours.

    Raises:
        OptionError: unknown ending, or coordinates that a .glb cannot hold.
        OutputError: the file cannot be written; an existing one is untouched.
    """
    content = _writer(path)(bake, mesh_file, colors)
    with atomic_write(path) as file:
        file.write(content)


def _writer(path: str | os.PathLike[str]) -> Callable[[Bake, MeshFile, bool], bytes | memoryview]:
    ending = Path(path).suffix.lower()
    if ending not in _WRITERS:
        raise OptionError("output", "a name ending in " + ", ".join(_WRITERS), os.fspath(path))
    return _WRITERS[ending]


def _npy(bake: Bake, _mesh_file: MeshFile, _colors: bool) -> memoryview:
    content = io.BytesIO()
    np.save(content, bake.w.astype("<f4"), allow_pickle=False)
    return content.getbuffer()


def _npz(bake: Bake, _mesh_file: MeshFile, _colors: bool) -> memoryview:
    content = io.BytesIO()
    np.savez(
        content,
        w=bake.w.astype("<f4"),
        error=bake.error.astype("<f4"),
        bent_normals=bake.bent_normals.astype("<f4"),
        flags=bake.flags.astype(np.uint8),
    )
    return content.getbuffer()


def _ply(bake: Bake, mesh_file: MeshFile, colors: bool) -> bytes:
    return ply(mesh_file, bake.w, colors)


def _glb(bake: Bake, mesh_file: MeshFile, colors: bool) -> bytes:
    from .glb import glb

    return glb(mesh_file, bake.w, colors)


_WRITERS: dict[str, Callable[[Bake, MeshFile, bool], bytes | memoryview]] = {
    ".npy": _npy,
    ".npz": _npz,
    ".ply": _ply,
    ".glb": _glb,
}
