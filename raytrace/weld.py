"""Which vertices are one point of one surface, though a file stores them apart."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]

CREASE = float(np.cos(np.radians(30.0)))  # coincident vertices whose faces differ by more stay apart: a hard edge
_NEIGHBOURS = 64


def weld(positions: npt.NDArray[np.float32], normals: Floats, agreement: float) -> Ints:
    """Group (n,) of each vertex: vertices at the same place whose normals agree share a group, numbered from 0.

    Args: positions (n, 3); normals (n, 3), unit or zero (agrees with none); agreement: the least cosine.
    """
    count = len(positions)
    x, y, z = (positions + np.float32(0.0)).T  # −0 becomes 0
    order = np.lexsort((z, y, x))
    same = np.ones(count - 1, bool)
    for coordinate in (x, y, z):
        same &= coordinate[order[1:]] == coordinate[order[:-1]]
    run = np.concatenate([[0], np.cumsum(~same)])
    pairs: list[tuple[npt.NDArray[Any], npt.NDArray[Any]]] = []
    for step in range(1, min(_NEIGHBOURS, count - 1) + 1):
        near = np.flatnonzero(run[step:] == run[:-step])
        if not len(near):
            break
        a, b = order[near], order[near + step]
        agree = np.einsum("ij,ij->i", normals[a], normals[b]) >= agreement
        pairs.append((a[agree], b[agree]))
    if not pairs:
        return np.arange(count)
    a, b = (np.concatenate(side) for side in zip(*pairs, strict=True))
    graph = coo_array((np.ones(len(a), bool), (a, b)), shape=(count, count))
    return connected_components(graph, directed=False)[1].astype(np.int64)
