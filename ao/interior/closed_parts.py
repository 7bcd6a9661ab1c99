"""Which faces bound closed solids, and which points may lie in one of another part."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

Ints = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]


def closed_parts(vertices: npt.NDArray[np.float32], faces: Ints) -> tuple[Ints, Bools]:
    """The connected part (m,) of each face, and whether each part is a closed solid whose faces look outwards.

    Vertices at the same place are one. At every edge of a closed part as many faces run one way as the other.
    """
    unused = int(np.count_nonzero(np.bincount(faces.ravel(), minlength=len(vertices)) == 0))
    if _connected(faces, len(vertices))[0] <= 1 + unused:  # the usual case, told soonest
        return np.zeros(len(faces), np.int64), np.zeros(1, np.bool_)
    corners = _places(vertices)[faces]
    count, part_of_place = _connected(corners, len(vertices))
    part = part_of_place[corners[:, 0]]
    ahead = np.roll(corners, -1, axis=1)
    low, high = np.minimum(corners, ahead).ravel(), np.maximum(corners, ahead).ravel()
    way = np.where(corners < ahead, 1, -1).ravel()
    edge = low * len(vertices) + high
    order = np.argsort(edge)
    first = np.flatnonzero(np.diff(edge[order], prepend=-1))
    torn = np.add.reduceat(way[order], first) != 0
    closed = np.ones(count, np.bool_)
    closed[np.repeat(part, 3)[order[first[torn]]]] = False
    a, b, c = vertices[faces].astype(np.float64).transpose(1, 0, 2)
    volume = np.bincount(part, np.einsum("ij,ij->i", a, np.cross(b, c)), count)
    return part, closed & (volume > 0)


def inside_boxes(
    points: npt.NDArray[np.float32],
    own: Ints,
    vertices: npt.NDArray[np.float32],
    faces: Ints,
    part: Ints,
    closed: Bools,
) -> Ints:
    """Rows, ascending, of the `points` (k, 3) within the bounding box of a closed part that is not their `own` (k,)."""
    low, high = np.full((len(closed), 3), np.inf), np.full((len(closed), 3), -np.inf)
    for corner in faces.T:
        np.minimum.at(low, part, vertices[corner])
        np.maximum.at(high, part, vertices[corner])
    order = np.argsort(points[:, 0], kind="stable")
    x = points[order, 0]
    found = np.zeros(len(points), np.bool_)
    for number in np.flatnonzero(closed):
        rows = order[np.searchsorted(x, low[number, 0]) : np.searchsorted(x, high[number, 0], "right")]
        within = (points[rows] >= low[number]).all(axis=1) & (points[rows] <= high[number]).all(axis=1)
        found[rows[within & (own[rows] != number)]] = True
    return np.flatnonzero(found)


def _places(vertices: npt.NDArray[np.float32]) -> Ints:
    """A number (n,) for each vertex, the same for the same place."""
    x, y, z = (vertices + np.float32(0.0)).T  # −0 becomes 0
    order = np.lexsort((z, y, x))
    new = np.zeros(len(order), np.bool_)
    for coordinate in (x, y, z):
        new[1:] |= coordinate[order[1:]] != coordinate[order[:-1]]
    number = np.empty(len(order), np.int64)
    number[order] = np.cumsum(new)
    return number


def _connected(corners: Ints, count: int) -> tuple[int, Ints]:
    """How many components `corners` (m, 3) of `count` points make, those of no face included, and that of each (n,)."""
    a, b = corners[:, [0, 1]].ravel(), corners[:, [1, 2]].ravel()
    number, label = connected_components(coo_array((np.ones(len(a), np.bool_), (a, b)), shape=(count, count)), False)
    return number, label.astype(np.int64)
