"""w at points spread over the faces, estimated twice by rays of their own, and what interpolation errs there."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from obscurance.raytrace.mesh.normals import face_areas
from obscurance.raytrace.ray_origins.origins import ray_offset
from obscurance.raytrace.ray_origins.surface import Surface
from obscurance.raytrace.sampling import derive, hash32_array, in_triangle
from obscurance.raytrace.types import AnyInts, Bools, Float32s, Float64s, Int64s

from .estimate.inside import inside_solids
from .execute.tracer import Tracer
from .mu import Mu, in_render_space
from .points.points import Points
from .points.smooth_surface import LocatedPoints, SmoothSurface, VertexAxes
from .points.surface_samples import with_alpha
from .prepared import Prepared
from .rays.below_face import leave_out_below
from .rays.gather import W
from .result import NOWHERE, Interpolation

_POINTS = 1024
_RAYS = 16  # of each of two estimates
_RIDGE = 1e-6  # of a point's weight, which vertices without one near are drawn to 0 by
_FITTED = 4  # points for each vertex, at least, from which one can tell how well any values would do


class SurfaceProbes(NamedTuple):
    """k points on faces, outside of solids, with two independent estimates of w by each of c falloffs."""

    face: Int64s  # (k,), of the mesh
    weights: Float64s  # (k, 3), barycentric
    estimates: Float64s  # (k, 2, c)


def measure_interpolation(prepared: Prepared, w: Float64s, error: Float64s) -> Interpolation:
    """Compare interpolated `w` (n,) with w at points spread evenly over the faces that have it, by 32 rays each.

    Points inside solids are left out. Args: error: (n,), standard errors of `w`.
    """
    requested = prepared.requested
    among = None if requested is None else np.all(requested[prepared.mesh.faces], axis=1)
    probes = probe_surface(prepared, [prepared.mu], among)
    if not len(probes.face):
        return NOWHERE
    corners = prepared.mesh.faces[probes.face]
    values = np.einsum("ki,ki->k", probes.weights, w[corners])
    variance = np.einsum("ki,ki->k", probes.weights**2, error[corners] ** 2)
    estimates = probes.estimates[:, :, 0]
    between = Interpolation.of(probes.face, probes.weights, estimates, values, variance)
    return between._replace(best=_least_error(corners, probes.weights, estimates)) if between.visible else between


def probe_surface(
    prepared: Prepared, mus: Sequence[Mu], among: Bools | None = None, rays: int = _RAYS
) -> SurfaceProbes:
    """Estimate w twice at 1,024 points spread evenly over faces; none are left where there is no area.

    Args: among: (m,), the faces; None: all. rays: of each estimate.
    """
    placement = prepared.placement
    receivers = prepared.receivers
    vertices = placement.vertices.astype(np.float64)
    areas = face_areas(vertices, receivers.faces)
    # Faces are numbered as in the mesh: degenerate ones are not among those of the receivers.
    number = None
    if len(receivers.faces) < len(prepared.mesh.faces):
        number = np.flatnonzero(face_areas(placement.vertices, prepared.mesh.faces) > 0)
    if among is not None:
        areas = np.where(among if number is None else among[number], areas, 0.0)
    if not areas.any() or not len(receivers.points):
        return SurfaceProbes(np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros((0, 2, len(mus))))

    # Points on faces, whose hemispheres lie between those of the faces' vertices.
    face, weights = _spread(areas, derive(prepared.key, 7))
    corners = receivers.faces[face]
    axes = VertexAxes.of(receivers, receivers.of_vertex[corners].ravel())
    points, located = _on_faces(vertices[corners], receivers.backwards[face], axes, weights)
    del vertices, areas

    # Those outside solids, estimated twice.
    interior = prepared.options.interior if prepared.options.method == "vertex" else "auto"
    outside = ~inside_solids(points, lambda: corners[:, 0], placement, receivers, interior, prepared.threads)
    geometric_normals = with_alpha(located, receivers.opacity, face, weights)[outside]
    estimates = _estimate_twice(prepared, mus, points[outside], geometric_normals, rays)
    of_mesh = face[outside] if number is None else number[face[outside]]
    return SurfaceProbes(of_mesh, weights[outside].astype(np.float64), estimates)


def _least_error(corners: AnyInts, weights: Float64s, estimates: Float64s) -> float:
    """The RMS error of the values at vertices that fit `estimates` (k, 2) best; 0 where these are too few to tell.

    Values that fit one estimate and those that fit the other err independently of the estimate that each is held to.
    Args: corners, weights: (k, 3), vertices of each point's face, and barycentric coordinates.
    """
    used, column = np.unique(corners, return_inverse=True)
    if _FITTED * len(used) > len(corners):
        return 0.0
    matrix = np.zeros((len(corners), len(used)))
    np.put_along_axis(matrix, column.reshape(corners.shape), weights, axis=1)
    normal = matrix.T @ matrix + _RIDGE * np.eye(len(used))
    off = matrix @ np.linalg.solve(normal, matrix.T @ estimates) - estimates[:, ::-1]
    return math.sqrt(max(float(off.prod(axis=1).mean()), 0.0))


def _estimate_twice(
    prepared: Prepared, mus: Sequence[Mu], points: Points, geometric_normals: Float32s, rays: int
) -> Float64s:
    """Two estimates of w (k, 2, c) by c falloffs at points, whose hemispheres end at faces of these normals."""
    total = 2 * _POINTS
    mu = in_render_space(mus, prepared.placement.scale)
    t_max = min(mu.limit, prepared.placement.diagonal)
    tracer = Tracer(prepared.scene, mu, t_max, prepared.threads, total)
    twice = points[np.tile(np.arange(len(points)), 2)]
    twice = replace(twice, numbers=np.arange(len(twice), dtype=np.uint32))
    key = derive(prepared.key, 8)
    gathered = tracer.gather(twice, rays, key)
    table, lobe = tracer.scene.table(rays, total, key), tracer.scene.lobe
    estimates = np.empty((2 * len(points), len(mus)))
    for column in range(len(mus)):
        rows = np.ascontiguousarray(gathered[:, column])
        leave_out_below(twice.arrays, np.tile(geometric_normals, (2, 1)), table, lobe, rows)
        estimates[:, column] = rows[:, W]
    return np.stack(np.split(estimates, 2), axis=1)


def _spread(areas: Float64s, key: np.uint32) -> tuple[Int64s, Float32s]:
    """Points one from each of equal shares of the faces' area: which face (k,), and barycentric coordinates (k, 3)."""
    total = np.cumsum(areas)
    share, u, v = np.ldexp(hash32_array(hash32_array(np.arange(3 * _POINTS)) ^ key), -32).reshape(3, -1)
    face = np.searchsorted(total, (np.arange(_POINTS) + share) / _POINTS * total[-1], "right").clip(0, len(areas) - 1)
    return face, in_triangle(u, v).astype(np.float32)


def _on_faces(corners: Float64s, backwards: Bools, axes: VertexAxes, weights: Float32s) -> tuple[Points, LocatedPoints]:
    """Points on faces of `corners` (k, 3, 3), whose vertices have `axes` (3 k, 3), lifted and as they are."""
    count = len(corners)
    numbers = np.arange(count, dtype=np.int32)
    surface = Surface.of(corners.reshape(-1, 3), np.arange(3 * count, dtype=np.int32).reshape(-1, 3), backwards)
    magnitude = surface.magnitudes(np.repeat(numbers[:, None], 3, axis=1), count)
    located = SmoothSurface(axes, surface).points_at(numbers, weights, 1)
    origins = located.positions + ray_offset(located.normals, magnitude, np.ones(count))[:, None] * located.normals
    return Points.lifted(located.positions, origins, located.axes), located
