"""How much memory a bake takes beside its mesh, told from counts.

The coefficients are fitted to measured peaks (`python -m benchmarks.memory`): of smooth meshes, welded and loose
triangles of 200,000 vertices and more they tell 0.77 to 1.41 times what was measured. Threads add next to nothing.
"""

from __future__ import annotations

_BASE = 75 << 20  # kernels, Embree, threads
_TABLE, _DIRECTION = 1 << 18, 100  # directions in a table, and bytes for each while it is made
_VERTEX, _FACE = 264, 136
_PREDICTING_FACE, _FILLING_FACE = 160, 300
_SURFACE_VERTEX, _SURFACE_FACE = 72, 660


def vertex_bytes(vertices: int, faces: int, samples: int, predicts: bool = False, fills: bool = False) -> int:
    """Bytes that `ao.bake` takes at its peak. Args: predicts: to a tolerance; fills: `hidden="fill"`."""
    directions = samples * min(max(_TABLE // samples, 8), 256)
    beside = max(predicts * _PREDICTING_FACE, fills * _FILLING_FACE)
    return _BASE + _DIRECTION * directions + _VERTEX * vertices + (_FACE + beside) * faces


def surface_bytes(vertices: int, faces: int) -> int:
    """Bytes that `ao.bake_surface` takes at its peak."""
    return _BASE + _SURFACE_VERTEX * vertices + _SURFACE_FACE * faces
