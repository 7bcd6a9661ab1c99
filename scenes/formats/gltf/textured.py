"""A binary glTF with baked textures as its materials' occlusion textures, by the coordinates they were baked for."""

import copy
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

from obscurance.ao.texture.result import BakedTexture
from obscurance.ao.texture.uv_layout import on_page
from obscurance.raytrace.errors import MeshError
from obscurance.raytrace.types import AnyFloats, Float64s, Int64s

from ...asset.asset import Asset
from ...asset.primitive import Array
from ..load import parser_errors
from ..table import Channels
from .accessors import flipped, normalized, triangles, values
from .asset import Gltf
from .builder import ARRAY_BUFFER, ELEMENT_ARRAY_BUFFER, GlbBuilder
from .occlusion import OcclusionTextures, add_coordinates, free_set
from .orm import OrmTextures
from .records import Primitive, parse
from .write import document, write_ramp

_SAME = 1e-6  # of texture coordinates that float32 has rounded
_VECTORS = "SCALAR", "VEC2", "VEC3", "VEC4"
_RESTART = 65535  # in indices of 16 bits, no vertex (section 3.7.2.1)


def textured_glb(
    source: Asset,
    pages: Sequence[BakedTexture],
    replace: bool = False,
    orm: bool = False,
    w: AnyFloats | None = None,
    bake_record: str = "",
) -> tuple[bytes, list[str]]:
    """A GLB file of a mesh file, with 8 bits of w a texel, and warnings: lines for the user, mostly none.

    A glTF source is kept as stored, as by `write.glb`; what was no glTF becomes one. Coordinates of a page that a
    primitive has not become a set of its own: vertices whose corners differ there are stored several times.

    Args:
        pages: textures of different faces. replace: put them also in place of occlusion textures of the source.
        orm: put w into R of the materials' metallic-roughness images (`scenes.formats.gltf.orm`).
        w: (n,) of the vertices, for primitives that are on no page: a ramp shows it.
        bake_record: of the bake, as of `Channels`.

    Raises: InputError: malformed materials or values; coordinates too large for float32.
    """
    # The document without textures, and what puts these into its materials.
    builder, drawn = document(source, None, Channels(record=bake_record))
    asset = Gltf(source.path, builder.header, [bytes(builder.binary)])
    raw = source.raw if isinstance(source.raw, Gltf) else None
    textures = OrmTextures(builder, replace, asset=raw) if orm else OcclusionTextures(builder, replace)
    numbers = [textures.add_page(page.w) for page in pages]
    on_no_page: list[tuple[dict[str, Any], Int64s]] = []
    kept = 0
    # Each primitive: kept, on no page, or divided by its pages.
    for (primitive, vertices, _), run in zip(drawn, source.runs(), strict=True):
        on_pages = np.array([on_page(page.uv[run.faces]) for page in pages])
        if not textures.materials(primitive):
            kept += 1
        elif not on_pages.any(axis=0).all():
            on_no_page.append((primitive, vertices))
        else:
            record = parse(Primitive, primitive, asset.path)
            faces = triangles(asset, record, len(vertices)).astype(np.int64)
            is_turned = not np.array_equal(vertices[faces], source.mesh.faces[run.faces])  # mirrored: turned over
            for page, face_rows, piece in _by_page(builder, primitive, on_pages.argmax(axis=0)):
                uv = pages[page].uv[run.faces[face_rows], :: -1 if is_turned else 1]
                number = _set_of(asset, record, faces[face_rows], uv)
                if number is None:
                    number = free_set(builder.header, piece)
                    split_vertices(builder, asset, piece, number, faces[face_rows], uv)
                elif len(face_rows) < len(faces):
                    draw(builder, piece, faces[face_rows])
                textures.give(piece, numbers[page], number)
    textures.apply()
    if w is not None:
        write_ramp(builder, [(primitive, w[vertices]) for primitive, vertices in on_no_page], replace)
    lines = []
    if kept:
        advice = "so viewers do not show the bake there; --replace-occlusion replaces them"
        lines.append(f"keeps the file's own occlusion textures (primitives: {kept:,}), {advice}")
    if textures.apart:
        apart = f"in images apart from metallic-roughness textures ({len(textures.apart):,})"
        reason = "which have other coordinates, are moved by KHR_texture_transform, or are neither PNG nor JPEG"
        lines.append(f"has its occlusion {apart}, {reason}")
    return builder.encode(), lines


