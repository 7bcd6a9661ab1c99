"""A glTF document with one buffer, for binary files."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from raytrace.types import Int64s

from ..gltf.container import encode_glb
from ..gltf.instances import PROFILE

if TYPE_CHECKING:
    from ao import Bake, Profile

FLOAT, UNSIGNED_BYTE, UNSIGNED_SHORT, UNSIGNED_INT = 5126, 5121, 5123, 5125
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

    def annotate(self, primitive: dict[str, Any], bake: Bake, rows: Int64s, colors: bool = False) -> None:
        """Give a primitive w of its vertices, and the profile in 16 bits, four columns an attribute.

        Args: rows: of the bake, one for each vertex. colors: also as `COLOR_0`.
        """
        attributes, w, profile = primitive["attributes"], bake.w[rows], bake.profile
        for name in [name for name in attributes if name.startswith(PROFILE)]:
            del attributes[name]
        attributes["_OBSCURANCE"] = self.accessor(w.astype("<f4"), FLOAT, "SCALAR")
        if colors:
            grey = np.full((len(w), 4), 255, dtype=np.uint8)
            grey[:, :3] = np.rint(np.clip(w, 0, 1) * 255)[:, None]
            attributes["COLOR_0"] = self.accessor(grey, UNSIGNED_BYTE, "VEC4", normalized=True)
        if profile is None:
            return
        for first in range(0, len(profile.half_distances), 4):
            attributes[f"{PROFILE}{first // 4}"] = self._columns(profile, rows, first)

    def _columns(self, profile: Profile, rows: Int64s, first: int) -> int:
        """Index of an accessor of four columns of a profile; that of the first ones says which they are."""
        columns = profile.values[rows, first : first + 4]
        codes = np.zeros((len(rows), 4), "<u2")
        codes[:, : columns.shape[1]] = np.rint(columns * np.float32(65535))
        number = self.accessor(codes, UNSIGNED_SHORT, "VEC4", normalized=True)
        if not first:
            known = {"half_distances": profile.half_distances.tolist(), "radius": profile.radius}
            self.header["accessors"][number]["extras"] = known
        return number
