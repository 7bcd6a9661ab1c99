"""Colours, texture coordinates and further properties of a PLY file, by their conventional names."""

from typing import Any

import numpy as np
import numpy.typing as npt

from raytrace.image.srgb import encode_srgb
from raytrace.types import AnyInts, Float32s, Float64s, Int64s

from ...geometry.detail import Detail, Element, PerCorner, Property
from ...geometry.polygons import Triangulation
from .layout import PROFILE, PROFILE_COMMENT

RGB = ("red", "green", "blue")
UV = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"), ("texture_s", "texture_t"))
_MESH = ("x", "y", "z", "nx", "ny", "nz")


def ply_detail(
    elements: tuple[Element, ...], comments: tuple[str, ...], corners: Int64s, sizes: AnyInts, triangles: Triangulation
) -> Detail:
    """All of a PLY file. Args: corners, sizes: of its polygons."""
    vertex, face = columns_of(elements, "vertex"), columns_of(elements, "face")
    uv, used = _coordinates(vertex, face, corners, sizes)
    own = own_colors(vertex)
    colors = None
    if own and set(RGB) <= set(own):
        colors = np.stack([_fraction(column) for column in own.values()], axis=1)
    known = {*_MESH, *RGB, "alpha", "obscurance", *used}
    numbers = {
        name: c.values for name, c in vertex.items() if c.sizes is None and name not in known and not is_profile(name)
    }
    kept = tuple(line for line in comments if not line.startswith(("comment obscurance: ", PROFILE_COMMENT)))
    return Detail(
        corners, np.asarray(sizes, np.int64), triangles, uv, None, colors, numbers, elements=elements, comments=kept
    )


def columns_of(elements: tuple[Element, ...], name: str) -> dict[str, Property]:
    """The properties of the elements of this name."""
    return {column.name: column for element in elements if element.name == name for column in element.properties}


def own_colors(vertex: dict[str, Property]) -> dict[str, Property]:
    """The properties red, green, blue and alpha, unless they are the grey that a bake gave them."""
    own = {name: vertex[name] for name in (*RGB, "alpha") if name in vertex and vertex[name].sizes is None}
    baked = vertex.get("obscurance")
    if baked is not None and all(name in own and own[name].kind == "B" for name in RGB):
        linear = np.rint(np.clip(np.nan_to_num(baked.values), 0, 1) * 255.0)  # of older files
        for grey in (grey_of(baked.values), linear):
            if all(np.array_equal(own[name].values, grey) for name in RGB):
                return {}
    return own if set(own) & set(RGB) else {}


def is_profile(name: str) -> bool:
    """Whether a property is a column of a profile."""
    return name.startswith(PROFILE) and name.removeprefix(PROFILE).isdecimal()


def grey_of(w: npt.NDArray[Any]) -> Float32s:
    """Greys in [0, 255] that programs which take colours of a PLY for sRGB, as most do, read as w."""
    return np.rint(255 * encode_srgb(np.nan_to_num(w)))


def _coordinates(
    vertex: dict[str, Property], face: dict[str, Property], corners: Int64s, sizes: AnyInts
) -> tuple[PerCorner | None, tuple[str, ...]]:
    """Texture coordinates, of vertices or of corners, and the vertices' properties that they come from."""
    for pair in UV:
        if all(name in vertex and vertex[name].sizes is None and _finite(vertex[name]) for name in pair):
            return PerCorner(np.stack([vertex[name].values for name in pair], axis=1).astype(np.float64), corners), pair
    wedges = face.get("texcoord")
    if wedges is not None and wedges.sizes is not None and _finite(wedges) and np.array_equal(wedges.sizes, 2 * sizes):
        return PerCorner(wedges.values.reshape(-1, 2).astype(np.float64), np.arange(len(corners))), ()
    return None, ()


def _finite(column: Property) -> bool:
    return bool(np.isfinite(column.values).all())


def _fraction(column: Property) -> Float64s:
    largest = 1.0 if column.kind in "fd" else float(np.iinfo(column.kind).max)
    return column.values.astype(np.float64) / largest
