"""Alpha of an OBJ file's faces, by its materials' `d`, `Tr` and `map_d`."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from raytrace import AlphaSurface, Opacity, Texture

from ..geometry.detail import Paint
from ..geometry.polygons import Triangles
from .obj_detail import polygons_of, read_paints
from .obj_text import ObjText


def obj_opacity(file: ObjText, folder: Path, triangles: Triangles) -> tuple[Opacity | None, tuple[str, ...]]:
    """Alpha of the faces, None where all are opaque; and warnings of images that are missing.

    Args: folder: where the file is. triangles: of its polygons.
    """
    known, _, left = read_paints(file.text, folder)
    notes = tuple(f"{words} is not read: alpha there is that of d alone" for words in left if "map_d" in words)
    paints = {name: paint for name, paint in known.items() if _has_alpha(paint)}
    if not paints:
        return None, notes
    (painted,) = polygons_of(file.text, "usemtl")
    of_name = [list(paints).index(name) if name in paints else -1 for name in painted.names]
    of = np.repeat(np.array([*of_name, -1])[painted.of], triangles.counts)
    if (of < 0).all():
        return None, notes
    uv = file.uv()
    surfaces = tuple(_surface(paint, uv is not None) for paint in paints.values())
    return Opacity(of, surfaces, None if uv is None else uv.rows[triangles.take(uv.of)]), notes


def _has_alpha(paint: Paint) -> bool:
    return paint.opacity < 1 or paint.opacity_texture is not None


def _surface(paint: Paint, has_uv: bool) -> AlphaSurface:
    image = paint.opacity_texture if has_uv else None
    return AlphaSurface(paint.opacity, Texture(image) if image else None, grey=image != paint.texture)
