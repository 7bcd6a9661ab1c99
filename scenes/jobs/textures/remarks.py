"""Remarks on the texture coordinates of a bake, in lines."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from ...formats.image_names import UDIM

if TYPE_CHECKING:
    import ao
    from raytrace.types import Float64s

    from ...formats.load import MeshFile

_SOME = 1e-3  # of the covered texels, that may overlap without a word
_LISTED = 3


def layout_remarks(baked: ao.BakedTexture, wraps: bool, tiles: bool) -> list[str]:
    """Remarks on the layout of a page.

    Args: wraps: whether it was taken modulo 1. tiles: whether the output may have a file for each tile.
    """
    facts = baked.facts
    lines = []
    if facts.overlapping > _SOME * facts.covered:
        mirrored = f"; {facts.mirrored:,} faces are mirrored" if facts.mirrored else ""
        lines.append(f"faces overlap in {facts.overlapping / facts.covered:.1%} of the covered texels{mirrored}")
    if facts.outside and wraps:
        advice = f"; {UDIM} in the output's name would keep tiles apart" if tiles and _has_tiles(baked.uv) else ""
        lines.append(f"{facts.outside:,} faces reach out of the unit square and are taken modulo 1{advice}")
    if facts.missed:
        lines.append(f"{facts.missed:,} points are not within the cage of the fine mesh and take the closest of it")
    if facts.flat:
        lines.append(f"{facts.flat:,} faces have no area in texture space, and no texels")
    return lines


def lacking(source: MeshFile, uv: Float64s, glb: Path | None) -> list[str]:
    """The parts of a file that have no texture coordinates, in a line. Args: glb: what is to hold the textures."""
    from ao.texture.uv_layout import on_page

    from ...formats.glb.pieces import pieces

    without = ~on_page(uv)
    if not without.any():
        return []
    without_uv = [piece for piece in pieces(source) if without[piece.faces].any()]
    names = list(dict.fromkeys(f"{piece.object.name} ({piece.material.name})" for piece in without_uv))
    more = f" and {len(names) - _LISTED:,} more" if len(names) > _LISTED else ""
    instead = "show w of their vertices" if glb else "get no texels"
    what = f"{without.sum():,} faces, of {', '.join(names[:_LISTED])}{more}, have no texture coordinates and {instead}"
    return [f"{source.path}: {what}; --uv fill{'' if glb else ' with --mesh-output'} makes some for them"]


def _has_tiles(uv: Float64s) -> bool:
    from ao.texture.uv_layout import on_page
    from raytrace.errors import OptionError

    from ...formats.images import udim_tiles

    try:
        return bool(udim_tiles(uv[on_page(uv)], ""))
    except OptionError:
        return False
