"""Alpha of glTF materials. Format: Khronos glTF 2.0 specification, section 3.9.4."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from raytrace import AlphaSurface, Opacity
from raytrace.types import Float64s, Int64s

from .accessors import entry, normalized, values
from .textures import SPECULAR_GLOSSINESS, Textures

_CUTOFF = 0.5


def opacity_of(textures: Textures, primitive: dict[str, Any], faces: Int64s) -> Opacity | None:
    """Alpha of the faces (m, 3) of a primitive: base colour factor, its texture and COLOR_0; None where all is opaque.

    Raises:
        SceneError: the texture is missing, or outside the file's folder.
        OptionError: a cutoff that is not in [0, 1].
        Exception: a malformed header.
    """
    material = entry(textures.asset, "materials", primitive["material"]) if "material" in primitive else {}
    mode = material.get("alphaMode", "OPAQUE")
    if mode == "OPAQUE":
        return None
    given = material.get("extensions", {}).get(SPECULAR_GLOSSINESS)
    surface = material.get("pbrMetallicRoughness", {}) if given is None else given
    factor = surface.get("baseColorFactor" if given is None else "diffuseFactor", (1, 1, 1, 1))[3]
    uv, texture = textures.of_base(primitive) or (None, None)
    cutoff = material.get("alphaCutoff", _CUTOFF) if mode == "MASK" else None
    alpha = AlphaSurface(float(np.clip(factor, 0, 1)), texture, cutoff=cutoff)
    corners = _vertex_alpha(textures, primitive)
    corners = None if corners is None else corners[faces]
    return replace(Opacity.uniform(alpha, faces, uv), corners=corners)


def _vertex_alpha(textures: Textures, primitive: dict[str, Any]) -> Float64s | None:
    """The alpha (n,) of COLOR_0, if it has any."""
    number = primitive["attributes"].get("COLOR_0")
    if number is None or entry(textures.asset, "accessors", number)["type"] != "VEC4":
        return None
    return normalized(values(textures.asset, number, "VEC4"))[:, 3].clip(0.0, 1.0)
