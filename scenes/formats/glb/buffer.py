"""A glTF document with one buffer, for binary files."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from raytrace.types import AnyFloats

from ..gltf.container import encode_glb

FLOAT, UNSIGNED_BYTE, UNSIGNED_INT = 5126, 5121, 5125
ARRAY_BUFFER, ELEMENT_ARRAY_BUFFER = 34962, 34963


class Packed:
    """A glTF header and its one buffer, which grow together."""

    def __init__(self, header: dict[str, Any]) -> None:
        self.header = header
        self.binary = bytearray()

    def bytes_view(self, data: bytes, **fields: Any) -> int:
        """Index of a new buffer view of `data`."""
        views = self.header.setdefault("bufferViews", [])
        views.append({"buffer": 0, "byteOffset": self.add(data), "byteLength": len(data), **fields})
        return len(views) - 1

    def accessor(
        self, array: npt.NDArray[Any], component: int, kind: str, target: int = ARRAY_BUFFER, **fields: Any
    ) -> int:
        """Index of a new accessor of `array`, rows of `kind`."""
        view = self.bytes_view(array.tobytes(), target=target)
        accessors = self.header.setdefault("accessors", [])
        accessors.append({"bufferView": view, "componentType": component, "count": len(array), "type": kind, **fields})
        return len(accessors) - 1

    def encode(self) -> bytes:
        """The GLB file."""
        self.header["buffers"] = [{"byteLength": len(self.binary)}]
        return encode_glb(self.header, bytes(self.binary))

    def add(self, data: bytes) -> int:
        """Offset of `data` in the buffer, aligned as every component type needs."""
        self.binary += b"\0" * (-len(self.binary) % 4)
        offset = len(self.binary)
        self.binary += data
        return offset

    def obscurance(self, w: AnyFloats, colors: bool) -> dict[str, int]:
        """Attributes of one primitive's vertices."""
        attributes = {"_OBSCURANCE": self.accessor(w.astype("<f4"), FLOAT, "SCALAR")}
        if colors:
            grey = np.full((len(w), 4), 255, dtype=np.uint8)
            grey[:, :3] = np.rint(np.clip(w, 0, 1) * 255)[:, None]
            attributes["COLOR_0"] = self.accessor(grey, UNSIGNED_BYTE, "VEC4", normalized=True)
        return attributes
