"""Triangle meshes: checked, immutable arrays in the user's own order and units; meshes of other libraries as such.

Other libraries' meshes are recognised by their attributes, so that no such library is imported.
"""

import os
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from ..errors import MeshError, OptionError
from ..kernel.jit import kernel
from ..sampling import hash64
from ..system.parallel import each
from ..types import AnyInts, Bools, Float64s, Int32Rows, Int32s, Int64s, UInt32Rows, UInt64s
from .opacity import Opacity
from .smallest_ball import smallest_ball

Vector = tuple[float, float, float]

TO_Y_UP: dict[str, tuple[Vector, Vector, Vector]] = {
    "x": ((0.0, 1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, -1.0)),
    "y": ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)),
    "z": ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, -1.0, 0.0)),
    "-x": ((0.0, 1.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
    "-y": ((-1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, 1.0)),
    "-z": ((1.0, 0.0, 0.0), (0.0, 0.0, -1.0), (0.0, 1.0, 0.0)),
}
"""Rows of the rotation that turns each axis to y; of z it is that of −90° about x."""
UP = {name: axes[1] for name, axes in TO_Y_UP.items()}
"""The axes that may be up, by their names."""
LARGEST = 5e153  # squares of coordinates and their differences don't overflow
MOST = 1 << 31  # vertices


class PerCorner(NamedTuple):
    """Values (k, w) of the corners of polygons, and which of them each corner has: `of`, integers, of any shape."""

    values: Float64s
    of: AnyInts

    def at_vertices(self, corners: AnyInts, count: int, elsewhere: float = 0.0) -> Float64s | None:
        """The values by vertex (count, w), `elsewhere` where no corner is; None if some vertex has several."""
        at_corners = self.values[self.of]
        by_vertex = np.full((count, self.values.shape[1]), elsewhere)
        by_vertex[corners] = at_corners
        return by_vertex if np.array_equal(by_vertex[corners], at_corners, equal_nan=True) else None


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles over vertices, in the order and units they came in.

    Attributes:
        vertices: float64 (n, 3), within ±5e153, n ≥ 1. Any length unit.
        faces: int32 (m, 3), m ≥ 1, indices into `vertices`. Degenerate and doubled faces are allowed.
        normals: float64 (n, 3), the source's own vertex normals of any length (zero or NaN: none there), or None.
        corner_normals: in their place, where corners of one vertex have several: a pair of float64 (k, 3), of any
            length, and int64 (m, 3), which of them each corner has; or None.
        source: what to call this mesh in messages, a file name for instance.
        up: "x", "y", "z", "-x", "-y" or "-z", the axis that is up, if the source defines it; None is shown as "y".
        opacity: alpha of the faces, or None: all are opaque.
        polygons: int64 (m,), faces of the same number are the triangles of one polygon, which shading takes as a whole;
            None: each face is a polygon of its own.

    Raises:
        MeshError: an array has a wrong shape or type, is empty, has coordinates that are not finite or too
            large, or indices out of range; `up` is no axis; or `opacity` or `polygons` is of another number of faces.
    """

    vertices: Float64s
    faces: Int32s
    normals: Float64s | None = None
    source: str = field(default="mesh", kw_only=True)
    up: str | None = field(default=None, kw_only=True)
    opacity: Opacity | None = field(default=None, kw_only=True)
    polygons: Int64s | None = field(default=None, kw_only=True)
    corner_normals: PerCorner | None = field(default=None, kw_only=True)

    if TYPE_CHECKING:  # what arrays are made of

        def __init__(
            self,
            vertices: npt.ArrayLike,
            faces: npt.ArrayLike,
            normals: npt.ArrayLike | None = None,
            *,
            source: str = "mesh",
            up: str | None = None,
            opacity: Opacity | None = None,
            polygons: npt.ArrayLike | None = None,
            corner_normals: tuple[npt.ArrayLike, npt.ArrayLike] | None = None,
        ) -> None: ...

    def __post_init__(self) -> None:
        vertices = self._array("vertices", self.vertices, np.float64)
        last = min(len(vertices), MOST) - 1
        self._check_range("vertices", vertices, -LARGEST, LARGEST, f"finite coordinates up to {LARGEST:g}")
        faces = self._array("faces", self.faces)
        self._check_range("faces", faces, 0, last, f"indices from 0 to {last}")
        object.__setattr__(self, "vertices", vertices)
        object.__setattr__(self, "faces", _read_only(faces.astype(np.int32, copy=False)))
        if self.normals is not None:
            normals = self._array("normals", self.normals, np.float64)
            if len(normals) != len(self.vertices):
                raise MeshError(self.source, "normals", f"one per vertex ({len(self.vertices)})", len(normals))
            object.__setattr__(self, "normals", normals)
        if self.corner_normals is not None:
            object.__setattr__(self, "corner_normals", self._corner_normals(*self.corner_normals))
        if self.up is not None and self.up not in UP:
            raise MeshError(self.source, "up", "one of " + ", ".join(UP), repr(self.up))
        if self.opacity is not None:
            got = len(self.opacity.of) if isinstance(self.opacity, Opacity) else repr(self.opacity)
            if got != len(self.faces):
                raise MeshError(self.source, "opacity", f"a raytrace.Opacity of {len(self.faces)} faces", got)
        if self.polygons is not None:
            polygons = np.array(self.polygons)
            if polygons.shape != (len(self.faces),) or polygons.dtype.kind not in "iu":
                kind = f"shape {polygons.shape} of {polygons.dtype}"
                raise MeshError(self.source, "polygons", f"{len(self.faces)} integers, one a face", kind)
            object.__setattr__(self, "polygons", _read_only(polygons.astype(np.int64)))

    def __repr__(self) -> str:
        return f"<Mesh {self.source!r}: {len(self.vertices):,} vertices, {len(self.faces):,} faces>"

    def _check_range(self, name: str, values: npt.NDArray[Any], least: float, most: float, expected: str) -> None:
        """Check that all of an array's values are in [least, most]. Raises: MeshError naming the first bad row."""
        if not (values.min() >= least and values.max() <= most):
            bad = ~((values >= least) & (values <= most)).all(axis=1)
            row = int(np.argmax(bad))
            raise MeshError(self.source, f"{name}[{row}]", expected, f"{values[row]} ({bad.sum()} such)")

    def _array(self, name: str, values: Any, dtype: type[np.float64] | None = None) -> npt.NDArray[Any]:
        """A read-only copy (…, 3) of an attribute's values. Raises: MeshError: another shape or type, or no rows.

        Args: dtype: of the copy; None: they are integers, and stay of their type.
        """
        try:
            array = np.array(values, order="C")  # kernels are compiled for each layout
            if dtype:
                array = array.astype(dtype, copy=False)
            elif array.size and not np.issubdtype(array.dtype, np.integer):
                raise MeshError(self.source, name, "integers", array.dtype)
        except MeshError:
            raise
        except (TypeError, ValueError) as reason:
            raise MeshError(self.source, name, "an array of numbers, shape (…, 3)", reason) from None
        if array.ndim != 2 or array.shape[1] != 3:
            raise MeshError(self.source, name, "shape (…, 3)", array.shape)
        if len(array) == 0:
            raise MeshError(self.source, name, "at least one", "none")
        return _read_only(array)

    def _corner_normals(self, values: Any, of: Any) -> PerCorner:
        """`corner_normals`, checked. Raises: MeshError: as the class."""
        name = "corner_normals"
        rows = self._array(name, of)
        normals = PerCorner(self._array(name, values, np.float64), _read_only(rows.astype(np.int64, copy=False)))
        if self.normals is not None:
            raise MeshError(self.source, name, "no normals of vertices besides", "both")
        if normals.of.shape != self.faces.shape or not 0 <= normals.of.min() <= normals.of.max() < len(normals.values):
            expected = f"indices from 0 to {len(normals.values) - 1} of the corners of {len(self.faces)} faces"
            raise MeshError(self.source, name, expected, f"shape {normals.of.shape} up to {normals.of.max()}")
        return normals

    def reversed(self) -> "Mesh":
        """The same surface with its inner side outwards: corners of faces in reverse order, normals negated."""
        normals = None if self.normals is None else -self.normals
        opacity = self.opacity and self.opacity.reversed()
        own = self.corner_normals
        facts: dict[str, Any] = {
            "source": self.source,
            "up": self.up,
            "opacity": opacity,
            "polygons": self.polygons,
            "corner_normals": own and PerCorner(-own.values, own.of[:, ::-1]),
        }
        return Mesh(self.vertices, self.faces[:, ::-1], normals, **facts)

    @cached_property
    def used(self) -> Float64s:
        """The vertices (k, 3) that are corners of faces."""
        mask = corner_mask(self.faces, len(self.vertices))
        return self.vertices if mask.all() else self.vertices[mask]

    @cached_property
    def bounds(self) -> tuple[Float64s, Float64s]:
        """Lower and upper corner (3,) of the bounding box of the faces."""
        columns = self.used.T  # one at a time: ten times as fast as along the rows
        return np.array([column.min() for column in columns]), np.array([column.max() for column in columns])

    @cached_property
    def centre(self) -> Float64s:
        """Centre (3,) of the bounding box."""
        low, high = self.bounds
        return low + (high - low) / 2

    @cached_property
    def radius(self) -> float:
        """Radius of the smallest ball that holds the faces: what a relative distance ("25%") is a part of."""
        return smallest_ball(self.used)[1]


def _read_only(array: npt.NDArray[Any]) -> npt.NDArray[Any]:
    array.flags.writeable = False
    return array


def corner_mask(faces: Int32s, count: int) -> Bools:
    """Which of `count` vertices are corners of `faces` (m, 3)."""
    mask = np.zeros(count, np.bool_)
    _mark_corners(faces, mask)
    return mask


@each("faces")
def _mark_corners(f: int, faces: Int32Rows, mask: Bools) -> None:
    """Set `mask` (n,) at the corners of the faces from `start` to `stop`."""
    for k in range(3):
        mask[faces[f, k]] = True


def mesh_of(given: Mesh | Any, source: str) -> Mesh:
    """A mesh, made of anything else that has one; vertices keep their order and number. Raises: MeshError.

    Args: given: a `Mesh`, or what has one as its `mesh`, of `scenes.load` for instance; a pair of arrays, vertices
        (n, 3) and faces (m, 3); or a mesh of trimesh, of PyVista, of meshio, triangles or quads, or of Open3D, legacy
        or tensor. Polygons are cut into triangles.
    """
    if isinstance(given, Mesh):
        return given
    within = getattr(given, "mesh", None)
    if isinstance(within, Mesh):
        return within
    if isinstance(given, tuple | list) and len(given) == 2:
        return Mesh(*given, source=source)
    # trimesh
    if hasattr(given, "vertices") and hasattr(given, "faces"):
        return Mesh(given.vertices, given.faces, source=source)
    # PyVista
    if hasattr(given, "points") and hasattr(given, "strips"):
        triangles = given if given.is_all_triangles else given.triangulate()
        return Mesh(triangles.points, np.reshape(triangles.faces, (-1, 4))[:, 1:], source=source)
    # meshio
    if hasattr(given, "points") and isinstance(getattr(given, "cells", None), list):
        return Mesh(given.points, _triangles(given, source), source=source)
    # Open3D
    if hasattr(given, "vertices") and hasattr(given, "triangles"):
        return Mesh(given.vertices, given.triangles, source=source)
    if hasattr(given, "vertex") and hasattr(given, "triangle"):
        try:  # Open3D's tensors, on whatever device
            arrays = given.vertex["positions"].cpu().numpy(), given.triangle["indices"].cpu().numpy()
        except KeyError:
            raise MeshError(source, "mesh", "vertex.positions and triangle.indices", "an empty mesh") from None
        return Mesh(*arrays, source=source)
    # Anything else is refused with the nearest way to a mesh.
    methods = "extract_surface", "combine", "to_mesh"
    nearest = next((f"its {name}()" for name in methods if hasattr(given, name)), None)
    if isinstance(given, str | os.PathLike):
        nearest = f'scenes.load("{os.fspath(given)}")'
    expected = "a raytrace.Mesh, a pair (vertices, faces), or a mesh of trimesh, PyVista, meshio or Open3D"
    raise MeshError(source, "mesh", expected, " ".join(repr(given).split()), nearest=nearest)


def _triangles(meshio_mesh: Any, source: str) -> Int64s:
    """The triangles of meshio's cells, quads cut along the diagonal that lies inside of them."""
    parts = [block for block in meshio_mesh.cells if block.type not in ("vertex", "line")]
    unsupported = next((block.type for block in parts if block.type not in ("triangle", "quad")), None)
    if unsupported or not parts:
        raise MeshError(source, "cells", "triangle or quad", unsupported or "none of them")
    triangles = [block.data for block in parts]
    for row, block in enumerate(parts):
        if block.type == "quad":
            a, b, c, d = np.asarray(meshio_mesh.points, np.float64)[block.data.T]
            folds = (np.cross(b - a, c - a) * np.cross(c - a, d - a)).sum(axis=1) < 0
            turned = np.where(folds[:, None], np.roll(block.data, -1, axis=1), block.data)
            triangles[row] = turned[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3)
    return np.concatenate(triangles).astype(np.int64)


def up_axis(mesh: Any, up: str | None = None) -> str:
    """The axis `up`, or else the one that is up in a `Mesh`, y if that does not say.

    Raises: OptionError: `up` is none of `UP`.
    """
    if up is not None and up not in UP:
        raise OptionError("up", "one of " + ", ".join(UP), up)
    return up or mesh.up or "y"


def shape_hash(mesh: Mesh) -> str:
    """A hash, in hexadecimal digits, of the triangles by their corners' coordinates in float32.

    It is the same whatever the order of vertices and faces, and how often vertices are stored; faces that are turned
    over have another.
    """
    of_vertices = np.empty(len(mesh.vertices), np.uint64)
    total = np.zeros(1, np.uint64)
    with np.errstate(over="ignore"):
        words = (mesh.vertices.astype(np.float32) + np.float32(0)).view(np.uint32)  # 0 and −0 are alike
    _hash_vertices(words, of_vertices)
    _add_triangles(of_vertices, mesh.faces, total)
    return f"{total[0]:016x}"


@each("words")
def _hash_vertices(i: int, words: UInt32Rows, hashes: UInt64s) -> None:
    """Write the hash (n,) of each vertex. Args: words: (n, 3), the bits of coordinates."""
    x = hash64(np.uint64(words[i, 0]))
    x = hash64(x ^ np.uint64(words[i, 1]))
    hashes[i] = hash64(x ^ np.uint64(words[i, 2]))


@kernel
def _add_triangles(of_vertices: UInt64s, faces: Int32Rows, total: UInt64s) -> None:
    """Add up hashes of the triangles. Args: of_vertices: (n,), hashes. total: (1,), a sum, written."""
    for f in range(len(faces)):
        a = of_vertices[faces[f, 0]]
        b = of_vertices[faces[f, 1]]
        c = of_vertices[faces[f, 2]]
        total[0] += hash64(hash64(b - a) + hash64(c - b) + hash64(a - c))
