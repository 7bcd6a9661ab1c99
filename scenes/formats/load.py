"""Any mesh file: by own readers, more by libraries; vertices exactly as stored."""

from __future__ import annotations

import io
import os
import sys
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Any, NamedTuple, Self

import numpy as np

from obscurance.raytrace.errors import InputError, MeshError, ObscuranceError, OptionError, first_names, printable
from obscurance.raytrace.mesh.mesh import Mesh, mesh_of
from obscurance.raytrace.mesh.normals import useless_normals
from obscurance.raytrace.system.checks import check_memory, check_regular
from obscurance.raytrace.types import Float64s

from ..geometry.attributes import FLOAT, SourceAttributes, reversed_attributes, triangle_attributes
from ..geometry.instances import Instance, Submesh, flatten, joined_attributes
from .table import MeshInput, format_of, formats, sniffed_format

if TYPE_CHECKING:
    from obscurance.ao import Profile

    from .gltf.asset import Gltf

_CONVERTERS = dict.fromkeys((".abc", ".blend", ".fbx", ".usd", ".usda", ".usdc", ".usdz"), "Blender") | dict.fromkeys(
    (".iges", ".igs", ".step", ".stp"), "FreeCAD"
)
"""Programs that know formats which nobody reads here."""
_KEPT = 2.5  # bytes of memory a byte of file where attributes are kept, besides the table's
PIPED = "<stdin>"  # in place of a file's name without its ending
STANDARD, _SOURCE = Path("-"), "standard input"
_CHUNK = 1 << 26
_TRIANGLES, _TRIANGLE, _HEAD = slice(80, 84), 50, 84  # of a binary STL


class MeshFile(NamedTuple):
    """A mesh file's content.

    Attributes:
        path: where it was read.
        mesh: all objects in world space, repeated nodes repeated. The vertices of each object are the file's, in its
            order: none merged, split, dropped or added.
        parts: the objects, consecutive in `mesh`.
        gltf: the asset as stored, when the file is glTF or GLB.
        attributes: what else the file holds that the target can hold too, if one was named.
        notes: warnings about the objects.
        unread: what the file holds and the mesh lacks, in words, if a target was named.
        w: (n,) obscurance that a bake has left in the file, unchecked, or None. profile: of it, or None.
        cloud: points and normals (k, 3) of a file of points, of which `mesh` has the discs; or None.
        to_system: (4, 4), of a raster, from the mesh to coordinates of its reference system; or None: they are these.
    """

    path: Path
    mesh: Mesh
    parts: tuple[Submesh, ...]
    gltf: Gltf | None = None
    attributes: SourceAttributes | None = None
    notes: tuple[str, ...] = ()
    unread: tuple[str, ...] = ()
    w: Float64s | None = None
    profile: Profile | None = None
    cloud: tuple[Float64s, Float64s] | None = None
    to_system: Float64s | None = None

    def __repr__(self) -> str:
        return f"<MeshFile {str(self.path)!r}: {self.mesh!r}, objects: {first_names(self.objects, 3)}>"

    @property
    def files(self) -> tuple[Path, ...]:
        """Every file that was read, or will be when the mesh is written."""
        named = self.gltf.files if self.gltf else (self.path,)
        return named + self.held.files

    @property
    def objects(self) -> tuple[str, ...]:
        """Names of the objects: of an OBJ file, loaded for a target, or else of the parts."""
        held = self.held
        if held.object_of is None:
            return tuple(part.name for part in self.parts)
        names = (*held.objects, "")
        return tuple(names[number] or self.parts[0].name for number in np.unique(held.object_of))

    def in_frame_of(self, other: MeshFile) -> Self:
        """The file with its mesh where it lies among the coordinates of another: of a raster, or of its system."""
        if self.to_system is None and other.to_system is None:
            return self
        one, to = (np.eye(4) if file.to_system is None else file.to_system for file in (self, other))
        matrix = np.linalg.solve(to, one)
        vertices = self.mesh.vertices @ matrix[:3, :3].T + matrix[:3, 3]
        return self._replace(mesh=replace(self.mesh, vertices=vertices))

    @property
    def split(self) -> Mesh:
        """The mesh with a vertex for each normal that corners of one have, the mesh's own first, in their order.

        A bake of it in place of `mesh` has w of each side of hard edges, for outputs that can hold it.
        """
        from obscurance.raytrace.mesh.corners import with_hard_edges

        return with_hard_edges(self.mesh)

    def baked_mesh(self, count: int) -> Mesh:
        """The mesh of a bake of `count` vertices, `mesh` or `split`. Raises: OptionError: neither."""
        mesh = self.mesh if count == len(self.mesh.vertices) else self.split
        if count != len(mesh.vertices):
            raise OptionError("bake", f"w of the {len(self.mesh.vertices):,} vertices of {self.path}", f"{count:,}")
        return mesh

    @property
    def held(self) -> SourceAttributes:
        """The file's `attributes`, or where it has none those of the bare triangles."""
        return self.attributes or triangle_attributes(self.mesh.faces)

    @property
    def uv(self) -> Float64s | None:
        """The first set of `texture_coordinates`."""
        return self.texture_coordinates()

    def texture_coordinates(self, number: int = 0) -> Float64s | None:
        """By face and corner (m, 3, 2), v upwards, NaN of faces without; None if there are none.

        Args: number: of the set, of which a glTF may have several.

        Raises: MeshError: a set of a glTF is malformed.
        """
        if self.gltf:
            from .gltf.textures import texture_coordinates

            return texture_coordinates(self.gltf, self.parts, self.mesh.faces, number)
        attributes = self.attributes
        if attributes is None and "uv" in format_of(self.path).holds and self.path.is_file():
            attributes = joined_attributes(read_objects(self.path, keep=True)[0])  # loaded for no target
        uv = attributes.corner_uv() if attributes and not number else None
        return uv if uv is not None and len(uv) == len(self.mesh.faces) else None

    @classmethod
    def of(cls, mesh: Mesh | Any) -> MeshFile:
        """A mesh made in memory, in any form that `ao.bake` takes, as if read from a file of its one object."""
        mesh = mesh_of(mesh, "mesh")
        whole = Submesh(mesh.source, slice(0, len(mesh.vertices)), slice(0, len(mesh.faces)))
        return cls(Path(mesh.source), mesh, (whole,))


