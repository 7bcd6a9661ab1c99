"""Binary glTF of meshes that were no glTF: one node an object, one primitive a material of it."""

import copy
from collections import Counter
from typing import Any

import numpy as np
import numpy.typing as npt

from raytrace.errors import OptionError
from raytrace.image.srgb import decode_srgb
from raytrace.mesh.mesh import Mesh
from raytrace.mesh.normals import creased_normals
from raytrace.types import Float64s, Int64s

from ...geometry.attributes import SourceAttributes
from ...geometry.corners import PerCorner, split_corners
from ...geometry.instances import Submesh
from ..load import MeshFile
from ..ply.layout import fractions, own_colors, stored_colors
from ..primitive_groups import primitive_groups
from .accessors import flipped
from .accessors import stored_colors as colors_of_gltf
from .builder import ELEMENT_ARRAY_BUFFER, GlbBuilder
from .materials import add_materials

_LARGEST = 1e38  # of float32, and of a difference of two
WHITE: dict[str, Any] = {"pbrMetallicRoughness": {"metallicFactor": 0, "roughnessFactor": 1}}
SOURCE_INDEX = "_SOURCE_INDEX"


Drawn = tuple[dict[str, Any], Int64s]
"""A primitive of a document, and which of the baked mesh's vertices its own are."""


def plain(mesh_file: MeshFile, colors: str) -> tuple[GlbBuilder, list[Drawn]]:
    """The document, without w, and its primitives, in the order of `primitive_groups`; normals if the mesh has none.

    The only primitive of a part has the part's vertices in their order, then those whose corners differ once more.
    One of several has the vertices that it uses, with their rows in the mesh as `_SOURCE_INDEX`.

    Args: colors: the channels that are to hold w: of all, the source's are left out.
    """
    mesh = mesh_file.mesh
    source = mesh_file.attributes
    builder = _empty_document()
    add_materials(builder, source.materials if source else ())
    # What the document holds of each corner, and where its objects lie.
    groups = list(primitive_groups(mesh_file))
    groups_of_part = Counter(group.part for group in groups)
    is_divided = len(groups) > len(mesh_file.parts)
    origins = [part_origin(mesh.vertices[part.vertices]) for part in mesh_file.parts]
    uv = _corner_uv(mesh_file)
    normals = _corner_normals(mesh_file)
    split_by = [values for values in (uv, normals) if values]
    drawn: list[Drawn] = []
    before = None
    # A primitive for each group, in the node of its object.
    for group in groups:
        origin = origins[group.part]
        if group.object != before:
            before = group.object
            _add_node(builder, before.name, origin)
        part = mesh_file.parts[group.part]
        vertices, faces, like = _group_vertices(mesh, part, group.faces, split_by, groups_of_part[group.part] == 1)
        attributes = {"POSITION": _add_positions(builder, mesh.vertices[vertices], origin)}
        smooth = None if mesh.normals is None else mesh.normals[vertices]
        _add_normals(builder, attributes, normals.values[normals.of[like]] if normals else smooth)
        if uv:
            _add_uv(builder, attributes, uv.values[uv.of[like]])
        _add_columns(builder, attributes, source, vertices, colors)
        indices = builder.accessor(faces.astype("<u4").ravel(), ELEMENT_ARRAY_BUFFER)
        if is_divided and fits_float(vertices):
            attributes[SOURCE_INDEX] = builder.accessor(vertices.astype("<f4"))
        primitive = {"attributes": attributes, "indices": indices, "material": group.material.key}
        builder.header["meshes"][-1]["primitives"].append(primitive)
        drawn.append((primitive, vertices))
    return builder, drawn


def _empty_document() -> GlbBuilder:
    return GlbBuilder(
        {
            "asset": {"version": "2.0", "generator": "obscurance"},
            "scene": 0,
            "scenes": [{"nodes": []}],
            "nodes": [],
            "meshes": [],
            "materials": [copy.deepcopy(WHITE)],
        }
    )


def _add_node(builder: GlbBuilder, name: str, origin: Float64s | None) -> None:
    """Append a node with an empty mesh to the scene."""
    mesh = builder.append("meshes", {"name": name, "primitives": []})
    node: dict[str, Any] = {"name": name, "mesh": mesh}
    if origin is not None:
        node["translation"] = origin.tolist()
    builder.header["scenes"][0]["nodes"].append(builder.append("nodes", node))


def _group_vertices(
    mesh: Mesh, part: Submesh, face_rows: Int64s, split_by: list[PerCorner], keeps_all: bool
) -> tuple[Int64s, Int64s, Int64s]:
    """The vertices (k,) of the mesh that some of its faces get, the faces (m, 3), and a corner like each vertex (k,).

    Args: face_rows: (m,) of the faces, in `part`. split_by: values whose corners divide vertices.
    """
    start = part.vertices.start
    count = part.vertices.stop - start if keeps_all else 0
    corners = 3 * face_rows[:, None] + np.arange(3)
    vertices, faces, like = split_corners(mesh.faces.ravel() - start, corners, split_by, count)
    return vertices + start, faces, like


def _corner_uv(mesh_file: MeshFile) -> PerCorner | None:
    """Texture coordinates of the triangles' corners."""
    source = mesh_file.attributes
    return source.of_triangles(source.uv) if source and source.uv else None


def _corner_normals(mesh_file: MeshFile) -> PerCorner | None:
    """Normals of the triangles' corners; None where each vertex has one."""
    source = mesh_file.attributes
    if source and source.normals:
        return source.of_triangles(source.normals)
    if mesh_file.mesh.normals is not None:
        return None
    normals, of = creased_normals(mesh_file.mesh)
    normals[~normals.any(axis=1)] = 0, 0, 1  # of faces without area, which nothing shows
    return PerCorner(normals, of.ravel())


