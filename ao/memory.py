"""Estimates of the memory that a bake takes beside its mesh, from counts.

The coefficients are fitted to peaks of the whole command, of .1 to 5 million triangles (evidence/reliability.md):
spheres, loose triangles, an STL's unshared vertices. Threads and rays add next to nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from obscurance.raytrace.mesh.opacity import opacity_bytes

if TYPE_CHECKING:
    from obscurance.raytrace.mesh.mesh import Mesh

    from .options import Options

_BASE = 32 << 20  # kernels, Embree, threads
_TABLE, _DIRECTION = 1 << 18, 100  # directions in a table, and bytes for each while it is made
_VERTEX, _POINT, _FACE = 45, 110, 85
TRACED = 140  # of a point, what is taken once the vertices are welded
_CORNER, _COLUMN = 450, 80
_SURFACE, _SURFACE_VERTEX, _SURFACE_FACE = 64 << 20, 72, 750  # the first is SciPy and blocks on their way to disk
_SURFACE_COLUMN = 64  # of a face
_LAYOUT, _TEXTURED_FACE = 730, 390  # a face on the page while seams are sought; while texels are traced
_TEXEL, _COVERED_TEXEL = 40, 130
TRACED_TEXEL = 300  # beside that, of each to trace rays at
_TRACED_SHARE = 0.15  # of the covered texels, where one may stand for several


def bytes_at_vertices(meshes: Sequence[Mesh], options: Options, points: int | None = None) -> int:
    """Bytes that a bake to vertices takes at its peak.

    Args: meshes: all that occlude. points: at how many places w is wanted; None: at as many as the meshes may have.
    """
    vertices, faces = _counts(meshes)
    if options.method == "surface":
        columns = column_bytes(vertices, options.columns) + _SURFACE_COLUMN * faces * (options.columns - 1)
        return _opacity_bytes(meshes) + columns + surface_bytes(vertices, faces)
    columns = column_bytes(vertices if points is None else points, options.columns)
    return _opacity_bytes(meshes) + columns + vertex_bytes(vertices, faces, options.rays, points)


def bytes_of_texture(meshes: Sequence[Mesh], options: Options, texels: int, covered: int, blocks: bool) -> int:
    """Bytes that a texture takes at its peak.

    Args: meshes: all that occlude. covered: texels, by faces. blocks: whether a texel may stand for several.
    """
    vertices, faces = _counts(meshes)
    traced = int(covered * (_TRACED_SHARE if blocks else 1.0))
    page = _TEXEL * texels + _COVERED_TEXEL * covered + TRACED_TEXEL * traced + column_bytes(texels, options.columns)
    of_page = max(_LAYOUT * faces, _TEXTURED_FACE * faces + page)
    return _opacity_bytes(meshes) + vertex_bytes(vertices, 0, options.rays) + of_page


def _counts(meshes: Sequence[Mesh]) -> tuple[int, int]:
    """Numbers of vertices and of faces."""
    return sum(len(mesh.vertices) for mesh in meshes), sum(len(mesh.faces) for mesh in meshes)


def _opacity_bytes(meshes: Sequence[Mesh]) -> int:
    return opacity_bytes([mesh.opacity for mesh in meshes if mesh.opacity])


def vertex_bytes(vertices: int, faces: int, samples: int, points: int | None = None) -> int:
    """Bytes that the vertex method takes at its peak, to a tolerance of at most so many samples too.

    Args: points: how many the vertices are once they are welded; None: as of a closed surface.
    """
    directions = samples * min(max(_TABLE // samples, 8), 256)
    points = min(vertices, faces // 2) if points is None else points
    return _BASE + _DIRECTION * directions + _VERTEX * vertices + _POINT * points + _FACE * faces


def column_bytes(points: int, columns: int) -> int:
    """Bytes that estimates by several falloffs take beside those by one, at vertices or texels."""
    return _COLUMN * points * (columns - 1)


def corner_bytes(corners: int) -> int:
    """Bytes that the corner samples of folded vertices take."""
    return _CORNER * corners


def surface_bytes(vertices: int, faces: int) -> int:
    """Bytes that the surface method takes at its peak."""
    return _BASE + _SURFACE + _SURFACE_VERTEX * vertices + _SURFACE_FACE * faces