def load(
    path: str | os.PathLike[str],
    target: str | os.PathLike[str] | None = None,
    content: bytes | None = None,
    alpha: bool = True,
    up: str | None = None,
    names: bool = False,
    flip: bool = False,
    points: bool = False,
) -> MeshFile:
    """Read a mesh file in the format of its ending.

    Polygons are cut into triangles. Point clouds, lines and cameras beside meshes are left out. A file's own
    normals fill `mesh.normals` (PLY `nx ny nz`, OBJ `vn`, glTF `NORMAL`), or `mesh.corner_normals` where a
    vertex has several. Materials,
    textures and the like are read for a target only, but for the alpha of faces (`mesh.opacity`). Files that a file
    refers to are read only from its own folder or below.

    Args:
        target: the file that `scenes.write` is to make of it: what that can hold besides is read too.
        content: the file's bytes, if they came from elsewhere; `path` then only names it and its format.
        alpha: whether faces have the alpha of their glTF or OBJ materials; otherwise they are opaque.
        up: `mesh.up` in place of what the file says.
        names: read those of an OBJ's objects whatever the target, with all that is kept beside them.
        points: whether it is a cloud of points with normals, and no faces: the mesh is of a disc for each.
        flip: turn all faces over, and normals with them; what is written has them turned.

    Raises:
        MeshError: the file is missing, unreadable, empty, incomplete, of another format than its ending says,
            without triangles, or has indices out of range or coordinates that are not finite.
        MemoryLimitError: it would not fit into memory.
    """
    path = Path(path)
    aim = format_of(target or "")
    keep = names or "source" in aim.holds or aim.ending == ".html"
    instances, asset = read_objects(path, keep, content, alpha, points)
    cloud = None
    if points:
        instances, cloud = _cloud(instances, path)
    instances = [instance._replace(up=up or instance.up) for instance in instances]
    with parser_errors(path):
        mesh, parts = flatten(instances, str(path))
        attributes = joined_attributes(instances)
        if attributes and attributes.uv and (np.abs(attributes.uv.values) > FLOAT).any():
            raise MeshError(path, "texture coordinates", f"numbers to {FLOAT:g}, for float32", "larger ones")
        unread = tuple(dict.fromkeys(words for instance in instances for words in instance.unread))
        if asset and "source" in aim.holds:
            _ = asset.materials  # to find what is malformed
            if "scene" not in aim.holds:
                from .gltf.textures import gltf_attributes

                attributes, unread = gltf_attributes(asset, parts, mesh.faces)
    notes = tuple(printable(f"{path}: {note}") for instance in instances for note in instance.notes)
    with np.errstate(invalid="ignore"):  # signalling NaNs, which are no w
        stored = [np.asarray(instance.w, np.float64) for instance in instances if instance.w is not None]
    if useless := useless_normals(mesh):
        of = f"{useless:,} of {mesh.faces.size:,} normals at corners are missing, zero, not finite or behind their face"
        notes += (printable(f"{path}: {of}; those of the faces take their place"),)
    w = np.concatenate(stored) if len(stored) == len(instances) else None
    if flip:
        if asset and aim.ending == ".glb":
            raise OptionError("flip", "another mesh file than a glTF for a .glb, which keeps its faces", path)
        mesh = mesh.reversed()
        attributes = attributes and reversed_attributes(attributes)
    profile, to_system = joined_profile(instances), instances[0].to_system
    return MeshFile(path, mesh, parts, asset, attributes, notes, unread, w, profile, cloud, to_system)


