"""Compressed geometry in glTF: it is not decoded; plain data beside it are read and kept.

Format: Khronos glTF extensions KHR_draco_mesh_compression (of primitives), EXT_meshopt_compression and
KHR_meshopt_compression (of buffer views).
"""

from typing import Any

from .records import BufferView, GltfGeometry

DRACO = "KHR_draco_mesh_compression"
MESHOPT = ("EXT_meshopt_compression", "KHR_meshopt_compression")


def compressions(geometry: GltfGeometry) -> str:
    """The compressions that a file says it uses, for messages; empty if none."""
    named = {*geometry.extensionsUsed, *geometry.extensionsRequired}
    used = [name for name in (DRACO, *MESHOPT) if name in named]
    return ", ".join(used) + ", which is not decoded" if used else ""


def must_be_decoded(geometry: GltfGeometry, view: BufferView) -> bool:
    """Whether a buffer view has compressed data, and the file does not promise plain ones beside them."""
    return any(name in view.extensions for name in MESHOPT if name in geometry.extensionsRequired)


def keep_plain_data(header: dict[str, Any]) -> None:
    """Take compressed data out of a document wherever it has the plain data too."""
    for view in header.get("bufferViews", []):
        for name in MESHOPT:
            _remove(view, name)
    left = False
    for primitive in (piece for mesh in header.get("meshes", []) for piece in mesh["primitives"]):
        numbers = [*primitive["attributes"].values(), *([primitive["indices"]] if "indices" in primitive else [])]
        accessors = [header["accessors"][number] for number in numbers if number < len(header.get("accessors", []))]
        if all("bufferView" in accessor for accessor in accessors):
            _remove(primitive, DRACO)
        left |= DRACO in primitive.get("extensions", {})
    for key in ("extensionsUsed", "extensionsRequired"):
        names = [name for name in header.get(key, []) if name not in MESHOPT and (left or name != DRACO)]
        if names:
            header[key] = names
        else:
            header.pop(key, None)


def _remove(entry: dict[str, Any], name: str) -> None:
    extensions = entry.get("extensions", {})
    extensions.pop(name, None)
    if not extensions:
        entry.pop("extensions", None)
