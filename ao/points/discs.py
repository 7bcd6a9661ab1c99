"""Discs in place of the points of a cloud, which occlude one another, but not the points of their own sheet.

A sheet is where normals are alike, and where no point is far off along the mean of both normals: points of one sheet,
flat or evenly curved, are not.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from obscurance.raytrace.errors import MeshError
from obscurance.raytrace.kernel.jit import inline
from obscurance.raytrace.kernel.vector import add, dot, length, load, scale, subtract
from obscurance.raytrace.mesh.mesh import Mesh
from obscurance.raytrace.mesh.morton import morton_order
from obscurance.raytrace.mesh.normals import normalize
from obscurance.raytrace.system.parallel import each
from obscurance.raytrace.system.threads import thread_count
from obscurance.raytrace.types import BoolRows, Float64Rows, Float64s, Int32Rows

NEIGHBOURS = 6
"""Nearest points of a sheet, to the last of which a disc reaches."""
_LIFT = 0.5  # of a disc's radius, from which rays of its point start at most: neighbours' discs are below that
_NEAR, _OF_SHEET = 32, 6  # nearest points, and how many of them are of the point's own sheet at least
_TURNED, _PARALLEL = 0.5, 0.8  # cosines between normals of one sheet, and of one above another, at least
_APART, _FLAT = 48.0, 0.03  # of how far a sheet's own points are off, and of the radius: off by more is another sheet
_DOUBT = 0.5  # error of w where it is open whether a disc is above the point
_CLOSED = 0.7  # the same where a disc of the own sheet is above the rays' origin
_INNER = 0.86  # of a disc's radius, within which the hexagon is in every direction
_RIM = np.radians(60 * np.arange(6))


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


class _Cloud(NamedTuple):
    """Points and axes (k, 3), the radii of their discs (k,), those `near` each (k, j), and which are of its sheet."""

    points: Float64Rows
    axes: Float64Rows
    radius: Float64s
    near: Int32Rows
    of_sheet: BoolRows


def discs(points: Float64s, axes: Float64s, source: str = "points", threads: int | None = None) -> Discs:
    """Discs of points (k, 3) that reach to their sixth neighbour of their own sheet.

    Raises: MeshError: fewer than two points, or one that is not finite.
    """
    if len(points) < 2 or not np.isfinite(points).all():
        raise MeshError(source, "points", "finite coordinates of at least two", f"{len(points)}, or others")
    axes = normalize(np.nan_to_num(axes))
    # The sheet of each point, the disc's radius, and what is above.
    count = min(_NEAR + 1, len(points))
    distances = np.empty((len(points), count))
    nearest = np.empty((len(points), count), np.int32)
    order = morton_order((points - points[0]).astype(np.float32))  # so that what is sought next lies near
    distances[order], nearest[order] = cKDTree(points).query(points[order], count, workers=thread_count(threads))
    near = np.ascontiguousarray(nearest[:, 1:])
    radius = distances[:, 1 : NEIGHBOURS + 1][:, -1].copy()
    cloud = _Cloud(np.ascontiguousarray(points), axes, radius, near, np.empty(near.shape, np.bool_))
    _tell_sheets.on(threads)(cloud, cloud.near, distances)
    lifts, doubts = np.empty((2, len(points)))
    _lift.on(threads)(cloud, lifts, doubts)
    # Hexagons.
    least = np.eye(3)[np.abs(axes).argmin(axis=1)]
    u = normalize(np.cross(axes, least))
    v = np.cross(axes, u)
    rim = np.cos(_RIM)[:, None] * u[:, None] + np.sin(_RIM)[:, None] * v[:, None]
    vertices = points[:, None] + cloud.radius[:, None, None] * rim
    fan = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]])
    faces = 6 * np.arange(len(points))[:, None, None] + fan
    return Discs(Mesh(vertices.reshape(-1, 3), faces.reshape(-1, 3), source=source), lifts, doubts)


@each("near")
def _tell_sheets(i: int, cloud: _Cloud, near: Int32Rows, distances: Float64Rows) -> None:
    """Fill in `of_sheet`, and the `radius`, which is the distance of the sixth neighbour before: a disc reaches to the
    sixth across edges, too, which does not lie on a sheet above or below.

    Args: near: of the cloud. distances: (k, 1 + j), of the point itself and of those near it.
    """
    least = np.full(_OF_SHEET, np.inf)  # distances of those with alike normals, sorted
    for j in range(near.shape[1]):
        facing, above, along = _beside(cloud, i, j)
        off = abs(above + along) / 2.0
        if facing > _TURNED and off < least[-1]:
            k = _OF_SHEET - 1
            while k > 0 and least[k - 1] > off:
                least[k] = least[k - 1]
                k -= 1
            least[k] = off
    limit = max(_APART * least[min(_OF_SHEET, near.shape[1]) - 1], _FLAT * cloud.radius[i])
    around = 0
    for j in range(near.shape[1]):
        facing, above, along = _beside(cloud, i, j)
        of_sheet = facing > _TURNED and abs(above + along) / 2.0 <= limit
        cloud.of_sheet[i, j] = of_sheet
        if of_sheet or abs(facing) <= _TURNED:
            around += 1
            if around == NEIGHBOURS:
                cloud.radius[i] = distances[i, 1 + j]


@each("lifts")
def _lift(i: int, cloud: _Cloud, lifts: Float64s, doubts: Float64s) -> None:
    """Write `Discs.lifts` and `doubts`: rays start above the discs of the own sheet, which overlap, and half the way to
    the first disc of another one above."""
    p = load(cloud.points, i)
    radius = cloud.radius[i]
    first, rough, highest = np.inf, 0.0, 0.0
    is_beside_hole = is_covered = False
    for j in range(cloud.near.shape[1]):
        facing, above, along = _beside(cloud, i, j)
        height = along / facing if facing != 0.0 else 0.0  # of the disc's plane over the point
        if height <= 0.0:
            continue
        near = cloud.near[i, j]
        reach = cloud.radius[near]
        aside = length(subtract(add(p, scale(height, load(cloud.axes, i))), load(cloud.points, near)))
        if cloud.of_sheet[i, j]:
            if aside <= reach:
                highest = max(highest, height)
                if abs(above + along) / 2.0 > _FLAT * radius:  # not level with the sheet
                    rough = max(rough, height)
        elif above > 0.0:
            if aside <= reach:
                first = min(first, height)
            if abs(facing) > _PARALLEL and height < radius and aside <= 2.0 * reach:
                is_beside_hole = True
            if aside <= _INNER * reach:
                is_covered = True
    lifts[i] = _LIFT * min(radius, first)
    is_hole = is_beside_hole and not is_covered  # of a sheet just above
    if highest >= lifts[i]:
        doubts[i] = _CLOSED
    else:
        doubts[i] = _DOUBT if is_hole else _DOUBT * (rough / lifts[i]) ** 3


@inline
def _beside(cloud, i, j):
    """The cosine between the normals of point i and of the j-th near it, and how far this lies along both."""
    near = cloud.near[i, j]
    axis = load(cloud.axes, i)
    there = load(cloud.axes, near)
    between = subtract(load(cloud.points, near), load(cloud.points, i))
    return dot(there, axis), dot(between, axis), dot(between, there)
