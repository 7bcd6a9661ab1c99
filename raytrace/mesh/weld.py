"""Welding: vertices that a file stores apart, but that are one point of one surface, grouped."""

from __future__ import annotations

import numpy as np

from ..types import Float32s, Float64s, Int64s
from .components import connected_components

CREASE = float(np.cos(np.radians(30.0)))  # coincident vertices whose faces differ by more stay apart: a hard edge
_NEIGHBOURS = 64


def weld(positions: Float32s, normals: Float64s, agreement: float) -> Int64s:
    """Group (n,) of each vertex: vertices at the same place whose normals agree share a group, numbered from 0.

    Args: positions (n, 3); normals (n, 3), unit or zero (agrees with none); agreement: the least cosine.
    """
    order, place = coincident(positions)
    links: list[Int64s] = []
    for step in range(1, min(_NEIGHBOURS, len(order) - 1) + 1):
        near = np.flatnonzero(place[step:] == place[:-step])
        if not len(near):
            break
        a, b = order[near], order[near + step]
        agree = np.einsum("ij,ij->i", normals[a], normals[b]) >= agreement
        links.append(np.stack([a[agree], b[agree]], axis=1))
    return connected_components(np.concatenate(links), len(positions)) if links else np.arange(len(positions))


def coincident(positions: Float32s) -> tuple[Int64s, Int64s]:
    """Rows (k,) of all `positions` (n, 3) that occur more than once, and perhaps of a few more, sorted by place.

    Returns these and the number (k,) of each one's place, ascending from 0.
    """
    rows = _repeated(positions + np.float32(0.0))  # −0 becomes 0
    x, y, z = (positions[rows] + np.float32(0.0)).T
    order = np.lexsort((z, y, x))
    new = np.zeros(len(rows), np.bool_)
    for coordinate in (x, y, z):
        new[1:] |= coordinate[order[1:]] != coordinate[order[:-1]]
    return rows[order], np.cumsum(new)


def sum_groups(group: Int64s, values: Float64s) -> Float64s:
    """Sums (k, 3) of the `values` (n, 3) of each group."""
    return np.stack([np.bincount(group, values[:, axis]) for axis in range(3)], axis=1)


def _repeated(positions: Float32s) -> Int64s:
    """Rows, ascending, of all positions (n, 3) that occur more than once, and perhaps of a few more."""
    x, y, z = np.ascontiguousarray(positions).view(np.uint32).T.astype(np.uint64)
    keys = x * np.uint64(0x9E3779B97F4A7C15) ^ y * np.uint64(0xC2B2AE3D27D4EB4F) ^ z * np.uint64(0x165667B19E3779F9)
    ordered = np.sort(keys)
    twice = ordered[1:][ordered[1:] == ordered[:-1]]
    if not len(twice):
        return np.zeros(0, np.int64)
    return np.flatnonzero(twice[np.minimum(np.searchsorted(twice, keys), len(twice) - 1)] == keys)
