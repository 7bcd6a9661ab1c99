"""Colours of glTF vertices, `COLOR_0`. Format: Khronos glTF 2.0 specification, sections 3.7.2.1 and 3.9.2."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from raytrace.types import Float64s

from .accessors import entry, normalized, values
from .container import Gltf

_ROUNDING = 0.51 / 255  # of the grey that a bake writes


def vertex_colours(asset: Gltf, primitive: dict[str, Any], w: npt.NDArray[Any] | None) -> Float64s | None:
    """Linear RGB (n, 3) in [0, 1] of a primitive's vertices, or None; the grey that shows w is no colour.

    Args: w: obscurance at the vertices, if a bake has left it in the file.

    Raises: MeshError, ValueError: they cannot be read, or are not finite.
    """
    if "COLOR_0" not in primitive["attributes"]:
        return None
    number = primitive["attributes"]["COLOR_0"]
    kind = entry(asset, "accessors", number)["type"]
    found = normalized(values(asset, number, kind if kind == "VEC4" else "VEC3"))[:, :3].clip(0.0, 1.0)
    if not np.isfinite(found).all():
        raise ValueError("colours that are not finite")
    return None if w is not None and (np.abs(found - w.clip(0, 1)[:, None]) < _ROUNDING).all() else found
