"""The arrays of a glTF file.

Format: Khronos glTF 2.0 specification, sections 3.6 (buffers, views, accessors) and 3.11 (quantised values).
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from raytrace.errors import MeshError
from raytrace.types import Float64s

from .container import Gltf

_COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_COLUMNS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}


def entry(asset: Gltf, key: str, number: int) -> Any:
    """`header[key][number]`. Raises: ValueError: there is no such entry."""
    entries = asset.header.get(key, [])
    if number >= len(entries):
        raise ValueError(f"there is no {key}[{number}]")
    return entries[number]


def view_bytes(asset: Gltf, number: int) -> memoryview:
    """The bytes of a buffer view, without a copy. Raises: ValueError: it reaches beyond its buffer."""
    view = entry(asset, "bufferViews", number)
    if view["buffer"] >= len(asset.buffers):
        raise ValueError(f"there is no buffers[{view['buffer']}]")
    start = view.get("byteOffset", 0)
    data = memoryview(asset.buffers[view["buffer"]])[start : start + view["byteLength"]]
    if len(data) < view["byteLength"]:
        raise ValueError(f"bufferViews[{number}] reaches beyond its buffer")
    return data


def values(asset: Gltf, number: int, kind: str) -> npt.NDArray[Any]:
    """The values of an accessor as stored, (count, columns) and read-only, without a copy.

    Args:
        kind: the type that it must have: SCALAR, VEC2, VEC3, VEC4.

    Raises:
        MeshError: an accessor that is sparse, compressed, empty or of another type.
        ValueError: it is missing, or reaches beyond its buffer view.
    """
    accessor = entry(asset, "accessors", number)

    def fault(expected: str, got: object) -> MeshError:
        return MeshError(asset.path, f"accessors[{number}]", expected, got)

    if accessor["count"] < 1:
        raise fault("a count of at least 1", accessor["count"])
    if accessor["type"] != kind or accessor["componentType"] not in _COMPONENTS:
        raise fault(f"{kind} of a component type", f"{accessor['type']} of {accessor['componentType']}")
    if "sparse" in accessor:
        raise fault("plain values", "a sparse accessor, which is not supported")
    view = entry(asset, "bufferViews", accessor["bufferView"]) if "bufferView" in accessor else None
    if view is None or "EXT_meshopt_compression" in view.get("extensions", {}):
        raise fault("uncompressed values", ", ".join(map(str, asset.header.get("extensionsUsed", []))) or "no data")
    item = np.dtype(_COMPONENTS[accessor["componentType"]])
    row = _COLUMNS[kind] * item.itemsize
    stride = view.get("byteStride", 0) or row
    start, data = accessor.get("byteOffset", 0), view_bytes(asset, accessor["bufferView"])
    if stride < row or start + (accessor["count"] - 1) * stride + row > len(data):
        raise ValueError(f"accessors[{number}] does not fit into its buffer view")
    return np.ndarray((accessor["count"], _COLUMNS[kind]), item, data, start, (stride, item.itemsize))


def normalized(stored: npt.NDArray[Any]) -> Float64s:
    """c / (2^bits − 1) of unsigned, max(c / (2^(bits−1) − 1), −1) of signed integers (section 3.11); floats stay."""
    if stored.dtype.kind == "f":
        return stored.astype(np.float64)
    return np.maximum(stored / np.iinfo(stored.dtype).max, -1.0)