def check_vertices(source: Asset) -> None:
    """Read all attributes of the vertices that a glTF draws, which `take_vertices` reads after a bake.

    Raises: MeshError: one is malformed, has not a row for each vertex, or a number that is not finite.
    """
    asset = source.raw
    if not isinstance(asset, Gltf):
        return
    with parser_errors(asset.path):
        for drawn in {(drawn.mesh, drawn.primitive_number): drawn for drawn in asset.drawn}.values():
            attributes = drawn.primitive.attributes
            count = asset.geometry.accessors[attributes["POSITION"]].count
            for table in (attributes, *drawn.primitive.targets):
                for name, number in table.items():
                    stored = values(asset, number, *_VECTORS)
                    field = f"meshes[{drawn.mesh}].primitives[{drawn.primitive_number}].{name}"
                    if len(stored) != count:
                        raise MeshError(asset.path, field, f"{count} rows", len(stored))
                    if stored.dtype.kind == "f" and not np.isfinite(stored).all():
                        raise MeshError(asset.path, field, "finite numbers", "others")


def _by_page(
    builder: GlbBuilder, primitive: dict[str, Any], page_of: Int64s
) -> Iterator[tuple[int, Int64s, dict[str, Any]]]:
    """Split a primitive by the pages of its faces.

    Returns of each page the rows of the faces on it, and a primitive for them: itself, or a copy that is added to its
    mesh.

    Args:
        page_of: (t,), the page of each face.
    """
    mesh = next(mesh for mesh in builder.header["meshes"] if any(other is primitive for other in mesh["primitives"]))
    used = np.unique(page_of).tolist()
    pieces = [primitive, *(copy.deepcopy(primitive) for _ in used[1:])]
    mesh["primitives"] += pieces[1:]
    for page, piece in zip(used, pieces, strict=True):
        yield page, np.flatnonzero(page_of == page), piece


def draw(builder: GlbBuilder, primitive: dict[str, Any], corners: Int64s) -> None:
    """Let a primitive draw triangles with these vertices at their `corners`, of any shape."""
    kind = "<u2" if corners.max(initial=0) < _RESTART else "<u4"
    primitive["indices"] = builder.accessor(corners.ravel().astype(kind), ELEMENT_ARRAY_BUFFER)
    primitive.pop("mode", None)


def _set_of(asset: Gltf, primitive: Primitive, faces: Int64s, uv: Float64s) -> int | None:
    """Number of the set of a primitive that holds the coordinates `uv` (t, 3, 2), or None."""
    for name in primitive.attributes:
        if not name.startswith("TEXCOORD_"):
            continue
        stored = normalized(values(asset, primitive.attributes[name], "VEC2"))[faces] * (1, -1) + (0, 1)
        if np.allclose(stored, uv, _SAME, _SAME):
            return int(name.removeprefix("TEXCOORD_"))
    return None


def split_vertices(
    builder: GlbBuilder, asset: Gltf, primitive: dict[str, Any], number: int, faces: Int64s, uv: Float64s
) -> None:
    """Give a primitive the set TEXCOORD_`number`, uv (t, 3, 2), with a vertex for each place that one has there."""
    rounded = uv.reshape(-1, 2).astype("<f4")
    keys = np.column_stack([faces.ravel(), rounded])  # doubles, which hold both
    _, example, corners = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    take_vertices(builder, asset, primitive, faces.ravel()[example])
    add_coordinates(builder, primitive, number, flipped(rounded[example]))
    draw(builder, primitive, corners)


def take_vertices(builder: GlbBuilder, asset: Gltf, primitive: dict[str, Any], taken_rows: Int64s) -> None:
    """Give a primitive, and its morph targets, some rows of its own vertices."""
    change_vertices(builder, asset, primitive, lambda name, stored: stored[taken_rows])


def change_vertices(
    builder: GlbBuilder, asset: Gltf, primitive: dict[str, Any], change: Callable[[str, Array], Array]
) -> None:
    """Give a primitive, and its morph targets, other rows of vertices: `change` of an attribute's name and values."""
    for attributes in (primitive["attributes"], *primitive.get("targets", [])):
        for name, accessor in attributes.items():
            stored = values(asset, accessor, *_VECTORS)
            attributes[name] = _accessor_like(builder, asset.header["accessors"][accessor], change(name, stored))


def _accessor_like(builder: GlbBuilder, old: dict[str, Any], rows: Array) -> int:
    """Index of a new accessor of `rows` (n, d), of the kind of an old one."""
    taken = np.ascontiguousarray(rows)
    data = taken.view(np.uint8)
    padding = -data.shape[1] % 4
    strided = {"byteStride": data.shape[1] + padding} if padding else {}
    view = builder.bytes_view(np.pad(data, ((0, 0), (0, padding))).tobytes(), target=ARRAY_BUFFER, **strided)
    kept = "componentType", "type", "normalized", "name", "extras"
    entry: dict[str, Any] = {key: old[key] for key in kept if key in old}
    entry |= {"bufferView": view, "count": len(taken)}
    if "min" in old:
        entry |= {"min": taken.min(axis=0).tolist(), "max": taken.max(axis=0).tolist()}
    return builder.append("accessors", entry)
