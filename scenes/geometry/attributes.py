"""Polygons, texture coordinates, colours and materials of a mesh file, and elements of a PLY, kept for outputs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from obscurance.raytrace.errors import InputError, MemoryLimitError
from obscurance.raytrace.mesh.mesh import PerCorner
from obscurance.raytrace.types import Float64s, Int64s

from .polygons import Triangulation

FLOAT = 3e38
"""No number of a file in float32 is larger."""


def float_normals(normals: Float64s) -> npt.NDArray[np.float32]:
    """Normals (n, 3) in float32, 0 for NaN; those too long for it are shortened."""
    finite = np.nan_to_num(normals)
    longest = np.abs(finite).max(axis=1, keepdims=True)
    return (finite / np.where(longest > FLOAT, longest, 1.0)).astype("<f4")


class SourceMaterial(NamedTuple):
    """A material as OBJ libraries have it: a name, linear colours in [0, 1], glTF's factors, and a picture."""

    name: str
    colour: tuple[float, float, float] = (1.0, 1.0, 1.0)
    opacity: float = 1.0
    metallic: float = 0.0
    roughness: float = 1.0
    emission: tuple[float, float, float] = (0.0, 0.0, 0.0)
    specular: tuple[float, float, float] = (0.0, 0.0, 0.0)  # and `exponent`, of Blinn–Phong; glTF has `roughness`
    exponent: float = 0.0
    texture: Path | None = None  # an existing PNG or JPEG, multiplied into `colour`; coordinates as the file has them
    opacity_texture: Path | None = None  # an existing image, multiplied into `opacity`


def is_picture(path: Path) -> bool:
    """Whether a file begins as a PNG or a JPEG, which glTF and browsers show."""
    with path.open("rb") as file:
        return file.read(8).startswith((b"\x89PNG", b"\xff\xd8\xff"))


def find_picture(name: str, folder: Path) -> Path | None:
    """The existing picture `name` in `folder` or below, or None: `resolve_inside` of PNG and JPEG files."""
    from ..safe_paths import resolve_inside

    path = resolve_inside(name, folder)
    return path if path and is_picture(path) else None


def is_opacity_map(path: Path, colour: Path | None) -> bool:
    """Whether an image, read wholly, can be an opacity map; one that is the `colour`, too, needs an alpha channel."""
    from obscurance.raytrace.image.texture import Texture, texture_codes

    try:
        channels = [texture_codes(Texture(image)).shape[2] for image in {path, colour} if image]
    except MemoryLimitError:
        raise
    except InputError:
        return False
    return path != colour or channels[0] in (2, 4)


class Property(NamedTuple):
    """A column of an element of a PLY file."""

    name: str
    kind: str  # the type of its values
    values: npt.NDArray[Any]  # (n,), or the values of all lists one after the other
    counted: str = ""  # of lists, the type of their lengths
    sizes: npt.NDArray[Any] = np.empty(0, np.int64)  # (n,), of lists their lengths

    def fitting(self) -> Property:
        """The same values in the same type if it holds them, or else in one that does."""
        kind = self.kind
        with np.errstate(all="ignore"):
            if self.values.dtype != np.dtype("<" + kind):
                cast = self.values.astype("<" + kind)
                if not np.array_equal(cast, self.values, equal_nan=kind in "fd"):
                    kind = "d"
            counted = self.counted
            if counted and not np.array_equal(self.sizes.astype("<" + counted), self.sizes):
                counted = "I"
        return self._replace(kind=kind, counted=counted)


@dataclass(eq=False)
class Element:
    """So many rows of some properties of a PLY file."""

    name: str
    count: int
    properties: tuple[Property, ...]


class SourceAttributes(NamedTuple):
    """The contents of a mesh file beside the mesh.

    All arrays go by the file's own vertices and polygons, whose order the mesh has too.
    """

    corners: Int64s  # (c,) vertex indices, polygon after polygon
    sizes: Int64s  # (p,) corners of each polygon
    triangles: Triangulation  # how the mesh's faces were cut from the polygons
    uv: PerCorner | None = None  # texture coordinates, v upwards, NaN at corners without, or None
    colors: Float64s | None = None  # (n, 3) or (n, 4), red green blue and alpha in [0, 1], sRGB-encoded, or None
    numbers: Mapping[str, Float64s] = {}  # further (n,) values of the vertices by name
    materials: tuple[SourceMaterial, ...] = ()
    material_of: Int64s | None = None  # (p,) which of the materials each polygon has, −1: none; or None
    objects: tuple[str, ...] = ()  # names of a file's objects that are no parts of the mesh
    object_of: Int64s | None = None  # (p,) which of these each polygon is of, −1: none; or None
    elements: tuple[Element, ...] = ()  # with the comments everything, if it was a PLY file
    comments: tuple[str, ...] = ()
    files: tuple[Path, ...] = ()  # read beside the mesh file, or to be read when it is written

    def of_triangles(self, values: PerCorner) -> PerCorner:
        """Values of the corners of triangles, from those of the polygons."""
        return PerCorner(values.values, self.triangles.take(values.of).ravel())

    def of_faces(self, numbers: Int64s | None) -> Int64s:
        """Numbers (m,) of the triangles, from those of the polygons, -1 where there are none."""
        counts = self.triangles.counts
        return np.repeat(np.full(len(counts), -1) if numbers is None else numbers, counts)

    def corner_uv(self) -> Float64s | None:
        """Texture coordinates (m, 3, 2) of the triangles, v upwards, NaN where a corner of one has none; None if there
        are none."""
        if self.uv is None:
            return None
        uv = self.uv.values[self.triangles.take(self.uv.of)]
        return np.where(np.isnan(uv).any(axis=(1, 2), keepdims=True), np.nan, uv)


