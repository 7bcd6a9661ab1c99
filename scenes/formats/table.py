"""THE table of file formats: what reads and writes each, and what it holds."""

import re
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
    again: str = 'baked.profile.at("{}")'  # how a page says to bake another half-distance, "{}"
    warning: str = ""  # about the result, which a page says first


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


_REGISTERED: dict[str, FileFormat] = {}
_LIBRARIES = FileFormat("", "", "obscurance.scenes.formats.libraries:read_by_library", 22.0)


def register(*formats: FileFormat) -> None:
    """Make formats known by their endings: those below, and those of other packages, which call this first."""
    _REGISTERED.update({row.ending: row for row in formats})


def formats() -> dict[str, FileFormat]:
    """All formats by their endings, sorted."""
    return dict(sorted(_REGISTERED.items()))


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


_DAE = "obscurance.scenes.formats.dae"
_COLLADA = rb"(?s)(\xef\xbb\xbf)?\s*(<\?xml.*?\?>\s*)?(<!--.*?-->\s*)*<COLLADA\b"
_READ_GLTF = "obscurance.scenes.formats.gltf.read:read_gltf"
_READ_RASTER, _WRITE_RASTER = "obscurance.scenes.formats.raster:read_raster", "obscurance.scenes.formats.raster:raster"

register(
    FileFormat(
        ".obj",
        "OBJ",
        read="obscurance.scenes.formats.obj.read:read_obj",
        peak=9.0,
        begins=rb"(\s*(#[^\n]*)?\n)*\s*(v|vn|vt|o|g|mtllib|usemtl|s)\s",
        write="obscurance.scenes.formats.obj.write:obj",
        holds=("source", "uv"),
    ),
    FileFormat(
        ".ply",
        "PLY",
        read="obscurance.scenes.formats.ply.read:read_ply",
        peak=7.5,
        begins=rb"ply[\r\n]",
        write="obscurance.scenes.formats.ply.write:ply",
        holds=("source", "w", "profile", "faces", "colors", "uv"),
    ),
    FileFormat(
        ".glb",
        "GLB",
        read=_READ_GLTF,
        peak=2.0,
        begins=rb"glTF",
        write="obscurance.scenes.formats.gltf.write:glb",
        holds=("source", "w", "profile", "colors", "scene"),
        unit=1.0,
    ),
    FileFormat(".gltf", "glTF", read=_READ_GLTF, peak=2.0, begins=rb"\s*\{", holds=("w", "profile", "scene"), unit=1.0),
    FileFormat(".vrm", "VRM", read=_READ_GLTF, peak=2.0, holds=("scene",), unit=1.0),
    FileFormat(
        ".stl", "STL", read="obscurance.scenes.formats.stl:read_stl", peak=6.0, begins=rb"\s*solid\b.*\n\s*facet\b"
    ),
    FileFormat(
        ".off", "OFF", read="obscurance.scenes.formats.off:read_off", peak=7.5, begins=rb"\s*(ST)?(C?N?4?n?)OFF\b"
    ),
    FileFormat(
        ".3mf",
        "3MF",
        read="obscurance.scenes.formats.threemf:read_3mf",
        peak=1.0,
        begins=rb"PK\x03\x04",
        unit="obscurance.scenes.formats.threemf:unit",
    ),
    FileFormat(".dae", "COLLADA", read=f"{_DAE}:read_dae", peak=22.0, begins=_COLLADA, unit=f"{_DAE}:unit"),
    FileFormat(".zae", "COLLADA", read=f"{_DAE}:read_dae", peak=22.0),
    FileFormat(".asc", "Esri ASCII grid", read=_READ_RASTER, peak=2.0, holds=("raster",), unit=1.0),
    FileFormat(".tif", "GeoTIFF", read=_READ_RASTER, peak=2.0, write=_WRITE_RASTER, holds=("raster", "w"), unit=1.0),
    FileFormat(".tiff", "GeoTIFF", read=_READ_RASTER, peak=2.0, write=_WRITE_RASTER, holds=("raster", "w"), unit=1.0),
    FileFormat(
        ".vtp",
        "VTK",
        read="obscurance.scenes.formats.vtp:read_vtp",
        peak=10.0,
        begins=rb"(?s)\s*(<\?xml.*?\?>\s*)?(<!--.*?-->\s*)*<VTKFile\b[^>]*PolyData",
        write="obscurance.scenes.formats.vtp:vtp",
        holds=("source", "w"),
    ),
    FileFormat(".npy", "NumPy", write="obscurance.scenes.formats.write:npy", holds=("w", "faces")),
    FileFormat(".npz", "NumPy", write="obscurance.scenes.formats.write:npz", holds=("w", "profile", "faces")),
    FileFormat(".html", "HTML", write="obscurance.scenes.show.page.document:page_of_bake", holds=("profile",)),
)
