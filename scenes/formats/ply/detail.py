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
    colors = fractions(own_colors(vertex))
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


def stored_colors(vertex: dict[str, Property]) -> dict[str, Property]:
    """The properties red, green, blue and alpha, as far as there are any."""
    return {name: vertex[name] for name in (*RGB, "alpha") if name in vertex and vertex[name].sizes is None}


def own_colors(vertex: dict[str, Property]) -> dict[str, Property]:
    """As `stored_colors`, none if they are the grey that a bake gave them."""
    own = stored_colors(vertex)
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


def fractions(colors: dict[str, Property]) -> Float64s | None:
    """`stored_colors` or `own_colors` as (n, 3) or (n, 4) in [0, 1], None if one of red, green and blue is missing."""
    if not set(RGB) <= set(colors):
        return None
    return np.stack([column.values.astype(np.float64) / _largest(column.kind) for column in colors.values()], axis=1)


def with_channel(w: npt.NDArray[Any], channel: str, stored: dict[str, Property]) -> list[Property]:
    """`stored_colors` with w, alpha linear, others sRGB-encoded, in the one that begins with the letter `channel`.

    It keeps its type; the others are as stored, or 1 where red, green or blue is missing.
    """
    name = next(name for name in (*RGB, "alpha") if name[0] == channel)
    kind = next((stored[each].kind for each in (name, *stored) if each in stored), "B")
    values = encode_srgb(np.nan_to_num(w)) if channel != "a" else np.clip(np.nan_to_num(w), 0, 1)
    levels = values.astype(kind) if kind in "fd" else np.rint(values * _largest(kind))
    white = {each: Property(each, kind, np.full(len(w), _largest(kind))) for each in RGB}
    return [*(white | stored | {name: Property(name, kind, levels)}).values()]


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


def _largest(kind: str) -> float:
    return 1.0 if kind in "fd" else float(np.iinfo(kind).max)
