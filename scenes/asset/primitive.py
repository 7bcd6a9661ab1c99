"""Polygons over vertices with columns of values: normals, texture coordinates, colours, w and others.

A column goes by vertices, or by the corners of polygons through indices of its own, as an OBJ's `vt` and Blender's
attributes do. All records are immutable: a change makes new ones that share every other array.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple, Self, TypeVar

import numpy as np
import numpy.typing as npt

from obscurance.raytrace.image.colour import decode_srgb, encode_srgb
from obscurance.raytrace.mesh.mesh import PerCorner
from obscurance.raytrace.types import AnyFloats, AnyInts, Float64s, Int64s

from ..geometry.polygons import Triangulation, triangulate

if TYPE_CHECKING:
    from obscurance.ao import Profile

Array = npt.NDArray[Any]
NORMAL, COLOR = "normal", "color"  # names of columns, as are "uv0", "uv1", …, and others as files have them
W = "obscurance"  # begins the names of all that a bake leaves
BAKED = {"w": W, **{name: f"{W}_{name}" for name in ("error", "flags", "bent_normals")}}
"""Names of a bake's attributes, and of the columns that hold them."""
RAMP = "ramp"  # and a number in place of "uv": coordinates by which a bake looks up a ramp
FLOAT = 3e38
"""No number of a file in float32 is larger."""
_ROUNDING = 0.51 / 255  # of the grey that a bake writes
T = TypeVar("T")


class Column(NamedTuple):
    """Values of a primitive's vertices or, with `of`, of the corners of its polygons."""

    values: Array  # (k,) or (k, d); texture coordinates with v upwards, colours in [0, 1]
    of: AnyInts | None = None  # (c,), the row of each corner; None: row i is vertex i's
    srgb: bool = False  # whether red, green and blue are sRGB-encoded; else they are linear

    def colours(self, srgb: bool) -> Float64s:
        """The values as red, green, blue and maybe alpha, linear or sRGB-encoded."""
        values = self.values.astype(np.float64, copy=False)
        if self.srgb == srgb:
            return values
        change = encode_srgb if srgb else decode_srgb
        return np.concatenate([change(values[:, :3]).astype(np.float64), values[:, 3:]], axis=1)

    def of_vertices(self, corners: Array, count: int) -> Column:
        """The column by vertices, NaN of those without corners, if all corners of each have the same; else itself.

        Args: corners: of the polygons. count: of the vertices.
        """
        if self.of is None:
            return self
        by_vertex = PerCorner(self.values, self.of).at_vertices(corners, count, np.nan)
        return self if by_vertex is None else self._replace(values=by_vertex, of=None)


class ColumnSet(Mapping[str, Column]):
    """Columns by name, each read when it is first asked for: one that is malformed troubles only its users."""

    def __init__(self, columns: Mapping[str, Column | Callable[[], Column]] = {}) -> None:
        self._columns = dict(columns)

    def __getitem__(self, name: str) -> Column:
        found = self._columns[name]
        if not isinstance(found, Column):
            found = self._columns[name] = found()
        return found

    def __contains__(self, name: object) -> bool:
        return name in self._columns

    def __iter__(self) -> Iterator[str]:
        return iter(self._columns)

    def __len__(self) -> int:
        return len(self._columns)

    def __or__(self, others: Mapping[str, Column]) -> ColumnSet:
        return ColumnSet({**self._columns, **others})

    def only(self, *names: str) -> ColumnSet:
        """The columns of these names, as far as there are any."""
        return ColumnSet({name: column for name, column in self._columns.items() if name in names})


class Lazy(Sequence[T]):
    """A sequence that is made when it is first looked at."""

    def __init__(self, make: Callable[[], Sequence[T]]) -> None:
        self._make = make
        self._made: Sequence[T] | None = None

    def __getitem__(self, place: Any) -> Any:
        if self._made is None:
            self._made = self._make()
        return self._made[place]

    def __len__(self) -> int:
        return len(self[:])


