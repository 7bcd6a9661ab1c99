"""Alpha of glTF materials, and colours of glTF vertices.

Format: Khronos glTF 2.0 specification, sections 3.7.2.1 (`COLOR_0`), 3.9.2 and 3.9.4 (alpha).
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from raytrace import AlphaSurface, Opacity
from raytrace.types import Float64s, Int64s

from .accessors import column
from .asset import Gltf, entry
from .records import Primitive
from .textures import Textures

_ROUNDING = 0.51 / 255  # of the grey that a bake writes


def opacity_of(textures: Textures, primitive: Primitive, faces: Int64s) -> Opacity | None:
    """Alpha of the faces (m, 3) of a primitive: base colour factor, its texture and COLOR_0; None where all is opaque.

    Raises:
        SceneError: the texture is missing, or outside the file's folder.
        MeshError, ValueError: malformed values, or a material that is not there.
    """
    material = textures.asset.material(primitive)
    if material.alphaMode == "OPAQUE":
        return None
    uv, texture = textures.of_base(primitive) or (None, None)
    cutoff = material.alphaCutoff if material.alphaMode == "MASK" else None
    alpha = AlphaSurface(float(np.clip(material.base[0][3], 0, 1)), texture, cutoff=cutoff)
    number, accessors = primitive.attributes.get("COLOR_0"), textures.asset.geometry.accessors
    corners = None
    if number is not None and entry(accessors, number, "accessors").type == "VEC4":
        colours = column(textures.asset, primitive, "COLOR_0", "VEC4")
        corners = None if colours is None else colours[:, 3].clip(0.0, 1.0)[faces]
    return replace(Opacity.uniform(alpha, faces, uv), corners=corners)


def vertex_colours(asset: Gltf, primitive: Primitive, w: npt.NDArray[Any] | None) -> Float64s | None:
    """Linear RGB (n, 3) in [0, 1] of a primitive's vertices, or None; the grey that shows w is no colour.

    Args: w: obscurance at the vertices, if a bake has left it in the file.

    Raises: MeshError, ValueError: they cannot be read, or are not finite.
    """
    stored = column(asset, primitive, "COLOR_0", "VEC3", "VEC4")
    if stored is None:
        return None
    found = stored[:, :3].clip(0.0, 1.0)
    return None if w is not None and (np.abs(found - w.clip(0, 1)[:, None]) < _ROUNDING).all() else found
