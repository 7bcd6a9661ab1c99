"""The demonstration scene: a small colonnade on steps, finely meshed so that w at the vertices shows its creases."""

import numpy as np

from raytrace.mesh.mesh import Mesh
from raytrace.types import Float64s

from .primitives import TexturedMesh, box, merge, tube

COLUMNS = (5, 3)  # along x and along y
SPACING = 1.5
COLUMN_RADIUS, COLUMN_HEIGHT = 0.28, 2.6


def temple(fineness: float = 0.07) -> Mesh:
    """Three steps, a ring of columns with bases and capitals, and a roof slab with a pediment block.

    Args: fineness: largest edge of a mesh cell; the temple is about 8 × 5 × 4 units, z up.
    """
    half = np.array([(COLUMNS[0] - 1) / 2 * SPACING + 0.55, (COLUMNS[1] - 1) / 2 * SPACING + 0.55])
    parts = [box((0, 0, -0.05), (*(2 * half + 3.0), 0.1), fineness * 2)]
    steps = [(0.075 + 0.15 * step, 2 * half + 0.5 * (3 - step)) for step in range(3)]
    parts += [box((0, 0, height), (*size, 0.15), fineness) for height, size in steps]
    floor = 0.45
    parts += [_column(position, floor, fineness) for position in _ring()]
    top = floor + COLUMN_HEIGHT
    parts.append(box((0, 0, top + 0.2), (*(2 * half), 0.4), fineness))
    parts.append(box((0, 0, top + 0.475), (*(2 * half + 0.4), 0.15), fineness))
    parts.append(box((0, 0, top + 0.7), (*(2 * half - 0.6), 0.3), fineness))
    parts.append(box((0, 0, floor + 0.45), (1.5, 0.9, 0.9), fineness))
    return merge(parts, source="temple").mesh


def _ring() -> Float64s:
    x, y = (SPACING * (np.arange(count) - (count - 1) / 2) for count in COLUMNS)
    grid = np.array([(a, b) for a in x for b in y])
    outer = (np.abs(grid[:, 0]) > x[-1] - 1e-9) | (np.abs(grid[:, 1]) > y[-1] - 1e-9)
    return grid[outer]


def _column(position: Float64s, floor: float, fineness: float) -> TexturedMesh:
    x, y = position
    cap = 0.14
    side = 2.6 * COLUMN_RADIUS
    shaft = tube((x, y, floor + cap), COLUMN_RADIUS, COLUMN_HEIGHT - 2 * cap, fineness)
    base = box((x, y, floor + cap / 2), (side, side, cap), fineness)
    capital = box((x, y, floor + COLUMN_HEIGHT - cap / 2), (side, side, cap), fineness)
    return merge([shaft, base, capital], source="column")
