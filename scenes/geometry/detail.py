"""Polygons, texture coordinates, colours and materials of a mesh file, and elements of a PLY, kept for outputs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from raytrace import InputError, MemoryLimitError, Mesh
from raytrace.mesh.normals import creased_normals
from raytrace.mesh.weld import first_alike
from raytrace.types import Float32s, Float64s, Int64s

from .polygons import Triangulation


class PerCorner(NamedTuple):
    """Values of the polygons' corners: `rows` (k, w), and for each corner (c,) which of them it has."""

    rows: Float64s
    of: Int64s

    def at_vertices(self, corners: Int64s, count: int, elsewhere: float = 0.0) -> Float64s | None:
        """The values by vertex (count, w), `elsewhere` where no corner is; None if some vertex has several."""
        values, own = np.full((count, self.rows.shape[1]), elsewhere), self.rows[self.of]
        values[corners] = own
        return values if np.array_equal(values[corners], own, equal_nan=True) else None


@dataclass(frozen=True)
class Paint:
    """A material as OBJ libraries have it: a name, linear colours in [0, 1], glTF's factors, and a picture."""

    name: str
    colour: tuple[float, float, float] = (1.0, 1.0, 1.0)
    opacity: float = 1.0
    metallic: float = 0.0
    roughness: float = 1.0
    emission: tuple[float, float, float] = (0.0, 0.0, 0.0)
    texture: Path | None = None  # an existing PNG or JPEG, multiplied into `colour`; coordinates as the file has them
    opacity_texture: Path | None = None  # an existing image, multiplied into `opacity`, see `opacity_map`

    def opacity_map(self) -> Float32s | None:
        """Opacity (h, w) in [0, 1], rows from the top, of the `opacity_texture`; None without one.

        The alpha channel if the image is also that of the colour, or if it is not constant, for exporters name the
        picture of the colour; else luminance as stored, as Wavefront MTL 5.0 has it for scalar textures.
        """
        from raytrace.image.texture import Texture, texture_alpha

        if self.opacity_texture is None:
            return None
        return texture_alpha(Texture(self.opacity_texture), grey=self.opacity_texture != self.texture)


def is_opacity_map(path: Path, colour: Path | None) -> bool:
    """Whether an image, read wholly, can be an opacity map; one that is the `colour`, too, needs an alpha channel."""
    from raytrace.image.texture import Texture, texture_codes

    try:
        channels = [texture_codes(Texture(each)).shape[2] for each in {path, colour} if each]
    except MemoryLimitError:
        raise
    except InputError:
        return False
    return path != colour or channels[0] in (2, 4)


@dataclass(frozen=True, eq=False)
class Property:
    """A column of an element of a PLY file."""

    name: str
    kind: str  # the type of its values
    values: npt.NDArray[Any]  # (n,), or the values of all lists one after the other
    counted: str = ""  # of lists, the type of their lengths
    sizes: npt.NDArray[Any] | None = None  # (n,), of lists their lengths

    def fitting(self) -> Property:
        """The same values in the same type if it holds them, or else in one that does."""
        kind = self.kind
        with np.errstate(all="ignore"):
            cast = self.values.astype("<" + kind)
            if not np.array_equal(cast, self.values, equal_nan=kind in "fd"):
                kind = "d"
            counted = self.counted
            if self.sizes is not None and not np.array_equal(self.sizes.astype("<" + counted), self.sizes):
                counted = "I"
        return replace(self, kind=kind, counted=counted)


@dataclass(frozen=True, eq=False)
class Element:
    """So many rows of some properties of a PLY file."""

    name: str
    count: int
    properties: tuple[Property, ...]


@dataclass(frozen=True, eq=False)
class Detail:
    """See the module. All arrays go by the file's own vertices and polygons, whose order the mesh has too."""

    corners: Int64s  # (c,) vertex indices, polygon after polygon
    sizes: Int64s  # (p,) corners of each polygon
    triangles: Triangulation  # how the mesh's faces were cut from the polygons
    uv: PerCorner | None = None  # texture coordinates, v upwards, NaN at corners without, or None
    normals: PerCorner | None = None  # where some vertex has several, or None: then `Mesh.normals` are all there are
    colors: Float64s | None = None  # (n, 3) or (n, 4), red green blue and alpha in [0, 1], sRGB-encoded, or None
    numbers: dict[str, Float64s] = field(default_factory=dict)  # further (n,) values of the vertices by name
    paints: tuple[Paint, ...] = ()
    paint_of: Int64s | None = None  # (p,) which of the materials each polygon has, −1: none; or None
    objects: tuple[str, ...] = ()  # names of a file's objects that are no parts of the mesh
    object_of: Int64s | None = None  # (p,) which of these each polygon is of, −1: none; or None
    elements: tuple[Element, ...] = ()  # with the comments everything, if it was a PLY file
    comments: tuple[str, ...] = ()
    files: tuple[Path, ...] = ()  # read beside the mesh file, or to be read when it is written

    def corner_uv(self) -> Float64s | None:
        """Texture coordinates (m, 3, 2) of the triangles, v upwards, NaN where a corner of one has none; None if there
        are none."""
        if self.uv is None:
            return None
        found = self.uv.rows[self.triangles.take(self.uv.of)]
        return np.where(np.isnan(found).any(axis=(1, 2), keepdims=True), np.nan, found)


