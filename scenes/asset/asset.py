"""A mesh file's content: primitives, the nodes that place them, and materials; and all of it as one mesh."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Any, NamedTuple, Self

import numpy as np
import numpy.typing as npt

from obscurance.raytrace.errors import MeshError, OptionError, first_names, printable
from obscurance.raytrace.mesh.mesh import Mesh, PerCorner, mesh_of
from obscurance.raytrace.mesh.opacity import Opacity
from obscurance.raytrace.system.atomic import PathName
from obscurance.raytrace.types import Float64s, Int64s

from ..geometry.instances import cofactors
from ..geometry.polygons import Triangulation
from .material import Lookup, Material, opacity_of, places
from .primitive import BAKED, COLOR, NORMAL, RAMP, Array, Column, ColumnSet, Primitive, StoredBake, W

if TYPE_CHECKING:
    from obscurance.ao import Profile
    from obscurance.raytrace.image.texture import Texture

_NO_MATERIAL = Material("default")


class Node(NamedTuple):
    """An object of a file, where its scene places it."""

    name: str
    primitives: tuple[int, ...]  # numbers in `Asset.primitives`
    matrix: Float64s | None = None  # (4, 4), affine, to the world for column vectors; None: the identity
    body: Hashable = None  # what it shares with its copies; None: it has none
    stored: Any = None  # where the file has it

    @property
    def volume(self) -> float:
        """The determinant of the matrix, by which volumes grow; below 0 if it mirrors."""
        return 1.0 if self.matrix is None else float(np.linalg.det(self.matrix[:3, :3]))


class Part(NamedTuple):
    """A primitive as a node places it: `mesh.vertices[part.vertices]`, `mesh.faces[part.faces]`."""

    name: str
    vertices: slice
    faces: slice
    place: int  # number of the node
    node: Node
    number: int  # of the primitive
    primitive: Primitive  # turned over where the node mirrors it

    @property
    def is_flattened(self) -> bool:
        """Whether there is nothing to see: no faces, or a matrix of no volume."""
        return self.faces.start == self.faces.stop or not self.node.volume


class Named(NamedTuple):
    """A unique key of a material or object, and its name, which need not be unique."""

    key: Any
    name: str


class Run(NamedTuple):
    """Triangles of one material in one object."""

    part: int  # number of the part
    faces: Int64s  # (k,) rows of the mesh's faces, ascending
    material: Named  # its key is the number in `Asset.materials`, −1 for none
    object: Named
    body: Hashable  # what the object shares with its copies


class Stored:
    """A file as its format has it, which the format's own writer gives back but for what is new."""

    is_scene = False  # whether it has nodes, and materials of its own kind, which others cannot hold
    record = ""  # of the bake whose w it holds (`scenes.bake.record`)

    @property
    def files(self) -> tuple[Path, ...]:
        """The files besides itself that it names."""
        return ()

    def reversed(self) -> Self:
        """The file of faces that are turned over."""
        return self


