"""A pass over the whole mesh before its tiles: bounds, render space, every vertex in it, and the tile of each."""

from dataclasses import dataclass
from pathlib import Path
from typing import Self

import numpy as np

from raytrace.errors import MeshError
from raytrace.mesh.mesh import LARGEST
from raytrace.mesh.placement import RenderSpace, sample
from raytrace.types import Bools, Float32s, Float64s, Int32s

from .source import TileSource, on_disk, runs

Grid = tuple[int, int, int]


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
        """Read all vertices and faces. Args: grid: number of tiles along each axis.

        Raises: MeshError: coordinates are not finite or too large, or indices out of range.
        """
        used = _used(source)
        low, high = _bounds(source, used)
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


def _bounds(source: TileSource, used: Bools) -> tuple[Float64s, Float64s]:
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for run in runs(source.vertex_count):
        vertices = source.vertices(run.start, run.stop)
        if not np.abs(vertices).max() <= LARGEST:
            bad = run.start + int(np.argmax(~(np.abs(vertices) <= LARGEST).all(axis=1)))
            expected = f"finite coordinates up to {LARGEST:g}"
            raise MeshError(source.name, f"vertices[{bad}]", expected, vertices[bad - run.start])
        vertices = vertices[used[run]]
        low, high = np.vstack([low, vertices]).min(axis=0), np.vstack([high, vertices]).max(axis=0)
    return low, high


def _radius(source: TileSource, used: Bools, low: Float64s, high: Float64s) -> float:
    """As `raytrace.Mesh.radius`."""
    centre = low + (high - low) / 2
    largest = float(np.abs([low - centre, high - centre]).max())
    if largest <= 0:
        return 0.0
    vertices = (source.vertices(run.start, run.stop)[used[run]] for run in runs(source.vertex_count))
    squares = (((((each - centre) / largest) ** 2).sum(axis=1)).max(initial=0.0) for each in vertices)
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
