"""`ao.tiles.baking.bake_tiled`: w at the vertices of a mesh on the disk, in the memory of a tile."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from raytrace.errors import OptionError
from raytrace.mesh.normals import face_normals
from raytrace.sampling.hash import seed_key
from raytrace.system.threads import thread_count
from raytrace.types import Float64s, Int64s

from ..estimate.fixed_samples import place_samples
from ..execute.tracer import Tracer
from ..falloff import Falloff
from ..mu import KernelMu, Mu
from ..options import MAX_SAMPLES, Normals, Options, Traversal, falloff_of
from ..points.corners import Corners, find_corners
from ..points.points import Points
from ..points.receivers import lift_points
from ..rays.estimate import W
from ..rays.ray_scene import RayScene
from ..rays.traversal_choice import fewer_than, most_packets, tried, try_out
from .halo import Piece, cut
from .numbering import Numbering, check_tile, number_points
from .source import TileSource, on_disk, runs
from .survey import Grid, Survey

_FAR = 1 << 40  # number of points of other tiles


@dataclass(frozen=True, eq=False)
class TiledBake:
    """Attributes:
    w: float64 (n,), on the disk: the bits of `ao.bake(…, denoise=False, interior="ignore").w`.
    rays: traced. mu: the falloff, in mesh units. tiles: how many had vertices.
    halo: faces that tiles were given, over those of the mesh, less 1.
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
    seed: int = 0,
    threads: int | None = None,
    normals: Normals = "angle",
    traversal: Traversal = "auto",
    progress: Callable[[int, int], None] | None = None,
) -> TiledBake:
    """w at every vertex of a mesh that need not fit into memory, without reconstruction.

    Args:
        source: the mesh. scratch: an empty folder on a disk, for some 70 bytes a vertex; `TiledBake.w` lies there.
        grid: tiles along x, y and z; memory holds one with what lies within `max_distance` of it.
        falloff: with a finite `max_distance`. Others as `ao.bake` has them.

    Raises:
        OptionError: an argument is out of range, or nothing limits the distance.
        MeshError: `source` is no mesh.
        MemoryLimitError: a tile would not fit into memory.
        OutputError: the disk of `scratch` is full.
    """
    options = Options(
        "vertex", falloff_of(falloff), samples, seed, threads, normals, None, None, False, "ignore", traversal
    )
    if normals == "file":
        raise OptionError("normals", "angle, area or equal for tiles", "file")
    survey = Survey.of(source, grid, scratch)
    mu = options.falloff.resolve(survey.radius)
    if not mu.max_distance < np.inf:
        expected = "a finite distance: without one, rays of every tile may meet the whole mesh"
        raise OptionError("max_distance", expected, mu.max_distance)
    numbering = number_points(survey, normals, scratch)
    tracing = _Tracing.of(survey, numbering, mu, options, progress)
    values = on_disk(scratch / "w", np.float64, source.vertex_count)
    tiles = faces = 0
    for tile in range(survey.tiles):
        found = tracing.trace(tile, values)
        tiles, faces = tiles + (found > 0), faces + found
    for run in runs(source.vertex_count):
        first = numbering.first[run]
        values[run] = np.where(first >= 0, values[np.maximum(first, 0)], 1.0)
    return TiledBake(values, tracing.rays, mu, tiles, faces / source.face_count - 1)


