"""Wavefront OBJ: geometry over exactly the file's own `v` lines.

trimesh's reader splits, repeats or drops vertices, takes index 0 for 1 and wraps negative ones. Memory is estimated at
9 times the bytes of a file, where what trimesh reads takes 22 times (evidence/reliability.md).
"""

import numpy as np

from obscurance.raytrace.mesh.mesh import PerCorner

from ...geometry.instances import Instance
from ...geometry.polygons import triangulate
from ..table import MeshInput
from .attributes import obj_attributes, obj_opacity
from .mtl import read_libraries
from .text import ObjText


def read_obj(mesh_input: MeshInput) -> list[Instance]:
    """All faces of the file, in its order, as triangles of one instance: no vertices are divided in OBJ.

    Raises: as `ObjText`.
    """
    file = ObjText(mesh_input.file.read(), mesh_input.source)
    normals = file.normals()
    vertex_normals = normals and normals.at_vertices(file.corners, len(file.vertices), np.nan)
    triangles = triangulate(file.vertices, file.corners, file.sizes, mesh_input.source)
    notes = file.notes + triangles.notes
    instance = Instance(mesh_input.name, file.vertices, triangles.take(file.corners), vertex_normals, notes=notes)
    if normals and vertex_normals is None:
        instance = instance._replace(corner_normals=PerCorner(normals.values, triangles.take(normals.of)))
    libraries = (
        read_libraries(file.lines("mtllib"), mesh_input.path.parent)
        if mesh_input.keep or mesh_input.alpha
        else ({}, [], [])
    )
    # What else the file holds, and the alpha of its materials.
    if mesh_input.keep:
        attributes, unread = obj_attributes(file, libraries, triangles)
        instance = instance._replace(attributes=attributes, unread=unread)
    if mesh_input.alpha:
        opacity, of_alpha = obj_opacity(file, libraries, triangles)
        unread = tuple(words for words in instance.unread if not any(note.startswith(words) for note in of_alpha))
        instance = instance._replace(opacity=opacity, unread=unread, notes=notes + of_alpha)
    return [instance._replace(polygons=triangles.polygons)]
