"""What of a mesh file a .glb cannot keep."""

import numpy as np

from ..load import MeshFile
from ..ply.layout import own_colors
from ..primitive_groups import pieces
from .accessors import stored_colors
from .plain import SOURCE_INDEX, attribute_name, fits_float, part_origin


def unsupported_features(mesh_file: MeshFile, colors: str) -> list[str]:
    """What of a mesh file a .glb lacks, in words. Args: colors: the channels of vertex colours that hold w.

    Raises: OptionError: coordinates that it cannot hold. MeshError: colours to be kept are malformed.
    """
    detail = mesh_file.detail
    replaced = len(colors) > 1
    if mesh_file.gltf:
        for piece, part in zip(mesh_file.gltf.drawn, mesh_file.parts if len(colors) == 1 else (), strict=False):
            stored_colors(mesh_file.gltf, piece.primitive.attributes, part.vertices.stop - part.vertices.start)
        stored = (piece.attributes for mesh in mesh_file.gltf.geometry.meshes for piece in mesh.primitives)
        return ["its colours"] if replaced and any("COLOR_0" in attributes for attributes in stored) else []
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
