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
from obscurance.raytrace.kernel.vector import add, cross, dot, length, load, scale, subtract
from obscurance.raytrace.mesh.mesh import Mesh
from obscurance.raytrace.mesh.morton import morton_order
from obscurance.raytrace.mesh.normals import normalize
from obscurance.raytrace.system.parallel import each
from obscurance.raytrace.system.threads import thread_count
from obscurance.raytrace.types import Float64Grid, Float64s, Int64s

from ..mu import Mu
from .outlines import CORNERS, outline
from .sheets import FLAT, NEAR, NEIGHBOURS, Cloud, beside, tell_sheets

_LIFT = 0.5  # of a disc's radius, from which rays of its point start at most: neighbours' discs are below that
_PARALLEL = 0.8  # cosine between normals of a sheet and of one above it, at least
_DOUBT = 0.5  # error of w where it is open whether a disc is above the point
_INNER = 0.86  # of a disc's radius, within which the hexagon is in every direction
_CLOSED = 0.7  # the same where a disc of the own sheet is above the rays' origin
_UNKNOWN = 0.5  # of a spacing, by which it is open where the border lies: on the outermost points, or up to one beyond
_POINTS = 16  # of borders, at most, that count for a point
_FARTHEST = 24.0  # spacings, up to which they do


class Discs(NamedTuple):
    """Discs in place of k points, which occlude.

    Attributes:
        mesh: a convex polygon about each point, in the order of the points: a fan of triangles about its first corner.
        lifts: (k,), how far above its disc the rays of each point start.
        doubts: (k,), errors of w of which rays know nothing: whether discs are above a point, or of its own sheet.
        spacings: (k,), of the points around those at a sheet's border, else 0.
    """

    mesh: Mesh
    lifts: Float64s
    doubts: Float64s
    spacings: Float64s


def discs(points: Float64s, axes: Float64s, source: str = "points", threads: int | None = None) -> Discs:
    """Discs of points (k, 3) that reach to their sixth neighbour of their own sheet.

    Raises: MeshError: fewer than two points, or one that is not finite.
    """
    check_finite(points, source)
    if len(points) < 2:
        raise MeshError(source, "points", "at least two", len(points))
    order = morton_order((points - points[0]).astype(np.float32))  # so that what is near is near in memory
    ordered = points[order]
    cloud_axes = normalize(np.nan_to_num(axes[order]))
    # The sheet of each point, the disc's radius and outline, and what is above.
    count = min(NEAR + 1, len(points))
    distances, nearest = cKDTree(ordered).query(ordered, count, workers=thread_count(threads))
    near = nearest[:, 1:].astype(np.int32)
    radius = distances[:, 1 : NEIGHBOURS + 1][:, -1].copy()
    cloud = Cloud(ordered, cloud_axes, radius, near, np.empty(near.shape, np.bool_))
    tell_sheets.on(threads)(cloud, near, distances)
    corners = np.empty((len(points), CORNERS, 3))
    counts = np.empty(len(points), np.int64)
    lifts, doubts, spacings = np.empty((3, len(points)))
    outline.on(threads)(cloud, near, corners, counts, spacings)
    _lift.on(threads)(cloud, (corners, counts), lifts, doubts)
    # A fan of triangles for each, in the order of the points.
    place = np.argsort(order)
    counts = counts[place]
    vertices = corners[place][np.arange(CORNERS) < counts[:, None]]
    fans = np.repeat(np.cumsum(counts) - counts, counts - 2)
    ahead = np.arange(len(fans)) - np.repeat(np.cumsum(counts - 2) - (counts - 2), counts - 2) + 1
    faces = np.stack([fans, fans + ahead, fans + ahead + 1], axis=1)
    return Discs(Mesh(vertices, faces, source=source), lifts[place], doubts[place], spacings[place])


def check_finite(points: Float64s, source: object) -> None:
    """Raises: MeshError: one of points (k, 3) is not finite; the first such is named."""
    bad = np.flatnonzero(~np.isfinite(points).all(axis=1))
    if len(bad):
        raise MeshError(source, f"points[{bad[0]}]", "finite coordinates", f"{points[bad[0]]} ({len(bad):,} such)")


