"""Any mesh file: by own readers, more by libraries; vertices exactly as stored."""

from __future__ import annotations

import io
import os
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from pkgutil import resolve_name

import numpy as np

from obscurance.raytrace.errors import InputError, MeshError, ObscuranceError, OptionError
from obscurance.raytrace.mesh.mesh import Mesh
from obscurance.raytrace.mesh.normals import useless_normals
from obscurance.raytrace.system.checks import check_memory, check_regular

from ..asset.asset import Asset
from ..asset.primitive import BAKED, COLOR, FLOAT, NORMAL, Primitive
from .table import MeshInput, format_of, formats, sniffed_format

_CONVERTERS = dict.fromkeys((".abc", ".blend", ".fbx", ".usd", ".usda", ".usdc", ".usdz"), "Blender") | dict.fromkeys(
    (".iges", ".igs", ".step", ".stp"), "FreeCAD"
)
"""Programs that know formats which nobody reads here."""
_KEPT = 2.5  # bytes of memory a byte of file where attributes are kept, besides the table's
PIPED = "<stdin>"  # in place of a file's name without its ending
STANDARD, _SOURCE = Path("-"), "standard input"
_CHUNK = 1 << 26
_TRIANGLES, _TRIANGLE, _HEAD = slice(80, 84), 50, 84  # of a binary STL


def load(
    path: str | os.PathLike[str],
    target: str | os.PathLike[str] | None = None,
    content: bytes | None = None,
    alpha: bool = True,
    up: str | None = None,
    names: bool = False,
    flip: bool = False,
    points: bool = False,
) -> Asset:
    """Read a mesh file in the format of its ending.

    Polygons are cut into triangles in `mesh`. Point clouds, lines and cameras beside meshes are left out. A file's own
    normals fill `mesh.normals` (PLY `nx ny nz`, OBJ `vn`, glTF `NORMAL`), or `mesh.corner_normals` where a vertex has
    several. Texture coordinates, colours and the like are read when they are used. Files that a file refers to are
    read only from its own folder or below.

    Args:
        target: the file that `scenes.write` is to make of it: it is checked for this, and what the target cannot hold
            takes no memory.
        content: the file's bytes, if they came from elsewhere; `path` then only names it and its format.
        alpha: whether faces have the alpha of their glTF or OBJ materials; otherwise they are opaque.
        up: `mesh.up` in place of what the file says.
        names: keep all whatever the target, such as the names of objects.
        points: whether it is a cloud of points with normals, and no faces: the mesh is of a disc for each.
        flip: turn all faces over, and normals with them; what is written has them turned.

    Raises:
        MeshError: the file is missing, unreadable, empty, incomplete, of another format than its ending says,
            without triangles, or has indices out of range or coordinates that are not finite.
        MemoryLimitError: it would not fit into memory.
    """
    path = Path(path)
    aim = format_of(target or "")
    is_scene = "scene" in format_of(path).holds
    keeps = not target or names or "source" in aim.holds or aim.ending == ".html"
    asset = read_asset(path, content, alpha, points)
    asset = replace(asset, up=up or asset.up)
    with parser_errors(path):
        if points:
            asset = _of_points(asset)
        if not keeps and not asset.has_alpha:  # frees memory before the mesh takes some
            bare = (one._replace(columns=one.columns.only(NORMAL, *BAKED.values())) for one in asset.primitives)
            asset = replace(asset, raw=None, pictures=asset.files[1:], primitives=tuple(bare))
        mesh = asset.mesh
        if "source" in aim.holds:
            _ = len(asset.materials)  # to find what is malformed
            if is_scene and "scene" not in aim.holds:
                asset = _without_malformed(asset)
        if keeps and target and not (is_scene and "scene" in aim.holds):
            uv = asset.columns("uv0") or ()
            if any(column and (np.abs(column.values) > FLOAT).any() for column in uv):
                raise MeshError(path, "texture coordinates", f"numbers to {FLOAT:g}, for float32", "larger ones")
    if useless := useless_normals(mesh):
        of = f"{useless:,} of {mesh.faces.size:,} normals at corners are missing, zero, not finite or behind their face"
        asset.warnings[f"{of}; those of the faces take their place"] = None
    if flip:
        if aim.ending == ".glb" and is_scene:
            raise OptionError("flip", "another mesh file than a glTF for a .glb, which keeps its faces", path)
        asset = asset.reversed()
    return asset if keeps else asset.bare()


