"""Primitives compressed by Draco, decoded by DracoPy (the extra `formats`). Format: KHR_draco_mesh_compression."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from obscurance.raytrace.errors import MeshError
from obscurance.raytrace.system.checks import check_memory

from .accessors import COLUMNS, COMPONENTS, view_bytes
from .asset import Gltf, entry
from .records import Accessor, Primitive


def decompressed(asset: Gltf) -> Gltf:
    """The asset with a further buffer of the values that accessors of compressed primitives lack.

    Raises: MeshError: what is decoded is of another size than the accessor says. ModuleNotFoundError: no DracoPy.
    Exception: of DracoPy.
    """
    geometry, header = asset.geometry, asset.header
    plain = bytearray()
    filled: set[int] = set()
    for mesh in geometry.meshes:
        for primitive in mesh.primitives:
            if primitive.draco is None:
                continue
            numbers = {
                name: number for name, number in primitive.attributes.items() if name in primitive.draco_attributes
            }
            accessors = {number: entry(geometry.accessors, number, "accessors") for number in numbers.values()}
            if all(accessor.bufferView is not None for accessor in accessors.values()):
                continue  # plain values beside the compressed ones
            for number, values in _decoded(asset, primitive, numbers).items():
                if number in filled:
                    continue
                filled.add(number)
                stored = _stored(asset, number, entry(geometry.accessors, number, "accessors"), values)
                plain += b"\0" * (-len(plain) % 4)
                view = {"buffer": len(asset.buffers), "byteOffset": len(plain), "byteLength": stored.nbytes}
                plain += stored.tobytes()
                table = header["accessors"][number]
                table.pop("byteOffset", None)
                rows = stored.reshape(len(stored), -1)  # which are rounded, and so are their bounds
                table |= {bound: getattr(rows, bound)(axis=0).tolist() for bound in ("min", "max") if bound in table}
                table["bufferView"] = len(header["bufferViews"])
                header["bufferViews"].append(view)
    if not filled:
        return asset
    header["buffers"].append({"byteLength": len(plain)})
    return Gltf(asset.path, header, [*asset.buffers, bytes(plain)])


def _decoded(asset: Gltf, primitive: Primitive, numbers: dict[str, int]) -> dict[int, npt.NDArray[Any]]:
    """Values by the number of their accessor, of the attributes `numbers` and of the indices."""
    import DracoPy

    assert primitive.draco is not None
    if primitive.indices is None:
        raise MeshError(asset.path, "indices", "an accessor of a compressed primitive's", "none")
    accessors = [
        entry(asset.geometry.accessors, number, "accessors") for number in (*numbers.values(), primitive.indices)
    ]
    count = sum(accessor.count for accessor in accessors)
    check_memory(asset.path, 64 * count, f"to decode {count:,} vectors and indices")
    mesh = DracoPy.decode(bytes(view_bytes(asset, primitive.draco)))
    values = {primitive.indices: np.ravel(mesh.faces)}
    for name, number in numbers.items():
        values[number] = np.asarray(mesh.get_attribute_by_unique_id(primitive.draco_attributes[name])["data"])
    return values


def _stored(asset: Gltf, number: int, accessor: Accessor, values: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Decoded values in the type of their accessor. Raises: MeshError: there are more or fewer."""
    field = f"accessors[{number}]"
    if accessor.componentType not in COMPONENTS or accessor.type not in COLUMNS:
        raise MeshError(
            asset.path, field, "a type and a component type", f"{accessor.type} of {accessor.componentType}"
        )
    if values.size != accessor.count * COLUMNS[accessor.type] or len(values) != accessor.count:
        raise MeshError(asset.path, field, f"{accessor.count} {accessor.type}, compressed", f"shape {values.shape}")
    return values.astype(COMPONENTS[accessor.componentType])