def border_errors(points: Float64s, axes: Float64s, spacings: Float64s, mu: Mu, threads: int | None = None) -> Float64s:
    """Errors of w at points (k, 3), (k,): the form factors of strips along borders, as wide as these are uncertain.

    A strip of area dA at distance d has cosθ cosθ' dA / (π d²) of a hemisphere; strips are off together.

    Args:
        points, axes, spacings: of the cloud; unit normals (k, 3), and spacings (k,), 0 but at borders.
        mu: the falloff; what is far away closes less.
    """
    errors = np.zeros(len(points))
    at_border = np.flatnonzero(spacings)
    if not len(at_border):
        return errors
    farthest = _FARTHEST * spacings.max()
    tree = cKDTree(points[at_border])
    count = list(range(1, min(_POINTS, len(at_border)) + 1))
    distances, nearest = tree.query(points, count, distance_upper_bound=farthest, workers=thread_count(threads))
    row, column = np.nonzero(np.isfinite(distances) & (distances > 0.0))
    distance = distances[row, column]
    border = at_border[nearest[row, column]]
    way = (points[border] - points[row]) / distance[:, None]
    cosine = np.maximum(np.einsum("kc,kc->k", way, axes[row]), 0.0) * np.abs(np.einsum("kc,kc->k", way, axes[border]))
    area = _UNKNOWN * spacings[border] ** 2
    strips = (1.0 - mu(distance)) * cosine * area / (np.pi * distance**2)
    np.add.at(errors, row, strips)
    return np.minimum(errors, _DOUBT)


@each("lifts")
def _lift(i: int, cloud: Cloud, outlines: tuple[Float64Grid, Int64s], lifts: Float64s, doubts: Float64s) -> None:
    """Write `Discs.lifts` and `doubts`: rays start above the discs of the own sheet, which overlap, and half the way to
    the first disc of another one above."""
    p = load(cloud.points, i)
    radius = cloud.radius[i]
    first, rough, highest = np.inf, 0.0, 0.0
    is_beside_hole = is_covered = False
    for j in range(cloud.near.shape[1]):
        facing, above, along = beside(cloud, i, j)
        height = along / facing if facing != 0.0 else 0.0  # of the disc's plane over the point
        if height <= 0.0:
            continue
        near = cloud.near[i, j]
        reach = cloud.radius[near]
        if not cloud.of_sheet[i, j] and above <= 0.0:
            continue
        centre = load(cloud.points, near)
        offset = subtract(add(p, scale(height, load(cloud.axes, i))), centre)
        aside = length(offset)
        is_below = aside <= reach and _is_in(outlines, near, add(centre, scale(_INNER, offset)), load(cloud.axes, near))
        if cloud.of_sheet[i, j]:
            if is_below:
                highest = max(highest, height)
                if abs(above + along) / 2.0 > FLAT * radius:  # not level with the sheet
                    rough = max(rough, height)
        else:
            if is_below:
                first = min(first, height)
                is_covered |= aside <= _INNER * reach
            if abs(facing) > _PARALLEL and height < radius and aside <= 2.0 * reach:
                is_beside_hole = True
    lifts[i] = _LIFT * min(radius, first)
    is_hole = is_beside_hole and not is_covered  # of a sheet just above
    if highest >= lifts[i]:
        doubts[i] = _CLOSED
    else:
        doubts[i] = _DOUBT if is_hole else _DOUBT * (rough / lifts[i]) ** 3


@inline
def _is_in(outlines, near, place, axis):
    """Whether a place in the plane of a disc is in its outline, anticlockwise about the axis."""
    corners, counts = outlines
    last = counts[near] - 1
    before = corners[near, last, 0], corners[near, last, 1], corners[near, last, 2]
    for k in range(counts[near]):
        corner = corners[near, k, 0], corners[near, k, 1], corners[near, k, 2]
        if dot(cross(subtract(corner, before), subtract(place, before)), axis) < 0.0:
            return False
        before = corner
    return True
