"""Where rays start: in front of everything that meets at a point, and short of what is almost in contact.

A point may lie on faces that it is no corner of: beside a hard edge whose sides are stored apart, on the edge of a
larger face (a T-junction), or on other geometry. It is taken to be in front of all of them. Faces that coincide and
look opposite ways cannot both be obeyed: the one that surrounds the point with the larger angle wins, as a floor does
over the foot of a box that stands on it, and the point's own in a tie, as in a sheet with two sides.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from .contacts import Contacts, distance_to_triangle, find_contacts
from .embree import TriangleScene
from .jit import inline, kernel
from .outermost import outermost_normals
from .placement import ULP, ray_offset
from .vector import add, cross, dot, load, scale, subtract

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]

TOUCHING = 4.0  # roundings of a coordinate; the point's and the face's own make 2
FLAT = 1.0 / 16.0
_ENOUGH = 0.3  # clearance with which a search for a better direction ends
_SAME_PLANE = 0.9999


def ray_origins(
    scene: TriangleScene,
    points: Floats,
    lift: Floats,
    clearance: Floats,
    vertices: Floats,
    faces: Ints,
    face_normals: Floats,
    seats: Ints,
) -> Floats:
    """Ray origins (k, 3) of `points` (k, 3) in placed coordinates.

    Args:
        scene: holds exactly the `faces`.
        lift: (k, 3), unit, or zero for points without origins; in front of the point's own faces with the least
            cosine `clearance` (k,).
        vertices (n, 3), faces (m, 3), none degenerate, with unit face_normals (m, 3).
        seats: (m, 3), the row of `points` that each face corner is.
    """

    def contacts(rows: Ints, reach: Floats) -> Contacts:
        number = np.full(len(points), -1)
        number[rows] = np.arange(len(rows))
        found = find_contacts(scene, points[rows], reach[rows], rounding, vertices, faces, number[seats])
        return Contacts(rows[found.point], found.face, found.distance)

    lift, clearance = lift.copy(), clearance.copy()
    extent, flat, rounding, size = *(np.zeros(len(faces)) for _ in range(3)), np.zeros(len(points))
    _measure(vertices, faces, face_normals, extent, flat, rounding)
    _spread(flat, seats, size)
    _largest(np.maximum(extent, flat), seats, size)
    offset = ray_offset(lift, size, clearance)
    own = TOUCHING * ULP * (np.abs(points) @ np.ones(3))
    reach = np.maximum(4.0 * offset, own)  # so far that turning a lift seldom asks for more
    has_lift = (lift != 0.0) @ np.ones(3) > 0
    near = contacts(np.flatnonzero(has_lift), reach)
    touched = near.only(near.distance <= np.maximum(own[near.point], rounding[near.face]))
    if len(touched.point):
        _step_out(points, lift, clearance, touched, vertices, faces, face_normals, seats)
        np.maximum.at(size, touched.point, np.maximum(extent, flat)[touched.face])
        offset = ray_offset(lift, size, clearance)
        more = contacts(np.flatnonzero(has_lift & (2.0 * offset > reach)), 2.0 * offset)
        near = Contacts(*(np.append(a, b) for a, b in zip(near, more, strict=True)))
    _stop_short(points, lift, own, rounding, near.point, near.face, vertices, faces, face_normals, offset)
    return points + offset[:, None] * lift


def _step_out(
    points: Floats,
    lift: Floats,
    clearance: Floats,
    touched: Contacts,
    vertices: Floats,
    faces: Ints,
    face_normals: Floats,
    seats: Ints,
) -> None:
    """Turn `lift` and `clearance` of touched points in front of what they touch, too, where there is a way."""
    rows = np.unique(touched.point)
    number = np.full(len(points), -1)
    number[rows] = np.arange(len(rows))
    own_face, corner = np.nonzero(number[seats] >= 0)
    row = np.concatenate([number[seats[own_face, corner]], number[touched.point]])
    face = np.concatenate([own_face, touched.face])
    own = np.arange(len(row)) < len(own_face)
    order = np.lexsort((face, row))
    row, face, own = row[order], face[order], own[order]
    starts = np.searchsorted(row, np.arange(len(rows) + 1))
    normals = face_normals[face]
    behind = own & (np.einsum("ij,ij->i", normals, lift[rows][row]) < 0)  # seen from its other side
    normals[behind] *= -1.0
    kept, angle = np.zeros(len(row), np.bool_), np.zeros(len(row))
    _angles(points[rows][row], vertices, faces[face], angle)
    _choose(starts, normals, angle, own, kept)

    row, normals, angle = row[kept], normals[kept], angle[kept]
    start: Floats = np.stack([np.bincount(row, angle * normals[:, axis], len(rows)) for axis in range(3)], axis=1)
    length = np.linalg.norm(start, axis=1, keepdims=True)
    start = np.where(length > 1e-9, start / np.where(length > 1e-9, length, 1.0), lift[rows])
    moved, room = outermost_normals(start, row[:, None], normals, _ENOUGH)
    free = room > 0
    lift[rows[free]], clearance[rows[free]] = moved[free], room[free]


@kernel
def _measure(vertices, faces, normals, extent, flat, rounding):
    """What offsets reckon with, for each face, and how far from it a point may be that touches it.

    `extent` is the largest |coordinate| of the corners. `flat` is as large as that may be beside a flat triangle:
    Embree takes the distance of its plane from a normal that it computes in float32, whose relative error is that of a
    coordinate over the sine of the largest angle, times the distance of a corner. Bounded: the offset there is 10⁻⁵ of
    the placed mesh, no more.
    """
    for f in range(len(faces)):
        a, b, c = load(vertices, faces[f, 0]), load(vertices, faces[f, 1]), load(vertices, faces[f, 2])
        for axis in range(3):
            largest = max(abs(a[axis]), abs(b[axis]), abs(c[axis]))
            extent[f] = max(extent[f], largest)
            rounding[f] += TOUCHING * ULP * abs(normals[f, axis]) * largest
        ab, bc, ca = subtract(b, a), subtract(c, b), subtract(a, c)
        x, y, z = np.sqrt(dot(ab, ab)), np.sqrt(dot(bc, bc)), np.sqrt(dot(ca, ca))
        normal = cross(ab, bc)
        slender = x * y * z / max(np.sqrt(dot(normal, normal)), 1e-150)  # longest edge/sine of the largest angle
        flat[f] = min(FLAT * slender, 8.0)


@kernel
def _stop_short(points, lift, own, rounding, point, face, vertices, faces, normals, offset):
    """Halve the way of each offset to the first face that it would pass, the faces it touches left out."""
    for i in range(len(point)):
        row, f = point[i], face[i]
        p, up, n = load(points, row), load(lift, row), load(normals, f)
        a, b, c = load(vertices, faces[f, 0]), load(vertices, faces[f, 1]), load(vertices, faces[f, 2])
        facing = dot(n, up)
        if facing != 0.0:
            ahead = dot(n, subtract(a, p)) / facing
            touching = max(own[row], rounding[f])
            passed = touching < ahead < 2.0 * offset[row]
            if passed and distance_to_triangle(add(p, scale(ahead, up)), a, b, c) <= touching:
                offset[row] = min(offset[row], 0.5 * ahead)


@kernel
def _largest(extent, seats, size):
    for f in range(len(seats)):
        for corner in range(3):
            row = seats[f, corner]
            size[row] = max(size[row], extent[f])


@kernel
def _spread(flat, seats, size):
    """The largest `flat` of the faces around a point and around its neighbours, whose rays pass by them closely."""
    around = np.zeros(len(size))
    _largest(flat, seats, around)
    for f in range(len(seats)):
        largest = max(around[seats[f, 0]], around[seats[f, 1]], around[seats[f, 2]])
        for corner in range(3):
            row = seats[f, corner]
            size[row] = max(size[row], largest)


@inline
def _angle(a, b):
    normal = cross(a, b)
    return np.arctan2(np.sqrt(dot(normal, normal)), dot(a, b))


@kernel
def _angles(points, vertices, faces, out):
    """Angle that each face fills about a point on it: a corner's own, π on an edge, 2π inside."""
    for i in range(len(points)):
        p = load(points, i)
        out[i] = 2.0 * np.pi
        for k in range(3):
            a = subtract(load(vertices, faces[i, k]), p)
            b = subtract(load(vertices, faces[i, (k + 1) % 3]), p)
            c = subtract(load(vertices, faces[i, (k + 2) % 3]), p)
            tiny = 16.0 * ULP
            if np.sqrt(dot(a, a)) <= tiny:
                out[i] = _angle(b, c)
                break
            along, across = subtract(b, a), cross(a, b)
            if np.sqrt(dot(across, across)) <= tiny * np.sqrt(dot(along, along)):
                out[i] = np.pi


@kernel
def _choose(starts, normals, angles, own, kept):
    """Mark the faces to be obeyed: see the module about faces that look opposite ways."""
    for k in range(len(starts) - 1):
        for i in range(starts[k], starts[k + 1]):
            balance, opposed = 0.0, False
            for j in range(starts[k], starts[k + 1]):
                cosine = 0.0
                for axis in range(3):
                    cosine += normals[i, axis] * normals[j, axis]
                if cosine > _SAME_PLANE:
                    balance += angles[j]
                elif cosine < -_SAME_PLANE:
                    balance -= angles[j]
                    opposed = True
            kept[i] = not opposed or balance > 1e-3 or (balance > -1e-3 and own[i])
