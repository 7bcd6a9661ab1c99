"""Warnings of what an output format cannot keep of the mesh file."""

from pathlib import Path

import numpy as np

from raytrace.errors import printable

from .load import MeshFile
from .obj.detail import PAINT_WORDS
from .ply.layout import own_colors
from .ply.write import has_own_colors
from .table import Channels, format_of, function


def lost(target: Path, mesh_file: MeshFile, channels: Channels = Channels()) -> list[str]:
    """Losses of `write_bake.write`, and unexpected changes: lines for the user, mostly none.

    Raises: OptionError: coordinates that the format does not hold. MeshError: colours to be kept are malformed.
    """
    row, colors = format_of(target), channels.colors
    if not row.lost:
        return []
    missing = function(row.lost)(mesh_file, colors)
    warnings = [f"{target}: not kept from {mesh_file.path}: {', '.join(missing)}"] if missing else []
    if row.name == "PLY" and not colors and has_own_colors(mesh_file.detail):
        warnings.append(f"{target}: keeps the colours of {mesh_file.path}; w is in its property obscurance alone")
    if channels.ramp and mesh_file.gltf:
        from .glb.write import ramp_warnings

        warnings += [f"{target}: {line}" for line in ramp_warnings(mesh_file.gltf, channels.replace)]
    return [printable(line) for line in warnings]


def of_ply(mesh_file: MeshFile, colors: str) -> list[str]:
    detail, missing = mesh_file.detail, list[str]()
    if len(colors) > 1 and has_own_colors(detail):
        missing.append("its colours")
    if detail is None or not detail.elements:
        of = None if detail is None else detail.object_of
        if not mesh_file.gltf and (len(mesh_file.parts) > 1 or (of is not None and np.ptp(of))):
            missing.append("its division into objects")
        missing += [words for words in mesh_file.unread if not words.startswith(PAINT_WORDS)]
    if detail and detail.normals:
        missing.append("normals of vertices that have several")
    if detail and detail.uv and not np.isfinite(detail.uv.rows).all():
        missing.append("texture coordinates, which some corners lack")
    if detail and detail.paints:
        missing.append("materials")
    return missing


def of_glb(mesh_file: MeshFile, colors: str) -> list[str]:
    detail, replaced = mesh_file.detail, len(colors) > 1
    if mesh_file.gltf:
        from .gltf.accessors import stored_colors

        for piece, part in zip(mesh_file.gltf.drawn, mesh_file.parts if len(colors) == 1 else (), strict=False):
            stored_colors(mesh_file.gltf, piece.primitive.attributes, part.vertices.stop - part.vertices.start)
        stored = (piece.attributes for mesh in mesh_file.gltf.geometry.meshes for piece in mesh.primitives)
        return ["its colours"] if replaced and any("COLOR_0" in attributes for attributes in stored) else []
    from .glb.pieces import pieces
    from .glb.plain import SOURCE_INDEX, attribute_name, fits_float, part_origin

    part_origin(mesh_file.mesh.vertices)
    if detail is None:
        return list(mesh_file.unread)
    divided = len(list(pieces(mesh_file))) > len(mesh_file.parts)
    left_out = (
        (replaced and detail.colors is not None, "its colours"),
        (divided, f"the order of vertices ({SOURCE_INDEX} has their places)"),
        (divided and len(np.unique(detail.corners)) < len(mesh_file.mesh.vertices), "vertices that no face uses"),
        ((detail.sizes != 3).any(), "polygons, which become triangles"),
    )
    missing = [*mesh_file.unread, *(words for is_left_out, words in left_out if is_left_out)]
    names = {"POSITION", "NORMAL", "_OBSCURANCE"}
    for name, values in detail.numbers.items():
        if not fits_float(values) or attribute_name(name) in names:
            missing.append(f"{name} of vertices")
        names.add(attribute_name(name))
    for element in detail.elements:
        if element.name == "vertex":
            missing += [f"{c.name} of vertices" for c in element.properties if c.sizes is not None]
            if own_colors(detail.elements) and detail.colors is None:
                missing.append("its colours")
        elif element.name == "face":
            has_wedges = detail.uv and detail.uv.of is not detail.corners  # coordinates of corners
            used = ("vertex_indices", "vertex_index", "texcoord" if has_wedges else "")
            missing += [f"{c.name} of faces" for c in element.properties if c.name not in used]
        elif element.count:
            missing.append(f"elements {element.name}")
    return missing
