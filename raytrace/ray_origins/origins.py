"""Ray origins: in front of everything that meets at a point, beyond rounding errors, and short of the next face.

Coincident vertices are one point, with an origin in front of the faces of all of them.

A face's front is on the side from which the corners run anticlockwise, wherever an axis points: the underside of a ball
is no front of its inside because an axis is up. But where axes are given, a whole patch that looks away from them is
wound the wrong way round.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..bvh.bvh16 import BVH16
from ..bvh.closest import closest_on_triangle
from ..kernel.arrays import product
from ..kernel.jit import inline, kernel
from ..kernel.vector import add, dot, load, load_triangle, scale, subtract
from ..mesh.normals import Weighting, face_areas, face_normals, nonzero, normalize, vertex_sums
from ..mesh.placement import LEAST, TOUCHING, ULP
from ..mesh.weld import CREASE, coincident, connected_components, sum_groups, weld
from ..system.parallel import each
from ..types import AnyFloats, Bools, Float32s, Float64Rows, Float64s, Int32s, Int64s
from .direction import SHARP, least_cosines, outermost_normals, resolve_contacts
from .surface import Contacts, Surface, find_contacts, front

OFFSET_ULPS = 16.0  # 4 were enough in 20,000 trials
_BLURRED = 5.0  # offsets within which rounding has a say in what a point sees of a face, and where faces are looked for
_LEAST, _NEAR = 0.25, 1.0 / 64.0  # of an offset and of the shortest edge, to which offsets in folds are cut
_BLOCK = 1 << 18  # points, for whose offsets there is memory at once
AWAY = -0.7  # mean cosine between normals and axes, below which faces are wound the wrong way round


def ray_origins(
    tree: BVH16,
    surface: Surface,
    points: Float64s,
    directions: Float64s,
    clearance: Float64s,
    face_points: Int32s,
    numbers: Int64s,
    magnitude: Float64s,
) -> tuple[Float64s, Bools]:
    """Ray origins (k, 3) of `points` (k, 3) in render space, and which (k,) are decided by faces beside them.

    Args: tree, face_points, numbers: as `find_contacts` takes them; points may share a number.
        directions: (k, 3), unit, or zero for points without origins; in front of the point's own faces with the least
            cosine `clearance` (k,).
        magnitude: (k,), what `surface.magnitudes(face_points, …)` has for a point's number.
    """
    offset, touching, reach = offsets_and_reaches(points, directions, magnitude, clearance)
    ambiguous = np.zeros(len(points), np.bool_)
    # Faces near the points: those that touch a point, and those that rounding leaves in doubt.
    near = find_contacts(tree, surface, points, reach, face_points, numbers)
    touches = near.distance <= np.maximum(touching[near.point], surface.rounding[near.face])
    touched = near.only(touches)
    blurred = near.point[~touches & (near.distance <= (reach * clearance)[near.point])]
    # Directions in front of what is touched, too, and offsets that clear it.
    if len(touched.point):
        directions = directions.copy()
        clearance = clearance.copy()
        magnitude = magnitude.copy()
        resolve_contacts((directions, clearance, ambiguous), surface, points, touched, face_points, numbers)
        np.maximum.at(magnitude, touched.point, surface.reaches(touched.face))
        offset = ray_offset(directions, magnitude, clearance)
        farther = np.where((reach >= 0.0) & (2.0 * offset > reach), 2.0 * offset, -1.0)
        far_contacts = find_contacts(tree, surface, points, farther, face_points, numbers)
        if len(far_contacts.point):
            near = Contacts.joined([near, far_contacts])
    ambiguous[blurred] = True
    # In sharp folds offsets stay small beside the shortest edge; nowhere do they reach the next face.
    sharp = np.flatnonzero((reach >= 0.0) & (clearance < SHARP))
    if len(sharp):
        near_edge = _NEAR * surface.shortest_edges(face_points, numbers[sharp])
        offset[sharp] = np.clip(near_edge, _LEAST * offset[sharp], offset[sharp])
    stop_short(offset, points, directions, touching, near, surface)
    return points + offset[:, None] * directions, ambiguous


def directions_in_front(
    points: Float64s, axes: Float64s, tree: BVH16, surface: Surface
) -> tuple[Float64s, Float64s, Float64s]:
    """Directions (k, 3) in front of the faces that hold `points` (k, 3), or touch them, their clearance (k,), and the
    largest coordinate (k,) of the point and of these faces.

    They are the `axes` (k, 3), unit, unless these lie in such faces or behind; a face is seen from its back where an
    axis is far behind it. Args: tree: over the faces of `surface`.
    """
    count = len(surface.faces)
    numbers = np.arange(count, dtype=np.int32)
    apart = np.repeat(numbers[:, None], 3, axis=1), np.full(len(points), count)  # points are no corners
    _, touching, _ = offsets_and_reaches(points, axes, np.zeros(len(points)), np.ones(len(points)))
    held = find_contacts(tree, surface, points, touching, *apart)
    normals = surface.normals(held.face)
    normals[np.einsum("ij,ij->i", normals, axes[held.point]) < AWAY] *= -1.0
    rows = held.point[:, None]
    sums = np.zeros_like(points)
    np.add.at(sums, held.point, normals)
    _, directions, clearance = outermost_normals(normalize(sums), rows, normals)
    clear = least_cosines(axes, rows, normals)
    is_in_front = clear > SHARP
    directions[is_in_front] = axes[is_in_front]
    magnitude = np.abs(points).max(axis=1, initial=0.0)
    np.maximum.at(magnitude, held.point, surface.reaches(held.face))
    return directions, np.where(is_in_front, clear, clearance), magnitude


def ray_offset(directions: Float64s, magnitude: Float64s, clearance: Float64s) -> Float64s:
    """Distance (n,) along unit `directions` (n, 3) at which an origin is surely above the surface that it starts on.

    Args: magnitude: (n,), the largest |coordinate| among the corners of the faces that meet there.
        clearance: (n,), the smallest cosine between the direction and those faces' normals; below .01 it counts as .01.
    """
    return OFFSET_ULPS * ULP * product(np.abs(directions), np.ones(3)) * magnitude / np.maximum(clearance, 0.01)


def offsets_and_reaches(
    points: Float64s, directions: Float64s, magnitude: Float64s, clearance: Float64s
) -> tuple[Float64s, Float64s, Float64s]:
    """`ray_offset`, how near a face is touched, and within what distance to look for faces, −1 without a direction."""
    lengths = np.empty((3, len(points)))
    _offsets_and_reaches(points, directions, magnitude, clearance, lengths)
    return lengths[0], lengths[1], lengths[2]


@each("points")
def _offsets_and_reaches(
    i: int,
    points: Float64Rows,
    directions: Float64Rows,
    magnitude: Float64s,
    clearance: Float64s,
    lengths: Float64Rows,
) -> None:
    """Write `offsets_and_reaches`. Args: lengths: the three arrays (k,) that it returns."""
    offset, touching, reach = lengths
    direction = load(directions, i)
    point = load(points, i)
    offset[i] = OFFSET_ULPS * ULP * _span(direction) * magnitude[i] / max(clearance[i], 0.01)
    touching[i] = TOUCHING * ULP * max(_span(point), LEAST)
    reach[i] = max(_BLURRED * offset[i], touching[i])  # so far that turning a direction seldom asks for more
    if direction == (0.0, 0.0, 0.0):
        reach[i] = -1.0


@inline
def _span(v):
    """The sum of the absolute coordinates, |x| + |y| + |z|."""
    return abs(v[0]) + abs(v[2]) + abs(v[1])


@kernel
def stop_short(
    offset: Float64s, points: Float64Rows, directions: Float64Rows, touching: Float64s, near: Contacts, surface: Surface
) -> None:
    """Cut each offset to half the way to the first face that twice of it would pass, those nearer than `touching`
    left out.

    Args: near: Contacts.
    """
    for i in range(len(near.point)):
        row = near.point[i]
        f = near.face[i]
        p = load(points, row)
        direction = load(directions, row)
        n = front(surface, f)
        a, b, c = load_triangle(surface.vertices, surface.faces, f)
        facing = dot(n, direction)
        if facing != 0.0:
            ahead = dot(n, subtract(a, p)) / facing
            touched = max(touching[row], surface.rounding[f])
            passed = touched < ahead < 2.0 * offset[row]
            if passed and closest_on_triangle(add(p, scale(ahead, direction)), a, b, c)[0] <= touched:
                offset[row] = min(offset[row], 0.5 * ahead)


class WeldedPoints(NamedTuple):
    """Points of a mesh of n vertices and m faces that are not degenerate.

    Attributes:
        group: int64 (n,), the point of each vertex. first_vertex: int64 (k,), of each point.
        surface: the faces; backwards are those that are `wound_away`. face_points: int32 (m, 3), the point at each
            corner.
        axes: float64 (k, 3), means of the faces' normals, unit or zero, moved in front of all the point's faces where
            there is a way.
        moved: bool (k,), those that are.
        directions: float64 (k, 3), to offset ray origins along, see `raytrace.ray_origins.direction`.
        clearance: float64 (k,), least cosine between the direction and the faces' normals.
    """

    group: Int64s
    first_vertex: Int64s
    surface: Surface
    face_points: Int32s
    axes: Float64s
    moved: Bools
    directions: Float64s
    clearance: Float64s

    def reversed(self) -> WeldedPoints:
        """The same points of the same faces, seen from behind."""
        return self._replace(surface=self.surface.reversed(), directions=-self.directions)

    def ray_origins(self, tree: BVH16) -> tuple[Float64s, Bools]:
        """`raytrace.ray_origins.origins.ray_origins`. Args: tree: over the faces of `surface`."""
        surface = self.surface
        corners, count = self.face_points, len(self.first_vertex)
        magnitude = surface.magnitudes(corners, count)
        origins = np.empty((count, 3))
        ambiguous = np.empty(count, np.bool_)
        for start in range(0, count, _BLOCK):
            some = slice(start, start + _BLOCK)
            points = surface.vertices[self.first_vertex[some]].astype(np.float64)
            numbers = np.arange(*some.indices(count))
            of_points = self.directions[some], self.clearance[some]
            found = ray_origins(tree, surface, points, *of_points, corners, numbers, magnitude[some])
            origins[some], ambiguous[some] = found
        return origins, ambiguous

    def displacement(self, origins: Float64s) -> Float32s:
        """Distances, float32 (k,), of origins (k, 3) from points in folds as sharp as `SHARP`, in shortest edges;
        elsewhere 0."""
        displaced = np.zeros(len(self.first_vertex), np.float32)
        sharp = np.flatnonzero(nonzero(self.directions) & (self.clearance < SHARP))
        if len(sharp):
            away = np.linalg.norm(origins[sharp] - self.surface.vertices[self.first_vertex[sharp]], axis=1)
            displaced[sharp] = away / self.surface.shortest_edges(self.face_points, sharp)
        return displaced


def weld_points(
    vertices: AnyFloats,
    faces: Int32s,
    weighting: Weighting = "angle",
    normals: Float64s | None = None,
    agreement: float = CREASE,
    by_means: bool = False,
) -> WeldedPoints:
    """Weld the vertices of a mesh, and find directions in front of their faces.

    Args: vertices: (n, 3), render space. faces: int32 (m, 3); degenerate ones are left out.
        weighting: of the faces' normals in their mean, see `vertex_sums`.
        normals: (n, 3), unit or zero, the directions where these are in front of the faces; by default the vertices'
            means, which lie in front of the faces elsewhere, too.
        agreement: least cosine between the normals of vertices that are welded. by_means: between their means instead.
    """
    has_area = face_areas(vertices, faces) > 0
    if not has_area.all():
        faces = faces[has_area]
    backwards = np.zeros(len(faces), np.bool_) if normals is None else wound_away(vertices, faces, normals)
    sums = vertex_sums(vertices, faces, weighting, backwards)
    mean = normalize(sums)
    axes_to_weld = mean if normals is None or by_means else normals
    group = weld(vertices.astype(np.float32, copy=False), faces, axes_to_weld, agreement)
    first_vertices, face_points = group, np.ascontiguousarray(faces)
    if len(group) > group.max() + 1:
        first_vertices = np.empty(int(group.max()) + 1, np.int64)
        first_vertices[group[::-1]] = np.arange(len(group))[::-1]
        face_points = group.astype(np.int32).take(faces)
        mean = normalize(sum_groups(group, sums))
    surface = Surface.of(vertices, faces, backwards)
    axes, directions, clearance = outermost_normals(mean, face_points, surface)
    moved = nonzero(axes != mean)
    if normals is not None:
        # A given normal in front of all faces is the direction itself; of the two sides of a sheet, it chooses one.
        own_normals = normals[first_vertices]
        directions = directions.copy()
        clear = least_cosines(own_normals, face_points, surface)
        is_in_front = (clear > SHARP) & nonzero(own_normals)
        directions[is_in_front] = own_normals[is_in_front]
        clearance[is_in_front] = clear[is_in_front]
        is_behind = (clearance <= 0.0) & (np.einsum("ij,ij->i", directions, own_normals) < 0.0)
        directions[is_behind] *= -1.0
    return WeldedPoints(group, first_vertices, surface, face_points, axes, moved, directions, clearance)


def wound_away(vertices: AnyFloats, faces: Int32s, axes: Float64s) -> Bools:
    """Which faces (m,) are of patches whose normals look away from the `axes` (n, 3), unit or zero, of their vertices.

    A patch hangs together by edges that two faces run along in opposite ways, wherever their vertices are stored.

    Args: faces: (m, 3), none degenerate.
    """
    normals, areas = face_normals(vertices, faces)
    corner_axes = axes[faces]
    along = areas * np.einsum("fi,fci->f", normals, corner_axes)
    if not (along < 0).any():
        return np.zeros(len(faces), np.bool_)
    place = coincident(vertices.astype(np.float32, copy=False), faces)
    patch = connected_components(_facing_pairs(place[faces]), len(faces))
    weights = areas * corner_axes.any(axis=2).sum(axis=1)
    away = np.bincount(patch, along) < AWAY * np.bincount(patch, weights)
    return np.asarray(away[patch])


def _facing_pairs(corners: Int64s) -> Int64s:
    """Pairs (j, 2) that connect the faces (m, 3) at each edge along which some run one way and some the other."""
    starts = corners.ravel()
    ends = corners[:, [1, 2, 0]].ravel()
    low, high = np.minimum(starts, ends), np.maximum(starts, ends)
    order = np.lexsort((high, low))
    is_new = np.diff(low[order], prepend=-1).astype(np.bool_) | np.diff(high[order], prepend=-1).astype(np.bool_)
    edge = np.cumsum(is_new) - 1
    ascending = np.bincount(edge, (starts < ends)[order])
    both_ways = (ascending > 0) & (ascending < np.bincount(edge))
    later = np.flatnonzero(~is_new & both_ways[edge])
    return np.stack([order[later - 1], order[later]], axis=1) // 3
