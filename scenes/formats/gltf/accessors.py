"""The arrays of a glTF file, and the triangles that its scene draws, with the transforms of their nodes.

Of compressed arrays, which are not decoded, plain data beside them are read and kept (KHR_draco_mesh_compression,
EXT_meshopt_compression, KHR_meshopt_compression). Format: Khronos glTF 2.0 specification, sections 3.6, 3.7 and 3.11.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from raytrace.errors import MeshError
from raytrace.types import Float64s

from ...geometry.instances import Instance, check_copies
from ..table import MeshInput
from .asset import MESHOPT, Gltf, decode, entry
from .records import PROFILE, TRIANGLE_STRIP, Primitive, Sparse

if TYPE_CHECKING:
    from ao import Profile

COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_COLUMNS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
_COPIES = "EXT_mesh_gpu_instancing"
_ZEROS, _GROWTH = 1 << 22, 16  # values of a sparse accessor without a base, and more of them a byte of the file


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
    accessor, field = entry(asset.geometry.accessors, number, "accessors"), f"accessors[{number}]"
    count, sparse = accessor.count, accessor.sparse
    if min(count, sparse.count if sparse else 1) < 1:
        raise MeshError(asset.path, field, "a count of at least 1", 0)
    if accessor.type not in kinds or accessor.componentType not in COMPONENTS:
        got = f"{accessor.type} of {accessor.componentType}"
        raise MeshError(asset.path, field, f"{kinds[0]} of a component type", got)
    item, columns = np.dtype(COMPONENTS[accessor.componentType]), _COLUMNS[accessor.type]
    if accessor.bufferView is not None:
        base = _rows(asset, accessor.bufferView, accessor.byteOffset, (count, columns), item, field)
    elif sparse is None:
        raise MeshError(asset.path, field, "uncompressed values", asset.compressions or "no data")
    elif count * columns > _ZEROS + _GROWTH * sum(map(len, asset.buffers)):
        raise MeshError(asset.path, field, "a count that the file's bytes can hold", count)
    else:
        base = np.zeros((count, columns), item)
    return base if sparse is None else _replaced(asset, base, sparse, f"{field}.sparse")


def _replaced(asset: Gltf, base: npt.NDArray[Any], sparse: Sparse, field: str) -> npt.NDArray[Any]:
    """The values of a sparse accessor (section 3.6.2.3)."""
    index = np.dtype(COMPONENTS.get(sparse.index_type, "<f4"))
    at = f"{field}.indices"
    places = _rows(asset, sparse.index_view, sparse.index_offset, (sparse.count, 1), index, at).ravel()
    if index.kind != "u" or places.max() >= len(base):
        raise MeshError(asset.path, at, f"whole numbers below {len(base)}", "others")
    made = base.copy()
    shape = sparse.count, base.shape[1]
    made[places] = _rows(asset, sparse.view, sparse.offset, shape, base.dtype, f"{field}.values")
    made.flags.writeable = False
    return made


def _rows(
    asset: Gltf, number: int, start: int, shape: tuple[int, int], item: np.dtype[Any], field: str
) -> npt.NDArray[Any]:
    """Rows from byte `start` of a buffer view on: a view of its bytes."""
    view = entry(asset.geometry.bufferViews, number, "bufferViews")
    # Compressed data, and no promise of plain ones beside them:
    if any(name in view.extensions for name in MESHOPT if name in asset.geometry.extensionsRequired):
        raise MeshError(asset.path, field, "uncompressed values", asset.compressions)
    data, row = view_bytes(asset, number), shape[1] * item.itemsize
    stride = view.byteStride or row
    if stride < row or start + (shape[0] - 1) * stride + row > len(data):
        raise ValueError(f"{field} does not fit into its buffer view")
    return np.ndarray(shape, item, data, start, (stride, item.itemsize))


def normalized(stored: npt.NDArray[Any]) -> Float64s:
    """c / (2^bits − 1) of unsigned, max(c / (2^(bits−1) − 1), −1) of signed integers (section 3.11); floats stay."""
    if stored.dtype.kind == "f":
        return stored.astype(np.float64)
    return np.maximum(stored / np.iinfo(stored.dtype).max, -1.0)


def flipped(uv: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Texture coordinates (n, 2) with v the other way: glTF's goes downwards."""
    return np.stack([uv[:, 0], 1 - uv[:, 1]], axis=1)


def triangles(asset: Gltf, primitive: Primitive, count: int) -> npt.NDArray[Any]:
    """The faces (m, 3) of a primitive of so many vertices."""
    corners: npt.NDArray[Any] = np.arange(count)
    if primitive.indices is not None:
        corners = values(asset, primitive.indices, "SCALAR").ravel()
    if primitive.mode != TRIANGLE_STRIP:
        return corners.reshape(-1, 3)
    faces = np.stack([corners[:-2], corners[1:-1], corners[2:]], axis=1) if len(corners) > 2 else corners[:0, None]
    faces[1::2] = faces[1::2, ::-1]
    return faces.reshape(-1, 3)