@dataclass(eq=False)
class _Tracing:
    """What all tiles are traced with; rays: traced so far."""

    survey: Survey
    numbering: Numbering
    options: Options
    mu: KernelMu
    reach: float
    below: int
    progress: Callable[[int, int], None] | None
    rays: int = 0

    @classmethod
    def of(
        cls,
        survey: Survey,
        numbering: Numbering,
        mu: Mu,
        options: Options,
        progress: Callable[[int, int], None] | None,
    ) -> _Tracing:
        kernel_mu = mu.in_render_space(survey.space.scale)
        reach = min(kernel_mu.limit, survey.space.diagonal)
        made = cls(survey, numbering, options, kernel_mu, reach, 0, progress)
        if options.traversal == "embree":
            made.below = MAX_SAMPLES + 1
        elif min(options.rays, place_samples(options.rays, False)) < most_packets(kernel_mu):
            made.below = fewer_than(made._openness(), kernel_mu)
        return made

    def _openness(self) -> Float64s:
        """`try_out` of the points that are tried, each in its tile."""
        numbers = tried(self.numbering.count)
        rows = self.numbering.order[numbers]
        out = np.empty(len(rows))
        tiles = self.survey.tile[rows]
        for tile in np.unique(tiles):
            scene, which = self._scene(cut(self.survey, int(tile), self.reach, False)), tiles == tile
            out[which] = try_out(scene.tree, self._points(rows[which]), len(rows), self.mu.limit, self.reach)
        return out

    def _points(self, rows: Int64s) -> Points:
        """The points whose first vertices are `rows`."""
        numbering = self.numbering
        return Points(numbering.origins[rows].astype(np.float32), numbering.axes[rows], numbering.number[rows])

    def _scene(self, piece: Piece) -> RayScene:
        area = face_normals(piece.placed.astype(np.float64), piece.faces)[1]
        return RayScene.of(piece.placed, piece.faces[area > 0])

    def trace(self, tile: int, values: Float64s) -> int:
        """Write w of a tile's points at their first vertices; how many faces that took."""
        numbering = self.numbering
        piece = cut(self.survey, tile, self.reach, False)
        vertices = piece.vertices[piece.own]
        rows = vertices[numbering.first[vertices] == vertices]
        if not len(rows):
            return 0
        check_tile(self.survey, piece)
        scene, samples = self._scene(piece), self.options.rays
        torn = numbering.torn[rows]
        ordinary = rows[~torn]
        ordinary = ordinary[np.argsort(numbering.number[ordinary])]
        values[ordinary] = np.clip(self._rows(scene, self._points(ordinary), samples)[:, W], 0.0, 1.0)
        if torn.any():
            corners, at = self._corners(tile)
            found = self._rows(scene, corners.places, place_samples(samples, False))
            values[at] = np.clip(corners.mean(found[:, :1])[:, 0], 0.0, 1.0)
        return len(piece.faces)

    def _rows(self, scene: RayScene, points: Points, samples: int) -> Float64s:
        numbering, options = self.numbering, self.options
        total = options.rays * (numbering.count - len(numbering.torn_first))
        total += place_samples(options.rays, False) * numbering.places
        lengths, threads = (self.mu, self.reach), thread_count(options.threads)
        tracer = Tracer(scene, self.below, *lengths, threads, numbering.count, self.progress, None, total, 0, self.rays)
        rows = tracer.gather(points, samples, seed_key(options.seed))
        self.rays = tracer.rays
        return rows

    def _corners(self, tile: int) -> tuple[Corners, Int64s]:
        """The corners of a tile's torn points by number, and the first vertices (j,) of these."""
        numbering = self.numbering
        piece = cut(self.survey, tile, 0.0, True)
        lifted = lift_points(piece.placed, piece.faces, self.options.normals)
        first = piece.vertices[lifted.first]
        own = lifted.torn & piece.own[lifted.first]
        number = np.where(own, numbering.number[first].astype(np.int64), _FAR + np.arange(len(first)))
        torn = np.flatnonzero(lifted.torn[lifted.face_points])
        points = number[lifted.face_points.ravel()[torn]]
        corners = find_corners(lifted.tree, lifted.surface, torn, points, 0, numbering.flattest)
        count = int(np.searchsorted(corners.rows, _FAR))
        starts = corners.starts[: count + 1]
        at = numbering.order[corners.rows[:count]]
        begin = numbering.places_from[np.searchsorted(numbering.torn_first, at)]
        numbers = np.repeat(begin - starts[:-1], np.diff(starts)) + np.arange(starts[-1])
        places = Points(
            corners.places.origins[: starts[-1]], corners.places.normals[: starts[-1]], numbers.astype(np.uint32)
        )
        return Corners(corners.rows[:count], starts, places, corners.weights[: starts[-1]]), at