class Primitive(NamedTuple):
    """Polygons over vertices, in a frame of their own."""

    positions: Array  # (n, 3) numbers
    corners: Array  # (c,) vertices, polygon after polygon
    sizes: Array  # (p,) corners of each polygon
    triangles: Triangulation  # of the polygons
    columns: ColumnSet = ColumnSet()
    material: Int64s | None = None  # (p,) in `Asset.materials`, −1: none; None: no polygon has one
    object: Int64s | None = None  # (p,) in `Asset.names`, −1: that of the node; None: all are
    profile: Profile | None = None  # that a bake has left
    name: str = ""  # behind that of the node, where a mesh has several

    @classmethod
    def of(cls, positions: Array, corners: Array, sizes: Array | None = None, source: Any = "", **more: Any) -> Self:
        """A primitive of polygons, or without `sizes` of triangles. Raises: MeshError: as `triangulate`."""
        if sizes is None or (sizes.strides == (0,) and len(sizes) and sizes[0] == 3):
            count = len(corners) // 3
            one_each = np.broadcast_to(np.int64(1), count)
            three_each = np.broadcast_to(np.int64(3), count)
            return cls(positions, corners, three_each, Triangulation(one_each, 0, None), **more)
        return cls(positions, corners, sizes, triangulate(positions, corners, sizes, source), **more)

    @property
    def faces(self) -> Array:
        """The triangles (m, 3)."""
        return self.triangles.take(self.corners)

    def of_faces(self, numbers: Int64s | None) -> Int64s:
        """Numbers (m,) of the triangles, from those of the polygons; −1 of None."""
        counts = self.triangles.counts
        if numbers is None:
            return np.broadcast_to(np.int64(-1), int(counts.sum()))
        return numbers if self.triangles.places is None else np.repeat(numbers, counts)

    def rows(self, column: Column) -> Array:
        """The row of a column that each corner of the triangles has, (m, 3)."""
        return self.triangles.take(self.corners if column.of is None else column.of)

    @property
    def own_colours(self) -> Column | None:
        """The column of vertex colours that are the file's own, None without: see the function of this name."""
        return own_colours(self.columns)

    @property
    def shown_colours(self) -> Float64s | None:
        """Linear red, green and blue (n, 3) in [0, 1] of the vertices, or None."""
        colours = self.own_colours
        return None if colours is None else colours.colours(srgb=False)[:, :3].clip(0.0, 1.0)

    def reversed(self) -> Self:
        """The same polygons with their corners in reverse order, as `Mesh.reversed` has triangles; normals negated."""
        order = reverse_order(self.sizes)
        triangles = self.triangles
        if triangles.places is not None:
            triangles = triangles._replace(places=order[triangles.places[:, ::-1]])

        def turned(name: str) -> Column:
            column = self.columns[name]
            values = -column.values if name == NORMAL else column.values
            return column._replace(values=values, of=None if column.of is None else column.of[order])

        columns = ColumnSet({name: partial(turned, name) for name in self.columns})
        return self._replace(corners=self.corners[order], triangles=triangles, columns=columns)


@dataclass(frozen=True, eq=False)
class StoredBake:
    """What a bake has left of n vertices, None where that is unknown; an `ao.Bake` has the same attributes."""

    w: AnyFloats  # (n,), in [0, 1]
    error: AnyFloats | None = None  # (n,), standard error of w, in [0, 100]
    flags: Array | None = None  # (n,), `ao.Flag`s
    bent_normals: AnyFloats | None = None  # (n, 3), unit or zero
    profile: Profile | None = None
    rmse: float | None = None  # of `error`; None: over all vertices
    at: str = "vertices"
    below: None = None

    def first(self, count: int) -> Self:
        """The values of the first `count` vertices."""
        of_vertices = {name: values[:count] for name in BAKED if (values := getattr(self, name)) is not None}
        profile = self.profile and replace(self.profile, values=self.profile.values[:count])
        return replace(self, **of_vertices, profile=profile)


def own_colours(columns: ColumnSet) -> Column | None:
    """The colours of the vertices, None where they are the grey by which a bake has shown w."""
    colours = columns.get(COLOR)
    if colours and W in columns:
        w = columns[W].values.clip(0, 1)
        grey = encode_srgb(w) if colours.srgb else w
        if (np.abs(colours.values[:, :3].clip(0, 1) - grey[:, None]) < _ROUNDING).all():
            return None
    return colours


def known_columns(bake: Any) -> dict[str, Array]:
    """What files hold of a bake by its attributes, floats and bytes of flags, as far as it is known."""
    kinds = {"w": "<f4", "error": "<f4", "bent_normals": "<f4", "flags": "u1"}
    known = {name: values for name in kinds if (values := getattr(bake, name)) is not None}
    with np.errstate(invalid="ignore", over="ignore"):  # of what a file has that is no bake's
        return {name: values.astype(kinds[name]) for name, values in known.items()}


def reverse_order(sizes: Array) -> Int64s:
    """The places (c,) of the corners of polygons of these sizes, each polygon's in reverse."""
    lengths = sizes.astype(np.int64)
    return np.repeat(2 * np.cumsum(lengths) - lengths - 1, lengths) - np.arange(lengths.sum())


def float_normals(normals: Float64s) -> npt.NDArray[np.float32]:
    """Normals (n, 3) in float32, 0 for NaN; those too long for it are shortened."""
    finite = np.nan_to_num(normals)
    longest = np.abs(finite).max(axis=1, keepdims=True)
    return (finite / np.where(longest > FLOAT, longest, 1.0)).astype("<f4")
