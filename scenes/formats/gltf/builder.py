"""A glTF document with one buffer, for binary files."""

from __future__ import annotations

import json
import struct
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from obscurance.raytrace.types import AnyInts, Float64s

from ...asset.primitive import BAKED, W, known_columns
from .accessors import COMPONENTS
from .asset import BIN_CHUNK, JSON_CHUNK, RECORD
from .records import LEFT, PROFILE

if TYPE_CHECKING:
    from obscurance.ao import Bake

    from ..table import Channels

_CODES = {np.dtype(kind): code for code, kind in COMPONENTS.items()}
ARRAY_BUFFER, ELEMENT_ARRAY_BUFFER = 34962, 34963
_GLB_MAGIC = 0x46546C67


@dataclass(eq=False)
class GlbBuilder:
    """A glTF header and its one buffer, which grow together."""

    header: dict[str, Any]
    binary: bytearray = field(default_factory=bytearray)

    def append(self, key: str, entry: dict[str, Any]) -> int:
        """Index of a new entry of a list of the header."""
        entries: list[dict[str, Any]] = self.header.setdefault(key, [])
        entries.append(entry)
        return len(entries) - 1

    def bytes_view(self, data: bytes, **fields: Any) -> int:
        """Index of a new buffer view of `data`."""
        view = {"buffer": 0, "byteOffset": self.add(data), "byteLength": len(data), **fields}
        return self.append("bufferViews", view)

    def accessor(self, array: npt.NDArray[Any], target: int = ARRAY_BUFFER, **fields: Any) -> int:
        """Index of a new accessor of scalars (n,) or vectors (n, 2 to 4), little-endian."""
        view = self.bytes_view(array.tobytes(), target=target)
        kind = "SCALAR" if array.ndim == 1 else f"VEC{array.shape[1]}"
        stored = {"bufferView": view, "componentType": _CODES[array.dtype], "count": len(array), "type": kind}
        return self.append("accessors", stored | fields)

    def describe_bake(self, record: str) -> None:
        """Store the record of a bake in place of an earlier one. Args: record: as of `Channels`, none if empty."""
        extras = self.header["asset"].setdefault("extras", {})
        if isinstance(extras, dict):  # else they are no table of names
            extras.pop(RECORD, None)
            extras |= {RECORD: record} if record else {}
        if extras == {}:
            del self.header["asset"]["extras"]

    def encode(self) -> bytes:
        """The GLB file."""
        self.header["buffers"] = [{"byteLength": len(self.binary)}]
        content = json.dumps(self.header, separators=(",", ":")).encode("ascii")
        content += b" " * (-len(content) % 4)
        binary = self.binary + b"\0" * (-len(self.binary) % 4)
        chunks = struct.pack("<II", len(content), JSON_CHUNK) + content
        chunks += struct.pack("<II", len(binary), BIN_CHUNK) + binary
        return struct.pack("<III", _GLB_MAGIC, 2, 12 + len(chunks)) + chunks

    def add(self, data: bytes) -> int:
        """Offset of `data` in the buffer, aligned as every component type needs."""
        self.binary += b"\0" * (-len(self.binary) % 4)
        offset = len(self.binary)
        self.binary += data
        return offset

    def annotate(
        self, primitive: dict[str, Any], bake: Bake, vertices: AnyInts, shown: Channels, stored: npt.NDArray[Any] | None
    ) -> None:
        """Give a primitive a bake of its vertices, floats, and the profile in 16 bits, four columns an attribute.

        Args: vertices: of the bake, which it has. stored: (n, 3 or 4), of the other channels of `COLOR_0`; None: white,
            8 bits.
        """
        attributes = primitive["attributes"]
        w = bake.w[vertices]
        profile = bake.profile
        for name in [name for name in attributes if name.startswith("_" if shown.alone else LEFT[W])]:
            del attributes[name]
        known = known_columns(bake)
        for name, values in {"w": known["w"]}.items() if shown.alone else known.items():
            attributes[LEFT[BAKED[name]]] = self.accessor(values[vertices].astype("<f4"))
        if shown.colors:
            attributes["COLOR_0"] = self._colors(w, shown.colors, stored)
        if profile is None:
            return
        for number, start in enumerate(range(0, len(profile.half_distances), 4)):
            columns = profile.values[vertices, start : start + 4]
            codes = np.zeros((len(vertices), 4), "<u2")
            codes[:, : columns.shape[1]] = np.rint(columns * np.float32(65535))
            attributes[f"{PROFILE}{number}"] = self.accessor(codes, normalized=True)
        self.header["accessors"][attributes[f"{PROFILE}0"]]["extras"] = profile.lengths

    def _colors(self, w: Float64s, channels: str, stored: npt.NDArray[Any] | None) -> int:
        """Index of an accessor of `COLOR_0` with w in some channels, the rest as `stored` or at its most."""
        kind = np.dtype(np.uint8) if stored is None else stored.dtype
        largest = 1 if kind.kind == "f" else np.iinfo(kind).max
        colors = np.full((len(w), 4), largest, kind)
        if stored is not None:
            colors[:, : stored.shape[1]] = stored
        level = np.clip(w, 0, 1) * largest
        colors[:, ["rgba".index(letter) for letter in channels]] = (level if largest == 1 else np.rint(level))[:, None]
        return self.accessor(colors, **({} if largest == 1 else {"normalized": True}))
