"""The `[[materials]]` and `[[objects]]` of a TOML scene."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from obscurance.raytrace import PRESETS, AlphaSurface, Material, Object, Opacity, Shape, Texture, material_from_dict
from obscurance.raytrace.errors import SceneError, nearest_name
from obscurance.raytrace.system.records import fields_of

from ..formats.table import format_of
from ..geometry.builtin_shapes import SOLIDS
from ..geometry.instances import check_copies
from ..geometry.primitives import Origin, TexturedMesh
from ..json_toml import check_keys, check_name, joined, located, shown
from ..safe_paths import confined
from .description import NEUTRAL, WHITE
from .mesh_scene import Placed, placed, read_mesh, read_source
from .schema import ObjectTable, Transform

MAX_BUILT = 1_500_000  # triangles: 1 GiB for a picture
MAX_OBJECTS = 100_000  # 10 s for a picture


def named_materials(tables: Sequence[dict[str, Any]], source: object) -> dict[str, Material]:
    """Materials by name: the presets, then `[[materials]]`. Raises: SceneError."""
    materials = {name: material_from_dict({"preset": name}) for name in PRESETS}
    names: set[str] = set()
    for number, table in enumerate(tables):
        path = f"materials[{number}]"
        name = table.get("name")
        if not isinstance(name, str) or not name or not name.isprintable():
            got = shown(name) if "name" in table else "nothing"
            raise SceneError(source, f"{path}.name", "a name on one line", got)
        if name in names:
            raise SceneError(source, f"{path}.name", "a name of its own", f"{shown(name)} again")
        names.add(name)
        with located(source, path):
            materials[name] = material_from_dict({key: value for key, value in table.items() if key != "name"})
    return materials


class ObjectReader:
    """Makes objects; what is the same in several of them, in mesh, material and texture, becomes one shape.

    Attributes: origins: by the identities of shapes, of vertices that are not their file's one by one.
    """

    def __init__(self, source: Path, materials: dict[str, Material]) -> None:
        self._source = source
        self._materials = materials
        self._geometry: dict[Any, TexturedMesh] = {}
        self._gltf: dict[Path, list[Placed]] = {}
        self._shapes: dict[Any, Shape] = {}
        self._stored: dict[int, int] = {}
        self.files: list[Path] = []
        self.notes: list[str] = []
        self.origins: dict[int, Origin] = {}
        self._placed = self._objects = 0
        self._built = 0.0

    def read(self, table: ObjectTable, path: str) -> list[Object]:
        """The objects of the entry at `path`: one for each copy, or more for a glTF file. Raises: SceneError."""
        repeated = joined(path, "mesh" if table.mesh else "fineness") if table.copies is None else f"{path}.copies"
        pieces = self._pieces(table, path, repeated)
        self._check_copies(pieces, table, repeated)
        own_matrix = table.affine(self._source, path)
        affine = [copy.affine(self._source, f"{path}.copies[{n}]") for n, copy in enumerate(table.copies or ())]
        copies = [(f" {number}", matrix @ own_matrix) for number, matrix in enumerate(affine)] or [("", own_matrix)]
        with located(self._source, path):
            return [
                replace(piece, transform=matrix @ piece.transform, name=piece.name + suffix)
                for suffix, matrix in copies
                for piece in pieces
            ]

    def _check_copies(self, pieces: list[Object], table: ObjectTable, field: str) -> None:
        """Count objects, vertices and triangles, of mesh files once and of all copies."""
        copies = len(table.copies or [table])
        self._objects += copies * len(pieces)
        if self._objects > MAX_OBJECTS:
            expected = f"at most {MAX_OBJECTS:,} objects with all copies"
            raise SceneError(self._source, field, expected, f"{self._objects:,}")
        sizes = {id(item.shape.mesh): len(item.shape.mesh.vertices) + len(item.shape.mesh.faces) for item in pieces}
        if table.mesh is not None:
            self._stored |= sizes
        self._placed += copies * sum(sizes[id(item.shape.mesh)] for item in pieces)
        check_copies(self._placed, sum(self._stored.values()), self._source, SceneError, field)

    def _pieces(self, table: ObjectTable, path: str, repeated: str) -> list[Object]:
        """The entry's objects before its own transform."""
        if (table.mesh is None) == (table.builtin is None):
            got = "neither" if table.mesh is None else "both"
            unknown = (nearest_name(key, ("mesh", "builtin")) for key in table.extra)
            raise SceneError(self._source, path, "either mesh or builtin", got, next(filter(None, unknown), None))
        # The material: a named one, or one of the entry's own.
        material = table.material
        field = joined(path, "material")
        if isinstance(material, str):
            material = self._materials[check_name(self._source, field, material, sorted(self._materials))]
        elif material is not None:
            with located(self._source, field):
                material = material_from_dict(material)
        if table.wrap is not None and not table.textured:
            raise SceneError(self._source, joined(path, "wrap"), "texture, grain or opacity_texture with it", "none")
        if table.cutoff is not None and table.opacity is None and table.opacity_texture is None:
            raise SceneError(self._source, joined(path, "cutoff"), "opacity or opacity_texture with it", "none")
        texture = self._texture(table, path, "texture")
        if table.builtin is not None:
            geometry = self._built_in(table, path, repeated)
            return [Object(self._shape(table, path, geometry, material, texture), name=table.name or table.builtin)]

        # A mesh file: a glTF brings its own materials, of others each is read once.
        check_keys(self._source, path, table.extra, _keys("mesh"))
        field = joined(path, "mesh")
        mesh = confined(table.mesh or "", self._source.parent, self._source, field)
        self.files.append(mesh)
        with located(self._source, field):
            if "scene" in format_of(mesh).holds:
                return self._gltf_pieces(mesh, table, path, material, texture)
            key = mesh, table.textured, table.own_normals
            if key not in self._geometry:
                self._geometry[key], notes = read_mesh(*key)
                self.notes += notes
            geometry = self._geometry[key]
        return [Object(self._shape(table, path, geometry, material, texture), name=table.name or mesh.stem)]

    def _built_in(self, table: ObjectTable, path: str, field: str) -> TexturedMesh:
        """A built-in shape; triangles, with all copies, are counted before they are made."""
        kind = SOLIDS[check_name(self._source, joined(path, "builtin"), table.builtin or "", SOLIDS)]
        check_keys(self._source, path, table.extra, [*fields_of(kind), *_keys("builtin")])
        with located(self._source, path):
            solid = kind(**table.extra)
            self._built += solid.triangles() * len(table.copies or [table])
            if not self._built <= MAX_BUILT:
                expected = f"at most {MAX_BUILT:,} triangles of built-in shapes with all copies"
                raise SceneError(self._source, field, expected, f"about {self._built:,.0f}")
            return self._cached(solid, solid.geometry)

    def _gltf_pieces(
        self, mesh: Path, table: ObjectTable, path: str, material: Material | None, texture: Texture | None
    ) -> list[Object]:
        """The objects of a glTF file, with the entry's material or texture in place of the file's."""
        if mesh not in self._gltf:
            source = read_source(mesh)
            self._gltf[mesh] = list(placed(source))
            self.notes += source.notes
            self.files.extend(source.files)
        pieces = []
        for item, origin in self._gltf[mesh]:
            shape = item.shape
            geometry = self._cached(
                shape, lambda shape=shape, origin=origin: TexturedMesh(shape.mesh, shape.uv, origin, shape.colours)
            )
            # A material of the entry's own takes the place of the file's with its texture.
            used_texture = texture or (shape.texture if material is None else None)
            new_shape = self._shape(table, path, geometry, material or shape.material, used_texture)
            name = item.name if table.name is None else f"{table.name} {item.name}"
            pieces.append(replace(item, shape=new_shape, name=name))
        return pieces

    def _cached(self, key: Any, make: Any) -> TexturedMesh:
        """What `make` returns, made once for each key."""
        if key not in self._geometry:
            self._geometry[key] = make()
        return self._geometry[key]

    def _shape(
        self, table: ObjectTable, path: str, geometry: TexturedMesh, material: Material | None, texture: Texture | None
    ) -> Shape:
        """The shape of a mesh with the entry's material, textures and alpha. Raises: SceneError."""
        # Images and alpha of the entry.
        grain = self._texture(table, path, "grain")
        image = self._texture(table, path, "opacity_texture")
        alpha = None
        if image is not None or table.opacity is not None:
            opacity = 1.0 if table.opacity is None else table.opacity
            alpha = AlphaSurface(opacity, image, grey=True, cutoff=table.cutoff)
        for field, used in (("texture", texture), ("grain", grain), ("opacity_texture", image)):
            if used is not None and geometry.uv is None:
                raise SceneError(self._source, joined(path, field), "a mesh with texture coordinates", "one without")
        # A material of the entry's own takes the place of a mesh's colours, unless it says so.
        wants_colours = table.material is None if table.vertex_colors is None else table.vertex_colors
        colours = geometry.colours if wants_colours else None
        if table.vertex_colors and colours is None:
            field = joined(path, "vertex_colors")
            raise SceneError(self._source, field, "a mesh with colours of vertices", "one without")
        material = material or (NEUTRAL if colours is None else WHITE)
        # A shape that the same entry has made before, or a new one.
        key = (geometry, material, texture, grain, table.own_normals, colours is None, alpha, table.material is None)
        if key not in self._shapes:
            mesh = geometry.mesh if table.own_normals else replace(geometry.mesh, normals=None)
            if alpha or (mesh.opacity and table.material):  # which take the place of the file's own alpha
                mesh = replace(mesh, opacity=Opacity.uniform(alpha, mesh.faces, geometry.uv) if alpha else None)
            with located(self._source, path):
                self._shapes[key] = Shape(mesh, material, geometry.uv, texture, grain=grain, colours=colours)
            if geometry.origin:
                self.origins[id(self._shapes[key])] = geometry.origin
        return self._shapes[key]

    def _texture(self, table: ObjectTable, path: str, field: str) -> Texture | None:
        """The image that a field of the entry names, None if it names none. Raises: SceneError."""
        name = getattr(table, field)
        if name is None:
            return None
        file = confined(name, self._source.parent, self._source, joined(path, field))
        self.files.append(file)
        return Texture(file, srgb=field == "texture", wrap=table.wrap or ("repeat", "repeat"))


def _keys(kind: str) -> list[str]:
    """The keys that an entry may have: all, but of "mesh" and "builtin" only `kind`."""
    keys = [*(key for key in fields_of(ObjectTable) if key not in fields_of(Transform)), *fields_of(Transform)]
    return [key for key in keys if key == kind or key not in ("mesh", "builtin")]