def reversed_attributes(attributes: SourceAttributes) -> SourceAttributes:
    """The same polygons with their corners in reverse order, as `Mesh.reversed` has the triangles; normals negated."""
    sizes = attributes.sizes
    order = np.repeat(2 * np.cumsum(sizes) - sizes - 1, sizes) - np.arange(len(attributes.corners))
    triangles = attributes.triangles
    if triangles.places is not None:
        triangles = triangles._replace(places=order[triangles.places[:, ::-1]])
    return attributes._replace(
        corners=attributes.corners[order],
        triangles=triangles,
        uv=attributes.uv and attributes.uv._replace(of=attributes.uv.of[order]),
        elements=tuple(_reversed_element(element, sizes, order) for element in attributes.elements),
    )


def _reversed_element(element: Element, sizes: Int64s, order: Int64s) -> Element:
    """An element of a PLY: lists of faces with a value or a pair for each corner in `order`, normals negated."""
    columns = []
    for column in element.properties:
        values = column.values
        if element.name == "vertex" and column.name in ("nx", "ny", "nz"):
            values = -values
        elif element.name == "face" and column.counted and len(values) in (len(order), 2 * len(order)):
            wide = len(values) // max(len(order), 1)
            if np.array_equal(column.sizes, wide * sizes):
                values = values.reshape(-1, wide)[order].ravel()
        columns.append(column._replace(values=values))
    return replace(element, properties=tuple(columns))


def join_attributes(several: Sequence[SourceAttributes], vertices: Sequence[int]) -> SourceAttributes:
    """The attributes of several objects one after another: polygons, materials, texture coordinates and colours.

    Args:
        vertices: how many each object has.
    """
    # Corners refer to vertices, and triangles to corners, of the objects before them too.
    first_vertex = np.cumsum([0, *vertices[:-1]])
    first_corner = np.cumsum([0, *(len(item.corners) for item in several[:-1])])
    corners = [item.corners + start for item, start in zip(several, first_vertex, strict=True)]
    triangles = [item.triangles for item in several]
    numbers = [np.arange(len(item.corners)) for item in several]
    cuts = zip(triangles, numbers, first_corner, strict=True)
    corner_places = [cut.take(of_polygons) + start for cut, of_polygons, start in cuts]
    # Each material once; -1, none, is the last of a list.
    materials = tuple(dict.fromkeys(material for item in several for material in item.materials))
    material_of = []
    for item in several:
        number = np.array([*(materials.index(material) for material in item.materials), -1])
        own_material = np.full(len(item.sizes), -1) if item.material_of is None else item.material_of
        material_of.append(number[own_material])
    # NaN where an object has no texture coordinates, white where it has no colours.
    uv = [item.uv or PerCorner(np.full((1, 2), np.nan), np.zeros(len(item.corners), np.int64)) for item in several]
    first_value = np.cumsum([0, *(len(values.values) for values in uv[:-1])])
    of = [values.of + start for values, start in zip(uv, first_value, strict=True)]
    colors = [
        np.ones((count, 3)) if item.colors is None else item.colors[:, :3]
        for item, count in zip(several, vertices, strict=True)
    ]
    return SourceAttributes(
        np.concatenate(corners),
        np.concatenate([item.sizes for item in several]),
        Triangulation(
            np.concatenate([cut.counts for cut in triangles]),
            sum(cut.crossing for cut in triangles),
            None if all(cut.places is None for cut in triangles) else np.concatenate(corner_places),
        ),
        uv=PerCorner(np.concatenate([values.values for values in uv]), np.concatenate(of))
        if any(item.uv for item in several)
        else None,
        colors=np.concatenate(colors) if any(item.colors is not None for item in several) else None,
        materials=materials,
        material_of=np.concatenate(material_of) if materials else None,
        files=tuple(dict.fromkeys(path for item in several for path in item.files)),
    )


def triangle_attributes(faces: Int64s) -> SourceAttributes:
    """The attributes of triangles (m, 3) without any."""
    sizes = np.full(len(faces), 3)
    return SourceAttributes(faces.ravel(), sizes, Triangulation(np.ones_like(sizes), 0, None))
