"""Faces that rays start from, with bounds of the rounding errors beside each; those that points touch or almost touch.

The latter are seams, T-junctions, feet on floors, plates almost in contact.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from ..bvh.bvh16 import BVH16
from ..bvh.closest import begin, closest_on_triangle, new_stack, next_leaf
from ..kernel.jit import inline, kernel
from ..kernel.simd import lowest_bit
from ..kernel.vector import cross, length, load, load_triangle, scale, subtract
from ..mesh.normals import face_normals, normal_and_area
from ..mesh.placement import NEAR, TOUCHING, ULP
from ..system.parallel import each, parallel
from ..system.threads import run_blocks, thread_count
from ..types import AnyFloats, Bools, Float32Rows, Float32s, Float64Rows, Float64s, Int32Rows, Int32s, Int64Rows, Int64s

FLAT = 1.0 / 16.0
_POINTS = 1 << 12  # of a thread that looks at all faces
_SEARCHED = 1 << 10  # points of a block, around which faces are looked for
_USUAL = 4  # contacts of a point that there are places for at first; coarse boxes on end have 2.5
_MOST_CONTACTS = 64  # contacts of one point; of more, those with the lowest rows are kept
_SEEN = 1 << 7  # faces that are compared with these; then no more are looked for
_USUAL_ROUNDING = 3.0 * NEAR * TOUCHING * ULP  # of all faces but those that reach far away
_CLASS = 16.0  # ratio of the roundings of faces that are searched for together


class Surface(NamedTuple):
    """Faces in render space; an argument of kernels.

    Attributes:
        vertices: float32 or float64 (n, 3). faces: int32 (m, 3), none degenerate. backwards: bool (m,), faces whose
            front is not that of their winding.
        rounding: float32 (m,), how far from a face a point may be that touches it.
    """

    vertices: Float32Rows | Float64Rows
    faces: Int32Rows
    backwards: Bools
    rounding: Float32s

    @classmethod
    def of(cls, vertices: AnyFloats, faces: Int32s, backwards: Bools) -> Surface:
        """Faces with their rounding measured; arguments as the attributes."""
        rounding = np.empty(len(faces), np.float32)
        _measure_rounding(vertices, faces, rounding)
        return cls(vertices, faces, backwards, rounding)

    def reversed(self) -> Surface:
        """The same faces, seen from behind."""
        return self._replace(backwards=~self.backwards)

    def normals(self, rows: Int32s | Int64s) -> Float64s:
        """The unit normals (k, 3) of some faces (k,), on their fronts."""
        normals, _ = face_normals(self.vertices, self.faces[rows])
        normals[self.backwards[rows]] *= -1.0
        return normals

    def extents(self, rows: Int32s | Int64s | slice = slice(None)) -> tuple[Float32s, Float32s]:
        """Of each of some faces (k,) the largest |coordinate| of its corners; above `NEAR` no more than counts across.
        And as large as that may be beside a flat triangle.

        There Embree takes the distance of the plane from a normal that it computes in float32, whose relative error is
        that of a coordinate over the sine of the largest angle, times the distance of a corner. At most `NEAR`, or as
        far away as the face is: the offset there is 10⁻⁵ of the mesh, no more.
        """
        faces = self.faces[rows]
        extent, flat = np.zeros((2, len(faces)), np.float32)
        _measure_extents(self.vertices, faces, extent, flat)
        return extent, flat

    def reaches(self, faces: Int32s) -> Float32s:
        """The larger of the two `extents` (k,) of some `faces` (k,)."""
        return np.maximum(*self.extents(faces))

    def shortest_edges(self, face_points: Int32s, points: Int64s) -> Float64s:
        """The shortest edge (k,) at each of some `points` (k,), numbers in `face_points` (m, 3); ∞ at none."""
        shortest = np.full(int(max(face_points.max(), points.max())) + 1, -1.0)
        shortest[points] = np.inf
        edged_faces, corners = np.nonzero(shortest[face_points] > 0)
        here = self.vertices[self.faces[edged_faces, corners]].astype(np.float64)
        for step in (1, 2):
            edge = np.linalg.norm(self.vertices[self.faces[edged_faces, (corners + step) % 3]] - here, axis=1)
            np.minimum.at(shortest, face_points[edged_faces, corners], edge)
        return shortest[points]

    def magnitudes(self, face_points: Int32s, count: int) -> Float64s:
        """The largest coordinates (count,) at each of `count` points, by which `ray_offset` scales offsets.

        Args:
            face_points: (m, 3), the points of each face.
        """
        around = np.zeros(count)
        magnitude = np.zeros(count)
        extent, flat = self.extents()
        _spread_flat(flat, face_points, around)
        _magnitudes(extent, face_points, around, magnitude)
        return magnitude


@inline
def front(surface, f):
    """The unit normal of face `f` on its front."""
    normal, _ = normal_and_area(load_triangle(surface.vertices, surface.faces, f))
    return scale(-1.0, normal) if surface.backwards[f] else normal


@inline
def _across(corners):
    """The largest distance from the origin to the plane of a triangle of such large coordinates."""
    a, b, c = corners
    normal, _ = normal_and_area(corners)
    across = 0.0
    for axis in range(3):
        across += abs(normal[axis]) * max(abs(a[axis]), abs(b[axis]), abs(c[axis]))
    return across


@each("faces")
def _measure_rounding(f: int, vertices: Float32Rows | Float64Rows, faces: Int32Rows, rounding: Float32s) -> None:
    """Write the attribute `rounding` of a `Surface`."""
    rounding[f] = TOUCHING * ULP * _across(load_triangle(vertices, faces, f))


@each("faces")
def _measure_extents(
    f: int, vertices: Float32Rows | Float64Rows, faces: Int32Rows, extent: Float32s, flat: Float32s
) -> None:
    """Write `Surface.extents`, which are zeros."""
    a, b, c = load_triangle(vertices, faces, f)
    for axis in range(3):
        extent[f] = max(extent[f], abs(a[axis]), abs(b[axis]), abs(c[axis]))
    extent[f] = min(extent[f], max(NEAR, _across((a, b, c))))
    ab = subtract(b, a)
    bc = subtract(c, b)
    ca = subtract(a, c)
    slender = length(ab) * length(bc) * length(ca) / max(length(cross(ab, bc)), 1e-150)  # longest edge/sine
    flat[f] = min(FLAT * slender, max(NEAR, min(_largest(a), _largest(b), _largest(c))))


@inline
def _largest(p):
    """The largest absolute coordinate."""
    return max(abs(p[0]), abs(p[1]), abs(p[2]))


@parallel("around", _POINTS, alone=True)
def _spread_flat(start: int, stop: int, flat: Float32s, face_points: Int32Rows, around: Float64s) -> None:
    """The largest `flat` of the faces of each point."""
    for f in range(len(face_points)):
        for corner in range(3):
            point = face_points[f, corner]
            if start <= point < stop and flat[f] > around[point]:  # seldom; a store each time would be waited for
                around[point] = flat[f]


@parallel("magnitude", _POINTS, alone=True)
def _magnitudes(
    start: int, stop: int, extent: Float32s, face_points: Int32Rows, around: Float64s, magnitude: Float64s
) -> None:
    """The largest `extent` of a point's faces, and `flat` of these and of its neighbours' faces, which rays pass by."""
    for f in range(len(face_points)):
        a = face_points[f, 0]
        b = face_points[f, 1]
        c = face_points[f, 2]
        if start <= a < stop or start <= b < stop or start <= c < stop:
            largest = max(extent[f], max(around[a], around[b], around[c]))
            for point in (a, b, c):
                if start <= point < stop and largest > magnitude[point]:
                    magnitude[point] = largest


class Contacts(NamedTuple):
    """Pairs of a point and a face near it, sorted: `point`, `face` int32 (j,), `distance` float64 (j,)."""

    point: Int32s
    face: Int32s
    distance: Float64s

    @classmethod
    def joined(cls, parts: Sequence[Contacts]) -> Contacts:
        """The contacts of several parts, one after another."""
        return cls(*(np.concatenate(column) for column in zip(*parts, strict=True)))

    def only(self, selection: Bools | Int64s) -> Contacts:
        """Some of the pairs, copied; `selection` is bool (j,) or their rows."""
        return Contacts(self.point[selection], self.face[selection], self.distance[selection])


_Points = tuple[Float64s, Float64s, Int32s, Int64s]  # points, reach, face_points, numbers


def find_contacts(
    tree: BVH16, surface: Surface, points: Float64s, reach: Float64s, face_points: Int32s, numbers: Int64s
) -> Contacts:
    """The faces within the larger of `reach` and their `rounding` of points, but not those that a point is a corner of.

    Args: tree: over the faces of `surface`. points: (k, 3), render space. reach: (k,), negative to leave points out.
        face_points: int32 (m, 3), the number of the point that each face corner is. numbers: int64 (k,), of each point.
    """
    if not (reach >= 0.0).any() or not len(surface.faces):
        return _empty(0)
    around = (points, reach, face_points, numbers)
    most = float(surface.rounding.max())
    if most <= _USUAL_ROUNDING:
        return _contacts_with_tree(tree, surface, around, most)
    contacts = []
    least = -1.0
    while least < most:
        limit = max(_CLASS * least, _USUAL_ROUNDING)
        uncertain = np.flatnonzero((surface.rounding > least) & (surface.rounding <= limit))
        if len(uncertain):
            uncertain_tree = BVH16.of(surface.vertices.astype(np.float32), surface.faces[uncertain])
            uncertain_tree = uncertain_tree._replace(
                leaf_faces=np.where(uncertain_tree.leaf_faces < 0, -1, uncertain[uncertain_tree.leaf_faces]).astype(
                    np.int32
                )
            )
            contacts.append(_contacts_with_tree(uncertain_tree, surface, around, limit))
        least = limit
    joined = Contacts.joined(contacts)
    joined = joined.only(np.lexsort((joined.face, joined.point)))
    rank = np.arange(len(joined.point)) - np.searchsorted(joined.point, joined.point)
    return joined.only(rank < _MOST_CONTACTS)


def _contacts_with_tree(tree: BVH16, surface: Surface, around: _Points, most: float) -> Contacts:
    """`find_contacts` of the faces of a tree, whose rounding is `most` at most."""
    count = len(around[0])
    parts: list[Contacts] = [_empty(0)] * -(-count // _SEARCHED)

    def search(start: int, stop: int) -> None:
        """Find the contacts of the points from `start` to `stop`, again with enough room if they were more than
        usual."""
        contacts = _empty(_USUAL * _SEARCHED)
        fill = partial(_search, tree, new_stack(), surface, around, most, start, stop)
        size = fill(contacts)
        if size > len(contacts.point):
            contacts = _empty(size)
            fill(contacts)
        parts[start // _SEARCHED] = contacts.only(np.arange(size))  # copies, so that the rest is let go

    run_blocks(count, _SEARCHED, search, thread_count(None))
    return Contacts.joined(parts)


def _empty(count: int) -> Contacts:
    """Room for so many contacts."""
    return Contacts(np.empty(count, np.int32), np.empty(count, np.int32), np.empty(count))


@inline
def _is_farther(p, reach, a, b, c):
    """Whether p is farther than `reach` from the interval that a, b and c span."""
    return min(a, b, c) - reach > p or max(a, b, c) + reach < p


@kernel
def _search(
    tree: BVH16,
    stack: Int64Rows,
    surface: Surface,
    around: tuple[Float64Rows, Float64s, Int32Rows, Int64s],
    most: float,
    start: int,
    stop: int,
    contacts: Contacts,
) -> int:
    """Write the contacts of points from `start` to `stop` into `contacts` as far as they fit; returns their number."""
    points, reach, corners, numbers = around
    count = 0
    kept = np.empty(_MOST_CONTACTS, np.int64)
    distances = np.empty(_MOST_CONTACTS)
    for i in range(start, stop):
        if reach[i] < 0.0:
            continue
        # The nearest faces that the point is no corner of, leaf by leaf.
        p = load(points, i)
        number = numbers[i]
        filled = 0
        seen = 0
        waiting = begin(tree, stack, p, max(reach[i], most))
        leaf, near = next_leaf(tree, stack, waiting)
        while near != 0 and seen < _SEEN:
            while near != 0:
                f = tree.leaf_faces[leaf, lowest_bit(near)]
                near &= near - 1
                seen += filled == _MOST_CONTACTS
                if corners[f, 0] != number and corners[f, 1] != number and corners[f, 2] != number:
                    filled = _insert_contact(
                        surface, f, p, max(reach[i], surface.rounding[f]), (kept, distances), filled
                    )
            leaf, near = next_leaf(tree, stack, waiting)
        # They are counted even where they do not fit.
        for k in range(filled):
            if count < len(contacts.point):
                contacts.point[count] = i
                contacts.face[count] = kept[k]
                contacts.distance[count] = distances[k]
            count += 1
    return count


@inline
def _insert_contact(surface, f, p, within, nearest, filled):
    """Add a face to those `filled`, sorted by number, and their distances if it is near enough; how many there are."""
    kept, distances = nearest
    if filled == _MOST_CONTACTS and f > kept[filled - 1]:
        return filled
    a, b, c = load_triangle(surface.vertices, surface.faces, f)
    if _is_farther(p[0], within, a[0], b[0], c[0]) or _is_farther(p[1], within, a[1], b[1], c[1]):
        return filled
    if _is_farther(p[2], within, a[2], b[2], c[2]):
        return filled
    away = closest_on_triangle(p, a, b, c)[0]
    if away > within:
        return filled
    slot = min(filled, _MOST_CONTACTS - 1)
    while slot > 0 and kept[slot - 1] > f:
        kept[slot] = kept[slot - 1]
        distances[slot] = distances[slot - 1]
        slot -= 1
    kept[slot] = f
    distances[slot] = away
    return min(filled + 1, _MOST_CONTACTS)
