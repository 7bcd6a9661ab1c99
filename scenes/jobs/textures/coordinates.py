"""The texture coordinates of a bake, a file's or new ones, and the size of its pages."""

from dataclasses import dataclass

import numpy as np

from ao.falloff import resolve_length
from ao.texture.uv_layout import on_page, page_size, texels_across
from raytrace.errors import MeshError, OptionError
from raytrace.mesh.mesh import Mesh
from raytrace.mesh.normals import face_normals
from raytrace.types import Bools, Float64s

from ...formats.load import MeshFile
from .unwrap import has_unwrapper, unwrap

AUTO, UNWRAP, FILL = "auto", "unwrap", "fill"
_USED = 0.65  # of a page, that an unwrapping fills


@dataclass(frozen=True, eq=False)
class Coordinates:
    """Texture coordinates of a mesh.

    Attributes:
        uv: (m, 3, 2), v upwards, NaN of faces that have none. new: bool (m,), which the file has not.
        number: of the file's set, None if all are new. size: texels across and down of a page.
    """

    uv: Float64s
    new: Bools
    number: int | None
    size: tuple[int, int]


def coordinates(source: MeshFile, wanted: str, size: str | None, texel_size: str | None, into_glb: bool) -> Coordinates:
    """Texture coordinates and size by the options --uv, --size and --texel-size.

    Args: into_glb: whether new coordinates would be written.

    Raises:
        MeshError: there are none. OptionError: as `unwrap`, or a page too large.
    """
    mesh, pages = source.mesh, (size, texel_size)
    number = int(wanted) if wanted.isdecimal() else 0
    uv = None if wanted == UNWRAP else source.texture_coordinates(number)
    if uv is not None:
        texels = _page(mesh, uv, *pages)
        new = ~on_page(uv) & (wanted == FILL)
        if new.any():
            uv[new] = unwrap(Mesh(mesh.vertices, mesh.faces[new], source=mesh.source), min(texels))
        return Coordinates(uv, new, number, texels)
    if wanted not in (UNWRAP, FILL) and not (wanted == AUTO and into_glb and has_unwrapper()):
        which = f" of number {number}" if number else ""
        install = "" if has_unwrapper() else "pip install uvunwrap and "
        advice = f"; {install}--uv unwrap makes some"
        raise MeshError(source.path, "texture coordinates", f"some{which} on every face", f"none{advice}")
    side = min(_page(mesh, None, *pages))
    return Coordinates(unwrap(mesh, side), np.ones(len(mesh.faces), np.bool_), None, (side, side))


def parse_texels(text: str) -> int | tuple[int, int]:
    """A side, or the width and height of "WxH". Raises: OptionError."""
    try:
        sides = [int(part) for part in text.lower().split("x")]
    except ValueError:
        sides = []
    if len(sides) not in (1, 2):
        raise OptionError("size", "a number of texels, such as 1024, or WIDTHxHEIGHT", repr(text))
    return sides[0] if len(sides) == 1 else (sides[0], sides[1])


def _page(mesh: Mesh, uv: Float64s | None, size: str | None, texel_size: str | None) -> tuple[int, int]:
    """Texels across and down; where faces are to be unwrapped, they are taken to fill most of the page."""
    if texel_size is None:
        return page_size(parse_texels(size or "1024"))
    length = resolve_length("texel_size", texel_size, mesh.radius)
    areas = face_normals(mesh.vertices, mesh.faces)[1]
    if uv is None:
        share = np.sqrt(2 * _USED / len(areas))
        uv = np.tile([[0.0, 0.0], [share, 0.0], [0.0, share]], (len(areas), 1, 1))
    shown = on_page(uv)
    return page_size(texels_across(uv[shown], areas[shown], length))
