"""The texture coordinates of a bake, of the file or by the optional library uvunwrap, and the size of its pages."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from importlib.util import find_spec
from shlex import quote
from typing import TYPE_CHECKING, Any

import numpy as np

from obscurance.ao.falloff import resolve_length
from obscurance.ao.texture.uv_layout import (
    MAX_SIDE,
    corner_uv,
    doubled_areas,
    have_area,
    on_page,
    page_size,
    texels_across,
)
from obscurance.ao.texture.uv_surface import corner_places
from obscurance.raytrace.errors import MeshError, OptionError
from obscurance.raytrace.mesh.mesh import Mesh, mesh_of
from obscurance.raytrace.mesh.normals import face_areas
from obscurance.raytrace.mesh.weld import connected_components
from obscurance.raytrace.types import AnyInts, Bools, Float64s, Int32s, Int64s

from ..asset.asset import Asset
from ..asset.objects import ObjectSelection

if TYPE_CHECKING:
    from .plan import Plan

_USED = 0.65  # of a page, that an unwrapping fills
_PADDING = 4  # texels between charts, so that neither bilinear lookups nor one coarser level see two of them
_WORTH = 1e-3  # of the surface: what has no area on the page gets a texture if it is more
_FILLED = 16  # texels of an even layout, that a chart is too large for to be within one
_LEAST = 64  # texels across, below which there is no room for charts


@dataclass(frozen=True, eq=False)
class Coordinates:
    """Texture coordinates of a mesh."""

    uv: Float64s  # (m, 3, 2), v upwards, NaN of faces that have none
    new: Bools  # (m,), which the file has not, or without area
    number: int | None  # of the file's set, None if all are new
    size: tuple[int, int]  # texels across and down of a page
    cramped: int = 0  # faces that share a texel with other charts, but show more than that


def coordinates(plan: Plan, source: Asset, chosen: ObjectSelection) -> Coordinates:
    """The texture coordinates that --uv asks for: those of the file, new ones, or new ones for some faces alone.

    Raises: MeshError: there are none. OptionError: as `unwrap`, or a page too large.
    """
    requested = plan.options.uv or "auto"
    can_unwrap = find_spec("uvunwrap") is not None
    number = int(requested) if requested.isdecimal() else 0
    uv = None if requested == "unwrap" else source.texture_coordinates(number)
    if uv is not None and requested != "pack":
        return _kept(plan, chosen, chosen.on_pages(uv), number)
    if (
        uv is None
        and requested not in ("unwrap", "fill")
        and not (requested == "auto" and plan.keeps_uv and can_unwrap)
    ):
        which = f" of number {number}" if number else ""
        into = "" if plan.keeps_uv else f" --mesh-output {quote(source.path.stem + '-uv.glb')}"
        advice = f"; {'' if can_unwrap else 'pip install uvunwrap and '}--uv unwrap{into} makes some"
        raise MeshError(source.path, "texture coordinates", f"some{which} on every face", f"none{advice}")
    # New ones; the page's size by those of triangles alike, of which it is filled.
    mesh, receive = chosen.mesh, chosen.receive
    share = np.sqrt(2 * _USED / np.count_nonzero(receive))  # of the page's side, of each face
    new_uv = np.full((len(receive), 3, 2), np.nan)
    new_uv[receive] = [[0.0, 0.0], [share, 0.0], [0.0, share]]
    side = min(_resolved_size(plan, mesh, new_uv))
    old = None if uv is None else uv[receive]
    new_uv[receive] = unwrap(_faces_only(mesh, receive), side, old)
    return Coordinates(new_uv, receive, None, (side, side))


def _kept(plan: Plan, chosen: ObjectSelection, uv: Float64s, number: int) -> Coordinates:
    """The file's texture coordinates (m, 3, 2), with new ones of faces that have none, if these are to be filled in.

    Where there can be several textures, faces of no area on the page get one of their own. Args: number: of the set.
    """
    mesh, receive = chosen.mesh, chosen.receive
    texels = _resolved_size(plan, mesh, uv)
    new = ~on_page(uv) & receive & (plan.options.uv == "fill")
    areas = face_areas(mesh.vertices, mesh.faces) * receive
    cramped = _cramped(mesh, uv, areas, texels)
    lost = cramped | (on_page(uv) & ~have_area(uv) & (areas > 0))
    if new.any():
        uv[new] = unwrap(_faces_only(mesh, new), min(texels))
    several = plan.ending == ".glb" and not plan.options.orm and plan.options.overlap is None
    has_room = find_spec("uvunwrap") is not None and min(texels) >= _LEAST
    if several and has_room and areas[lost].sum() > _WORTH * areas.sum():
        with suppress(MeshError):  # there is no room for them: they stay, and a line tells of them
            uv[lost] = unwrap(_faces_only(mesh, lost), min(texels))
            new |= lost
    return Coordinates(uv, new, number, texels, int(np.count_nonzero(cramped & ~new)))


def _faces_only(mesh: Mesh, faces: Bools) -> Mesh:
    """The mesh with some of its faces, bool (m,), alone."""
    return Mesh(mesh.vertices, mesh.faces[faces], source=mesh.source)


def _cramped(mesh: Mesh, uv: Float64s, areas: Float64s, size: tuple[int, int]) -> Bools:
    """The faces (m,) of charts smaller than a texel, beside others, that would fill several in an even layout.

    Args: areas: (m,), of faces' surface.
    """
    is_cramped = np.zeros(len(uv), np.bool_)
    face_rows = np.flatnonzero(have_area(uv))
    places = uv[face_rows] * size
    texels = areas[face_rows] * (size[0] * size[1] / max(areas.sum(), 1e-300))
    if not (np.abs(doubled_areas(places)) / 2 * _FILLED < texels).any():
        return is_cramped
    corners = corner_places(places, mesh.faces[face_rows])
    chart = np.unique(connected_components(corners, int(corners.max()) + 1)[corners[:, 0]], return_inverse=True)[1]
    order = np.argsort(chart, kind="stable")
    begins = np.flatnonzero(np.diff(chart[order], prepend=-1))
    low = np.minimum.reduceat(places.min(axis=1)[order], begins)
    high = np.maximum.reduceat(places.max(axis=1)[order], begins)
    within = (high - low < 1).all(axis=1) & (np.bincount(chart, texels) >= _FILLED)
    is_cramped[face_rows] = (within & (len(begins) > 1))[chart]
    return is_cramped


def _resolved_size(plan: Plan, mesh: Mesh, uv: Float64s) -> tuple[int, int]:
    """Width and height of the page, in texels, as given, or by the texel size."""
    if plan.size:
        return plan.size
    length = resolve_length("texel_size", plan.options.texel_size, mesh.radius)
    areas = face_areas(mesh.vertices, mesh.faces)
    shown = on_page(uv)
    return page_size(texels_across(uv[shown], areas[shown], length))


def unwrap(mesh: Mesh | Any, size: int = 1024, uv: Any = None) -> Float64s:
    """New texture coordinates (m, 3, 2) without overlaps, v upwards; the same mesh and size give the same.

    Args:
        mesh: as `ao.bake` takes it.
        size: texels across the square page that they are for, 64 to 16384.
        uv: texture coordinates as `ao.bake_texture` takes them, whose charts are packed in their shapes, with the same
            number of texels per area of the surface: turned by right angles, mirrored ones turned over, and cut where
            they lie over themselves. Faces without coordinates or without area there get new ones.

    Raises:
        OptionError: the library is not installed, or the page is smaller than 64 texels.
        MeshError: the library fails, or `uv` cannot be used.
    """
    if find_spec("uvunwrap") is None:
        raise OptionError("uv", "pip install uvunwrap, to unwrap meshes", "no uvunwrap")
    if not _LEAST <= size <= MAX_SIDE:
        raise OptionError("size", f"{_LEAST} to {MAX_SIDE} texels, to unwrap for", size)
    import uvunwrap

    mesh = mesh_of(mesh, "unwrap")
    centred = (mesh.vertices - mesh.centre) / max(mesh.radius, 1e-300)
    # Pieces to unwrap: the whole mesh, or the flattened charts of `uv` and the faces without any.
    pieces: list[tuple[Int64s, Float64s, AnyInts]] = [(np.arange(len(mesh.faces)), centred, mesh.faces)]
    if uv is not None:
        old = corner_uv(uv, mesh)
        pieces = list(_flat_charts(centred, mesh.faces, old, size))
        without_uv = np.flatnonzero(~have_area(old))
        pieces += [(without_uv, centred, mesh.faces[without_uv])] if len(without_uv) else []
    try:
        inputs = [uvunwrap.Mesh(np.float32(at).ravel(), np.uint32(faces).ravel()) for _, at, faces in pieces]
        atlas = uvunwrap.generate(inputs, page_size=size, padding=_PADDING)
    except BaseException as reason:  # a panic of Rust is no Exception
        if not isinstance(reason, Exception) and type(reason).__name__ != "PanicException":
            raise
        raise MeshError(mesh.source, "faces", "a mesh that uvunwrap can unwrap", reason) from None
    if atlas.page_count > 1:
        got = f"{atlas.page_count} pages of {size} texels; a larger --size may do"
        raise MeshError(mesh.source, "faces", "a mesh that uvunwrap can unwrap to one page", got)
    # The corners' places on the page, in the order of the mesh's faces.
    corner_uvs = np.full((len(mesh.faces), 3, 2), np.nan)
    for (face_rows, *_), unwrapped in zip(pieces, atlas.meshes, strict=True):
        corner_uvs[face_rows] = np.reshape(unwrapped.corner_uvs, (-1, 3, 2))
    if atlas.page_count != 1 or not np.isfinite(corner_uvs).all():
        raise MeshError(mesh.source, "faces", "a mesh that uvunwrap can unwrap", f"{atlas!r}")
    return corner_uvs if uv is None else corner_uvs * (atlas.width / size, atlas.height / size)


def _flat_charts(
    vertices: Float64s, faces: Int32s, uv: Float64s, size: int
) -> Iterator[tuple[Int64s, Float64s, AnyInts]]:
    """The charts of `uv` (m, 3, 2), mirrored halves apart: rows of faces, and a flat mesh of the area that it has."""
    face_rows = np.flatnonzero(have_area(uv))
    if not len(face_rows):
        return
    uv = uv[face_rows]
    faces = faces[face_rows]
    doubled = doubled_areas(uv)
    areas = face_areas(vertices, faces)
    points = np.unique(vertices, axis=0, return_inverse=True)[1].reshape(-1)[faces]
    corners = 2 * corner_places(uv * size, points) + (doubled < 0)[:, None]
    chart = connected_components(corners, int(corners.max()) + 1)[corners[:, 0]]
    order = np.argsort(chart, kind="stable")
    for chart_faces in np.split(order, np.flatnonzero(np.diff(chart[order])) + 1):
        scale = np.sqrt(2 * areas[chart_faces].sum() / abs(doubled[chart_faces]).sum())
        flat = np.pad((uv[chart_faces] - uv[chart_faces].min(axis=(0, 1))) * scale, ((0, 0), (0, 0), (0, 1)))
        yield face_rows[chart_faces], flat, np.arange(3 * len(chart_faces))