def _without_malformed(asset: Asset) -> Asset:
    """The asset, without texture coordinates and colours if they are malformed, which `unread` tells."""
    for name in ("uv0", COLOR):
        try:
            asset.columns(name)
        except MeshError as fault:
            kept = (one._replace(columns=one.columns.only(*{*one.columns} - {name})) for one in asset.primitives)
            changed = replace(asset, primitives=tuple(kept), unread=(*asset.unread, fault.field))
            asset = changed.with_mesh(asset.mesh)
    return asset


def _of_points(asset: Asset) -> Asset:
    """A cloud of points with normals as their discs. Raises: MeshError: the file is none."""
    from obscurance.ao.points.discs import check_finite, discs

    normals = asset.at_vertices(NORMAL)
    faces = sum(part.faces.stop - part.faces.start for part in asset.parts)
    if len(asset.parts) > 1 or faces or normals is None:
        expected = "one cloud of points with normals, without faces"
        got = "faces" if faces else "points without normals" if normals is None else "several"
        raise MeshError(asset.path, "points", expected, got)
    if not np.nan_to_num(normals).any():
        raise MeshError(asset.path, "normals", "some that are neither zero nor NaN", f"none of {len(normals):,}")
    places = np.asarray(asset.primitives[0].positions, np.float64)
    check_finite(places, asset.path)
    if len(places) > 1:
        mesh = discs(places, normals, str(asset.path)).mesh
    else:  # beside others that occlude
        mesh = Mesh(places[[0, 0, 0]], [[0, 1, 2]], source=str(asset.path))
    discs_of = Primitive.of(mesh.vertices, mesh.faces.ravel())
    return replace(asset, primitives=(discs_of,), cloud=(places, normals), has_alpha=False)


def read_asset(path: Path, content: bytes | None = None, alpha: bool = False, points: bool = False) -> Asset:
    """The content of a mesh file as it stores it. Raises: MeshError: as `load`.

    Args: content, alpha, points: as `load` takes them.
    """
    row = format_of(path)
    name = "mesh" if path.stem == PIPED else path.stem
    with parser_errors(path):
        if content is None:
            check_regular(path, "a mesh file", MeshError)
        if not row.read or not row.ending:
            from .libraries import library_endings

            if path.suffix.lower() not in library_endings():
                readable = ", ".join(dict.fromkeys(row.name for row in formats().values() if row.read))
                by_library = " or a format of meshio" * bool(library_endings())
                converter = _CONVERTERS.get(path.suffix.lower())
                advice = f"; {converter} writes .glb of it" if converter else ""
                raise MeshError(path, "ending", f"that of {readable}{by_library}{advice}", path.suffix or "none")
        size = path.stat().st_size if content is None else len(content)
        if size == 0:
            raise MeshError(path, "content", "a mesh", "an empty file")
        check_memory(path, int((row.peak + _KEPT) * size), f"to read {size:,} bytes")
        with path.open("rb") if content is None else io.BytesIO(content) as file:
            asset: Asset = resolve_name(row.read)(MeshInput(file, path, name, alpha, content is None))
        asset.warnings.update((note, None) for one in asset.primitives for note in one.triangles.notes)
        # Every primitive of a glTF keeps its part: the GLB writer counts on it.
        is_scene = "scene" in row.holds
        has_faces = [one.triangles.counts.any() for one in asset.primitives]
        nodes = tuple(node for node in asset.nodes if is_scene or any(has_faces[number] for number in node.primitives))
        if nodes:
            return replace(asset, nodes=nodes)
        if points and asset.nodes:
            return asset
        count = sum(len(asset.primitives[number].positions) for node in asset.nodes for number in node.primitives)
        besides = "no vertices: perhaps it is no OBJ" if row.name == "OBJ" and not count else f"{count} points"
        if any(NORMAL in primitive.columns for primitive in asset.primitives):
            besides += " with normals: bake --points takes those"
        raise MeshError(path, "faces", "at least one triangle", "; ".join([f"none, and {besides}", *asset.warnings]))


