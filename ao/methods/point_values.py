"""`ao.bake_points`: w at points with normals, on a mesh, in space, or a cloud of points that is a surface itself."""

import time
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple, Self

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from obscurance.raytrace.errors import MeshError, OptionError
from obscurance.raytrace.mesh.mesh import Mesh, mesh_of
from obscurance.raytrace.mesh.morton import morton_order
from obscurance.raytrace.mesh.normals import normalize
from obscurance.raytrace.ray_origins.origins import directions_in_front, ray_offset
from obscurance.raytrace.ray_origins.surface import Surface
from obscurance.raytrace.system.threads import run_blocks, thread_count
from obscurance.raytrace.types import Bools, Float64s, Int32s, UInt8s

from ..declared import known_names
from ..estimate.estimate import estimate
from ..estimate.one_ring import Neighbours
from ..estimate.sites import ONE_PLACE, Sites
from ..execute.tracer import Progress
from ..falloff import Falloffs
from ..options import BackFaces, Options
from ..points.points import Points
from ..points.receivers import Flag
from ..prepared import Prepared
from ..result import Bake, BakedElements, PointValues, assemble, shortfalls

_NEIGHBOURS = 6  # of a point, over which it is denoised, and to the last of which a disc reaches
_LIFT = 0.5  # of a disc's radius, from which rays of its point start at most: neighbours' discs are below that
_NEAR, _OF_SHEET = 32, 10  # nearest points, and how many of them are of the point's own sheet at least
_TURNED, _PARALLEL = 0.5, 0.8  # cosines between normals of one sheet, and of one above another, at least
_APART, _FLAT = 16.0, 0.03  # of how far a sheet's own points are off, and of the radius: off by more is another sheet
_DOUBT = 0.5  # error of w where it is open whether a disc is above the point
_INNER = 0.86  # of a disc's radius, within which the hexagon is in every direction
_BLOCK = 1 << 12
TAKEN = (*("falloff", "samples", "tolerance", "denoise", "spread", "back_faces", "profile", "seed", "threads"),)
"""The options that apply to points."""
_RIM = np.radians(60 * np.arange(6))


