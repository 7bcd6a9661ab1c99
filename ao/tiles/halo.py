"""The part of a mesh that w at a tile's vertices depends on.

That is the faces which rays from these vertices can hit, and the faces that decide where the rays begin: faces at the
vertices, at vertices that coincide with them, and at the neighbours of both.
"""

from typing import NamedTuple

import numpy as np

from raytrace.mesh.weld import grids
from raytrace.types import Bools, Float32s, Int64s

from .source import runs
from .tiling_pass import Tiling

MARGIN = 2.0**-7  # of render space: ray origins are within 2^-9 of vertices, and faces near them within 2^-8
_ROUNDED = np.float32(2.0**-20)  # of a face's coordinates: more than the rounded distance of a point on it


class TileMesh(NamedTuple):
    """Faces with vertices of their own, in the order of the whole mesh.

    Attributes:
        vertices: int64 (n,), ascending, rows of the whole mesh. placed: float32 (n, 3), in render space.
        faces: int64 (m, 3), rows of `placed`. own: bool (n,), the vertices of the tile.
    """

    vertices: Int64s
    placed: Float32s
    faces: Int64s
    own: Bools


def extract_tile(tiling: Tiling, tile: int, reach: float, origins: bool) -> TileMesh:
    """The mesh of a tile. Args: reach: length of its rays, in render space. origins: also what decides ray origins."""
    low, high = _box(tiling, tile)
    size = max(1.0, float(np.abs([low, high]).max())) if (low <= high).all() else 1.0
    low, high = low - np.float32(reach + MARGIN * size), high + np.float32(reach + MARGIN * size)
    source, kept, rim = tiling.source, [np.zeros(0, np.int64)], [np.zeros(0, np.int64)]
    for run in runs(source.face_count):
        faces = source.faces(run.start, run.stop)
        corners = tiling.placed[faces]
        face_low, face_high = corners.min(axis=1), corners.max(axis=1)
        rounded = _ROUNDED * np.maximum(-face_low, face_high).max(axis=1, keepdims=True)
        near = (face_low - rounded <= high).all(axis=1) & (face_high + rounded >= low).all(axis=1)
        kept.append(run.start + np.flatnonzero(near))
        if origins:
            rim.append(np.unique(faces[(tiling.tile[faces] == tile).any(axis=1)]))
    rows, at_rim = np.concatenate(kept), np.unique(np.concatenate(rim))
    if len(at_rim):
        rows = np.union1d(rows, _faces_at(tiling, at_rim))
    faces = np.empty((len(rows), 3), np.int64)
    for run in runs(source.face_count):
        first, last = np.searchsorted(rows, [run.start, run.stop])
        if first < last:
            faces[first:last] = source.faces(run.start, run.stop)[rows[first:last] - run.start]
    own = [run.start + np.flatnonzero(tiling.tile[run] == tile) for run in runs(source.vertex_count)]
    vertices = np.union1d(np.unique(faces), np.concatenate(own))
    place = np.searchsorted(vertices, faces)
    return TileMesh(vertices, np.ascontiguousarray(tiling.placed[vertices]), place, tiling.tile[vertices] == tile)


def _box(tiling: Tiling, tile: int) -> tuple[Float32s, Float32s]:
    """The bounding box of a tile's vertices; empty without vertices."""
    low, high = np.full(3, np.inf, np.float32), np.full(3, -np.inf, np.float32)
    for run in runs(tiling.source.vertex_count):
        own = tiling.placed[run][tiling.tile[run] == tile]
        if len(own):
            low, high = np.minimum(low, own.min(axis=0)), np.maximum(high, own.max(axis=0))
    return low, high


def _faces_at(tiling: Tiling, vertices: Int64s) -> Int64s:
    """The rows of all faces with a corner at one of `vertices`, ascending, and perhaps of a few more."""
    cells = [np.unique(keys) for _, keys in grids(tiling.placed[vertices])]
    touched = np.zeros(tiling.source.vertex_count, np.bool_)
    for run in runs(tiling.source.vertex_count):
        for (rows, keys), known in zip(grids(tiling.placed[run]), cells, strict=True):
            touched[run.start + rows[np.isin(keys, known)]] = True
    faces = ((run.start, tiling.source.faces(run.start, run.stop)) for run in runs(tiling.source.face_count))
    return np.concatenate([start + np.flatnonzero(touched[rows].any(axis=1)) for start, rows in faces])
