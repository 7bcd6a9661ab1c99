"""A binary glTF with baked textures as its materials' occlusion textures, by the coordinates they were baked for."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from ao.texture.result import BakedTexture
from raytrace.errors import MeshError
from raytrace.image.encode import linear_png
from raytrace.types import AnyFloats, Float64s, Int64s

from ..load import MeshFile
from ..primitive_groups import primitive_groups
from .accessors import flipped, normalized, triangles, values
from .asset import Gltf
from .builder import ARRAY_BUFFER, ELEMENT_ARRAY_BUFFER, GlbBuilder
from .occlusion import OWN, OcclusionTextures, add_coordinates, free_set
from .orm import OrmTextures
from .parse import parse
from .records import WRAP, Primitive
from .write import document, write_ramp

_SAME = 1e-6  # of texture coordinates that float32 has rounded
_KINDS = {"SCALAR", "VEC2", "VEC3", "VEC4"}


def textured_glb(
    mesh_file: MeshFile,
    pages: Sequence[BakedTexture],
    replace: bool = False,
    orm: bool = False,
    w: AnyFloats | None = None,
) -> tuple[bytes, int]:
    """A GLB file of a mesh file, with 8 bits of w a texel, and how many primitives keep another occlusion texture.

    A glTF source is kept as stored, as by `write.glb`; what was no glTF becomes one. Coordinates of a page that a
    primitive has not become a set of its own: vertices whose corners differ there are stored several times.

    Args:
        pages: textures of different faces. replace: put them also in place of occlusion textures of the source.
        orm: put w into R of the materials' metallic-roughness images (`scenes.formats.gltf.orm`).
        w: (n,) of the vertices, for primitives that are on no page: a ramp shows it.

    Raises: InputError: as `check_orm`, with `orm`; malformed materials or values; coordinates too large for float32.
    """
    builder, drawn = document(mesh_file, None)
    before = Gltf(mesh_file.path, builder.header, [bytes(builder.binary)])
    textures = OcclusionTextures(builder, replace)
    if orm:
        textures = OrmTextures(builder, mesh_file.gltf, [page.w for page in pages], replace)
    numbers = list(range(len(pages)))
    if not orm:
        codes = [np.rint(np.clip(page.w, 0, 1) * 255).astype(np.uint8)[:, :, None] for page in pages]
        numbers = [textures.add(linear_png(each), f"{OWN} occlusion", wrapS=WRAP, wrapT=WRAP) for each in codes]
    rest, kept = [], 0
    for (primitive, vertices), piece in zip(drawn, primitive_groups(mesh_file), strict=True):
        texture = next((k for k, page in enumerate(pages) if not np.isnan(page.uv[piece.faces]).any()), None)
        if not textures.materials(primitive):
            kept += 1
        elif texture is None:
            rest.append((primitive, vertices))
        else:
            record = parse(Primitive, primitive, before.path)
            faces, uv = triangles(before, record, len(vertices)).astype(np.int64), pages[texture].uv[piece.faces]
            if not np.array_equal(vertices[faces], mesh_file.mesh.faces[piece.faces]):  # mirrored, and turned over
                uv = uv[:, ::-1]
            number = _set_of(before, record, faces, uv)
            if number is None:
                number = free_set(builder.header, primitive)
                split_vertices(builder, before, primitive, number, faces, uv)
            textures.give(primitive, numbers[texture], number)
    textures.apply()
    if w is not None:
        write_ramp(builder, [(primitive, w[vertices]) for primitive, vertices in rest], replace)
    return builder.encode(), kept


def _set_of(asset: Gltf, primitive: Primitive, faces: Int64s, uv: Float64s) -> int | None:
    """Number of the set of a primitive that holds the coordinates `uv` (t, 3, 2), or None."""
    for name in (name for name in primitive.attributes if name.startswith("TEXCOORD_")):
        found = normalized(values(asset, primitive.attributes[name], "VEC2"))[faces] * (1, -1) + (0, 1)
        if np.allclose(found, uv, _SAME, _SAME):
            return int(name.removeprefix("TEXCOORD_"))
    return None


def split_vertices(
    builder: GlbBuilder, asset: Gltf, primitive: dict[str, Any], number: int, faces: Int64s, uv: Float64s
) -> None:
    """Give a primitive the set TEXCOORD_`number`, uv (t, 3, 2), with a vertex for each place that one has there."""
    rounded = uv.reshape(-1, 2).astype("<f4")
    keys = np.empty(len(rounded), [("vertex", "<i8"), ("u", "<f4"), ("v", "<f4")])
    keys["vertex"], keys["u"], keys["v"] = faces.ravel(), rounded[:, 0], rounded[:, 1]
    kinds, first, corners = np.unique(keys, return_index=True, return_inverse=True)
    for attributes in (primitive["attributes"], *primitive.get("targets", [])):
        for name, accessor in attributes.items():
            attributes[name] = _taken(builder, asset, accessor, kinds["vertex"])
    add_coordinates(builder, primitive, number, flipped(rounded[first]))
    primitive["indices"] = builder.accessor(corners.ravel().astype("<u4"), ELEMENT_ARRAY_BUFFER)
    primitive.pop("mode", None)


def _taken(builder: GlbBuilder, asset: Gltf, number: int, rows: Int64s) -> int:
    """Index of a new accessor of some rows of another."""
    old = asset.header["accessors"][number]
    if old["type"] not in _KINDS:
        raise MeshError(asset.path, f"accessors[{number}]", "a number or vector a vertex", old["type"])
    taken = np.ascontiguousarray(values(asset, number, old["type"])[rows])
    size = taken.shape[1] * taken.dtype.itemsize
    stride = -(-size // 4) * 4
    padded: npt.NDArray[np.uint8] = np.zeros((len(rows), stride), np.uint8)
    padded[:, :size] = taken.view(np.uint8).reshape(len(rows), size)
    made = {key: old[key] for key in ("componentType", "type", "normalized", "name", "extras") if key in old}
    strided = {"byteStride": stride} if stride != size else {}
    view = builder.bytes_view(padded.tobytes(), target=ARRAY_BUFFER, **strided)
    made |= {"bufferView": view, "count": len(rows)}
    if "min" in old:
        made |= {"min": taken.min(axis=0).tolist(), "max": taken.max(axis=0).tolist()}
    return builder.append("accessors", made)
