"""The error of interpolation between vertices, measured by rays at points on the faces."""

from dataclasses import replace

import numpy as np

from raytrace.mesh.normals import face_normals
from raytrace.ray_origins.origins import ray_offset
from raytrace.ray_origins.surface import Surface
from raytrace.sampling.sequences import hash32_array
from raytrace.types import Float32s, Float64s, Int64s

from .estimate.inside import inside_solids
from .estimate.sampling_error import derive
from .execute.tracer import Tracer
from .points.points import Points
from .points.smooth_surface import SmoothSurface
from .points.surface_samples import with_alpha
from .prepared import Prepared
from .rays.below_face import leave_out_below
from .rays.gather import W
from .result import NOWHERE, Interpolation

_FEWEST, _MOST = 256, 1024  # points
_SHARE = 20  # vertices for each point between, so that these take few of a bake's rays
_RAYS = 16  # of each of two estimates


def measure_interpolation(prepared: Prepared, w: Float64s, error: Float64s) -> Interpolation:
    """Compare interpolated `w` (n,) with w at points spread evenly over the faces that have it, by 32 rays each.

    Points inside solids are left out. Args: error: (n,), standard errors of `w`.
    """
    placement, receivers, threads = prepared.placement, prepared.receivers, prepared.threads
    vertices, faces = placement.vertices.astype(np.float64), receivers.faces
    normals, areas = face_normals(vertices, faces)
    if prepared.asked is not None:
        areas = np.where(prepared.asked[faces].all(axis=1), areas, 0.0)
    if not areas.any() or not len(receivers.points):
        return NOWHERE
    count = min(max(len(receivers.points) // _SHARE, _FEWEST), _MOST)
    own, weights = _spread(areas, count, derive(prepared.key, 7))
    corners = faces[own]
    point = receivers.of_vertex[corners]
    axes = np.where(point[..., None] < 0, np.float32(0), receivers.points.normals[point])
    points, sides = _on_faces(vertices[corners], normals[own], axes, weights)
    del vertices, normals, areas
    interior = prepared.options.interior if prepared.options.method == "vertex" else "auto"
    seen = ~inside_solids(points, faces[own, 0], placement, receivers, interior, threads)
    if not seen.any():
        return NOWHERE
    points, sides = points[seen], with_alpha(sides, receivers.opacity, own, weights)[seen]
    mu = prepared.mu.in_render_space(placement.scale)
    tracer = Tracer(prepared.scene, 0, mu, min(mu.limit, placement.diagonal), threads, 2 * count)
    twice = points[np.tile(np.arange(len(points)), 2)]
    twice = replace(twice, numbers=np.arange(len(twice), dtype=np.uint32))
    key = derive(prepared.key, 8)
    rows = tracer.gather(twice, _RAYS, key)
    leave_out_below(twice.arrays, np.tile(sides, (2, 1)), tracer.scene.table(_RAYS, 2 * count, key), rows)
    estimates = rows[:, W].reshape(2, -1).T
    part, corners = weights[seen].astype(np.float64), corners[seen]
    values = np.einsum("ki,ki->k", part, w[corners])
    variance = np.einsum("ki,ki->k", part**2, error[corners] ** 2)
    own = own[seen]
    if len(faces) < len(prepared.mesh.faces):  # degenerate ones are not among them
        own = np.flatnonzero(face_normals(placement.vertices.astype(np.float64), prepared.mesh.faces)[1] > 0)[own]
    return Interpolation.of(own, part, estimates, values, variance)


def _spread(areas: Float64s, count: int, key: np.uint32) -> tuple[Int64s, Float32s]:
    """Points one from each of equal shares of the faces' area: which face (k,), and barycentric coordinates (k, 3)."""
    total, steps = np.cumsum(areas), np.arange(count)
    share, u, v = np.ldexp(hash32_array(hash32_array(np.arange(3 * count)) ^ key), -32).reshape(3, -1)
    own = np.searchsorted(total, (steps + share) / count * total[-1], "right").clip(0, len(areas) - 1)
    root = np.sqrt(u)
    return own, np.stack([1 - root, root * (1 - v), root * v], axis=-1).astype(np.float32)


def _on_faces(corners: Float64s, normals: Float64s, axes: Float32s, weights: Float32s) -> tuple[Points, Float32s]:
    """Points on faces of `corners` (k, 3, 3), whose vertices have `axes` (k, 3, 3), and the sides of hemispheres."""
    count = len(corners)
    rows, alone = np.arange(count), np.arange(3 * count).reshape(-1, 3)
    each = np.repeat(rows[:, None], 3, axis=1)
    surface = Surface.of(corners.reshape(-1, 3), alone, normals)
    magnitude = surface.magnitudes(each, count)
    faces = SmoothSurface(axes.reshape(-1, 3).astype(np.float64), surface)
    places, sides, hemispheres = faces.points_at(rows, weights, 1)
    origins = places + ray_offset(sides, magnitude, np.ones(count))[:, None] * sides
    points = Points(origins.astype(np.float32), hemispheres.astype(np.float32), rows.astype(np.uint32))
    return points, sides.astype(np.float32)