@contextmanager
def parser_errors(path: Path, error: type[InputError] = MeshError, content: str = "") -> Iterator[None]:
    """Everything a parser may raise on the hostile data of a file, as one clear line; no warnings.

    Args: content: what is expected, if that is no mesh.
    """
    try:
        with warnings.catch_warnings(action="ignore"):
            yield
    except ObscuranceError:
        raise
    except OSError as reason:
        raise error(path, "file", "a readable file", reason.strerror or reason) from None
    except MemoryError:
        raise error(path, "content", "sizes that fit into memory", "larger ones") from None
    except ModuleNotFoundError as missing:
        name = str(missing.name)
        packages = name if name in ("rasterio", "DracoPy") else "lxml pycollada"
        expected = f"{name}, to read it: `python -m pip install {packages}`"
        raise error(path, "format", expected, f"no {name}") from None
    except Exception as reason:
        begin = {ValueError: "", KeyError: "no "}.get(type(reason), f"{type(reason).__name__}: ")
        message = " ".join(f"{begin}{reason}".split())[:160]
        kind = path.suffix.upper().removeprefix(".")
        raise error(path, "content", content or f"a complete and valid {kind} file", message) from None


def standard_input(format_: str | None) -> tuple[Path, bytes]:
    """The content of standard input, and a name with the ending of `format_`, or of the format by its first bytes.

    Raises: InputError: a terminal, nothing, what would not fit into memory, or first bytes that identify no format.
    """
    if sys.stdin.isatty():
        raise OptionError("mesh", "a mesh piped to standard input", "a terminal")
    content = bytearray()
    try:
        while chunk := sys.stdin.buffer.read(_CHUNK):
            content += chunk
            check_memory(_SOURCE, 2 * len(content), f"to read {len(content):,} bytes and more")
    except OSError as reason:  # it is closed
        raise MeshError(_SOURCE, "content", "a mesh", reason.strerror) from None
    if not content:
        raise MeshError(_SOURCE, "content", "a mesh", "nothing")
    return Path(f"{PIPED}.{format_ or _format_of(content)}"), bytes(content)


def unit_of(path: Path, content: bytes | None = None) -> float:
    """The unit of a mesh file's coordinates in metres; 0: it has none. Args: content: as of `load`.

    Raises: MeshError: the file is missing or malformed.
    """
    unit = format_of(path).unit
    if not isinstance(unit, str):
        return unit
    with parser_errors(path):
        if content is None:
            check_regular(path, "a mesh file", MeshError)
        with path.open("rb") if content is None else io.BytesIO(content) as file:
            found: float = resolve_name(unit)(file)
        if not 0 <= found < np.inf:
            raise MeshError(path, "unit", "a finite one above 0", found)
    return found


def load_faces_or_points(path: Path, target: Path | None = None) -> Asset:
    """A mesh file with its names, or a cloud of points. Args: target: as of `load`. Raises: MeshError: neither."""
    try:
        return load(path, target, names=True)
    except MeshError:
        with suppress(MeshError):
            return load(path, target, names=True, points=True)
        raise


def load_mesh(path: Path) -> Asset:
    """A mesh file with all that is kept, or standard input for "-". Raises: as `load` and `standard_input`."""
    piped, content = standard_input(None) if path == STANDARD else (path, None)
    return load(piped, "described.glb", content)


def _format_of(content: bytes | bytearray) -> str:
    """The format that a file's first bytes identify. Raises: MeshError: none."""
    if ending := sniffed_format(content[:4096]):
        return ending.removeprefix(".")
    if len(content) == _HEAD + _TRIANGLE * int.from_bytes(content[_TRIANGLES], "little"):
        return "stl"
    names = ", ".join(row.name for row in formats().values() if row.begins)
    raise MeshError(_SOURCE, "format", f"one of {names}, or --input-format", "another")
