"""THE table of file formats: what reads and writes each, and what it holds.

A format's own file, or the `__init__.py` of its folder, ends with its rows: `FORMATS`, a literal of fields of
`FileFormat`. They are read from the text: a file is not imported before it reads or writes something.
"""

import re
from ast import literal_eval
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import BinaryIO, NamedTuple

from obscurance.raytrace.system.atomic import PathName


class MeshInput(NamedTuple):
    """A mesh file to be read."""

    file: BinaryIO
    path: Path  # where the bytes are, or what they are called
    name: str  # of an object without one
    alpha: bool  # whether materials may let light through
    is_on_disk: bool  # whether `path` holds the bytes

    @property
    def source(self) -> str:
        return str(self.path)


class Channels(NamedTuple):
    """Where a file holds w beside its own attribute, for viewers, and how a page stands."""

    colors: str = ""  # which of "rgba" of the vertex colours hold w, too; of several, alpha of a .glb becomes 1
    ramp: bool = False  # also in the materials' occlusion textures (`scenes.formats.gltf.write`)
    replace: bool = False  # in place of occlusion textures of the source, too
    up: str | None = None  # the axis that is up, in place of `Mesh.up`
    ply_name: str | None = None  # a further property of a PLY that holds w
    alone: bool = False  # whether a .glb has no attributes of other names: Blender 5.1 and before mix several up
    again: str = 'baked.profile.at("{}")'  # how a page says to bake another half-distance, "{}"
    warning: str = ""  # about the result, which a page says first
    record: str = ""  # of the bake (`scenes.bake.record`)


class FileFormat(NamedTuple):
    """The format of one ending of file names. Functions are texts for `pkgutil.resolve_name`."""

    ending: str  # of files, in lower case
    name: str
    read: str = ""  # a `MeshInput` to an `Asset`
    peak: float = 0.0  # bytes of memory a byte of file while it is read; what archives and glTF hold is counted later
    begins: bytes = b""  # a pattern of the first bytes, which identifies a pipe's format
    write: str = ""  # a bake, an `Asset` and `Channels` to bytes
    # what else the "source" of an output holds; "w", that of "faces" and backs, "colors" of vertices, "uv" of corners,
    # a "profile", a "scene", a "raster"
    holds: tuple[str, ...] = ()
    unit: float | str = 0.0  # of its coordinates, in metres; or the function that finds it in a file; 0: none


_FOREIGN: dict[str, FileFormat] = {}
_LIBRARIES = FileFormat("", "", "obscurance.scenes.formats.libraries:read_by_library", 22.0)


def register(*formats: FileFormat) -> None:
    """Make formats of another package known by their endings."""
    _FOREIGN.update({row.ending: row for row in formats})


def rows_of(file: Path) -> Iterator[FileFormat]:
    """The formats with which a source file ends."""
    _, mark, rows = file.read_text("utf-8").rpartition("\nFORMATS = ")
    yield from (FileFormat(**row) for row in literal_eval(rows)) if mark else ()


@cache
def _own() -> dict[str, FileFormat]:
    """The formats of this folder by their endings."""
    here = Path(__file__).parent
    files = (*here.glob("*.py"), *here.glob("*/__init__.py"))
    return {row.ending: row for file in files if file != Path(__file__) for row in rows_of(file)}


def formats() -> dict[str, FileFormat]:
    """All formats by their endings, sorted."""
    return dict(sorted((_own() | _FOREIGN).items()))


def format_of(path: PathName) -> FileFormat:
    """The format of a file's ending; for unknown endings one without an ending, which libraries may read."""
    return formats().get(Path(path).suffix.lower(), _LIBRARIES)


def endings(what: str) -> tuple[str, ...]:
    """The endings of formats that have the field `what` set, or that hold `what`."""
    return tuple(row.ending for row in formats().values() if what in row.holds or getattr(row, what, False))


def is_raster(path: PathName) -> bool:
    """Whether a file is a raster of heights, by its ending: every cell gets w, in a raster."""
    return "raster" in format_of(path).holds


def sniffed_format(content: bytes | bytearray) -> str | None:
    """The ending of the format that the first bytes identify, or None."""
    return next((row.ending for row in formats().values() if row.begins and re.match(row.begins, content)), None)
