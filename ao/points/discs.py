"""Discs in place of the points of a cloud, which occlude one another, but not the points of their own sheet."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from obscurance.raytrace.errors import MeshError
from obscurance.raytrace.kernel.jit import inline
from obscurance.raytrace.kernel.vector import add, cross, dot, length, load, scale, store, subtract, unit
from obscurance.raytrace.mesh.mesh import Mesh
from obscurance.raytrace.mesh.morton import morton_order
from obscurance.raytrace.mesh.normals import normalize
from obscurance.raytrace.system.parallel import each
from obscurance.raytrace.system.threads import thread_count
from obscurance.raytrace.types import Float64Grid, Float64Rows, Float64s, Int64s

from ..mu import Mu
from .outlines import CORNERS, outline
from .sheets import FLAT, NEAR, NEIGHBOURS, Cloud, beside, tell_sheets

_LEAST = 0.1  # of a disc's radius, above which rays of its point start
_LIFT = 0.5  # the same at most
_CLEAR = 5.0  # times the height of the highest disc of the own sheet over the point, between both
_BEYOND_EDGES = 1.5  # times how far discs that turn away from the point's plane stick out of it, likewise
_BESIDE_WALL = 2.0  # of the larger disc's radius, within which a disc rises from a point in its plane
_PARALLEL = 0.8  # cosine between normals of a sheet and of one above it, at least
_ONE_SIDED = 0.5  # mean of unit vectors to points beyond a border, at least; beyond a straight one 2 / π
_DOUBT = 0.5  # error of w where it is open whether a disc is above the point
_INNER = 0.86  # of a disc's radius, within which the hexagon is in every direction
_CLOSED = 0.7  # the same where a disc of the own sheet is above the rays' origin
_UNKNOWN = 0.6  # of a spacing, by which borders err: they lie on the outermost points, or up to one beyond
_POINTS = 16  # of borders, at most, that count for a point
_FARTHEST = 24.0  # spacings, up to which they do


class Discs(NamedTuple):
    """Discs in place of k points, which occlude.

    Attributes:
        mesh: a convex polygon about each point, in the order of the points: a fan of triangles about its first corner.
        lifts: (k, 3), from each point to where its rays start: above its disc, and at a concave edge in front of the
            sheet on the other side, too.
        doubts: (k,), errors of w of which rays know nothing: whether discs are above a point, or of its own sheet.
        borders: (k, 3), at the outermost points of a sheet outwards, as long as the spacing of the points, else 0.
    """

    mesh: Mesh
    lifts: Float64s
    doubts: Float64s
    borders: Float64s


def discs(points: Float64s, axes: Float64s, source: str = "points", threads: int | None = None) -> Discs:
    """Discs of points (k, 3) that reach to their sixth neighbour of their own sheet.

    Args: points: finite ones.

    Raises: MeshError: fewer than two points.
    """
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
    tell_sheets.on(threads)(cloud, distances)
    corners = np.empty((len(points), CORNERS, 3))
    counts = np.empty(len(points), np.int64)
    lifts = np.empty((len(points), 3))
    borders = np.empty((len(points), 3))
    doubts = np.empty(len(points))
    outline.on(threads)(cloud, corners, counts, borders)
    _lift.on(threads)(cloud, (corners, counts), lifts, doubts)
    # A fan of triangles for each, in the order of the points.
    place = np.argsort(order)
    counts = counts[place]
    vertices = corners[place][np.arange(CORNERS) < counts[:, None]]
    fans = np.repeat(np.cumsum(counts) - counts, counts - 2)
    ahead = np.arange(len(fans)) - np.repeat(np.cumsum(counts - 2) - (counts - 2), counts - 2) + 1
    faces = np.stack([fans, fans + ahead, fans + ahead + 1], axis=1)
    return Discs(Mesh(vertices, faces, source=source), lifts[place], doubts[place], borders[place])


def check_finite(points: Float64s, source: object) -> None:
    """Raises: MeshError: one of points (k, 3) is not finite; the first such is named."""
    bad = np.flatnonzero(~np.isfinite(points).all(axis=1))
    if len(bad):
        raise MeshError(source, f"points[{bad[0]}]", "finite coordinates", f"{points[bad[0]]} ({len(bad):,} such)")


def border_errors(points: Float64s, axes: Float64s, borders: Float64s, mu: Mu, threads: int | None = None) -> Float64s:
    """Errors of w at points (k, 3), (k,): the form factors of strips along borders, as wide as these are uncertain.

    A strip of area dA at distance d has cosθ cosθ' dA / (π d²) of a hemisphere; strips are off together.

    Args:
        points, axes, borders: of the cloud; unit normals (k, 3), and `Discs.borders`.
        mu: the falloff; what is far away closes less.
    """
    errors = np.zeros(len(points))
    spacings = np.linalg.norm(borders, axis=1)
    at_border = np.flatnonzero(spacings)
    if not len(at_border):
        return errors
    middles = points[at_border] + borders[at_border] / 2
    tree = cKDTree(middles)
    count = list(range(1, min(_POINTS, len(at_border)) + 1))
    farthest = _FARTHEST * spacings.max()
    distances, nearest = tree.query(points, count, distance_upper_bound=farthest, workers=thread_count(threads))
    row, column = np.nonzero(np.isfinite(distances) & (distances > 0.0))
    distance = distances[row, column]
    strip = nearest[row, column]
    border = at_border[strip]
    way = (middles[strip] - points[row]) / distance[:, None]
    cosine = np.maximum(np.einsum("kc,kc->k", way, axes[row]), 0.0) * np.abs(np.einsum("kc,kc->k", way, axes[border]))
    area = _UNKNOWN * spacings[border] ** 2
    strips = (1.0 - mu(distance)) * cosine * area / (np.pi * distance**2)
    np.add.at(errors, row, strips)
    return np.minimum(errors, _DOUBT)


@each("lifts")
def _lift(i: int, cloud: Cloud, outlines: tuple[Float64Grid, Int64s], lifts: Float64Rows, doubts: Float64s) -> None:
    """Write `Discs.lifts` and `doubts`: rays start above the discs of the own sheet, which overlap, and below half the
    way to the first disc of another one above. On a concave edge they start between both sheets."""
    p = load(cloud.points, i)
    axis = load(cloud.axes, i)
    radius = cloud.radius[i]
    first, rough, highest, sticking_out = np.inf, 0.0, 0.0, 0.0
    is_covered = False
    just_above = 0  # discs of a sheet
    directions = 0.0, 0.0, 0.0  # from their centres, summed
    walls = 0.0, 0.0, 0.0  # the sum of the normals of sheets that rise from the point
    for j in range(cloud.near.shape[1]):
        facing, above, along = beside(cloud, i, j)
        near = cloud.near[i, j]
        there = load(cloud.axes, near)
        if _rises_from(cloud, i, j, above, along):
            walls = add(walls, there)
            is_covered = True
            continue
        height = along / facing if facing != 0.0 else 0.0  # of the disc's plane over the point
        if height <= 0.0:
            continue
        if above <= 0.0:
            sticking_out = max(sticking_out, _height_of_corners(outlines, near, p, axis))
            if not cloud.of_sheet[i, j]:
                continue
        aside, is_below, outwards = _place_on_disc(cloud, outlines, near, add(p, scale(height, axis)))
        if cloud.of_sheet[i, j]:
            if is_below:
                highest = max(highest, height)
                if abs(above + along) / 2.0 > FLAT * radius:  # not level with the sheet
                    rough = max(rough, height)
        else:
            if is_below:
                first = min(first, height)
                is_covered |= aside <= _INNER
            if abs(facing) > _PARALLEL and height < radius and 0.0 < aside <= 2.0:
                just_above += 1
                directions = add(directions, outwards)
    distance = min(max(_LEAST * radius, _CLEAR * highest, _BEYOND_EDGES * sticking_out), _LIFT * min(radius, first))
    lift = scale(distance, axis)
    if length(walls) > 0.0:
        between = add(axis, scale(1.0 / length(walls), walls))
        lift = scale(distance / length(between), between)
    store(lifts, i, lift)
    height = dot(lift, axis)
    is_hole = not is_covered and length(directions) < _ONE_SIDED * just_above  # else the sheet ends here
    if highest >= height:
        doubts[i] = _CLOSED
    else:
        doubts[i] = _DOUBT if is_hole else _DOUBT * (rough / height) ** 3


@inline
def _rises_from(cloud, i, j, above, along):
    """Whether the j-th disc near point i is of another sheet, in whose plane the point lies, on a concave edge.

    Args: above, along: of `beside`.
    """
    near = cloud.near[i, j]
    level = FLAT * cloud.radius[i]
    if cloud.of_sheet[i, j] or above <= level or abs(along) > level:
        return False
    distance = length(subtract(load(cloud.points, near), load(cloud.points, i)))
    return distance <= _BESIDE_WALL * max(cloud.radius[i], cloud.radius[near])


@inline
def _place_on_disc(cloud, outlines, near, place):
    """How far a place in the plane of a disc is from its centre, in radii, whether it is in the outline, but for its
    rim, and the direction there from the centre, zero at it."""
    centre = load(cloud.points, near)
    offset = subtract(place, centre)
    aside = length(offset) / max(cloud.radius[near], 1e-300)  # 0 where points coincide
    is_in = aside <= 1.0 and _is_in(outlines, near, add(centre, scale(_INNER, offset)), load(cloud.axes, near))
    return aside, is_in, unit(offset)


@inline
def _height_of_corners(outlines, near, p, axis):
    """How far the highest corner of a disc is above the plane of a point."""
    corners, counts = outlines
    highest = -np.inf
    for k in range(counts[near]):
        corner = corners[near, k, 0], corners[near, k, 1], corners[near, k, 2]
        highest = max(highest, dot(subtract(corner, p), axis))
    return highest


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
