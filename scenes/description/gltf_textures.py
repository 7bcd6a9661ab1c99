"""Base colour textures of a glTF file, and their texture coordinates.

Of samplers the wrap modes are read; filtering is the renderer's. KHR_texture_transform is not read.
Format: Khronos glTF 2.0 specification, sections 3.6.2, 3.8 and 5.26.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any
from urllib.parse import unquote

import numpy as np

from raytrace.errors import SceneError
from raytrace.image.texture import Texture, Wrap
from raytrace.types import Float64s

from ..field_errors import shown
from ..gltf.accessors import entry, normalized, values, view_bytes
from ..gltf.container import Gltf, referenced
from ..safe_paths import confined
from .gltf_materials import base_texture

_REPEAT = 10497
_MODES: dict[int, Wrap] = {_REPEAT: "repeat", 33648: "mirrored_repeat", 33071: "clamp_to_edge"}


class Textures:
    """The textures of an asset, each made once."""

    def __init__(self, asset: Gltf) -> None:
        self._asset, self._path = asset, asset.path
        self._made: dict[tuple[int, tuple[Wrap, Wrap]], Texture] = {}

    def of(self, primitive: dict[str, Any]) -> tuple[Float64s, Texture] | None:
        """Coordinates uv (n, 2), v upwards, and the texture of a primitive that has both, or None.

        Raises:
            SceneError: the image is missing, or outside the file's folder.
            Exception: a malformed header.
        """
        used = base_texture(self._asset, primitive)
        if used is None:
            return None
        attribute = f"TEXCOORD_{used.get('texCoord', 0)}"
        stored = entry(self._asset, "textures", used["index"])
        image = stored.get("source")
        if attribute not in primitive["attributes"] or image is None:
            return None
        key = image, self._wrap(stored)
        if key not in self._made:
            self._made[key] = replace(self._texture(image), wrap=key[1])
        return _coordinates(self._asset, primitive["attributes"][attribute]), self._made[key]

    def _wrap(self, texture: dict[str, Any]) -> tuple[Wrap, Wrap]:
        """The modes of a texture's sampler, or repetition without one."""
        sampler = entry(self._asset, "samplers", texture["sampler"]) if "sampler" in texture else {}
        along_u, along_v = (_MODES[sampler.get(axis, _REPEAT)] for axis in ("wrapS", "wrapT"))
        return along_u, along_v

    def _texture(self, number: int) -> Texture:
        stored = entry(self._asset, "images", number)
        label = self._path.with_name(f"{self._path.name}: images[{number}]")
        if "bufferView" in stored:
            return Texture(label, data=bytes(view_bytes(self._asset, stored["bufferView"])))
        field = f"images[{number}].uri"
        if stored.get("uri", "").startswith("data:"):
            data = referenced(stored["uri"], self._path.parent)
            if not data:
                raise SceneError(self._path, field, "an image in base64", shown(stored["uri"]))
            return Texture(label, data)
        return Texture(confined(unquote(stored.get("uri", "")), self._path.parent, self._path, field))


def _coordinates(asset: Gltf, number: int) -> Float64s:
    """The values (n, 2) of a texture coordinate accessor, v upwards."""
    uv = normalized(values(asset, number, "VEC2"))
    if not np.isfinite(uv).all():
        raise ValueError("texture coordinates that are not finite")
    return np.stack([uv[:, 0], 1.0 - uv[:, 1]], axis=-1)