def _cloud(instances: list[Instance], path: Path) -> tuple[list[Instance], tuple[Float64s, Float64s]]:
    """Discs in place of the points, and the points and normals (k, 3) themselves. Raises: MeshError."""
    from obscurance.ao.points.discs import discs

    whole = instances[0]
    if len(instances) > 1 or len(whole.faces) or whole.normals is None:
        expected = "one cloud of points with normals, without faces"
        got = "faces" if len(whole.faces) else "points without normals" if whole.normals is None else "several"
        raise MeshError(path, "points", expected, got)
    places = np.asarray(whole.vertices, np.float64)
    normals = np.asarray(whole.normals, np.float64)
    mesh = discs(places, normals, str(path)).mesh
    return [whole._replace(vertices=mesh.vertices, faces=mesh.faces, normals=None)], (places, normals)


def joined_profile(instances: Sequence[Instance]) -> Profile | None:
    """The profile of all objects, None where one has none, or another's half-distances."""
    profiles = [instance.profile for instance in instances if instance.profile]
    if len(profiles) < len(instances):
        return None
    from obscurance.ao import Profile

    return Profile.joined(profiles)


def read_objects(
    path: Path, keep: bool = False, content: bytes | None = None, alpha: bool = False, points: bool = False
) -> tuple[list[Instance], Gltf | None]:
    """The placed objects of a mesh file as it stores them, at least one, and the asset when it is glTF or GLB.

    Of a glTF they are its drawn primitives, in the order of `Gltf.drawn`. Raises: MeshError: as `load`.

    Args: keep: also the `Instance.attributes` of OBJ and PLY. content, alpha, points: as `load` takes them.
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
        check_memory(path, int((row.peak + (_KEPT if keep else 0)) * size), f"to read {size:,} bytes")
        with path.open("rb") if content is None else io.BytesIO(content) as file:
            result = resolve_name(row.read)(MeshInput(file, path, name, keep, alpha, content is None))
        instances, asset = result if isinstance(result, tuple) else (result, None)
        # Every primitive of a glTF keeps its part: the GLB writer counts on it.
        if solid := [instance for instance in instances if asset or len(instance.faces)]:
            return solid, asset
        if points and instances:
            return instances, asset
        count = sum(len(instance.vertices) for instance in instances)
        besides = "no vertices: perhaps it is no OBJ" if row.name == "OBJ" and not count else f"{count} points"
        if any(instance.normals is not None for instance in instances):
            besides += " with normals: bake --points takes those"
        raise MeshError(path, "faces", "at least one triangle", f"none, and {besides}")


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


def load_mesh(path: Path) -> MeshFile:
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
