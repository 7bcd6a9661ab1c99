"""Numbers of the points of all tiles, as in a bake of the whole mesh: along a curve. Directions are drawn by them."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from raytrace.mesh.morton import morton_codes
from raytrace.system.checks import check_memory
from raytrace.types import Bools, Float32s, Float64s, Int64s, UInt32s

from ..memory import vertex_bytes
from ..options import Normals
from ..points.corners import SPREAD, flattest_elsewhere
from ..points.receivers import offset_points
from .halo import TileMesh, extract_tile
from .source import on_disk, runs
from .tiling_pass import Tiling


@dataclass(frozen=True, eq=False)
class Numbering:
    """All points of a mesh of n vertices, each at the row of its first vertex; on the disk.

    Attributes:
        first: int64 (n,), the first vertex of each vertex's point, −1 for none.
        origins: float64 (n, 3), axes: float32 (n, 3), number: uint32 (n,), split: bool (n,): of points.
        order: int64 (k,), the first vertices of all points by number.
        split_first: int64 (j,), ascending, the first vertices of split points. first_corner: int64 (j,), the number of
            each one's first corner sample. corner_count: corner samples in all.
        flattest: see `flattest_elsewhere`.
    """

    first: Int64s
    origins: Float64s
    axes: Float32s
    number: UInt32s
    split: Bools
    order: Int64s
    split_first: Int64s
    first_corner: Int64s
    corner_count: int
    flattest: float


def number_points(tiling: Tiling, normals: Normals, scratch: Path) -> Numbering:
    """Find the points of every tile, then number them all."""
    count = tiling.source.vertex_count
    first = on_disk(scratch / "first", np.int64, count)
    origins = on_disk(scratch / "origins", np.float64, count, 3)
    axes = on_disk(scratch / "axes", np.float32, count, 3)
    split = np.zeros(count, np.bool_)
    flattest = 0.0
    split_first, corner_counts = [np.zeros(0, np.int64)], [np.zeros(0, np.int64)]
    first[:] = -1
    for tile in range(tiling.tiles):
        mesh = extract_tile(tiling, tile, 0.0, True)
        if not (mesh.own.any() and len(mesh.faces)):
            continue
        check_tile(tiling, mesh)
        offset = offset_points(mesh.placed, mesh.faces, normals)
        own: Bools = offset.usable & mesh.own[offset.first]
        rows = mesh.vertices[offset.first[own]]
        origins[rows], axes[rows] = offset.origins[own], offset.axes[own]
        vertices = mesh.own & offset.usable[offset.group]
        first[mesh.vertices[vertices]] = mesh.vertices[offset.first[offset.group[vertices]]]
        at_split: Bools = offset.split[offset.face_points]
        at_own: Bools = own[offset.face_points]
        flattest = max(flattest, flattest_elsewhere(offset.surface, ~at_split & at_own.any(axis=1, keepdims=True)))
        corners = np.bincount(offset.face_points[at_split], minlength=len(own))
        own_split = own & offset.split
        split_first.append(mesh.vertices[offset.first[own_split]])
        split[split_first[-1]] = True
        corner_counts.append(corners[own_split])
    points = [run.start + np.flatnonzero(first[run] == np.arange(run.start, run.stop)) for run in runs(count)]
    order = _along_curve(np.concatenate(points), origins)
    number = on_disk(scratch / "number", np.uint32, count)
    number[order] = np.arange(len(order), dtype=np.uint32)
    of_split, corners = np.concatenate(split_first), np.concatenate(corner_counts)
    by_number = np.argsort(number[of_split], kind="stable")
    of_split, corners = of_split[by_number], corners[by_number]
    first_corner = len(order) + SPREAD * (np.cumsum(corners) - corners)
    by_vertex = np.argsort(of_split)
    return Numbering(
        first, origins, axes, number, split, order, of_split[by_vertex], first_corner[by_vertex],
        SPREAD * int(corners.sum()), flattest,
    )  # fmt: skip


def check_tile(tiling: Tiling, mesh: TileMesh) -> None:
    """Raises: MemoryLimitError: a tile would not fit into memory."""
    counts = len(mesh.vertices), len(mesh.faces)
    work = f"for a tile of {counts[0]:,} vertices and {counts[1]:,} faces; more tiles are smaller"
    check_memory(tiling.source.name, vertex_bytes(*counts, 1), work)


def _along_curve(points: Int64s, origins: Float64s) -> Int64s:
    """`points`, rows of `origins`, in the order of `raytrace.mesh.morton`."""
    codes = np.empty(len(points), np.uint32)
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for run in runs(len(points)):
        positions = origins[points[run]]
        low, high = np.minimum(low, positions.min(axis=0)), np.maximum(high, positions.max(axis=0))
    for run in runs(len(points)):
        codes[run] = morton_codes(np.ascontiguousarray(origins[points[run]]), low, high)
    return points[np.argsort(codes, kind="stable")]