@dataclass(frozen=True, eq=False)
class Asset:
    """A mesh file's content. The vertices of each object are the file's, in its order: none merged, split or dropped.

    Attributes:
        path: where it was read.
        primitives: polygons, each once. nodes: the objects that place them. materials: of polygons.
        names: of objects within primitives.
        up: the axis that is up, if the file or its format defines it.
        warnings: in words, more once what is read late was looked at.
        unread: what the file holds and nobody reads, in words.
        pictures: files beside it that were read, or will be when it is written.
        raw: the file as stored, of formats whose writers give it back.
        cloud: points and normals (k, 3) of a file of points, of which the mesh has discs.
        to_system: (4, 4), of a raster, from the mesh to coordinates of its reference system; or None: they are these.
        has_alpha: whether materials may let light through.
    """

    path: Path
    primitives: tuple[Primitive, ...]
    nodes: tuple[Node, ...]
    materials: Sequence[Material] = ()
    names: tuple[str, ...] = ()
    up: str | None = None
    warnings: dict[str, None] = field(default_factory=dict)
    unread: tuple[str, ...] = ()
    pictures: tuple[Path, ...] = ()
    raw: Stored | None = None
    cloud: tuple[Float64s, Float64s] | None = None
    to_system: Float64s | None = None
    has_alpha: bool = False

    def __repr__(self) -> str:
        return f"<Asset {str(self.path)!r}: {self.mesh!r}, objects: {first_names(self.objects, 3)}>"

    @classmethod
    def of(cls, mesh: Mesh | Any) -> Self:
        """A mesh made in memory, in any form that `ao.bake` takes, as if read from a file of its one object."""
        mesh = mesh_of(mesh, "mesh")
        only = Primitive.of(mesh.vertices, mesh.faces.ravel())
        return cls(Path(mesh.source), (only,), (Node(mesh.source, (0,)),), up=mesh.up).with_mesh(mesh)

    @classmethod
    def single(cls, path: Path, name: str, primitive: Primitive, notes: Iterable[str] = (), **more: Any) -> Self:
        """The content of a file of one object."""
        return cls.several(path, (name,), (primitive,), notes, **more)

    @classmethod
    def several(
        cls, path: Path, names: Iterable[str], primitives: Iterable[Primitive], notes: Iterable[str] = (), **more: Any
    ) -> Self:
        """The content of a file of an object for each primitive, as it stands."""
        nodes = tuple(Node(name, (number,)) for number, name in enumerate(names))
        return cls(path, tuple(primitives), nodes, warnings=dict.fromkeys(notes), **more)

    @cached_property
    def parts(self) -> tuple[Part, ...]:
        """The primitives of all nodes, consecutive in the mesh."""
        parts: list[Part] = []
        vertex = face = 0
        turned: dict[int, Primitive] = {}
        for place, node in enumerate(self.nodes):
            for number in node.primitives:
                primitive = self.primitives[number]
                if node.volume < 0:
                    primitive = turned.get(number) or turned.setdefault(number, primitive.reversed())
                vertices = slice(vertex, vertex + len(primitive.positions))
                faces = slice(face, face + int(primitive.triangles.counts.sum()))
                parts.append(Part(node.name + primitive.name, vertices, faces, place, node, number, primitive))
                vertex, face = vertices.stop, faces.stop
        return tuple(parts)

    @cached_property
    def mesh(self) -> Mesh:
        """All parts in world space. Raises: MeshError: as `Mesh`."""
        source = str(self.path)
        only = self.parts[0]
        facts: dict[str, Any] = {"source": source, "up": self.up, "polygons": self.triangles.polygons}
        vertices, faces = only.primitive.positions, only.primitive.faces
        if len(self.parts) > 1 or only.node.matrix is not None:
            vertices = np.empty((self.parts[-1].vertices.stop, 3))
            faces = np.empty((self.parts[-1].faces.stop, 3), np.int64)
            for part in self.parts:
                matrix = np.eye(4) if part.node.matrix is None else part.node.matrix
                vertices[part.vertices] = part.primitive.positions @ matrix[:3, :3].T + matrix[:3, 3]
                # Indices are checked against the part's own vertices: shifted ones could fall into a neighbour's range.
                checked = Mesh(vertices[part.vertices], part.primitive.faces, source=f"{source}: {part.name}").faces
                faces[part.faces] = checked + part.vertices.start
        if of_corners := self.corner_normals:
            facts["corner_normals"] = of_corners._replace(of=self.triangles.take(of_corners.of))
        elif any(self._normals):
            gaps = [np.broadcast_to(np.nan, part.primitive.positions.shape) for part in self.parts]
            each = [column.values if column else gap for column, gap in zip(self._normals, gaps, strict=True)]
            facts["normals"] = each[0] if len(each) == 1 else np.concatenate(each)
        mesh = Mesh(vertices, faces, **facts)
        opacity = self._opacity() if self.has_alpha else None
        return replace(mesh, opacity=opacity) if opacity else mesh

    @cached_property
    def _normals(self) -> list[Column | None]:
        """Normals of each part in the world."""
        placed: list[Column | None] = []
        for part in self.parts:
            # Those of the primitive as it is stored, whose signs go by the matrix.
            column = self.primitives[part.number].columns.get(NORMAL)
            if column and part.node.matrix is not None:
                turned = column.values @ cofactors(part.node.matrix[:3, :3]).T * (-1 if part.node.volume < 0 else 1)
                column = part.primitive.columns[NORMAL]._replace(values=turned)
            placed.append(column)
        return placed

    @cached_property
    def corner_normals(self) -> PerCorner | None:
        """Normals by the corners of polygons (c,) where some vertex may have several, or None."""
        if all(column is None or column.of is None for column in self._normals):
            return None
        return self._joined(self._normals)

    @cached_property
    def corners(self) -> Int64s:
        """The vertices (c,) of all polygons, polygon after polygon."""
        shifted = [np.asarray(part.primitive.corners, np.int64) + part.vertices.start for part in self.parts[1:]]
        first = np.asarray(self.parts[0].primitive.corners, np.int64)
        return np.concatenate([first, *shifted]) if shifted else first

    @cached_property
    def sizes(self) -> Int64s:
        """The corners (p,) of each polygon."""
        sizes = [np.asarray(part.primitive.sizes, np.int64) for part in self.parts]
        return np.concatenate(sizes) if len(sizes) > 1 else sizes[0]

    @cached_property
    def triangles(self) -> Triangulation:
        """How all polygons are cut into the faces of the mesh."""
        each = [part.primitive.triangles for part in self.parts]
        if len(each) == 1:
            return each[0]
        counts = np.concatenate([cut.counts for cut in each])
        if all(cut.places is None for cut in each):
            return Triangulation(counts, 0, None)
        lengths = [len(part.primitive.corners) for part in self.parts]
        starts = np.cumsum([0, *lengths[:-1]])
        places = [cut.take(np.arange(n)) + at for cut, n, at in zip(each, lengths, starts, strict=True)]
        return Triangulation(counts, sum(cut.crossing for cut in each), np.concatenate(places))

    # Columns of all parts.

    def columns(self, name: str) -> list[Column | None] | None:
        """A column of each part; None if no part has it."""
        columns = [part.primitive.columns.get(name) for part in self.parts]
        return columns if any(columns) else None

    def at_vertices(self, name: str) -> Float64s | None:
        """Numbers (n,) of all vertices; None if a part lacks them."""
        columns = self.columns(name)
        if columns is None or None in columns:
            return None
        with np.errstate(invalid="ignore"):  # signalling NaNs, which are no numbers
            return np.concatenate([column.values.astype(np.float64) for column in columns if column])

    def of_polygons(self, name: str, missing: npt.ArrayLike = np.nan) -> PerCorner | None:
        """A column by the corners of polygons (c,), `missing` of parts that lack it; None if all do."""
        columns = self.columns(name)
        return None if columns is None else self._joined(columns, missing)

    def per_corner(self, name: str) -> PerCorner | None:
        """A column by the corners of the mesh's faces (3 m,), NaN of parts that lack it; None if all do."""
        joined = self.of_polygons(name)
        return joined and joined._replace(of=self.triangles.take(joined.of).ravel())

    def _joined(self, columns: Sequence[Column | None], missing: npt.ArrayLike = np.nan) -> PerCorner:
        """Columns of the parts by the corners of polygons (c,), `missing` of parts without."""
        width = next(column.values.shape[1] for column in columns if column)
        values: list[Float64s] = []
        of: list[Int64s] = []
        start = 0
        for part, column in zip(self.parts, columns, strict=True):
            rows = part.primitive.corners if column is None or column.of is None else column.of
            own = np.broadcast_to(missing, (1, width)) if column is None else column.values
            of.append(np.asarray(0 * rows if column is None else rows, np.int64) + start)
            values.append(own.astype(np.float64, copy=False))
            start += len(own)
        return PerCorner(values[0], of[0]) if len(of) == 1 else PerCorner(np.concatenate(values), np.concatenate(of))

    @property
    def uv(self) -> Float64s | None:
        """The first set of `texture_coordinates`."""
        return self.texture_coordinates()

    def texture_coordinates(self, number: int = 0) -> Float64s | None:
        """By face and corner (m, 3, 2), v upwards, NaN of faces without; None if there are none.

        Args: number: of the set, of which a file may have several.

        Raises: MeshError: the set is malformed.
        """
        uv = self.per_corner(f"uv{number}")
        if uv is None:
            return None
        corners = uv.values[uv.of.reshape(-1, 3)]
        return np.where(np.isnan(corners).any(axis=(1, 2), keepdims=True), np.nan, corners)

    def colours(self, srgb: bool = False, grey: bool = False) -> Float64s | None:
        """Red, green, blue and maybe alpha (n, 3 or 4) of the vertices, 1 where a part has none; None if none has.

        Args: srgb: encoded, not linear. grey: also where they are the grey that a bake has left.
        """
        columns = [part.primitive.columns.get(COLOR) if grey else part.primitive.own_colours for part in self.parts]
        if not any(columns):
            return None
        joined = np.ones((self.parts[-1].vertices.stop, max(column.values.shape[1] for column in columns if column)))
        for part, column in zip(self.parts, columns, strict=True):
            if column:
                joined[part.vertices, : column.values.shape[1]] = column.colours(srgb)
        return joined

    @property
    def numbers(self) -> dict[str, Array]:
        """Further values (n,) of the vertices by name, of a file of one part."""
        if len(self.parts) > 1:
            return {}
        columns = self.parts[0].primitive.columns
        others = [name for name in columns if not name.startswith(("uv", RAMP, W)) and name not in (NORMAL, COLOR)]
        return {name: columns[name].values for name in others if columns[name].values.ndim == 1}

    @property
    def w(self) -> Float64s | None:
        """(n,) obscurance that a bake has left in the file, unchecked, or None."""
        return self.at_vertices(W)

    @property
    def baked(self) -> StoredBake | None:
        """All that a bake has left in the file, unchecked, or None without w."""
        if self.w is None:
            return None
        columns: dict[str, Any] = {name: self.at_vertices(column) for name, column in BAKED.items()}
        return StoredBake(**columns, profile=self.profile)

    @cached_property
    def profile(self) -> Profile | None:
        """The profile that a bake has left in the file; None where an object has none, or another's half-distances."""
        profiles = [part.primitive.profile for part in self.parts if part.primitive.profile]
        if len(profiles) < len(self.parts):
            return None
        from obscurance.ao import Profile

        return Profile.joined(profiles)

    @property
    def objects(self) -> tuple[str, ...]:
        """Names of the objects."""
        names: list[str] = []
        for part in self.parts:
            of = part.primitive.object
            numbers = [-1] if of is None else np.unique(of).tolist()
            names += [(*self.names, "")[number] or part.name for number in numbers]
        return tuple(names)

    def runs(self) -> Iterator[Run]:
        """The faces part by part, object by object, materials ascending: primitives of a .glb list them so."""
        for number, part in enumerate(self.parts):
            primitive = part.primitive
            kinds = np.stack([primitive.of_faces(primitive.object), primitive.of_faces(primitive.material)], axis=1)
            order = np.lexsort((kinds[:, 1], kinds[:, 0]))
            begins = np.flatnonzero((kinds[order][1:] != kinds[order][:-1]).any(axis=1)) + 1
            for rows in np.split(order, begins):
                within, material = kinds[rows[0]].tolist() if len(rows) else (-1, -1)
                name = (*self.names, "")[within] or part.node.name
                key = part.place if part.node.stored is None else part.node.stored, name
                body = key if part.node.body is None else part.node.body
                exists = material < len(self.materials)
                of_material = Named(material, self.material(material).name if exists else f"material {material}")
                yield Run(number, rows + part.faces.start, of_material, Named(key, name), body)

    @property
    def objects_of_faces(self) -> tuple[Int64s, list[str]]:
        """The number (m,) of the object of each face, and the objects' names."""
        numbers: dict[Named, int] = {}
        of = np.zeros(len(self.mesh.faces), np.int64)
        for run in self.runs():
            of[run.faces] = numbers.setdefault(run.object, len(numbers))
        return of, [named.name for named in numbers]

    def material(self, number: int) -> Material:
        """A material by its number, a white one for −1. Raises: MeshError: there is none of this number."""
        if number >= len(self.materials):
            raise MeshError(self.path, f"materials[{number}]", f"a number below {len(self.materials)}", number)
        return self.materials[number] if number >= 0 else _NO_MATERIAL

    def looked_up(self, primitive: Primitive, lookup: Lookup | None) -> tuple[Column, Texture] | None:
        """Where a lookup reads, v upwards, and its texture; None without either. A picture of colours that cannot be
        had goes to `warnings`."""
        where = places(primitive, lookup)
        if lookup is None or where is None:
            return None
        if lookup.fault:
            self.warnings[lookup.words] = None
            return None
        return None if lookup.texture is None else (where, lookup.texture)

    def _opacity(self) -> Opacity | None:
        """Alpha of all faces; None where all are opaque."""
        made: dict[int, Opacity | None] = {}
        for part in self.parts:
            if part.number not in made:
                made[part.number] = opacity_of(self.primitives[part.number], self.materials, self.warnings)
        each = [(made[part.number], part) for part in self.parts]
        placed = [one.reversed() if one and part.node.volume < 0 else one for one, part in each]
        return Opacity.joined(placed, [part.faces.stop - part.faces.start for part in self.parts])

    def with_mesh(self, mesh: Mesh) -> Self:
        """The asset with another mesh of the same faces in place of its own."""
        changed = replace(self)
        vars(changed)["mesh"] = mesh
        return changed

    def reversed(self) -> Self:
        """The asset with all faces turned over, and normals with them."""
        turned = tuple(primitive.reversed() for primitive in self.primitives)
        changed = replace(self, primitives=turned, raw=self.raw and self.raw.reversed())
        return changed.with_mesh(self.mesh.reversed())

    def bare(self) -> Self:
        """The asset with its mesh and an earlier bake alone, as one primitive, which frees the memory of all else."""
        left = {name: self.at_vertices(name) for name in BAKED.values()}
        columns = ColumnSet({name: Column(values) for name, values in left.items() if values is not None})
        mesh = self.mesh
        only = Primitive.of(mesh.vertices, mesh.faces.ravel(), columns=columns, profile=self.profile)
        node = Node(self.nodes[0].name, (0,))
        changed = replace(self, primitives=(only,), nodes=(node,), materials=(), raw=None, pictures=self.files[1:])
        return changed.with_mesh(mesh)

    @property
    def is_scene(self) -> bool:
        """Whether the file is a glTF, which a .glb keeps as it is stored."""
        return self.raw is not None and self.raw.is_scene

    def save(self, path: PathName, bake: Any = None, **options: Any) -> None:
        """Write the mesh with w of a bake of it, or with that of the file. Args: options: of `scenes.write`.

        Raises: OptionError: the file has no w. Others as `scenes.write`.
        """
        write: Callable[..., None] = resolve_name("obscurance.scenes.formats.write:write")
        write(path, bake or self, self, **options)

    @property
    def files(self) -> tuple[Path, ...]:
        """Every file that was read, or will be when the mesh is written."""
        return self.path, *(self.raw.files if self.raw else ()), *self.pictures

    def in_frame_of(self, other: Asset) -> Self:
        """The file with its mesh where it lies among the coordinates of another: of a raster, or of its system."""
        if self.to_system is None and other.to_system is None:
            return self
        one, to = (np.eye(4) if asset.to_system is None else asset.to_system for asset in (self, other))
        matrix = np.linalg.solve(to, one)
        vertices = self.mesh.vertices @ matrix[:3, :3].T + matrix[:3, 3]
        return self.with_mesh(replace(self.mesh, vertices=vertices))

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
    def notes(self) -> tuple[str, ...]:
        """Warnings about the file's content, lines that name it."""
        return tuple(printable(f"{self.path}: {words}") for words in self.warnings)