@known_names
def bake_points(
    mesh: Mesh | Any | None,
    points: npt.ArrayLike,
    normals: npt.ArrayLike,
    *,
    falloff: Falloffs = None,
    samples: int | None = None,
    seed: int = 0,
    threads: int | None = None,
    progress: Progress | None = None,
    occluders: Sequence[Mesh | Any] = (),
    tolerance: float | None = None,
    denoise: bool = True,
    spread: float = 180.0,
    back_faces: BackFaces = "occlude",
    profile: bool = False,
) -> Bake:
    """w at any points: one row a point in the result.

    Args:
        mesh: what occludes, in any form that `ao.bake` takes. None: the points are samples of a surface and occlude
            each other, each as a disc that reaches to its sixth neighbour, but not those of its own sheet that overlap
            it; lengths in per cent are of these discs.
        points: (k, 3), in the unit of `mesh`; those on a face are taken to lie on its front, or on its back if their
            normal is more than 45° behind it. Directions below the face are closed.
        normals: (k, 3), axes of the hemispheres, of any length; where one is zero or NaN, w is 1.
        falloff, samples, seed, threads, progress, occluders, tolerance, denoise: as `ao.bake` takes them.
        spread, back_faces, profile: likewise.

    Raises: OptionError, MeshError, MemoryLimitError, EmbreeError: as `ao.bake`, or arrays have other shapes.
    """
    start = time.perf_counter()
    # The arguments.
    checked = Options(
        falloff, samples, seed, threads, tolerance=tolerance, denoise=denoise, spread=spread, back_faces=back_faces,
        profile=profile,
    )  # fmt: skip
    places = _rows("points", points)
    axes = _rows("normals", normals)
    if axes.shape != places.shape:
        raise OptionError("normals", f"shape {places.shape}, as points have", axes.shape)
    if not np.isfinite(places).all() or not len(places):
        raise MeshError("points", "points", "finite coordinates of at least one", "none, or others")
    axes = normalize(np.nan_to_num(axes))
    usable = np.flatnonzero(axes.any(axis=1))
    # What occludes: the mesh, or discs in place of the points.
    lifts, doubts = np.zeros((2, len(places)))
    if mesh is None:
        mesh, lifts[usable], doubts[usable] = discs(places[usable], axes[usable], threads=threads)
    solid = mesh_of(mesh, "bake_points")
    prepared = Prepared.of(solid, checked, progress, None, [mesh_of(occluder, "occluders") for occluder in occluders])
    # The points with an axis, along a curve that keeps neighbours together, and those near each.
    order = usable[morton_order(_in_render_space(prepared, places[usable]).astype(np.float32))]
    baked = _points_at(prepared, places[order], axes[order], lifts[order])
    tracer = prepared.tracer(len(order))
    near = cKDTree(places[order]).query(places[order], min(_NEIGHBOURS + 1, len(order)), workers=prepared.threads)[1]
    rows = np.repeat(np.arange(len(order)), near.size // max(len(order), 1))
    sites = Sites.alike(baked, Neighbours.linked(rows, near.ravel(), baked.normals, prepared.threads), ONE_PLACE)
    # Their estimates, in the order of the arguments.
    values = PointValues.of(estimate(tracer, sites, checked), 0, tracer.rays, doubts[order])
    row = np.full(len(places), -1)
    row[order] = np.arange(len(order))
    flags: UInt8s = np.where(row < 0, Flag.DEGENERATE, 0).astype(np.uint8)
    result = assemble(prepared, solid, BakedElements(row, flags, baked.normals, len(places)), values)
    seconds = {"build": prepared.receivers.tree_seconds, "bake": time.perf_counter() - start}
    lines = shortfalls(checked, max(result.rmses), values.samples, "point", solid, prepared.placement.vertices)
    if lines and (in_doubt := np.count_nonzero(doubts > result.rmse)):
        lines += (f"discs may be above {in_doubt:,} of {len(places):,} points, or beside: noise, or holes of a sheet",)
    return replace(result, at="points", seconds=seconds, shortfalls=lines)


def _rows(name: str, values: npt.ArrayLike) -> Float64s:
    """Points or vectors as float64 (k, 3). Raises: OptionError: another shape."""
    array: Float64s = np.asarray(values, np.float64)
    if array.ndim != 2 or array.shape[1] != 3:
        raise OptionError(name, "shape (…, 3)", array.shape)
    return array


class Discs(NamedTuple):
    """Discs in place of k points, which occlude.

    Attributes:
        mesh: a hexagon about each point.
        lifts: (k,), how far above its disc the rays of each point start.
        doubts: (k,), errors of w of which rays know nothing: whether discs are above a point, or of its own sheet.
    """

    mesh: Mesh
    lifts: Float64s
    doubts: Float64s


def discs(points: Float64s, axes: Float64s, source: str = "points", threads: int | None = None) -> Discs:
    """Discs of points (k, 3) that reach to their sixth neighbour of their own sheet.

    Raises: MeshError: fewer than two points, or one that is not finite.
    """
    if len(points) < 2 or not np.isfinite(points).all():
        raise MeshError(source, "points", "finite coordinates of at least two", f"{len(points)}, or others")
    axes = normalize(np.nan_to_num(axes))
    cloud = _Cloud.of(points, axes, thread_count(threads))
    least = np.eye(3)[np.abs(axes).argmin(axis=1)]
    u = normalize(np.cross(axes, least))
    v = np.cross(axes, u)
    rim = np.cos(_RIM)[:, None] * u[:, None] + np.sin(_RIM)[:, None] * v[:, None]
    vertices = points[:, None] + cloud.radius[:, None, None] * rim
    fan = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]])
    faces = 6 * np.arange(len(points))[:, None, None] + fan
    mesh = Mesh(vertices.reshape(-1, 3), faces.reshape(-1, 3), source=source)
    return Discs(mesh, *cloud.lifts(thread_count(threads)))


