"""The arrays of a glTF file.

Format: Khronos glTF 2.0 specification, sections 3.6 (buffers, views, accessors) and 3.11 (quantised values).
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from raytrace.errors import MeshError
from raytrace.types import Float64s

from .compression import compressions, must_be_decoded
from .container import Gltf

_COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_COLUMNS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
_ZEROS, _GROWTH = 1 << 22, 16  # values of a sparse accessor without others, and more of them a byte of the file


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
    """The values of an accessor as stored, (count, columns) and read-only, without a copy unless they are sparse.

    Args:
        kind: the type that it must have: SCALAR, VEC2, VEC3, VEC4.

    Raises:
        MeshError: an accessor that is compressed, empty or of another type.
        ValueError: it is missing, or reaches beyond its buffer view.
    """
    accessor = entry(asset, "accessors", number)

    def fault(expected: str, got: object) -> MeshError:
        return MeshError(asset.path, f"accessors[{number}]", expected, got)

    if accessor["count"] < 1:
        raise fault("a count of at least 1", accessor["count"])
    if accessor["type"] != kind or accessor["componentType"] not in _COMPONENTS:
        raise fault(f"{kind} of a component type", f"{accessor['type']} of {accessor['componentType']}")
    count, item = accessor["count"], np.dtype(_COMPONENTS[accessor["componentType"]])
    sparse = accessor.get("sparse")
    if "bufferView" in accessor:
        base = _rows(asset, accessor, count, item, _COLUMNS[kind], f"accessors[{number}]")
    elif sparse is None:
        raise fault("uncompressed values", compressions(asset.header) or "no data")
    elif count * _COLUMNS[kind] > _ZEROS + _GROWTH * sum(map(len, asset.buffers)):
        raise fault("a count that the file's bytes can hold", count)
    else:
        base = np.zeros((count, _COLUMNS[kind]), item)
    return base if sparse is None else _replaced(asset, base, sparse, f"accessors[{number}].sparse")


def _replaced(asset: Gltf, base: npt.NDArray[Any], sparse: dict[str, Any], field: str) -> npt.NDArray[Any]:
    """The values of a sparse accessor (section 3.6.2.3)."""
    index = np.dtype(_COMPONENTS.get(sparse["indices"]["componentType"], "<f4"))
    places = _rows(asset, sparse["indices"], sparse["count"], index, 1, f"{field}.indices").ravel()
    if index.kind != "u" or (len(places) and places.max() >= len(base)):
        raise MeshError(asset.path, f"{field}.indices", f"whole numbers below {len(base)}", "others")
    made = base.copy()
    made[places] = _rows(asset, sparse["values"], sparse["count"], base.dtype, base.shape[1], f"{field}.values")
    made.flags.writeable = False
    return made


def _rows(
    asset: Gltf, stored: dict[str, Any], count: int, item: np.dtype[Any], columns: int, field: str
) -> npt.NDArray[Any]:
    """So many rows of the buffer view that an accessor, or a part of a sparse one, refers to: a view of its bytes."""
    view = entry(asset, "bufferViews", stored["bufferView"])
    if must_be_decoded(asset.header, view):
        raise MeshError(asset.path, field, "uncompressed values", compressions(asset.header))
    start, data = stored.get("byteOffset", 0), view_bytes(asset, stored["bufferView"])
    row = columns * item.itemsize
    stride = view.get("byteStride", 0) or row
    if stride < row or start + (count - 1) * stride + row > len(data):
        raise ValueError(f"{field} does not fit into its buffer view")
    return np.ndarray((count, columns), item, data, start, (stride, item.itemsize))


def normalized(stored: npt.NDArray[Any]) -> Float64s:
    """c / (2^bits − 1) of unsigned, max(c / (2^(bits−1) − 1), −1) of signed integers (section 3.11); floats stay."""
    if stored.dtype.kind == "f":
        return stored.astype(np.float64)
    return np.maximum(stored / np.iinfo(stored.dtype).max, -1.0)
