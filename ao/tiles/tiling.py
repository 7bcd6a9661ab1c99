"""A pass over the whole mesh before its tiles: bounds, render space, every vertex in it, and the tile of each; tiles.

The mesh of a tile has the faces which rays from its vertices can hit, and the faces that decide where the rays begin:
faces at the vertices, at vertices that coincide with them, and at the neighbours of both.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple, Self

import numpy as np

from raytrace.errors import MeshError
from raytrace.mesh.mesh import LARGEST
from raytrace.mesh.placement import RenderSpace, sample
from raytrace.mesh.weld import grids
from raytrace.types import Bools, Float32s, Float64s, Int32s, Int64s

from .source import TileSource, bounds, on_disk, runs

Grid = tuple[int, int, int]
MARGIN = 2.0**-7  # of render space: ray origins are within 2^-9 of vertices, and faces near them within 2^-8
_ROUNDED = np.float32(2.0**-20)  # of a face's coordinates: more than the rounded distance of a point on it


@dataclass(frozen=True, eq=False)
class Tiling:
    """A mesh on the disk, placed in render space.

    Attributes:
        source: the mesh. space: where it is placed. radius: of its bounding sphere, in mesh units.
        placed: float32 (n, 3), its vertices in render space. tile: int32 (n,), the tile of each, −1 for none. Both are
        on the disk. tiles: number of tiles.
    """

    source: TileSource
    space: RenderSpace
    radius: float
    placed: Float32s
    tile: Int32s
    tiles: int

    @classmethod
    def of(cls, source: TileSource, grid: Grid, scratch: Path) -> Self:
        """Read all vertices and faces. Raises: MeshError: coordinates not finite or too large, indices out of range."""
        used = _used(source)
        low, high = bounds(_checked(source, used))
        space = RenderSpace.around(low, high, _sample(source, used))
        count = source.vertex_count
        placed = on_disk(scratch / "placed", np.float32, count, 3)
        tile = on_disk(scratch / "tile", np.int32, count)
        for run in runs(count):
            placed[run] = space.place(source.vertices(run.start, run.stop))
        first, last = (space.place(corner[None])[0].clip(-1, 1) for corner in (low, high))
        cells, extent = np.array(grid), np.maximum(last - first, np.float32(1e-30))
        for run in runs(count):
            cell = ((placed[run].clip(-1, 1) - first) / extent * cells).clip(0, cells - 1).astype(np.int32)
            tile[run] = np.where(used[run], np.ravel_multi_index(tuple(cell.T), grid), -1)
        return cls(source, space, _radius(source, used, low, high), placed, tile, int(cells.prod()))


def _checked(source: TileSource, used: Bools) -> Iterator[Float64s]:
    """The vertices that faces use."""
    for run in runs(source.vertex_count):
        vertices = source.vertices(run.start, run.stop)
        if not np.abs(vertices).max() <= LARGEST:
            bad = run.start + int(np.argmax(~(np.abs(vertices) <= LARGEST).all(axis=1)))
            expected = f"finite coordinates up to {LARGEST:g}"
            raise MeshError(source.name, f"vertices[{bad}]", expected, vertices[bad - run.start])
        yield vertices[used[run]]


def _radius(source: TileSource, used: Bools, low: Float64s, high: Float64s) -> float:
    """As `raytrace.Mesh.radius`."""
    centre = low + (high - low) / 2
    largest = float(np.abs([low - centre, high - centre]).max())
    if largest <= 0:
        return 0.0
    squares = (((((each - centre) / largest) ** 2).sum(axis=1)).max(initial=0.0) for each in _checked(source, used))
    return float(largest * np.sqrt(max(squares)))


def _sample(source: TileSource, used: Bools) -> Float64s:
    """The `raytrace.mesh.placement.sample` of the vertices that faces use."""
    rows = np.flatnonzero(used)
    rows, vertices = rows[sample(len(rows))], []
    for run in runs(source.vertex_count):
        own = rows[np.searchsorted(rows, run.start) : np.searchsorted(rows, run.stop)]
        vertices.append(source.vertices(run.start, run.stop)[own - run.start])
    return np.concatenate(vertices)


def _used(source: TileSource) -> Bools:
    """The vertices (n,) that are corners of faces."""
    used = np.zeros(source.vertex_count, np.bool_)
    for run in runs(source.face_count):
        faces = source.faces(run.start, run.stop)
        if faces.min() < 0 or faces.max() >= source.vertex_count:
            bad = int(np.argmax(((faces < 0) | (faces >= source.vertex_count)).any(axis=1)))
            expected = f"indices from 0 to {source.vertex_count - 1}"
            raise MeshError(source.name, f"faces[{run.start + bad}]", expected, faces[bad])
        used[faces] = True
    return used


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
    low, high = bounds(tiling.placed[run][tiling.tile[run] == tile] for run in runs(tiling.source.vertex_count))
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


def _faces_at(tiling: Tiling, vertices: Int64s) -> Int64s:
    """The rows of all faces with a corner at one of `vertices`, ascending, and perhaps of a few more."""
    cells = [np.unique(keys) for _, keys in grids(tiling.placed[vertices])]
    touched = np.zeros(tiling.source.vertex_count, np.bool_)
    for run in runs(tiling.source.vertex_count):
        for (rows, keys), known in zip(grids(tiling.placed[run]), cells, strict=True):
            touched[run.start + rows[np.isin(keys, known)]] = True
    faces = (tiling.source.faces(run.start, run.stop) for run in runs(tiling.source.face_count))
    return np.flatnonzero(np.concatenate([touched[rows].any(axis=1) for rows in faces]))
