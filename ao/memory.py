"""Estimates of the memory that a bake takes beside its mesh, from counts.

The coefficients are fitted to measured peaks (`python -m benchmarks.memory.baking`): of a smooth mesh and of loose
triangles of 200,000 and 600,000 vertices they give 0.98 to 1.54 times what was measured. Threads add next to nothing.
"""

from __future__ import annotations

_BASE = 40 << 20  # kernels, Embree, threads
_TABLE, _DIRECTION = 1 << 18, 100  # directions in a table, and bytes for each while it is made
_VERTEX, _FACE = 560, 120
_CORNER = 450
_SURFACE_VERTEX, _SURFACE_FACE = 72, 660
_TEXEL = 760


def vertex_bytes(vertices: int, faces: int, samples: int) -> int:
    """Bytes that the vertex method takes at its peak, to a tolerance of at most so many samples too."""
    directions = samples * min(max(_TABLE // samples, 8), 256)
    return _BASE + _DIRECTION * directions + _VERTEX * vertices + _FACE * faces


def corner_bytes(corners: int) -> int:
    return _CORNER * corners


def surface_bytes(vertices: int, faces: int) -> int:
    return _BASE + _SURFACE_VERTEX * vertices + _SURFACE_FACE * faces


def texture_bytes(texels: int, vertices: int, faces: int, samples: int) -> int:
    """Bytes that a texture takes at its peak, if all of its texels are covered."""
    return vertex_bytes(vertices, 3 * faces, samples) + _TEXEL * texels
