"""Textures of a glTF file, with the coordinates by which its primitives use them.

Of samplers the wrap modes are read; filtering is the renderer's.
Format: Khronos glTF 2.0 specification, sections 3.6.2, 3.8, 3.9.3 and 5.26; KHR_texture_transform;
KHR_materials_pbrSpecularGlossiness.
"""

from __future__ import annotations

from dataclasses import replace
from math import cos, sin
from typing import Any
from urllib.parse import unquote

import numpy as np

from raytrace.errors import SceneError
from raytrace.image.texture import Texture, Wrap
from raytrace.types import Float64s

from ...field_errors import shown
from ...safe_paths import confined
from ..glb.occlusion import TRANSFORM, occlusion_reference
from .accessors import entry, normalized, values, view_bytes
from .container import Gltf, referenced

SPECULAR_GLOSSINESS = "KHR_materials_pbrSpecularGlossiness"
_REPEAT = 10497
_MODES: dict[int, Wrap] = {_REPEAT: "repeat", 33648: "mirrored_repeat", 33071: "clamp_to_edge"}


class Textures:
    """The textures of an asset, each made once."""

    def __init__(self, asset: Gltf) -> None:
        self.asset, self._path = asset, asset.path
        self._made: dict[tuple[int, tuple[Wrap, Wrap], bool], Texture] = {}

    def of_base(self, primitive: dict[str, Any]) -> tuple[Float64s, Texture] | None:
        """Coordinates uv (n, 2), v upwards, and the base colour texture of a primitive that has both, or None.

        Raises:
            SceneError: the image is missing, or outside the file's folder.
            Exception: a malformed header.
        """
        return self._used(primitive, base_texture(self.asset, primitive), srgb=True)

    def of_occlusion(self, primitive: dict[str, Any]) -> tuple[Float64s, Texture, float] | None:
        """The same of the occlusion texture, whose R channel is linear, with its strength in [0, 1]."""
        reference = occlusion_reference(self.asset.header, primitive.get("material"))
        used = self._used(primitive, reference, srgb=False)
        if reference is None or used is None:
            return None
        return *used, float(np.clip(reference.get("strength", 1.0), 0.0, 1.0))

    def _used(
        self, primitive: dict[str, Any], reference: dict[str, Any] | None, srgb: bool
    ) -> tuple[Float64s, Texture] | None:
        if reference is None:
            return None
        moved = reference.get("extensions", {}).get(TRANSFORM, {})
        attribute = f"TEXCOORD_{moved.get('texCoord', reference.get('texCoord', 0))}"
        stored = entry(self.asset, "textures", reference["index"])
        image = stored.get("source")
        if attribute not in primitive["attributes"] or image is None:
            return None
        key = image, self._wrap(stored), srgb
        if key not in self._made:
            self._made[key] = replace(self.image(image), wrap=key[1], srgb=srgb)
        return _coordinates(self.asset, primitive["attributes"][attribute], moved), self._made[key]

    def _wrap(self, texture: dict[str, Any]) -> tuple[Wrap, Wrap]:
        """The modes of a texture's sampler, or repetition without one."""
        sampler = entry(self.asset, "samplers", texture["sampler"]) if "sampler" in texture else {}
        along_u, along_v = (_MODES[sampler.get(axis, _REPEAT)] for axis in ("wrapS", "wrapT"))
        return along_u, along_v

    def image(self, number: int) -> Texture:
        """An image of the asset, as a texture that repeats. Raises: SceneError: it is missing, or elsewhere."""
        stored = entry(self.asset, "images", number)
        label = self._path.with_name(f"{self._path.name}: images[{number}]")
        if "bufferView" in stored:
            return Texture(label, data=bytes(view_bytes(self.asset, stored["bufferView"])))
        field = f"images[{number}].uri"
        if stored.get("uri", "").startswith("data:"):
            data = referenced(stored["uri"], self._path.parent)
            if not data:
                raise SceneError(self._path, field, "an image in base64", shown(stored["uri"]))
            return Texture(label, data)
        return Texture(confined(unquote(stored.get("uri", "")), self._path.parent, self._path, field))


def base_texture(asset: Gltf, primitive: dict[str, Any]) -> dict[str, Any] | None:
    """The texture reference (`index`, `texCoord`) of the base colour of a primitive's material, or None."""
    if "material" not in primitive:
        return None
    stored = entry(asset, "materials", primitive["material"])
    reference: dict[str, Any] | None = stored.get("pbrMetallicRoughness", {}).get("baseColorTexture")
    other = stored.get("extensions", {}).get(SPECULAR_GLOSSINESS)
    return reference if other is None else other.get("diffuseTexture")


def _coordinates(asset: Gltf, number: int, moved: dict[str, Any]) -> Float64s:
    """The values (n, 2) of a texture coordinate accessor, v upwards.

    Args: moved: the extension's offset, rotation (radians, anticlockwise as seen) and scale, which is applied first.
    """
    uv = normalized(values(asset, number, "VEC2"))
    if not np.isfinite(uv).all():
        raise ValueError("texture coordinates that are not finite")
    if moved:
        c, s = cos(moved.get("rotation", 0.0)), sin(moved.get("rotation", 0.0))
        uv = (uv * moved.get("scale", (1, 1))) @ np.array([[c, -s], [s, c]]) + moved.get("offset", (0, 0))
    return np.stack([uv[:, 0], 1.0 - uv[:, 1]], axis=-1)
