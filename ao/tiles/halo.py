"""The part of a mesh that a tile's vertices depend on.

What rays of theirs can meet, and all faces that decide where those rays begin: those at the vertices, at vertices that
coincide with them, and at the neighbours of both.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from raytrace.mesh.weld import grids
from raytrace.types import Bools, Float32s, Int64s

from .source import runs
from .survey import Survey

MARGIN = 2.0**-7  # of render space: ray origins are within 2^-9 of vertices, and what is near them within 2^-8
_ROUNDED = np.float32(2.0**-20)  # of a face's coordinates, and more: how far from it what touches it may be


class Piece(NamedTuple):
    """Faces with vertices of their own, in the order of the whole mesh.

    Attributes:
        vertices: int64 (n,), ascending: which of the whole mesh. placed: float32 (n, 3), where they are.
        faces: int64 (m, 3), into these. own: bool (n,), the vertices of the tile.
    """

    vertices: Int64s
    placed: Float32s
    faces: Int64s
    own: Bools


def cut(survey: Survey, tile: int, reach: float, origins: bool) -> Piece:
    """What tile number `tile` needs.

    Args: reach: length of its rays, in render space. origins: also all that decides where rays begin.
    """
    low, high = _box(survey, tile)
    size = max(1.0, float(np.abs([low, high]).max())) if (low <= high).all() else 1.0
    low, high = low - np.float32(reach + MARGIN * size), high + np.float32(reach + MARGIN * size)
    source, kept = survey.source, []
    rim: list[Int64s] = []
    for run in runs(source.face_count):
        faces = source.faces(run.start, run.stop)
        corners = survey.placed[faces]
        least, most = corners.min(axis=1), corners.max(axis=1)
        rounded = _ROUNDED * np.maximum(-least, most).max(axis=1, keepdims=True)
        near = (least - rounded <= high).all(axis=1) & (most + rounded >= low).all(axis=1)
        kept.append(run.start + np.flatnonzero(near))
        if origins:
            rim.append(np.unique(faces[(survey.tile[faces] == tile).any(axis=1)]))
    rows = np.concatenate(kept)
    if origins and any(map(len, rim)):
        rows = np.union1d(rows, _around(survey, np.unique(np.concatenate(rim))))
    faces = _take_faces(survey, rows)
    used = np.unique(faces)
    own_vertices = np.concatenate([run.start + np.flatnonzero(survey.tile[run] == tile) for run in _all(survey)])
    vertices = np.union1d(used, own_vertices)
    place = np.searchsorted(vertices, faces)
    return Piece(vertices, np.ascontiguousarray(survey.placed[vertices]), place, survey.tile[vertices] == tile)


def _all(survey: Survey) -> list[slice]:
    return list(runs(survey.source.vertex_count))


def _box(survey: Survey, tile: int) -> tuple[Float32s, Float32s]:
    """The bounding box of a tile's vertices; of none an empty one."""
    low, high = np.full(3, np.inf, np.float32), np.full(3, -np.inf, np.float32)
    for run in _all(survey):
        own = survey.placed[run][survey.tile[run] == tile]
        if len(own):
            low, high = np.minimum(low, own.min(axis=0)), np.maximum(high, own.max(axis=0))
    return low, high


def _around(survey: Survey, vertices: Int64s) -> Int64s:
    """The rows of all faces with a corner where any of `vertices`, ascending, is, and perhaps of a few more."""
    places = [np.unique(keys) for _, keys in grids(survey.placed[vertices])]
    touched = np.zeros(survey.source.vertex_count, np.bool_)
    for run in _all(survey):
        for (rows, keys), known in zip(grids(survey.placed[run]), places, strict=True):
            touched[run.start + rows[np.isin(keys, known)]] = True
    found_rows = []
    for run in runs(survey.source.face_count):
        faces = survey.source.faces(run.start, run.stop)
        found_rows.append(run.start + np.flatnonzero(touched[faces].any(axis=1)))
    return np.concatenate(found_rows)


def _take_faces(survey: Survey, rows: Int64s) -> Int64s:
    """The faces (k, 3) of ascending `rows` (k,)."""
    out, source = np.empty((len(rows), 3), np.int64), survey.source
    for run in runs(source.face_count):
        first, last = np.searchsorted(rows, [run.start, run.stop])
        if first < last:
            out[first:last] = source.faces(run.start, run.stop)[rows[first:last] - run.start]
    return out