def column(asset: Gltf, primitive: Primitive, name: str, *kinds: str) -> Float64s | None:
    """An attribute of a primitive's vertices, or None. Raises: ValueError: not finite, or not one for each."""
    number = primitive.attributes.get(name)
    if number is None:
        return None
    count = entry(asset.geometry.accessors, primitive.attributes["POSITION"], "accessors").count
    found = normalized(values(asset, number, *kinds))
    if len(found) != count:
        raise MeshError(asset.path, name, f"{count} rows", len(found))
    if not np.isfinite(found).all():
        raise MeshError(asset.path, name, "finite numbers", "others")
    return found


def stored_colors(asset: Gltf, attributes: dict[str, int], count: int) -> npt.NDArray[Any] | None:
    """`COLOR_0` of `count` vertices as stored, (count, 3 or 4), or None. Raises: MeshError: it is malformed."""
    if "COLOR_0" not in attributes:
        return None
    try:
        found = values(asset, attributes["COLOR_0"], "VEC3", "VEC4")
    except ValueError as reason:
        raise MeshError(asset.path, "COLOR_0", "three or four numbers a vertex", reason) from None
    if len(found) != count:
        raise MeshError(asset.path, "COLOR_0", f"{count} rows", len(found))
    return found


def read_gltf(given: MeshInput) -> tuple[list[Instance], Gltf]:
    """The triangle primitives that a file draws, in the order of `Gltf.drawn`, sharing arrays by mesh, and its asset.

    Raises: ValueError: as `decode`, compressed values, very many copies, nodes that are no tree, no image with alpha.
    """
    asset = decode(given.file.read(), given.path)
    shapes: dict[tuple[int, int], Instance] = {}
    opacity_of = None
    materials = asset.header.get("materials", [])
    tables = [each for each in materials if isinstance(each, dict)] if isinstance(materials, list) else []
    if given.alpha and any(each.get("alphaMode", "OPAQUE") != "OPAQUE" for each in tables):  # opaque ones are not read
        from .textures import Textures
        from .textures import opacity_of as of

        opacity_of = partial(of, Textures(asset))
    rows = 0
    made = []
    for piece in asset.drawn:
        key = (piece.mesh, piece.place)
        if key not in shapes:
            shape = _shape(asset, piece.primitive)
            shapes[key] = replace(shape, opacity=opacity_of(piece.primitive, shape.faces)) if opacity_of else shape
        shape = shapes[key]
        rows += len(shape.vertices) + len(shape.faces)
        check_copies(rows, sum(map(len, asset.buffers)), asset.path)
        node, mesh = asset.geometry.nodes[piece.node], asset.geometry.meshes[piece.mesh]
        name = node.name or mesh.name or f"node {piece.node}"
        name = f"{name}[{piece.place}]" if len(mesh.primitives) > 1 else name
        drawn_once = f"{name} is drawn many times by {_COPIES}, which is not read: once here"
        notes = (drawn_once,) if _COPIES in node.extensions else ()
        made.append(replace(shape, name=name, matrix=asset.world[piece.node], notes=notes))
    return made, asset


def _shape(asset: Gltf, primitive: Primitive) -> Instance:
    """A primitive where its own frame has it."""
    attributes = primitive.attributes
    if "POSITION" not in attributes:
        raise ValueError("a primitive without POSITION")
    vertices = values(asset, attributes["POSITION"], "VEC3")
    if entry(asset.geometry.accessors, attributes["POSITION"], "accessors").normalized:
        vertices = normalized(vertices)
    normals = normalized(values(asset, attributes["NORMAL"], "VEC3")) if "NORMAL" in attributes else None
    faces = triangles(asset, primitive, len(vertices))
    w, profile = _stored_w(asset, attributes, len(vertices)), _stored_profile(asset, attributes, len(vertices))
    return Instance("", vertices, faces, normals, w=w, profile=profile, up="y")


def _stored_w(asset: Gltf, attributes: dict[str, int], count: int) -> npt.NDArray[Any] | None:
    """w of an earlier bake, unless the attribute of that name is something else."""
    if "_OBSCURANCE" not in attributes:
        return None
    try:
        w = values(asset, attributes["_OBSCURANCE"], "SCALAR").ravel()
    except ValueError:
        return None
    return w if len(w) == count and w.dtype.kind == "f" else None


def _stored_profile(asset: Gltf, attributes: dict[str, int], count: int) -> Profile | None:
    """The profile of an earlier bake, unless the attributes of these names are something else."""
    if f"{PROFILE}0" not in attributes:
        return None
    from ao import Profile

    try:
        extras = entry(asset.geometry.accessors, attributes[f"{PROFILE}0"], "accessors").extras
        lengths, radius = extras["half_distances"], extras["radius"]
        numbers = [attributes[f"{PROFILE}{number}"] for number in range(-(-len(lengths) // 4))]
        columns = np.hstack([normalized(values(asset, number, "VEC4")) for number in numbers])
    except (KeyError, TypeError, ValueError):
        return None
    return Profile.stored(lengths, columns[:, : len(lengths)], radius) if len(columns) == count else None
