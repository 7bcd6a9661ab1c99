"""Every format of files: what reads and writes it, and what it holds. A new one is a file and a row."""

import os
import re
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple


class MeshInput(NamedTuple):
    """A mesh file to be read."""

    file: BinaryIO
    path: Path  # where the bytes are, or what they are called
    name: str  # of an object without one
    keep: bool  # whether to read what a target can hold besides, too
    alpha: bool  # also alpha of materials
    is_on_disk: bool  # whether `path` holds the bytes

    @property
    def source(self) -> str:
        return str(self.path)


class Channels(NamedTuple):
    """Where a file holds w beside its own attribute, for viewers, and how a page stands."""

    colors: str = ""  # which of "rgba" of the vertex colours hold w, too; of several, alpha of a .glb becomes 1
    ramp: bool = False  # also in the materials' occlusion textures (`scenes.formats.glb.write`)
    replace: bool = False  # in place of occlusion textures of the source, too
    up: str | None = None  # the axis that is up, in place of `Mesh.up`


class FileFormat(NamedTuple):
    """A row of the table. Functions are texts, `module:name` below `scenes`, so that none is imported before use."""

    ending: str  # of files, in lower case
    name: str
    read: str = ""  # a `MeshInput` to a list of `Instance`s, of glTF with its asset
    peak: float = 0.0  # bytes of memory a byte of file while it is read; what archives and glTF hold is counted later
    begins: bytes = b""  # a pattern of the first bytes, which identifies a pipe's format
    write: str = ""  # a bake, a `MeshFile` and `Channels` to bytes
    lost: str = ""  # a `MeshFile` and `Channels.colors` to words for what an output lacks
    holds: tuple[str, ...] = ()  # of "w", "colors" of vertices, "uv" of polygons' corners, a "scene"


_GLTF = "formats.gltf.instances:read_gltf"
_ROWS = (
    FileFormat(".npy", "NumPy", write="write_bake:npy", holds=("w",)),
    FileFormat(".npz", "NumPy", write="write_bake:npz", holds=("w",)),
    FileFormat(".obj", "OBJ", "formats.obj.read:read_obj", 9.0,
               rb"(\s*(#[^\n]*)?\n)*\s*(v|vn|vt|o|g|mtllib|usemtl|s)\s", holds=("uv",)),
    FileFormat(".ply", "PLY", "formats.ply.read:read_ply", 7.5, rb"ply\r?\n", "formats.ply.write:ply",
               "formats.losses:of_ply", ("w", "colors", "uv")),
    FileFormat(".stl", "STL", "formats.stl:read_stl", 6.0, rb"\s*solid\b.*\n\s*facet\b"),
    FileFormat(".off", "OFF", "formats.off:read_off", 7.5, rb"\s*(ST)?(C?N?4?n?)OFF\b"),
    FileFormat(".glb", "GLB", _GLTF, 2.0, rb"glTF", "formats.glb.write:glb", "formats.losses:of_glb",
               ("w", "colors", "scene")),
    FileFormat(".gltf", "glTF", _GLTF, 2.0, rb"\s*\{", holds=("w", "scene")),
    FileFormat(".3mf", "3MF", "formats.threemf:read_3mf", 1.0, rb"PK\x03\x04"),
    FileFormat(".html", "HTML", write="write_bake:html"),
)  # fmt: skip
FORMATS = {row.ending: row for row in _ROWS}
_LIBRARIES = FileFormat("", "", "formats.libraries:read_by_library", 22.0)


def format_of(path: str | os.PathLike[str]) -> FileFormat:
    """The row of a file's ending; for unknown endings a row without one, which libraries may read."""
    return FORMATS.get(Path(path).suffix.lower(), _LIBRARIES)


def endings(column: str, word: str = "") -> tuple[str, ...]:
    """The endings of formats that have something in a column of the table, or among what they hold this word."""
    return tuple(row.ending for row in _ROWS if (word in row.holds if word else getattr(row, column)))


def function(name: str) -> Callable[..., Any]:
    """A function that the table names."""
    module, _, attribute = name.partition(":")
    found: Callable[..., Any] = getattr(import_module(f"scenes.{module}"), attribute)
    return found


def sniffed_format(content: bytes | bytearray) -> str | None:
    """The ending of the format that the first bytes identify, or None."""
    return next((row.ending for row in _ROWS if row.begins and re.match(row.begins, content)), None)
