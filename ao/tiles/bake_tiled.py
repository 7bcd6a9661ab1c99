"""`ao.tiles.bake_tiled.bake_tiled`: w at the vertices of a mesh on the disk, in the memory of a tile."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from raytrace.errors import OptionError
from raytrace.mesh.normals import face_normals
from raytrace.sampling.sequences import seed_key
from raytrace.system.threads import thread_count
from raytrace.types import Float64s, Int64s

from ..estimate.estimate import rays_per_corner_sample
from ..execute.tracer import Progress, Tracer
from ..falloff import Falloff
from ..mu import KernelMu, Mu
from ..options import Options
from ..points.corners import CornerSamples, find_corner_samples
from ..points.points import Points
from ..points.receivers import offset_points
from ..rays.gather import W
from ..rays.ray_scene import RayScene
from ..rays.traverse import packets_below, tried
from .halo import TileMesh, extract_tile
from .numbering import Numbering, check_tile, number_points
from .source import TileSource, on_disk, runs
from .tiling_pass import Grid, Tiling


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
        source: the mesh. scratch: an empty folder on a disk, for some 70 bytes a vertex; `TiledBake.w` lies there.
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
    numbering = number_points(tiling, chosen.normals, scratch)
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


class _TileTracer:
    """Traces tile after tile. Attributes: reach: length of rays. rays: traced so far."""

    def __init__(
        self, tiling: Tiling, numbering: Numbering, mu: KernelMu, options: Options, progress: Progress | None
    ) -> None:
        self.tiling, self.numbering, self.mu, self.options, self.progress = tiling, numbering, mu, options, progress
        self.reach, self.rays = min(mu.limit, tiling.space.diagonal), 0
        count, reach = len(numbering.order), self.reach / tiling.space.diagonal
        normals = numbering.axes[numbering.order[tried(count)]]
        below = packets_below(options.traversal, False, normals, reach, count, mu)
        self.packets_below = below if options.rays < below else 0  # at corner samples, too, as `ao.estimate` has it

    def _points(self, rows: Int64s) -> Points:
        numbering = self.numbering
        return Points(numbering.origins[rows].astype(np.float32), numbering.axes[rows], numbering.number[rows])

    def _scene(self, mesh: TileMesh) -> RayScene:
        area = face_normals(mesh.placed.astype(np.float64), mesh.faces)[1]
        return RayScene.of(mesh.placed, mesh.faces[area > 0], cone=self.options.cone)

    def trace(self, tile: int, values: Float64s) -> int:
        """Write w of a tile's points at their first vertices; the number of faces of the tile's mesh."""
        numbering = self.numbering
        mesh = extract_tile(self.tiling, tile, self.reach, False)
        vertices = mesh.vertices[mesh.own]
        rows = vertices[numbering.first[vertices] == vertices]
        if not len(rows):
            return 0
        check_tile(self.tiling, mesh)
        scene, samples = self._scene(mesh), self.options.rays
        split = numbering.split[rows]
        ordinary = rows[~split]
        ordinary = ordinary[np.argsort(numbering.number[ordinary])]
        values[ordinary] = np.clip(self._rows(scene, self._points(ordinary), samples)[:, W], 0.0, 1.0)
        if split.any():
            corners, first = self._corner_samples(tile)
            rows = self._rows(scene, corners.points, rays_per_corner_sample(samples, False))
            values[first] = np.clip(corners.mean(rows[:, :1])[:, 0], 0.0, 1.0)
        return len(mesh.faces)

    def _rows(self, scene: RayScene, points: Points, samples: int) -> Float64s:
        numbering, options = self.numbering, self.options
        total = options.rays * (len(numbering.order) - len(numbering.split_first))
        total += rays_per_corner_sample(options.rays, False) * numbering.corner_count
        how = self.packets_below, self.mu, self.reach, thread_count(options.threads), len(numbering.order)
        tracer = Tracer(scene, *how, self.progress, expected=total, rays=self.rays)
        rows = tracer.gather(points, samples, seed_key(options.seed))
        self.rays = tracer.rays
        return rows

    def _corner_samples(self, tile: int) -> tuple[CornerSamples, Int64s]:
        """Corner samples of a tile's split points, and the first vertices (j,) of these points."""
        numbering = self.numbering
        mesh = extract_tile(self.tiling, tile, 0.0, True)
        offset = offset_points(mesh.placed, mesh.faces, self.options.normals)
        own = offset.split & mesh.own[offset.first]
        own_numbers = numbering.number[mesh.vertices[offset.first]].astype(np.int64)
        number = np.where(own, own_numbers, -1 - np.arange(len(own)))
        split = np.flatnonzero(offset.split[offset.face_points])
        points = number[offset.face_points.ravel()[split]]
        corners = find_corner_samples(offset.tree, offset.surface, split, points, 0, numbering.flattest)
        kept = np.sort(number[own])
        corners, first = corners.only(kept), numbering.order[kept]
        begin = numbering.first_corner[np.searchsorted(numbering.split_first, first)]
        numbers = np.repeat(begin - corners.starts[:-1], np.diff(corners.starts)) + np.arange(len(corners.points))
        return replace(corners, points=replace(corners.points, numbers=numbers.astype(np.uint32))), first
