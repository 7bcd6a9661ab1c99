"""Warnings of what an output format cannot keep of the mesh file."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from obscurance.raytrace.errors import printable

from .load import MeshFile
from .obj.mtl import MATERIAL_WORDS
from .ply.write import MESHLAB, cuts_polygons, has_own_colors
from .table import Channels, FileFormat, format_of


def unsupported_features(target: Path, mesh_file: MeshFile, channels: Channels = Channels()) -> list[str]:
    """Losses of `scenes.write`, and unexpected changes: lines for the user, mostly none.

    Raises: OptionError: coordinates that the format does not hold. MeshError: colours to be kept are malformed.
    """
    row = format_of(target)
    colors = channels.colors
    if "source" not in row.holds:
        return []
    missing = [*(_of_glb(mesh_file, colors) if row.ending == ".glb" else _of_polygons(mesh_file, row, colors))]
    if channels.ply_name == MESHLAB and cuts_polygons(mesh_file):
        missing.append("polygons, which become triangles")
    warnings = [f"{target}: not kept from {mesh_file.path}: {', '.join(missing)}"] if missing else []
    if row.name == "PLY" and not colors and has_own_colors(mesh_file.held):
        instead = "w, the openness, is only in the property obscurance; --colors puts it in their place"
        warnings.append(f"{target}: keeps the colours of {mesh_file.path}; {instead}")
    if channels.ply_name in mesh_file.held.numbers:
        warnings.append(f"{target}: w takes the place of {channels.ply_name} of {mesh_file.path}")
    if channels.ramp and mesh_file.gltf:
        from .gltf.write import ramp_warnings

        warnings += [f"{target}: {line}" for line in ramp_warnings(mesh_file.gltf, channels.replace)]
    return [printable(line) for line in warnings]


def _of_polygons(mesh_file: MeshFile, row: FileFormat, colors: str) -> Iterator[str]:
    """What a format of polygons leaves out of a mesh file, in words.

    Args: colors: the channels of colours that hold w.
    """
    attributes = mesh_file.held
    if (len(colors) > 1 or "colors" not in row.holds) and has_own_colors(attributes):
        yield "its colours"
    if not attributes.elements:
        of = attributes.object_of
        if not mesh_file.gltf and (len(mesh_file.parts) > 1 or (of is not None and np.ptp(of))):
            yield "its division into objects"
        yield from (words for words in mesh_file.unread if not words.startswith(MATERIAL_WORDS))
    if mesh_file.mesh.corner_normals:
        yield "normals of vertices that have several"
    if attributes.uv and "uv" in row.holds and not np.isfinite(attributes.uv.values).all():
        yield "texture coordinates, which some corners lack"
    if attributes.materials and not attributes.elements:
        yield "materials"
    if "colors" not in row.holds:
        yield from (f"{name} of vertices" for name in attributes.numbers)
    if attributes.uv and "uv" not in row.holds:
        yield "texture coordinates"


def _of_glb(mesh_file: MeshFile, colors: str) -> Iterator[str]:
    """What a .glb leaves out of a mesh file, in words. Raises: as `unsupported_features`."""
    from .gltf.accessors import stored_colors
    from .gltf.plain import SOURCE_INDEX, kept_numbers, part_origin
    from .primitive_groups import primitive_groups

    attributes = mesh_file.held
    if asset := mesh_file.gltf:
        for drawn, part in zip(asset.drawn, mesh_file.parts, strict=True):
            if len(colors) == 1:  # the other channels are kept, so they must be right
                stored_colors(asset, drawn.primitive.attributes, part.vertices.stop - part.vertices.start)
        primitives = [primitive for mesh in asset.geometry.meshes for primitive in mesh.primitives]
        if len(colors) > 1 and any("COLOR_0" in primitive.attributes for primitive in primitives):
            yield "its colours"
        return
    part_origin(mesh_file.mesh.vertices)
    yield from mesh_file.unread
    if has_own_colors(attributes) and (len(colors) > 1 or attributes.colors is None):
        yield "its colours"
    if len(list(primitive_groups(mesh_file))) > len(mesh_file.parts):
        yield f"the order of vertices ({SOURCE_INDEX} has their places)"
        if len(np.unique(attributes.corners)) < len(mesh_file.mesh.vertices):
            yield "vertices that no face uses"
    if (attributes.sizes != 3).any():
        yield "polygons, which become triangles"
    kept_names = kept_numbers(attributes)
    yield from (f"{name} of vertices" for name in attributes.numbers if name not in kept_names)
    # Of a PLY's elements.
    has_wedges = attributes.uv and attributes.uv.of is not attributes.corners  # coordinates of corners
    used = ("vertex_indices", "vertex_index", "texcoord" if has_wedges else "")
    for element in attributes.elements:
        if element.name == "vertex":
            yield from (f"{column.name} of vertices" for column in element.properties if column.counted)
        elif element.name == "face":
            yield from (f"{column.name} of faces" for column in element.properties if column.name not in used)
        elif element.count:
            yield f"elements {element.name}"
