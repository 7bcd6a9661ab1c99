"""The arrays of a glTF file.

Of arrays that meshopt has compressed, which are not decoded, plain data beside them are read and kept
(EXT_meshopt_compression, KHR_meshopt_compression). Format: Khronos glTF 2.0 specification, sections 3.6 and 3.11.
"""

from typing import Any

import numpy as np
import numpy.typing as npt

from obscurance.raytrace.errors import MeshError
from obscurance.raytrace.types import Float64s

from ...geometry.polygons import strip_triangles
from .asset import MESHOPT, Gltf, entry
from .records import TRIANGLE_FAN, TRIANGLE_STRIP, Primitive, Sparse

COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
COLUMNS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
_ZEROS, _GROWTH = 1 << 22, 16  # values of an accessor without a base, and more of them a byte of the file


def view_bytes(asset: Gltf, number: int) -> memoryview:
    """The bytes of a buffer view, without a copy. Raises: ValueError: it reaches beyond its buffer."""
    view = entry(asset.geometry.bufferViews, number, "bufferViews")
    buffer = entry(asset.buffers, view.buffer, "buffers")
    data = memoryview(buffer)[view.byteOffset : view.byteOffset + view.byteLength]
    if len(data) < view.byteLength:
        raise ValueError(f"bufferViews[{number}] reaches beyond its buffer")
    return data


def values(asset: Gltf, number: int, *kinds: str) -> npt.NDArray[Any]:
    """The values of an accessor as stored, (count, columns) and read-only, without a copy unless they are sparse.

    Raises: MeshError: it is compressed, empty or of another type. ValueError: it is not there, or not all of it.
    """
    accessor = entry(asset.geometry.accessors, number, "accessors")
    field = f"accessors[{number}]"
    count = accessor.count
    sparse = accessor.sparse
    if min(count, sparse.count if sparse else 1) < 1:
        raise MeshError(asset.path, field, "a count of at least 1", 0)
    if accessor.type not in kinds or accessor.componentType not in COMPONENTS:
        got = f"{accessor.type} of {accessor.componentType}"
        raise MeshError(asset.path, field, f"{kinds[0]} of a component type", got)
    item = np.dtype(COMPONENTS[accessor.componentType])
    columns = COLUMNS[accessor.type]
    if accessor.bufferView is not None:
        base = _rows(asset, accessor.bufferView, accessor.byteOffset, (count, columns), item, field)
    elif sparse is None and asset.compressions:
        raise MeshError(asset.path, field, "uncompressed values", asset.compressions)
    elif count * columns > _ZEROS + _GROWTH * sum(map(len, asset.buffers)):
        raise MeshError(asset.path, field, "a count that the file's bytes can hold", count)
    else:
        base = np.zeros((count, columns), item)
    return base if sparse is None else _replaced(asset, base, sparse, f"{field}.sparse")


def _replaced(asset: Gltf, base: npt.NDArray[Any], sparse: Sparse, field: str) -> npt.NDArray[Any]:
    """The values of a sparse accessor (section 3.6.2.3)."""
    index = np.dtype(COMPONENTS.get(sparse.index_type, "<f4"))
    at = f"{field}.indices"
    indices = _rows(asset, sparse.index_view, sparse.index_offset, (sparse.count, 1), index, at).ravel()
    if index.kind != "u" or indices.max() >= len(base):
        raise MeshError(asset.path, at, f"whole numbers below {len(base)}", "others")
    replaced = base.copy()
    shape = sparse.count, base.shape[1]
    replaced[indices] = _rows(asset, sparse.view, sparse.offset, shape, base.dtype, f"{field}.values")
    replaced.flags.writeable = False
    return replaced


def _rows(
    asset: Gltf, number: int, start: int, shape: tuple[int, int], item: np.dtype[Any], field: str
) -> npt.NDArray[Any]:
    """Rows from byte `start` of a buffer view on: a view of its bytes."""
    view = entry(asset.geometry.bufferViews, number, "bufferViews")
    # Compressed data, and no promise of plain ones beside them:
    if any(name in view.extensions for name in MESHOPT if name in asset.geometry.extensionsRequired):
        raise MeshError(asset.path, field, "uncompressed values", asset.compressions)
    data = view_bytes(asset, number)
    row = shape[1] * item.itemsize
    stride = view.byteStride or row
    if stride < row or start + (shape[0] - 1) * stride + row > len(data):
        raise ValueError(f"{field} does not fit into its buffer view")
    return np.ndarray(shape, item, data, start, (stride, item.itemsize))


def normalized(stored: npt.NDArray[Any]) -> Float64s:
    """c / (2^bits − 1) of unsigned, max(c / (2^(bits−1) − 1), −1) of signed integers (section 3.11); floats stay."""
    if stored.dtype.kind == "f":
        return stored.astype(np.float64)
    return np.maximum(stored / np.iinfo(stored.dtype).max, -1.0)


def vectors(asset: Gltf, number: int) -> npt.NDArray[Any]:
    """Vectors (n, 3), fractions where the accessor says that its integers are. Raises: as `values`."""
    stored = values(asset, number, "VEC3")
    return normalized(stored) if asset.geometry.accessors[number].normalized else stored


def flipped(uv: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Texture coordinates (n, 2) with v reversed: glTF's v goes downwards."""
    return np.stack([uv[:, 0], 1 - uv[:, 1]], axis=1)


def triangles(asset: Gltf, primitive: Primitive, count: int) -> npt.NDArray[Any]:
    """The faces (m, 3) of a primitive of so many vertices. Raises: MeshError: corners are left over."""
    corners: npt.NDArray[Any] = np.arange(count)
    if primitive.indices is not None:
        corners = values(asset, primitive.indices, "SCALAR").ravel()
    if primitive.mode == TRIANGLE_STRIP:
        return strip_triangles(corners, np.array([len(corners)]))
    if primitive.mode == TRIANGLE_FAN:
        return np.stack([np.repeat(corners[0], max(len(corners) - 2, 0)), corners[1:-1], corners[2:]], axis=1)
    if len(corners) % 3:
        raise MeshError(asset.path, "indices", "three for each triangle", len(corners))
    return corners.reshape(-1, 3)


def column(asset: Gltf, primitive: Primitive, name: str, *kinds: str) -> Float64s | None:
    """An attribute of a primitive's vertices, or None. Raises: ValueError: not finite, or not one for each."""
    number = primitive.attributes.get(name)
    if number is None:
        return None
    count = entry(asset.geometry.accessors, primitive.attributes["POSITION"], "accessors").count
    numbers = normalized(values(asset, number, *kinds))
    if len(numbers) != count:
        raise MeshError(asset.path, name, f"{count} rows", len(numbers))
    if not np.isfinite(numbers).all():
        raise MeshError(asset.path, name, "finite numbers", "others")
    return numbers


def stored_colors(asset: Gltf, attributes: dict[str, int], count: int) -> npt.NDArray[Any] | None:
    """`COLOR_0` of `count` vertices as stored, (count, 3 or 4), or None. Raises: MeshError: it is malformed."""
    if "COLOR_0" not in attributes:
        return None
    try:
        colors = values(asset, attributes["COLOR_0"], "VEC3", "VEC4")
    except ValueError as reason:
        raise MeshError(asset.path, "COLOR_0", "three or four numbers a vertex", reason) from None
    if len(colors) != count:
        raise MeshError(asset.path, "COLOR_0", f"{count} rows", len(colors))
    return colors