def part_origin(vertices: Float64s) -> Float64s | None:
    """The origin of positions that float32 cannot hold about zero, or None. Raises: OptionError: about none it can."""
    if np.abs(vertices).max() > _LARGEST:
        raise OptionError("output", f"coordinates up to {_LARGEST:g} in a .glb", f"{np.abs(vertices).max():g}")
    if np.array_equal(vertices.astype("<f4"), vertices):
        return None
    return np.asarray((vertices.min(axis=0) + vertices.max(axis=0)) / 2)


def _add_positions(builder: GlbBuilder, vertices: Float64s, origin: Float64s | None) -> int:
    positions = (vertices if origin is None else vertices - origin).astype("<f4")
    return builder.accessor(positions, min=positions.min(axis=0).tolist(), max=positions.max(axis=0).tolist())


def _add_uv(builder: GlbBuilder, attributes: dict[str, int], uv: Float64s) -> None:
    if np.isfinite(uv).any():
        attributes["TEXCOORD_0"] = builder.accessor(flipped(np.nan_to_num(uv)).astype("<f4"))


def _add_normals(builder: GlbBuilder, attributes: dict[str, int], normals: Float64s | None) -> None:
    """glTF allows unit normals only: a primitive that lacks some goes without."""
    if normals is not None:
        length = np.linalg.norm(normals, axis=1, keepdims=True)
        if np.isfinite(length).all() and (length > 0).all():
            attributes["NORMAL"] = builder.accessor((normals / length).astype("<f4"))


def _add_columns(
    builder: GlbBuilder, attributes: dict[str, int], source: SourceAttributes | None, vertices: Int64s, colors: str
) -> None:
    """Colours, unless all channels are to hold w, and further numbers of the vertices."""
    if source is None:
        return
    source_colors = source.colors if len(colors) < 2 else None
    if source_colors is None and len(colors) == 1:
        source_colors = fractions(stored_colors(source.elements))  # the grey of an earlier bake
    if source_colors is not None:
        linear = np.concatenate([decode_srgb(source_colors[vertices, :3]), source_colors[vertices, 3:]], axis=1)
        attributes["COLOR_0"] = builder.accessor(linear.astype("<f4"))
    for name, values in source.numbers.items():
        if fits_float(values) and attribute_name(name) not in attributes:
            attributes[attribute_name(name)] = builder.accessor(values[vertices].astype("<f4"))


def fits_float(values: npt.NDArray[Any]) -> bool:
    """Whether float32 holds the values exactly."""
    with np.errstate(over="ignore", invalid="ignore"):
        return bool(np.isfinite(values).all() and np.array_equal(values.astype("<f4"), values))


def attribute_name(name: str) -> str:
    """The glTF name of an attribute that is not in the specification."""
    return "_" + name.upper()


def unsupported_features(mesh_file: MeshFile, colors: str) -> list[str]:
    """What of a mesh file a .glb lacks, in words. Args: colors: the channels of vertex colours that hold w.

    Raises: OptionError: coordinates that it cannot hold. MeshError: colours to be kept are malformed.
    """
    source = mesh_file.attributes
    replaced = len(colors) > 1
    if mesh_file.gltf:
        return _unsupported_of_gltf(mesh_file, colors)
    part_origin(mesh_file.mesh.vertices)
    if source is None:
        return list(mesh_file.unread)
    divided = len(list(primitive_groups(mesh_file))) > len(mesh_file.parts)
    left_out = (
        (replaced and source.colors is not None, "its colours"),
        (divided, f"the order of vertices ({SOURCE_INDEX} has their places)"),
        (divided and len(np.unique(source.corners)) < len(mesh_file.mesh.vertices), "vertices that no face uses"),
        ((source.sizes != 3).any(), "polygons, which become triangles"),
    )
    missing = [*mesh_file.unread, *(words for is_left_out, words in left_out if is_left_out)]
    names = {"POSITION", "NORMAL", "_OBSCURANCE"}
    for name, values in source.numbers.items():
        if not fits_float(values) or attribute_name(name) in names:
            missing.append(f"{name} of vertices")
        names.add(attribute_name(name))
    return missing + _unsupported_of_elements(source)


def _unsupported_of_gltf(mesh_file: MeshFile, colors: str) -> list[str]:
    asset = mesh_file.gltf
    assert asset is not None
    if len(colors) == 1:  # the other channels are kept, so they must be right
        for drawn, part in zip(asset.drawn, mesh_file.parts, strict=True):
            colors_of_gltf(asset, drawn.primitive.attributes, part.vertices.stop - part.vertices.start)
    stored = (primitive.attributes for mesh in asset.geometry.meshes for primitive in mesh.primitives)
    return ["its colours"] if len(colors) > 1 and any("COLOR_0" in attributes for attributes in stored) else []


def _unsupported_of_elements(source: SourceAttributes) -> list[str]:
    """What of a PLY's elements a .glb lacks."""
    missing = []
    for element in source.elements:
        if element.name == "vertex":
            missing += [f"{column.name} of vertices" for column in element.properties if column.counted]
            if own_colors(source.elements) and source.colors is None:
                missing.append("its colours")
        elif element.name == "face":
            has_wedges = source.uv and source.uv.of is not source.corners  # coordinates of corners
            used = ("vertex_indices", "vertex_index", "texcoord" if has_wedges else "")
            missing += [f"{column.name} of faces" for column in element.properties if column.name not in used]
        elif element.count:
            missing.append(f"elements {element.name}")
    return missing
