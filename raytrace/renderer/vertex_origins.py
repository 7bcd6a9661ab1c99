"""Smooth vertex normals, and origins of the shadow rays of vertices for Gouraud shading."""

import numpy as np

from ..brdf.layout import TWO_SIDED
from ..bvh.bvh16 import BVH16
from ..kernel.arrays import aligned, product
from ..mesh.mesh import Mesh
from ..mesh.normals import face_normals, normalize, vertex_sums
from ..mesh.placement import Placement
from ..mesh.weld import CREASE, sum_groups, weld
from ..ray_origins.origins import weld_points
from ..settings import Normals
from ..shade.layout import Geometry
from ..types import Float32s, Float64s, Int64s

INSTANCED = 4.0  # the ray's own way into an instance's frame is rounded too, as if coordinates were that large


def smooth_normals(mesh: Mesh, normals: Normals = "file") -> Float64s:
    """Unit normals (n, 3) in the mesh's own frame, `normals` as in `raytrace.settings`; zero where there is none."""
    if normals == "file" and mesh.normals is not None:
        return normalize(mesh.normals)
    vertices = Placement.of(mesh).vertices
    placed = vertices.astype(np.float64)
    weighting = "angle" if normals == "file" else normals
    own = vertex_sums(placed, mesh.faces, *face_normals(placed, mesh.faces), weighting)
    group = weld(vertices, mesh.faces, normalize(own), CREASE)
    return normalize(sum_groups(group, own))[group]


def vertex_origins(geometry: Geometry) -> Float32s:
    """Origins of shadow rays from the vertices of all objects in order: float32 (n, 3), in render space.

    They are in front of all faces of the scene that meet at a vertex (`raytrace.ray_origins`). Where a surface has two
    sides there are n more, for vertices seen from behind.
    """
    vertices, faces, normals = _in_render_space(geometry)
    points = weld_points(vertices, faces, normals=normals)
    away = 0.0 if geometry.placed.all() else INSTANCED  # all that is reckoned with is in proportion to coordinates
    surface = points.surface(vertices + away)
    tree = BVH16.of(surface.vertices.astype(np.float32), surface.faces)
    sides = [points.ray_origins(tree, surface)[0][points.group]]
    if geometry.rows[:, TWO_SIDED].any():
        sides.append(points.reversed().ray_origins(tree, surface.reversed())[0][points.group])
    origins = aligned((len(sides) * len(vertices), 3), np.float32)
    origins[:] = np.concatenate(sides) - away
    return origins


def _in_render_space(geometry: Geometry) -> tuple[Float64s, Int64s, Float64s]:
    """All objects as one mesh in render space, faces wound outwards: vertices, faces, unit vertex normals."""
    vertices, faces, normals = [], [], []
    begins = np.unique(geometry.first_face)
    ends = np.append(begins, len(geometry.faces))[np.searchsorted(begins, geometry.first_face) + 1]
    for item, size in enumerate(np.diff(geometry.first_w)):
        start = geometry.first_vertex[item]
        own = geometry.vertices[start : start + size].astype(np.float64)
        normal = geometry.normals[start : start + size].astype(np.float64)
        if not geometry.placed[item]:
            own = product(own, geometry.to_render[item, :, :3].T) + geometry.to_render[item, :, 3]
            normal = product(normal, geometry.normal_to_render[item].T)
        corners = geometry.faces[geometry.first_face[item] : ends[item]] - start + geometry.first_w[item]
        vertices.append(own)
        faces.append(corners[:, ::-1] if geometry.mirrored[item] < 0 else corners)
        normals.append(normal)
    return np.concatenate(vertices), np.concatenate(faces).astype(np.int64), normalize(np.concatenate(normals))
