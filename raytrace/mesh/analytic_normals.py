"""Unit normals of surfaces given by functions, and of polygons; zero where none exists.

Vertex normals of meshes are in `raytrace.mesh.normals`.
Source: (12.29) and the textbook chapter's polygon normals; Martin Newell's sums after Sutherland, Sproull &
Schumacker 1974.
"""

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from ..errors import OptionError
from ..types import Float64s
from .normals import normalize

STEP = float(np.finfo(np.float64).eps) ** (1 / 3)  # balances truncation and rounding of a central difference


def implicit_normals(f: Callable[[Float64s], Float64s], points: npt.ArrayLike) -> Float64s:
    """``∇f/|∇f|`` (…, 3) at points (…, 3) of the surface f = 0, by central differences (about 1e-10 relative).

    `f` takes (…, 3) and returns (…,); it grows outwards if normals are to point outwards.
    """
    points = np.asarray(points, np.float64)
    gradient = np.empty_like(points)
    for axis in range(3):
        step = np.zeros_like(points)
        step[..., axis] = STEP * np.maximum(1.0, np.abs(points[..., axis]))
        gradient[..., axis] = (f(points + step) - f(points - step)) / (2.0 * step[..., axis])
    return normalize(gradient)


def parametric_normals(f: Callable[[Float64s, Float64s], Float64s], u: npt.ArrayLike, v: npt.ArrayLike) -> Float64s:
    """∂f/∂u × ∂f/∂v, normalised (…, 3) (12.29), by central differences (about 1e-10 relative).

    `f` takes parameters u, v (…,) and returns points (…, 3).
    """
    u, v = np.broadcast_arrays(np.asarray(u, np.float64), np.asarray(v, np.float64))
    du, dv = STEP * np.maximum(1.0, np.abs(u)), STEP * np.maximum(1.0, np.abs(v))
    along_u = (f(u + du, v) - f(u - du, v)) / (2.0 * du[..., None])
    along_v = (f(u, v + dv) - f(u, v - dv)) / (2.0 * dv[..., None])
    return normalize(np.cross(along_u, along_v))


def corner_normals(polygon: npt.ArrayLike) -> Float64s:
    """Unit (v_{i+1} − v_i) × (v_{i−1} − v_i) at every corner (k, 3); reflex corners point the other way."""
    points = _polygon(polygon)
    return normalize(np.cross(np.roll(points, -1, axis=0) - points, np.roll(points, 1, axis=0) - points))


def averaged_normal(polygon: npt.ArrayLike) -> Float64s:
    """Unit mean (3,) of the unit corner normals; for convex polygons (use `newell_normal` for concave ones)."""
    return normalize(corner_normals(polygon).sum(axis=0))


def newell_sums(polygon: npt.ArrayLike) -> Float64s:
    """(a, b, c) of Martin Newell's plane: twice the areas (3,) of the polygon's projections."""
    points = _polygon(polygon)
    points = points - points[0]  # far from the origin the products would cancel
    following = np.roll(points, -1, axis=0)
    difference, total = points - following, points + following
    return np.asarray(np.sum(np.roll(difference, -1, axis=1) * np.roll(total, -2, axis=1), axis=0))


def newell_normal(polygon: npt.ArrayLike) -> Float64s:
    """Unit normal (3,) of a polygon (k, 3), k ≥ 3, convex or not, not quite planar too."""
    return normalize(newell_sums(polygon))


def newell_plane(polygon: npt.ArrayLike) -> Float64s:
    """(a, b, c, d) of Martin Newell's plane a x + b y + c z + d = 0: `newell_sums`, and d so that it holds corner 0."""
    sums = newell_sums(polygon)
    return np.append(sums, -(sums @ _polygon(polygon)[0]))


def plane_through(points: npt.ArrayLike) -> Float64s:
    """(a, b, c) of the plane a x + b y + c z = 1 through three points, C = X⁻¹ D: rows of X the points, D = (1, 1, 1).

    `newell_plane` takes planes through the origin, too.

    Raises: OptionError: not three points (3, 3), or they lie on one line, or their plane holds the origin.
    """
    x = _polygon(points)
    if len(x) != 3:
        raise OptionError("points", "three points, shape (3, 3)", x.shape, "normals")
    size = np.abs(x).max()
    if not np.isfinite(size) or size == 0 or np.linalg.matrix_rank(x / size) < 3:
        raise OptionError("points", "three points of one plane that the origin is not in", x.tolist(), "normals")
    return np.linalg.solve(x / size, np.ones(3)) / size


def _polygon(polygon: npt.ArrayLike) -> Float64s:
    points = np.asarray(polygon, np.float64)
    if points.ndim != 2 or points.shape[0] < 3 or points.shape[1] != 3:
        raise OptionError("polygon", "an array of shape (k, 3), k ≥ 3", points.shape, "normals")
    return points
