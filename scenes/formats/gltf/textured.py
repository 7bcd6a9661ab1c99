"""A binary glTF with baked textures as its materials' occlusion textures, by the coordinates they were baked for."""

import copy
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from obscurance.ao.texture.result import BakedTexture
from obscurance.ao.texture.uv_layout import on_page
from obscurance.raytrace.types import AnyFloats, Float64s, Int64s

from ...asset.asset import Asset
from ..table import Channels
from .accessors import flipped, normalized, triangles, values
from .asset import Gltf
from .builder import GlbBuilder
from .occlusion import OcclusionTextures, add_coordinates, free_set, kept_in_words
from .orm import OrmTextures
from .records import Primitive, parse
from .vertices import draw, take_vertices
from .write import document, write_ramp

_SAME = 1e-6  # of texture coordinates that float32 has rounded


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
            faces = triangles(asset, parse(Primitive, primitive, asset.path), len(vertices)).astype(np.int64)
            is_turned = not np.array_equal(vertices[faces], source.mesh.faces[run.faces])  # mirrored: turned over
            for page, face_rows, piece in _by_page(builder, primitive, on_pages.argmax(axis=0)):
                uv = pages[page].uv[run.faces[face_rows], :: -1 if is_turned else 1]
                draws_all = len(face_rows) == len(faces)
                textures.give(piece, numbers[page], _laid_out(builder, asset, piece, faces[face_rows], uv, draws_all))
    textures.apply()
    if w is not None:
        write_ramp(builder, [(primitive, w[vertices]) for primitive, vertices in on_no_page], replace)
    lines = []
    if kept:
        lines.append(kept_in_words(f"{kept:,}"))
    if textures.apart:
        apart = f"in images apart from metallic-roughness textures ({len(textures.apart):,})"
        reason = "which have other coordinates, are moved by KHR_texture_transform, or are neither PNG nor JPEG"
        lines.append(f"has its occlusion {apart}, {reason}")
    return builder.encode(), lines


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


def _laid_out(
    builder: GlbBuilder, asset: Gltf, primitive: dict[str, Any], faces: Int64s, uv: Float64s, draws_all: bool
) -> int:
    """Number of the set that looks up `uv` (t, 3, 2) at the faces (t, 3), which a primitive is let draw alone: one that
    it has, or a new one. Args: draws_all: whether it draws these faces alone already."""
    number = _set_of(asset, parse(Primitive, primitive, asset.path), faces, uv)
    if number is None:
        number = free_set(builder.header, primitive)
        split_vertices(builder, asset, primitive, number, faces, uv)
    elif not draws_all:
        draw(builder, primitive, faces)
    return number


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
