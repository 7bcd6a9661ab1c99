"""`ao.tiles.bake_tiled.bake_tiled`: w at the vertices of a mesh on the disk, in the memory of a tile."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from raytrace.errors import OptionError
from raytrace.mesh.morton import morton_codes
from raytrace.mesh.normals import face_normals
from raytrace.sampling.sequences import seed_key
from raytrace.system.checks import check_memory
from raytrace.system.threads import thread_count
from raytrace.types import Bools, Float32s, Float64s, Int32s, Int64s, UInt32s

from ..estimate.estimate import rays_per_corner_sample
from ..execute.checkpoint import NOTHING_KEPT
from ..execute.tracer import Progress, Tracer
from ..falloff import Falloff
from ..memory import vertex_bytes
from ..mu import KernelMu, Mu
from ..options import Normals, Options
from ..points.corners import SPREAD, CornerSamples, find_corner_samples, flattest_elsewhere
from ..points.points import Points
from ..points.receivers import offset_points
from ..rays.gather import W
from ..rays.ray_scene import RayScene
from ..rays.traverse import packets_below, tried
from .source import TileSource, bounds, on_disk, runs
from .tiling import Grid, TileMesh, Tiling, extract_tile


@dataclass(frozen=True, eq=False)
class TiledBake:
    """Attributes:
    w: float64 (n,), on the disk: the bits of `ao.bake(…, denoise=False, interior="ignore").w`.
    rays: traced. mu: the falloff, in mesh units. tiles: how many had vertices.
    halo: faces of all tiles' meshes over faces of the mesh, less 1.
    """

    w: Float64s
    rays: int
    mu: Mu
    tiles: int
    halo: float


def bake_tiled(
    source: TileSource,
    scratch: Path,
    grid: Grid = (2, 2, 2),
    falloff: Falloff | str | None = None,
    samples: int | None = None,
    progress: Progress | None = None,
    **options: Any,
) -> TiledBake:
    """w at every vertex of a mesh that need not fit into memory, not denoised.

    Args:
        source: the mesh. scratch: an empty folder on a disk, for some 75 bytes a vertex; `TiledBake.w` lies there.
        grid: tiles along x, y and z; memory holds one, with the faces within `max_distance` of it.
        falloff: with a finite `max_distance`. samples, progress, options: as `ao.bake` takes them.

    Raises:
        OptionError: an argument is out of range, or nothing limits the distance.
        MeshError: `source` is no mesh.
        MemoryLimitError: a tile would not fit into memory.
        OutputError: the disk of `scratch` is full.
    """
    plain: dict[str, Any] = {"denoise": False, "interior": "ignore"}
    chosen = Options(falloff, samples, **plain | options)
    if chosen.normals == "file":
        raise OptionError("normals", "angle, area or equal for tiles", "file")
    tiling = Tiling.of(source, grid, scratch)
    (mu,) = chosen.mus(tiling.radius)
    if not mu.max_distance < np.inf:
        expected = "a finite distance: without one, rays of every tile may meet the whole mesh"
        raise OptionError("max_distance", expected, mu.max_distance)
    numbering = _number_points(tiling, chosen.normals, scratch)
    tracer = _TileTracer(tiling, numbering, mu.in_render_space(tiling.space.scale), chosen, progress)
    values = on_disk(scratch / "w", np.float64, source.vertex_count)
    tiles = faces = 0
    for tile in range(tiling.tiles):
        traced = tracer.trace(tile, values)
        tiles, faces = tiles + (traced > 0), faces + traced
    for run in runs(source.vertex_count):
        first = numbering.first[run]
        values[run] = np.where(first >= 0, values[np.maximum(first, 0)], 1.0)
    return TiledBake(values, tracer.rays, mu, tiles, faces / source.face_count - 1)


@dataclass(frozen=True, eq=False)
class _Numbering:
    """All points of a mesh of n vertices, each at the row of its first vertex; on the disk.

    They are numbered along a curve, as in a bake of the whole mesh: directions are drawn by the numbers.

    Attributes:
        first: int64 (n,), the first vertex of each vertex's point, −1 for none.
        origins: float64 (n, 3), axes: float32 (n, 3), number: uint32 (n,), of points.
        corners: int32 (n,), of the faces at split points, 0 at others.
        order: int64 (k,), the first vertices of all points by number.
        split: int64 (j,), ascending, the numbers of split points. first_corner: int64 (j,), the number of each one's
            first corner sample. corner_count: corner samples in all. flattest: see `flattest_elsewhere`.
    """

    first: Int64s
    origins: Float64s
    axes: Float32s
    number: UInt32s
    corners: Int32s
    order: Int64s
    split: Int64s
    first_corner: Int64s
    corner_count: int
    flattest: float


def _number_points(tiling: Tiling, normals: Normals, scratch: Path) -> _Numbering:
    """Find the points of every tile, then number them all."""
    count = tiling.source.vertex_count
    first = on_disk(scratch / "first", np.int64, count)
    origins = on_disk(scratch / "origins", np.float64, count, 3)
    axes = on_disk(scratch / "axes", np.float32, count, 3)
    corners = on_disk(scratch / "corners", np.int32, count)
    flattest = 0.0
    first[:] = -1
    for tile in range(tiling.tiles):
        mesh = extract_tile(tiling, tile, 0.0, True)
        if not (mesh.own.any() and len(mesh.faces)):
            continue
        _check_tile(tiling, mesh)
        offset = offset_points(mesh.placed, mesh.faces, normals)
        welded = offset.welded
        own: Bools = offset.usable & mesh.own[welded.first]
        rows = mesh.vertices[welded.first[own]]
        origins[rows], axes[rows] = offset.origins[own], welded.axes[own]
        vertices = mesh.own & offset.usable[welded.group]
        first[mesh.vertices[vertices]] = mesh.vertices[welded.first[welded.group[vertices]]]
        at_split: Bools = offset.split[welded.face_points]
        at_own: Bools = own[welded.face_points]
        flattest = max(flattest, flattest_elsewhere(offset.surface, ~at_split & at_own.any(axis=1, keepdims=True)))
        corners[rows] = np.bincount(welded.face_points[at_split], minlength=len(own))[own]
    points = [run.start + np.flatnonzero(first[run] == np.arange(run.start, run.stop)) for run in runs(count)]
    order = _along_curve(np.concatenate(points), origins)
    number = on_disk(scratch / "number", np.uint32, count)
    number[order] = np.arange(len(order), dtype=np.uint32)
    counts = corners[order]
    split = np.flatnonzero(counts)
    ends = SPREAD * np.cumsum(counts[split], dtype=np.int64)
    first_corner, corner_count = len(order) + ends - SPREAD * counts[split], int(ends[-1]) if len(ends) else 0
    return _Numbering(first, origins, axes, number, corners, order, split, first_corner, corner_count, flattest)


def _check_tile(tiling: Tiling, mesh: TileMesh) -> None:
    """Raises: MemoryLimitError: a tile would not fit into memory."""
    counts = len(mesh.vertices), len(mesh.faces)
    work = f"for a tile of {counts[0]:,} vertices and {counts[1]:,} faces; more tiles are smaller"
    check_memory(tiling.source.name, vertex_bytes(*counts, 1), work)


def _along_curve(points: Int64s, origins: Float64s) -> Int64s:
    """`points`, rows of `origins`, in the order of `raytrace.mesh.morton`."""
    codes = np.empty(len(points), np.uint32)
    low, high = bounds(origins[points[run]] for run in runs(len(points)))
    for run in runs(len(points)):
        codes[run] = morton_codes(np.ascontiguousarray(origins[points[run]]), low, high)
    return points[np.argsort(codes, kind="stable")]


class _TileTracer:
    """Traces tile after tile. Attributes: reach: length of rays. rays: traced so far."""

    def __init__(
        self, tiling: Tiling, numbering: _Numbering, mu: KernelMu, options: Options, progress: Progress | None
    ) -> None:
        self.tiling, self.numbering, self.options, self.rays = tiling, numbering, options, 0
        count, diagonal = len(numbering.order), tiling.space.diagonal
        self.reach = min(mu.limit, diagonal)
        normals = numbering.axes[numbering.order[tried(count)]]
        below = packets_below(options.traversal, False, normals, self.reach / diagonal, count, mu)
        below = below if options.rays < below else 0  # at corner samples, too, as `ao.baking` has it
        how = below, mu, self.reach, thread_count(options.threads), count, progress, NOTHING_KEPT
        rays = options.rays * (count - len(numbering.split))
        self.how = *how, rays + rays_per_corner_sample(options.rays, False) * numbering.corner_count

    def trace(self, tile: int, values: Float64s) -> int:
        """Write w of a tile's points at their first vertices; the number of faces of the tile's mesh."""
        numbering = self.numbering
        mesh = extract_tile(self.tiling, tile, self.reach, False)
        vertices = mesh.vertices[mesh.own]
        rows = vertices[numbering.first[vertices] == vertices]
        if not len(rows):
            return 0
        _check_tile(self.tiling, mesh)
        area, samples = face_normals(mesh.placed.astype(np.float64), mesh.faces)[1], self.options.rays
        scene, key = RayScene.of(mesh.placed, mesh.faces[area > 0], cone=self.options.cone), seed_key(self.options.seed)
        tracer = Tracer(scene, *self.how, rays=self.rays)
        ordinary = rows[numbering.corners[rows] == 0]
        ordinary = ordinary[np.argsort(numbering.number[ordinary])]
        origins, axes = numbering.origins[ordinary].astype(np.float32), numbering.axes[ordinary]
        points = Points(origins, axes, numbering.number[ordinary])
        values[ordinary] = np.clip(tracer.gather(points, samples, key)[:, W], 0.0, 1.0)
        if len(ordinary) < len(rows):
            corners, first = self._corner_samples(tile)
            rows = tracer.gather(corners.points, rays_per_corner_sample(samples, False), key)
            values[first] = np.clip(corners.mean(rows[:, :1])[:, 0], 0.0, 1.0)
        self.rays = tracer.rays
        return len(mesh.faces)

    def _corner_samples(self, tile: int) -> tuple[CornerSamples, Int64s]:
        """Corner samples of a tile's split points, and the first vertices (j,) of these points."""
        numbering = self.numbering
        mesh = extract_tile(self.tiling, tile, 0.0, True)
        offset = offset_points(mesh.placed, mesh.faces, self.options.normals)
        face_points, first = offset.welded.face_points, offset.welded.first
        own = offset.split & mesh.own[first]
        number = np.where(own, numbering.number[mesh.vertices[first]].astype(np.int64), -1 - np.arange(len(own)))
        split = np.flatnonzero(offset.split[face_points])
        points = number[face_points.ravel()[split]]
        corners = find_corner_samples(offset.tree, offset.surface, split, points, 0, numbering.flattest)
        kept = np.sort(number[own])
        corners, first = corners.only(kept), numbering.order[kept]
        begin = numbering.first_corner[np.searchsorted(numbering.split, kept)]
        numbers = np.repeat(begin - corners.starts[:-1], np.diff(corners.starts)) + np.arange(len(corners.points))
        return replace(corners, points=replace(corners.points, numbers=numbers.astype(np.uint32))), first
