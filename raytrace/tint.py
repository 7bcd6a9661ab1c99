"""The albedo texture at a hit, filtered over what one pixel covers."""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from .entries import AMBIENT, DIFFUSE, TINT
from .jit import inline
from .surface import corner, put
from .texture_kernel import sample_texture
from .vector import cross, dot, subtract


class Textures(NamedTuple):
    """The arrays of `raytrace.texture.PackedTextures`; a texture that is not read yet has depth 0."""

    texels: npt.NDArray[np.float32]
    levels: npt.NDArray[np.int64]
    start: npt.NDArray[np.int64]
    depth: npt.NDArray[np.int64]


@inline
def tint(entry, geometry, textures, wanted, item, face, u, v, width):
    """Set an entry's TINT, or mark its texture in `wanted` if it has to be read first.

    Args: item, face, u, v: the hit; width: of a pixel at the hit, in the world's own units.
    """
    texture = geometry.texture[item]
    if texture < 0:
        return
    if textures.depth[texture] == 0:
        wanted[texture] = 1
        return
    f = geometry.first_face[item] + face
    i, j, k = geometry.faces[f, 0], geometry.faces[f, 1], geometry.faces[f, 2]
    uv = geometry.uv
    t = 1.0 - u - v
    s0 = t * uv[i, 0] + u * uv[j, 0] + v * uv[k, 0]
    s1 = t * uv[i, 1] + u * uv[j, 1] + v * uv[k, 1]
    p0 = corner(geometry, item, i)
    normal = cross(subtract(corner(geometry, item, j), p0), subtract(corner(geometry, item, k), p0))
    area = sqrt(dot(normal, normal))
    covered = abs((uv[j, 0] - uv[i, 0]) * (uv[k, 1] - uv[i, 1]) - (uv[k, 0] - uv[i, 0]) * (uv[j, 1] - uv[i, 1]))
    footprint = width * sqrt(covered / area) if area > 0.0 else 0.0
    put(
        entry,
        TINT,
        sample_texture(
            textures.texels, textures.levels, textures.start[texture], textures.depth[texture], s0, s1, footprint
        ),
    )


@inline
def apply_tint(entry):
    """Multiply light that was gathered without the texture by it."""
    for c in range(3):
        entry[AMBIENT + c] *= entry[TINT + c]
        entry[DIFFUSE + c] *= entry[TINT + c]