class _Cloud(NamedTuple):
    """Points and axes (k, 3), the radii of their discs (k,), and those `near` each (k, j), of its sheet or of others.

    A sheet is where normals are alike, and where no point is far off along the mean of both normals: points of one
    sheet, flat or evenly curved, are not. Discs reach to the sixth neighbour across edges, too, which does not
    lie on a sheet above or below.
    """

    points: Float64s
    axes: Float64s
    radius: Float64s
    near: Int32s
    of_sheet: Bools  # (k, j)

    @classmethod
    def of(cls, points: Float64s, axes: Float64s, threads: int) -> Self:
        distances, near = cKDTree(points).query(points, min(_NEAR + 1, len(points)), workers=threads)
        radius = distances[:, 1 : _NEIGHBOURS + 1][:, -1].copy()
        cloud = cls(points, axes, radius, near[:, 1:].astype(np.int32), np.empty(near[:, 1:].shape, np.bool_))

        def tell(start: int, stop: int) -> None:
            some = slice(start, stop)
            facing, above, along = cloud.beside(some)
            off = np.abs(above + along) / 2
            alike = facing > _TURNED
            own = np.sort(np.where(alike, off, np.inf), axis=1)[:, :_OF_SHEET][:, -1:]
            is_off = off > np.maximum(_APART * own, _FLAT * radius[some, None])
            cloud.of_sheet[some] = alike & ~is_off
            around = (alike & ~is_off) | (np.abs(facing) <= _TURNED)
            sixth = around & (np.cumsum(around, axis=1) == _NEIGHBOURS)
            reached = np.where(sixth, distances[some, 1:], 0.0).max(axis=1, initial=0.0)
            radius[some] = np.where(sixth.any(axis=1), reached, radius[some])

        run_blocks(len(points), _BLOCK, tell, threads)
        return cloud

    def beside(self, some: slice) -> tuple[Float64s, Float64s, Float64s]:
        """Cosines between the normals of points and of those near them (b, j), and how far these lie along both."""
        axes, there = self.axes[some], self.axes[self.near[some]]
        between = self.points[self.near[some]] - self.points[some, None]
        facing, above = (np.einsum("kjc,kc->kj", vectors, axes) for vectors in (there, between))
        return facing, above, np.einsum("kjc,kjc->kj", between, there)

    def lifts(self, threads: int) -> tuple[Float64s, Float64s]:
        """`Discs.lifts` and `doubts`: rays start above the discs of the own sheet, which overlap, and half the way to
        the first disc of another one above."""
        lifts, doubts = np.empty((2, len(self.points)))

        def lift(start: int, stop: int) -> None:
            some = slice(start, stop)
            near, of_sheet = self.near[some], self.of_sheet[some]
            facing, above, along = self.beside(some)
            with np.errstate(divide="ignore", invalid="ignore"):
                height = along / facing  # of the disc's plane over the point
                reached = self.points[some, None] + height[..., None] * self.axes[some, None]
                aside = np.linalg.norm(reached - self.points[near], axis=2)
            is_above = height > 0
            reach = self.radius[near]
            is_over, is_other = is_above & (aside <= reach), ~of_sheet & (above > 0)
            first = np.where(is_over & is_other, height, np.inf).min(axis=1, initial=np.inf)
            lifts[some] = _LIFT * np.minimum(self.radius[some], first)
            # What is in doubt: discs of the own sheet that are not level with it, and holes of a sheet just above.
            is_rough = is_over & of_sheet & (np.abs(above + along) / 2 > _FLAT * self.radius[some, None])
            rough = np.where(is_rough, height, 0.0).max(axis=1, initial=0.0) / np.maximum(lifts[some], 1e-300)
            is_near = is_above & is_other & (np.abs(facing) > _PARALLEL) & (height < self.radius[some, None])
            is_hole = (is_near & (aside <= 2 * reach)).any(axis=1)
            is_hole &= ~(is_above & is_other & (aside <= _INNER * reach)).any(axis=1)
            doubts[some] = _DOUBT * np.where(is_hole, 1.0, np.minimum(rough, 1.0) ** 3)

        run_blocks(len(self.points), _BLOCK, lift, threads)
        return lifts, doubts


def _in_render_space(prepared: Prepared, points: Float64s) -> Float64s:
    """Points (k, 3) in render space."""
    placed: Float64s = (points - prepared.placement.centre) * prepared.placement.scale
    return placed


def _points_at(prepared: Prepared, points: Float64s, axes: Float64s, lifts: Float64s) -> Points:
    """Origins of rays above the points, in render space."""
    placed = _in_render_space(prepared, points)
    vertices, receivers = prepared.placement.vertices.astype(np.float64), prepared.receivers
    directions, clearance, magnitude = axes, np.ones(len(points)), np.abs(placed).max(axis=1)
    if not lifts.any():  # else each lies on its own disc
        surface = Surface.of(vertices, receivers.faces, receivers.face_normals(vertices)[0])
        directions, clearance, magnitude = directions_in_front(placed, axes, receivers.tree, surface)
    offset = np.maximum(ray_offset(directions, magnitude, clearance), lifts * prepared.placement.scale)
    origins = placed + offset[:, None] * directions
    return Points.lifted(placed, origins, axes)
