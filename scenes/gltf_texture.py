"""Base colour textures of a glTF file and the coordinates they are looked up by.

Wrapping is always repetition, and filtering the renderer's: samplers are not read, nor KHR_texture_transform.
Format: Khronos glTF 2.0 specification, sections 3.6.2 and 3.8.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
import numpy.typing as npt

from raytrace.errors import SceneError
from raytrace.texture import Texture

from .confined import confined
from .gltf import Gltf, reference
from .gltf_materials import base_texture
from .located import shown

Floats = npt.NDArray[np.float64]
_TYPES = {5121: "<u1", 5123: "<u2", 5126: "<f4"}


class Textures:
    """The textures of an asset, each made once."""

    def __init__(self, asset: Gltf, path: Path) -> None:
        self._asset, self._path = asset, path
        self._made: dict[int, Texture] = {}

    def of(self, primitive: dict[str, Any]) -> tuple[Floats, Texture] | None:
        """Coordinates uv (n, 2), v upwards, and the texture of a primitive that has both, or None.

        Raises:
            SceneError: the image is missing, or outside the file's folder.
            Exception: a malformed header.
        """
        used = base_texture(self._asset.header, primitive)
        if used is None:
            return None
        attribute = f"TEXCOORD_{used.get('texCoord', 0)}"
        image = self._asset.header["textures"][used["index"]].get("source")
        if attribute not in primitive["attributes"] or image is None:
            return None
        if image not in self._made:
            self._made[image] = self._texture(image)
        return _coordinates(self._asset, primitive["attributes"][attribute]), self._made[image]

    def _texture(self, number: int) -> Texture:
        stored = self._asset.header["images"][number]
        label = self._path.with_name(f"{self._path.name}: images[{number}]")
        if "bufferView" in stored:
            view = self._asset.header["bufferViews"][stored["bufferView"]]
            return Texture(label, data=_view(self._asset, view))
        field = f"images[{number}].uri"
        if stored["uri"].startswith("data:"):
            data = reference(stored["uri"], self._asset.folder)
            if not data:
                raise SceneError(self._path, field, "an image in base64", shown(stored["uri"]))
            return Texture(label, data)
        return Texture(confined(unquote(stored["uri"]), self._asset.folder, self._path, field))


def _view(asset: Gltf, view: dict[str, Any]) -> bytes:
    start = view.get("byteOffset", 0)
    data = asset.buffers[view["buffer"]][start : start + view["byteLength"]]
    if start < 0 or len(data) < view["byteLength"]:
        raise ValueError("a buffer view reaches beyond its buffer")
    return data


def _coordinates(asset: Gltf, number: int) -> Floats:
    """The values (n, 2) of a texture coordinate accessor, v upwards."""
    accessor = asset.header["accessors"][number]
    if accessor["type"] != "VEC2" or "sparse" in accessor:
        raise ValueError("texture coordinates that are no plain pairs")
    view = asset.header["bufferViews"][accessor["bufferView"]]
    item = np.dtype(_TYPES[accessor["componentType"]])
    stride = view.get("byteStride", 2 * item.itemsize)
    values = np.ndarray(
        (accessor["count"], 2), item, _view(asset, view), accessor.get("byteOffset", 0), (stride, item.itemsize)
    )
    uv = values.astype(np.float64)
    if item.kind == "u":
        uv /= np.iinfo(item).max
    if not np.isfinite(uv).all():
        raise ValueError("texture coordinates that are not finite")
    return np.stack([uv[:, 0], 1.0 - uv[:, 1]], axis=-1)
