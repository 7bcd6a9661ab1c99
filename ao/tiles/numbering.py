"""The points of all tiles, numbered as those of the whole mesh are: along a curve, from which their rays are drawn."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from raytrace.system.memory import check_memory
from raytrace.types import Bools, Float32s, Float64s, Int64s, UInt32s

from ..memory import vertex_bytes
from ..options import Normals
from ..points.corners import SPREAD, flattest_elsewhere
from ..points.morton import morton_codes
from ..points.receivers import lift_points
from .halo import Piece, cut
from .source import on_disk, runs
from .survey import Survey


@dataclass(frozen=True, eq=False)
class Numbering:
    """All points of a mesh of n vertices, each at the row of its first vertex; on the disk.

    Attributes:
        first: int64 (n,), the first vertex of each vertex's point, −1 for none.
        origins: float64 (n, 3), axes: float32 (n, 3), number: uint32 (n,), torn: bool (n,): of points.
        count: how many points there are. order: int64 (count,), their first vertices by number.
        torn_first: int64 (j,), ascending: the points that are folded or opposed. places_from: int64 (j,), the number of
            the first place of each; places: how many these are in all.
        flattest: see `flattest_elsewhere`.
    """

    first: Int64s
    origins: Float64s
    axes: Float32s
    number: UInt32s
    torn: Bools
    count: int
    order: Int64s
    torn_first: Int64s
    places_from: Int64s
    places: int
    flattest: float


def number_points(survey: Survey, normals: Normals, scratch: Path) -> Numbering:
    """Lift the points of every tile, then number them all."""
    count = survey.source.vertex_count
    first = on_disk(scratch / "first", np.int64, count)
    origins = on_disk(scratch / "origins", np.float64, count, 3)
    axes = on_disk(scratch / "axes", np.float32, count, 3)
    torn = np.zeros(count, np.bool_)
    flattest = 0.0
    torn_first, corner_counts = [np.zeros(0, np.int64)], [np.zeros(0, np.int64)]
    for run in runs(count):
        first[run] = -1
    for tile in range(survey.tiles):
        piece = cut(survey, tile, 0.0, True)
        if not (piece.own.any() and len(piece.faces)):
            continue
        check_tile(survey, piece)
        lifted = lift_points(piece.placed, piece.faces, normals)
        own: Bools = lifted.usable & piece.own[lifted.first]
        rows = piece.vertices[lifted.first[own]]
        origins[rows], axes[rows] = lifted.origins[own], lifted.axes[own]
        vertices = piece.own & lifted.usable[lifted.group]
        first[piece.vertices[vertices]] = piece.vertices[lifted.first[lifted.group[vertices]]]
        at_torn: Bools = lifted.torn[lifted.face_points]
        at_own: Bools = own[lifted.face_points]
        flattest = max(flattest, flattest_elsewhere(lifted.surface, ~at_torn & at_own.any(axis=1, keepdims=True)))
        corners = np.bincount(lifted.face_points[at_torn], minlength=len(own))
        own_torn = own & lifted.torn
        torn[piece.vertices[lifted.first[own_torn]]] = True
        torn_first.append(piece.vertices[lifted.first[own_torn]])
        corner_counts.append(corners[own_torn])
    return _numbered(
        first, origins, axes, torn, np.concatenate(torn_first), np.concatenate(corner_counts), flattest, scratch
    )


def check_tile(survey: Survey, piece: Piece) -> None:
    """Raises: MemoryLimitError: a tile would not fit into memory."""
    counts = len(piece.vertices), len(piece.faces)
    work = f"for a tile of {counts[0]:,} vertices and {counts[1]:,} faces; more tiles are smaller"
    check_memory(survey.source.name, vertex_bytes(*counts, 1), work)


def _numbered(
    first: Int64s,
    origins: Float64s,
    axes: Float32s,
    torn: Bools,
    torn_first: Int64s,
    corners: Int64s,
    flattest: float,
    scratch: Path,
) -> Numbering:
    count = len(first)
    points = np.concatenate(
        [run.start + np.flatnonzero(first[run] == np.arange(run.start, run.stop)) for run in runs(count)]
    )
    codes = np.empty(len(points), np.uint32)
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for run in runs(len(points)):
        some = origins[points[run]]
        low, high = np.minimum(low, some.min(axis=0)), np.maximum(high, some.max(axis=0))
    for run in runs(len(points)):
        codes[run] = morton_codes(np.ascontiguousarray(origins[points[run]]), low, high)
    order = points[np.argsort(codes, kind="stable")]
    number = on_disk(scratch / "number", np.uint32, count)
    number[order] = np.arange(len(order), dtype=np.uint32)
    by_number = np.argsort(number[torn_first], kind="stable")
    torn_first, corners = torn_first[by_number], corners[by_number]
    places_from = len(order) + SPREAD * (np.cumsum(corners) - corners)
    by_vertex = np.argsort(torn_first)
    return Numbering(
        first, origins, axes, number, torn, len(order), order, torn_first[by_vertex], places_from[by_vertex],
        SPREAD * int(corners.sum()), flattest,
    )  # fmt: skip
