"""A binary glTF with a baked texture as its materials' occlusion texture, by the coordinates that it was baked for."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from ao.texture.result import BakedTexture
from raytrace.errors import MeshError
from raytrace.image.encode import linear_png
from raytrace.types import Float64s, Int64s

from ..gltf.accessors import values
from ..gltf.container import TRIANGLE_STRIP, Gltf, encode_glb
from ..gltf.glb_buffer import ARRAY_BUFFER, ELEMENT_ARRAY_BUFFER, UNSIGNED_INT, Packed
from ..gltf.occlusion import OWN, OcclusionTextures, add_coordinates, free_set
from ..readers.load import MeshFile
from ..writers.glb import stored
from ..writers.plain_glb import groups, plain
from .orm import OrmTextures

_REPEAT = 10497
_KINDS = {"SCALAR", "VEC2", "VEC3", "VEC4"}


def textured_glb(
    mesh_file: MeshFile, baked: BakedTexture, uv: int | Float64s, replace: bool = False, orm: bool = False
) -> tuple[bytes, int]:
    """A GLB file of a mesh file, with 8 bits of w a texel, and how many primitives keep another occlusion texture.

    A glTF source is kept as stored, as by `scenes.writers.glb`; what was no glTF becomes one.

    Args:
        uv: number of the set of texture coordinates that `baked` is for, or coordinates (m, 3, 2) of all faces, v
            upwards, which become a set of their own: vertices whose corners differ are stored several times.
        replace: put the texture also in place of occlusion textures of the source.
        orm: put w into R of the materials' metallic-roughness images, by the set of `uv` (`scenes.textures.orm`).

    Raises:
        MeshError, SceneError, InputError: as `check_orm`, with `orm`.
        MeshError: the source's materials or values are malformed.
        OptionError: coordinates of vertices that are too large for float32.
    """
    asset = mesh_file.gltf
    packed, drawn = stored(asset, mesh_file.parts) if asset else plain(mesh_file, False)
    textures = OrmTextures(packed, asset, baked.w, replace) if orm else OcclusionTextures(packed, replace)
    texture, kept = -1, 0
    if not orm:
        codes = np.rint(np.clip(baked.w, 0, 1) * 255).astype(np.uint8)
        texture = textures.add(linear_png(codes[:, :, None]), f"{OWN} occlusion", wrapS=_REPEAT, wrapT=_REPEAT)
    for (primitive, vertices), faces in zip(drawn, _faces(mesh_file), strict=True):
        if not textures.takes(primitive):
            kept += 1
            continue
        if isinstance(uv, int):
            number = uv
        else:
            number = free_set(packed.header, primitive)
            asset_now = Gltf(mesh_file.path, packed.header, (bytes(packed.binary),))
            triangles = _triangles(asset_now, primitive)
            as_stored = np.array_equal(vertices[triangles], mesh_file.mesh.faces[faces])  # or mirrored, and turned over
            corners = uv[faces] if as_stored else uv[faces][:, ::-1]
            split_vertices(packed, asset_now, primitive, number, triangles, corners)
        textures.give(primitive, texture, number)
    textures.apply()
    packed.header["buffers"] = [{"byteLength": len(packed.binary)}]
    return encode_glb(packed.header, bytes(packed.binary)), kept


def split_vertices(
    packed: Packed, asset: Gltf, primitive: dict[str, Any], number: int, triangles: Int64s, uv: Float64s
) -> None:
    """Give a primitive the set TEXCOORD_`number`, with a vertex for each place that one of its vertices has there.

    Args: asset: the document as it is. triangles: (t, 3), rows of its vertices. uv: (t, 3, 2), v upwards.
    """
    rounded = uv.reshape(-1, 2).astype("<f4")
    keys = np.empty(len(rounded), [("vertex", "<i8"), ("u", "<f4"), ("v", "<f4")])
    keys["vertex"], keys["u"], keys["v"] = triangles.ravel(), rounded[:, 0], rounded[:, 1]
    kinds, corners = np.unique(keys, return_inverse=True)
    for attributes in (primitive["attributes"], *primitive.get("targets", [])):
        for name, accessor in attributes.items():
            attributes[name] = _taken(packed, asset, accessor, kinds["vertex"])
    downwards = np.stack([kinds["u"], np.float32(1) - kinds["v"]], axis=1)
    add_coordinates(packed, primitive, number, downwards)
    indices = corners.ravel().astype("<u4")
    primitive["indices"] = packed.accessor(indices, UNSIGNED_INT, "SCALAR", ELEMENT_ARRAY_BUFFER)
    primitive.pop("mode", None)


def _taken(packed: Packed, asset: Gltf, number: int, rows: Int64s) -> int:
    """Index of a new accessor of some rows of another."""
    old = asset.header["accessors"][number]
    if old["type"] not in _KINDS:
        raise MeshError(asset.path, f"accessors[{number}]", "a number or vector a vertex", old["type"])
    taken = np.ascontiguousarray(values(asset, number, old["type"])[rows])
    size = taken.shape[1] * taken.dtype.itemsize
    stride = -(-size // 4) * 4
    padded: npt.NDArray[np.uint8] = np.zeros((len(rows), stride), np.uint8)
    padded[:, :size] = taken.view(np.uint8).reshape(len(rows), size)
    made = {key: old[key] for key in ("componentType", "type", "normalized", "name") if key in old}
    view = packed.bytes_view(
        padded.tobytes(), target=ARRAY_BUFFER, **({"byteStride": stride} if stride != size else {})
    )
    made |= {"bufferView": view, "count": len(rows)}
    if "min" in old:
        made |= {"min": taken.min(axis=0).tolist(), "max": taken.max(axis=0).tolist()}
    packed.header["accessors"].append(made)
    return len(packed.header["accessors"]) - 1


def _faces(mesh_file: MeshFile) -> Iterator[Int64s]:
    """The faces of the mesh that each primitive draws, in the order in which `stored` and `plain` list them."""
    if mesh_file.gltf:
        for part in mesh_file.parts:
            yield np.arange(part.faces.start, part.faces.stop)
    else:
        yield from (group.faces for group in groups(mesh_file))


def _triangles(asset: Gltf, primitive: dict[str, Any]) -> Int64s:
    """The triangles (t, 3) of a primitive, as `scenes.gltf.instances` reads them."""
    if "indices" in primitive:
        corners = values(asset, primitive["indices"], "SCALAR").ravel().astype(np.int64)
    else:
        corners = np.arange(asset.header["accessors"][primitive["attributes"]["POSITION"]]["count"])
    if primitive.get("mode") != TRIANGLE_STRIP:
        return corners.reshape(-1, 3)
    faces = np.stack([corners[:-2], corners[1:-1], corners[2:]], axis=1)
    faces[1::2] = faces[1::2, ::-1]
    return faces
