"""Estimates of the memory that a bake takes beside its mesh, from counts.

The coefficients are fitted to peaks of the whole command, of .1 to 5 million triangles (evidence/reliability.md):
spheres, loose triangles, an STL's unshared vertices. Threads and rays add next to nothing.
"""

_BASE = 32 << 20  # kernels, Embree, threads
_TABLE, _DIRECTION = 1 << 18, 100  # directions in a table, and bytes for each while it is made
_VERTEX, _POINT, _FACE = 40, 190, 100
TRACED = 190  # of a point, what is taken once the vertices are welded
_CORNER, _COLUMN = 450, 80
_SURFACE, _SURFACE_VERTEX, _SURFACE_FACE = 64 << 20, 72, 750  # the first is SciPy and blocks on their way to disk
_LAYOUT, _TEXTURED_FACE = 730, 390  # a face on the page while seams are sought; while texels are traced
_TEXEL, _COVERED_TEXEL = 40, 130
TRACED_TEXEL = 300  # beside that, of each to trace rays at
_TRACED_SHARE = 0.15  # of the covered texels, where one may stand for several


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
    return _CORNER * corners


def surface_bytes(vertices: int, faces: int) -> int:
    """Bytes that the surface method takes at its peak."""
    return _BASE + _SURFACE + _SURFACE_VERTEX * vertices + _SURFACE_FACE * faces


def texture_bytes(texels: int, covered: int, vertices: int, faces: int, samples: int, blocks: bool) -> int:
    """Bytes that a texture takes at its peak.

    Args: covered: texels, by faces. blocks: whether a texel may stand for several.
    """
    traced = int(covered * (_TRACED_SHARE if blocks else 1.0))
    page = _TEXEL * texels + _COVERED_TEXEL * covered + TRACED_TEXEL * traced
    return vertex_bytes(vertices, 0, samples) + max(_LAYOUT * faces, _TEXTURED_FACE * faces + page)
