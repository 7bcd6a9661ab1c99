"""`ao.bake_points`: w at points with normals, on a mesh, in space, or a cloud of points that is a surface itself."""

import time
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from obscurance.raytrace.errors import MeshError, OptionError
from obscurance.raytrace.mesh.mesh import Mesh, mesh_of
from obscurance.raytrace.mesh.morton import morton_order
from obscurance.raytrace.mesh.normals import normalize
from obscurance.raytrace.ray_origins.origins import directions_in_front, ray_offset
from obscurance.raytrace.ray_origins.surface import Surface
from obscurance.raytrace.types import Float32s, Float64s, UInt8s

from ..declared import known_names
from ..estimate.estimate import estimate
from ..estimate.one_ring import Neighbours
from ..estimate.sites import ONE_PLACE, Sites
from ..execute.tracer import Progress
from ..falloff import Falloffs
from ..options import BackFaces, Options, Weight
from ..points.discs import border_errors, check_finite, discs
from ..points.points import Points
from ..points.receivers import Flag
from ..points.sheets import NEIGHBOURS
from ..prepared import Prepared
from ..result import Bake, BakedElements, PointValues, assemble, shortfalls

TAKEN = (
    *("falloff", "samples", "tolerance", "denoise", "spread", "weight", "back_faces", "profile", "seed", "threads"),
)
"""The options that apply to points."""


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
    weight: Weight = "cosine",
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
        normals: (k, 3), axes of the hemispheres, of any length; where one is zero or NaN, w is 1. Not all are.
        falloff, samples, seed, threads, progress, occluders, tolerance, denoise: as `ao.bake` takes them.
        spread, weight, back_faces, profile: likewise.

    Raises: OptionError, MeshError, MemoryLimitError, EmbreeError: as `ao.bake`, or arrays have other shapes.
    """
    start = time.perf_counter()
    # The arguments.
    checked = Options(
        falloff, samples, seed, threads, tolerance=tolerance, denoise=denoise, spread=spread, weight=weight,
        back_faces=back_faces, profile=profile,
    )  # fmt: skip
    places = _rows("points", points)
    axes = _rows("normals", normals)
    if axes.shape != places.shape:
        raise OptionError("normals", f"shape {places.shape}, as points have", axes.shape)
    check_finite(places, "points")
    count = len(places)
    axes = normalize(np.nan_to_num(axes))
    # Those with an axis; what occludes, the mesh, or discs in place of them.
    usable = np.flatnonzero(axes.any(axis=1))
    if not len(usable):
        raise MeshError("points", "normals", "at least one that is neither zero nor NaN", "none")
    places = places[usable]
    axes = axes[usable]
    cloud = discs(places, axes, threads=threads) if mesh is None else None
    solid = mesh_of(mesh, "bake_points") if cloud is None else cloud.mesh
    prepared = Prepared.of(solid, checked, progress, None, [mesh_of(occluder, "occluders") for occluder in occluders])
    lifts = np.zeros(places.shape)
    doubts = np.zeros(len(places))
    if cloud:
        lifts = cloud.lifts
        doubts = np.hypot(cloud.doubts, border_errors(places, axes, cloud.borders, prepared.mu, threads))
    # Along a curve that keeps neighbours together.
    order = morton_order(_in_render_space(prepared, places).astype(np.float32))
    baked = _points_at(prepared, places[order], axes[order], lifts[order])
    tracer = prepared.tracer(len(order))
    sites = Sites.alike(baked, partial(_neighbours, places[order], baked.normals, prepared.threads), ONE_PLACE)
    # Their estimates, in the order of the arguments.
    values = PointValues.of(estimate(tracer, sites, checked), 0, tracer.rays, doubts[order])
    row = np.full(count, -1)
    row[usable[order]] = np.arange(len(order))
    flags: UInt8s = np.where(row < 0, Flag.DEGENERATE, 0).astype(np.uint8)
    result = assemble(prepared, solid, BakedElements(row, flags, baked.normals, count), values)
    seconds = {"build": prepared.receivers.tree_seconds, "bake": time.perf_counter() - start}
    lines = shortfalls(checked, result.rmses, values.samples, "point", solid, prepared.placement.vertices)
    if lines and (in_doubt := np.count_nonzero(doubts > result.rmse)):
        where = f"{in_doubt:,} of {count:,} points"
        lines += (f"discs may be above {where}, or beside: noise, holes of a sheet, or its border",)
    return replace(result, at="points", seconds=seconds, shortfalls=lines)


def _rows(name: str, values: npt.ArrayLike) -> Float64s:
    """Points or vectors as float64 (k, 3). Raises: OptionError: another shape."""
    array: Float64s = np.asarray(values, np.float64)
    if array.ndim != 2 or array.shape[1] != 3:
        raise OptionError(name, "shape (…, 3)", array.shape)
    return array


def _neighbours(places: Float64s, normals: Float32s, threads: int) -> Neighbours:
    """The points (k, 3) that are nearest to each, as estimates take neighbours."""
    near = cKDTree(places).query(places, list(range(1, min(NEIGHBOURS + 1, len(places)) + 1)), workers=threads)[1]
    rows = np.repeat(np.arange(len(places)), near.shape[1])
    return Neighbours.linked(rows, near.ravel(), normals, threads)


def _in_render_space(prepared: Prepared, points: Float64s) -> Float64s:
    """Points (k, 3) in render space."""
    placed: Float64s = (points - prepared.placement.centre) * prepared.placement.scale
    return placed


def _points_at(prepared: Prepared, points: Float64s, axes: Float64s, lifts: Float64s) -> Points:
    """Origins of rays above the points, in render space."""
    placed = _in_render_space(prepared, points)
    vertices, receivers = prepared.placement.vertices.astype(np.float64), prepared.receivers
    if lifts.any():  # each lies on its own disc
        directions = normalize(lifts)
        magnitude = np.abs(placed).max(axis=1)
        clearance = np.einsum("kc,kc->k", directions, axes)
    else:
        surface = Surface.of(vertices, receivers.faces, receivers.backwards)
        directions, clearance, magnitude = directions_in_front(placed, axes, receivers.hierarchy.tree, surface)
    lengths = np.linalg.norm(lifts, axis=1) * prepared.placement.scale
    offset = np.maximum(ray_offset(directions, magnitude, clearance), lengths)
    origins = placed + offset[:, None] * directions
    return Points.lifted(placed, origins, axes)
