"""Wavefront OBJ: geometry over exactly the file's own `v` lines; colours, texture coordinates, materials, alpha.

trimesh's reader splits, repeats or drops vertices, takes index 0 for 1 and wraps negative ones. Memory is estimated at
9 times the bytes of a file, where what trimesh reads takes 22 times (evidence/reliability.md).
"""

import numpy as np

from obscurance.raytrace.mesh.mesh import PerCorner
from obscurance.raytrace.mesh.opacity import AlphaSurface, Opacity

from ...geometry.attributes import SourceAttributes, SourceMaterial
from ...geometry.instances import Instance
from ...geometry.polygons import Triangulation, triangulate
from ..table import MeshInput
from .mtl import LIBRARY, OPAQUE, OPTION, Libraries, read_libraries
from .text import ObjText

MAX_OBJECTS = 4096  # each takes a kilobyte or two of a .glb
_OTHER = "l", "p", "curv", "curv2", "surf"
_TOLD = {  # of what is left out of materials, what matters to alpha
    OPAQUE: "",
    LIBRARY: " is not there: what it paints is opaque",
    OPTION: " is not read",
    "texture of map_d": " is not read: alpha there is that of d alone",
}


def read_obj(mesh_input: MeshInput) -> list[Instance]:
    """All faces of the file, in its order, as triangles of one instance: no vertices are divided in OBJ.

    Raises: as `ObjText`.
    """
    file = ObjText(mesh_input.file.read(), mesh_input.source)
    normals = file.normals()
    vertex_normals = normals and normals.at_vertices(file.corners, len(file.vertices), np.nan)
    triangles = triangulate(file.vertices, file.corners, file.sizes, mesh_input.source)
    instance = Instance(mesh_input.name, file.vertices, triangles.take(file.corners), vertex_normals)
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
    of_alpha: tuple[str, ...] = ()
    if mesh_input.alpha:
        opacity, of_alpha = obj_opacity(file, libraries, triangles)
        unread = tuple(words for words in instance.unread if not any(note.startswith(words) for note in of_alpha))
        instance = instance._replace(opacity=opacity, unread=unread)
    return [instance._replace(polygons=triangles.polygons, notes=file.notes + triangles.notes + of_alpha)]


def obj_attributes(
    file: ObjText, libraries: Libraries, triangles: Triangulation
) -> tuple[SourceAttributes, tuple[str, ...]]:
    """All of an OBJ file that can be kept beside its mesh, and the rest in words."""
    colors = file.colors
    if colors is not None and not ((colors >= 0) & (colors <= 1)).all():
        colors = None
    # Faces by the statements before them: objects, or groups where those alone divide the file, and materials.
    by_object = file.named("o")
    by_group = file.named("g")
    objects = by_group if by_object.kinds < 2 <= by_group.kinds or not by_object.names else by_object
    keeps_objects = bool(objects.names) and objects.kinds <= MAX_OBJECTS
    # Materials.
    used = file.named("usemtl")
    material_of_name, files, missing = libraries if used.names else ({}, [], [])
    materials = tuple(material_of_name.get(name, SourceMaterial(name)) for name in used.names)
    # What is left out, in words.
    left_out = (
        (by_object.kinds > 1 and by_group.kinds > 1, "names of groups"),
        (objects.kinds > MAX_OBJECTS, f"its division into {objects.kinds:,} objects"),
        (len(set(file.lines("s").split())) > 1, "smoothing groups"),
        (any(run.keyword in _OTHER for run in file.runs), "lines, points, curves and surfaces"),
        (colors is None and file.has_colors, "colours, which some vertices lack or have outside of [0, 1]"),
    )
    attributes = SourceAttributes(
        file.corners,
        file.sizes,
        triangles,
        uv=file.uv,
        colors=colors,
        materials=materials,
        material_of=used.of if materials else None,
        objects=objects.names if keeps_objects else (),
        object_of=objects.of if keeps_objects else None,
        files=tuple(files),
    )
    return attributes, (*(words for is_left_out, words in left_out if is_left_out), *missing)


def obj_opacity(
    file: ObjText, libraries: Libraries, triangles: Triangulation
) -> tuple[Opacity | None, tuple[str, ...]]:
    """Alpha of the faces, None where all are opaque; and warnings of images that are missing."""
    material_of_name, _, left = libraries
    notes = tuple(
        words + end for words in dict.fromkeys(left) for begin, end in _TOLD.items() if words.startswith(begin)
    )
    # The see-through material of each face, −1: none.
    materials = {
        name: material
        for name, material in material_of_name.items()
        if material.opacity < 1 or material.opacity_texture
    }
    used = file.named("usemtl")
    numbers = {name: number for number, name in enumerate(materials)}
    of = np.repeat(np.array([*(numbers.get(name, -1) for name in used.names), -1])[used.of], triangles.counts)
    if (of < 0).all():
        return None, notes
    from obscurance.raytrace.image.texture import Texture

    uv = file.uv
    surfaces = []
    for material in materials.values():
        image = material.opacity_texture if uv else None
        texture = Texture(image) if image else None
        surfaces.append(AlphaSurface(material.opacity, texture, grey=image != material.texture))
    if uv is None:
        return Opacity(of, tuple(surfaces), None), notes
    # Faces without texture coordinates have the alpha of their material without its image.
    coordinates = uv.values[triangles.take(uv.of)]
    lacking = np.isnan(coordinates).any(axis=(1, 2)) & (of >= 0)
    plain = [len(materials) + n if material.opacity < 1 else -1 for n, material in enumerate(materials.values())]
    of[lacking] = np.array(plain)[of[lacking]]
    surfaces += [AlphaSurface(material.opacity) for material in materials.values()]
    return Opacity(of, tuple(surfaces), np.nan_to_num(coordinates)), notes