def reversed_detail(detail: Detail) -> Detail:
    """The same polygons with their corners in reverse order, as `Mesh.reversed` has the triangles; normals negated."""
    ends = np.cumsum(detail.sizes)
    order = np.repeat(2 * ends - detail.sizes - 1, detail.sizes) - np.arange(len(detail.corners))
    triangles, places = detail.triangles, detail.triangles.places
    if places is not None:
        triangles = triangles._replace(places=order[places[:, ::-1]])
    uv = detail.uv and detail.uv._replace(of=detail.uv.of[order])
    normals = detail.normals and PerCorner(-detail.normals.rows, detail.normals.of[order])
    elements = tuple(_reversed_element(element, detail.sizes, order) for element in detail.elements)
    corners = detail.corners[order]
    return replace(detail, corners=corners, triangles=triangles, uv=uv, normals=normals, elements=elements)


def _reversed_element(element: Element, sizes: Int64s, order: Int64s) -> Element:
    """An element of a PLY: lists of faces with a value or a pair for each corner in `order`, normals negated."""
    made = []
    for column in element.properties:
        values = column.values
        if element.name == "vertex" and column.name in ("nx", "ny", "nz"):
            values = -values
        elif element.name == "face" and column.sizes is not None and len(values) in (len(order), 2 * len(order)):
            wide = len(values) // max(len(order), 1)
            if np.array_equal(column.sizes, wide * sizes):
                values = values.reshape(-1, wide)[order].ravel()
        made.append(replace(column, values=values))
    return replace(element, properties=tuple(made))


def triangle_detail(faces: Int64s) -> Detail:
    """The detail of triangles (m, 3)."""
    sizes = np.full(len(faces), 3)
    return Detail(faces.ravel(), sizes, Triangulation(np.ones_like(sizes), 0, None))


def unique_rows(columns: Sequence[Int64s]) -> tuple[Int64s, Int64s]:
    """The first row (k,) of each kind, in ascending order of the columns (n,), and the kind (n,) of each row."""
    rows = np.stack(columns, axis=1)
    alike = first_alike(rows)
    first = np.flatnonzero(alike == np.arange(len(rows)))
    first = first[np.lexsort(rows[first].T[::-1])]
    number = np.empty(len(rows), np.int64)
    number[first] = np.arange(len(first))
    return first, number[alike]


def split_corners(
    corners: Int64s, places: Int64s, several: list[PerCorner], keep: int
) -> tuple[Int64s, Int64s, Int64s]:
    """One vertex for every combination of a vertex with what its corners have; of `keep` vertices all come first.

    Args: places: (m, 3) of triangles in `corners`. Returns: vertices (k,), faces (m, 3), and the place of a corner like
        each of the new vertices (k,).
    """
    flat = places.ravel()
    first, inverse = unique_rows([corners[flat], *(values.of[flat] for values in several)])
    vertices = corners[flat[first]]
    if not keep:
        return vertices, inverse.reshape(-1, 3), flat[first]
    repeated = np.concatenate([[False], vertices[1:] == vertices[:-1]])
    slots = np.where(repeated, keep + np.cumsum(repeated) - 1, vertices)
    whole, like = np.arange(keep + int(repeated.sum())), np.full(keep + int(repeated.sum()), flat[0])
    whole[slots], like[slots] = vertices, flat[first]
    return whole, slots[inverse].reshape(-1, 3), like


def split_creases(mesh: Mesh, more: Sequence[PerCorner] = ()) -> tuple[Int64s, Int64s, Float64s, Int64s]:
    """A mesh with a vertex for each normal that `raytrace.mesh.normals` gives, and for `more` that corners have.

    Returns: vertices (k,), the mesh's first, faces (m, 3), normals (k, 3), and a corner like each vertex (k,).
    """
    rows, of = creased_normals(mesh)
    own, places = PerCorner(rows, of.ravel()), np.arange(of.size).reshape(-1, 3)
    vertices, faces, like = split_corners(mesh.faces.ravel(), places, [own, *more], len(mesh.vertices))
    return vertices, faces, rows[own.of[like]], like
