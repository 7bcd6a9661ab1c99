"""Which side of a face is its front, where axes are given that may contradict the windings of a file.

A front is on the side from which the corners run anticlockwise, wherever an axis points: the underside of a ball is no
front of its inside because an axis is up. But a whole patch that looks away from its axes is wound the wrong way round.
"""

import numpy as np

from ..mesh.weld import coincident, connected_components
from ..types import AnyInts, Bools, Float64s, Int64s

AWAY = -0.7  # mean cosine between normals and axes, below which faces are wound the wrong way round


def wound_away(vertices: Float64s, faces: Int64s, normals: Float64s, areas: Float64s, axes: Float64s) -> Bools:
    """Which faces (m,) are of patches whose normals look away from the `axes` (n, 3), unit or zero, of their vertices.

    A patch hangs together by edges that two faces run along in opposite ways, wherever their vertices are stored.

    Args: faces: (m, 3), none degenerate. normals: (m, 3), unit. areas: (m,).
    """
    corner_axes = axes[faces]
    along = areas * np.einsum("fi,fci->f", normals, corner_axes)
    if not (along < 0).any():
        return np.zeros(len(faces), np.bool_)
    patch = connected_components(_facing_pairs(coincident(vertices.astype(np.float32), faces)[faces]), len(faces))
    weights = areas * corner_axes.any(axis=2).sum(axis=1)
    away = np.bincount(patch, along) < AWAY * np.bincount(patch, weights)
    return np.asarray(away[patch])


def _facing_pairs(corners: AnyInts) -> AnyInts:
    """Pairs (j, 2) that connect the faces (m, 3) at each edge along which some run one way and some the other."""
    starts = corners.ravel()
    ends = corners[:, [1, 2, 0]].ravel()
    low, high = np.minimum(starts, ends), np.maximum(starts, ends)
    order = np.lexsort((high, low))
    is_new = np.diff(low[order], prepend=-1).astype(np.bool_) | np.diff(high[order], prepend=-1).astype(np.bool_)
    edge = np.cumsum(is_new) - 1
    ascending = np.bincount(edge, (starts < ends)[order])
    both_ways = (ascending > 0) & (ascending < np.bincount(edge))
    later = np.flatnonzero(~is_new & both_ways[edge])
    return np.stack([order[later - 1], order[later]], axis=1) // 3
