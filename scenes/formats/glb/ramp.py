"""Vertex values as an occlusion texture: a grey ramp, and texture coordinates that point into it.

A texture that is linear in u, sampled linearly at a u that is interpolated linearly, gives the interpolated value: any
viewer that shows occlusion textures shows vertex values, without an unwrapping of the mesh.
"""

from collections.abc import Iterable
from functools import cache
from typing import Any

import numpy as np

from raytrace.image.encode import linear_png
from raytrace.types import AnyFloats, Float64s

from ..gltf.asset import Gltf
from .buffer import Packed
from .occlusion import RAMP, OcclusionTextures, add_coordinates, free_set

LEVELS = 256
SETS_OF_ALL_VIEWERS = 2  # the least that viewers must support (section 3.7.2.1)
_ROWS = 4


@cache
def ramp_png() -> bytes:
    """A PNG file of 256 × 4 greys of 8 bits: texel i of a row is i."""
    return linear_png(np.tile(np.arange(LEVELS, dtype=np.uint8), (_ROWS, 1))[..., None])


def ramp_coordinates(w: AnyFloats) -> Float64s:
    """Texture coordinates (n, 2) at which the ramp is w (n,), in [0, 1].

    255 w is the place between the centres of the first and the last texel, which lie at (i + ½)/256.
    """
    u = ((LEVELS - 1) * np.clip(np.asarray(w, np.float64), 0.0, 1.0) + 0.5) / LEVELS
    return np.stack([u, np.full_like(u, 0.5)], axis=-1)


def write_ramp(packed: Packed, drawn: Iterable[tuple[dict[str, Any], AnyFloats]], replace: bool) -> None:
    """Give primitives of a document the ramp as their occlusion texture.

    Args:
        drawn: the primitives, each with w (n,) of its vertices.
        replace: also primitives that have an occlusion texture which is not ours.
    """
    textures = OcclusionTextures(packed, replace)
    open_to_it = [(primitive, w) for primitive, w in drawn if textures.takes(primitive)]
    if not open_to_it:
        return
    ramp = textures.add(ramp_png(), RAMP)
    for primitive, w in open_to_it:
        number = free_set(packed.header, primitive)
        add_coordinates(packed, primitive, number, ramp_coordinates(w))
        textures.give(primitive, ramp, number)
    textures.apply()


def ramp_warnings(asset: Gltf, replace: bool) -> list[str]:
    """Warnings where `write_ramp` leaves w out, or some viewers will: lines for the user, mostly none."""
    header = asset.header
    textures = OcclusionTextures(Packed(header), replace)
    pieces = {each[1:3]: each.of(header) for each in asset.drawn}.values()
    kept = sum(not textures.takes(piece) for piece in pieces)
    lines = []
    if kept:
        lines.append(
            f"keeps the occlusion textures of {kept:,} of {len(pieces):,} primitives, whose w viewers do not show; "
            "--replace-occlusion replaces them"
        )
    highest = max((free_set(header, piece) for piece in pieces if textures.takes(piece)), default=0)
    if highest >= SETS_OF_ALL_VIEWERS:
        lines.append(f"uses the set TEXCOORD_{highest}; not every viewer reads more than {SETS_OF_ALL_VIEWERS}")
    return lines
