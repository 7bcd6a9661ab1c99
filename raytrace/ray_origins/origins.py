"""Where rays start: in front of everything that meets at a point, and short of what is almost in contact.

A point may lie on faces that it is no corner of: beside a hard edge whose sides are stored apart, on the edge of a
larger face (a T-junction), or on other geometry. It is taken to be in front of all of them. Faces that coincide and
look opposite ways cannot both be obeyed: the one that surrounds the point with the larger angle wins, as a floor does
over the foot of a box that stands on it, and the point's own in a tie, as in a sheet with two sides.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ..embree.scene import TriangleScene
from ..kernel.arrays import product
from ..kernel.jit import inline, kernel
from ..kernel.vector import add, cross, dot, load, scale, subtract
from ..mesh.normals import given
from ..mesh.placement import ULP, ray_offset
from ..system.threads import run_blocks, thread_count
from .clearance import outermost_normal
from .contacts import Contacts, distance_to_triangle, find_contacts

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]

TOUCHING = 4.0  # roundings of a coordinate; the point's and the face's own make 2
FLAT = 1.0 / 16.0
_ENOUGH = 0.3  # clearance with which a search for a better direction ends
_SAME_PLANE = 0.9999
_POINTS, _FACES = 1 << 12, 1 << 15  # of a block of work


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

    def contacts(reach: Floats) -> Contacts:
        return find_contacts(scene, points, reach, rounding, vertices, faces, seats)

    lift, clearance = lift.copy(), clearance.copy()
    extent, flat, rounding, size = *(np.zeros(len(faces)) for _ in range(3)), np.zeros(len(points))

    def measure(a: int, b: int) -> None:
        _measure(vertices, faces[a:b], face_normals[a:b], extent[a:b], flat[a:b], rounding[a:b])

    run_blocks(len(faces), _FACES, measure, thread_count(None))
    _spread(flat, seats, size)
    _largest(np.maximum(extent, flat), seats, size)
    offset = ray_offset(lift, size, clearance)
    own = TOUCHING * ULP * product(np.abs(points), np.ones(3))
    reach = np.maximum(4.0 * offset, own)  # so far that turning a lift seldom asks for more
    reach[~given(lift)] = -1.0
    near = contacts(reach)
    touched = near.only(near.distance <= np.maximum(own[near.point], rounding[near.face]))
    if len(touched.point):
        _step_out(points, lift, clearance, touched, vertices, faces, face_normals, seats)
        np.maximum.at(size, touched.point, np.maximum(extent, flat)[touched.face])
        offset = ray_offset(lift, size, clearance)
        more = contacts(np.where((reach >= 0.0) & (2.0 * offset > reach), 2.0 * offset, -1.0))
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
    first = np.flatnonzero(np.diff(touched.point, prepend=-1))
    rows, ends = touched.point[first], np.append(first, len(touched.point))
    number = np.full(len(points), -1)
    number[rows] = np.arange(len(rows))
    starts = np.zeros(len(rows) + 2, np.int64)
    _count(number, seats, starts)
    own = np.empty(starts[-1], np.int64)
    _list(number, seats, starts, own)
    most = int(np.max(np.diff(starts[:-1]) + np.diff(ends)))

    def work(a: int, b: int) -> None:
        scratch = np.empty((most, 3)), np.empty(most), np.empty(most, np.bool_), np.empty((most, 3))
        _turn(
            rows[a:b], starts[a:], own, ends[a:], touched.face, points, vertices, faces, face_normals, *scratch, lift,
            clearance,
        )  # fmt: skip

    run_blocks(len(rows), _POINTS, work, thread_count(None))


@kernel
def _count(number, seats, starts):
    """Count the corners at each point, `number` ≥ 0, into starts[number + 2], and add them up."""
    for f in range(len(seats)):
        for corner in range(3):
            row = number[seats[f, corner]]
            if row >= 0:
                starts[row + 2] += 1
    for row in range(2, len(starts)):
        starts[row] += starts[row - 1]


@kernel
def _list(number, seats, starts, out):
    """List the faces of those corners, ascending, from out[starts[number]] on, which ends up where the next begin."""
    for f in range(len(seats)):
        for corner in range(3):
            row = number[seats[f, corner]]
            if row >= 0:
                out[starts[row + 1]] = f
                starts[row + 1] += 1


@kernel
def _turn(
    rows, starts, own, ends, touched, points, vertices, faces, face_normals, normals, angles, mine, kept, lift,
    clearance,
):  # fmt: skip
    """Turn the lifts of some points, see `_step_out`.

    Args:
        rows: (j,), which. own: their own faces, starts[k] to starts[k + 1] for the k-th; touched: those that they
            touch, ends[k] to ends[k + 1]; ascending.
        normals, kept: (most, 3), angles, mine: (most,), scratch for the faces of one point.
    """
    for k in range(len(rows)):
        row = rows[k]
        p, up = load(points, row), load(lift, row)
        i, j, count = starts[k], ends[k], 0
        while i < starts[k + 1] or j < ends[k + 1]:
            mine[count] = j == ends[k + 1] or (i < starts[k + 1] and own[i] < touched[j])
            f = own[i] if mine[count] else touched[j]
            i, j = (i + 1, j) if mine[count] else (i, j + 1)
            n = load(face_normals, f)
            if mine[count] and dot(n, up) < 0.0:  # seen from its other side
                n = scale(-1.0, n)
            normals[count, 0], normals[count, 1], normals[count, 2] = n
            angles[count] = _angle_about(p, vertices, faces[f])
            count += 1
        x, y, z = 0.0, 0.0, 0.0
        last = 0
        for i in range(count):
            if _obeyed(i, normals[:count], angles, mine):
                n = load(normals, i)
                x, y, z = x + angles[i] * n[0], y + angles[i] * n[1], z + angles[i] * n[2]
                kept[last, 0], kept[last, 1], kept[last, 2] = n
                last += 1
        length = np.sqrt(x * x + y * y + z * z)
        start = (x / length, y / length, z / length) if length > 1e-9 else up
        moved, room = outermost_normal(start, kept[:last], _ENOUGH)
        if room > 0.0:
            lift[row, 0], lift[row, 1], lift[row, 2] = moved
            clearance[row] = room


@inline
def _obeyed(i, normals, angles, own):
    """Whether a point is in front of its i-th face: see the module about faces that look opposite ways."""
    balance, opposed = 0.0, False
    n = load(normals, i)
    for j in range(len(normals)):
        cosine = dot(n, load(normals, j))
        if cosine > _SAME_PLANE:
            balance += angles[j]
        elif cosine < -_SAME_PLANE:
            balance -= angles[j]
            opposed = True
    return not opposed or balance > 1e-3 or (balance > -1e-3 and own[i])


@inline
def _angle(a, b):
    normal = cross(a, b)
    return np.arctan2(np.sqrt(dot(normal, normal)), dot(a, b))


@inline
def _angle_about(p, vertices, face):
    """Angle that a face fills about a point on it: a corner's own, π on an edge, 2π inside."""
    angle, tiny = 2.0 * np.pi, 16.0 * ULP
    for k in range(3):
        a = subtract(load(vertices, face[k]), p)
        b = subtract(load(vertices, face[(k + 1) % 3]), p)
        if np.sqrt(dot(a, a)) <= tiny:
            return _angle(b, subtract(load(vertices, face[(k + 2) % 3]), p))
        along, across = subtract(b, a), cross(a, b)
        if np.sqrt(dot(across, across)) <= tiny * np.sqrt(dot(along, along)):
            angle = np.pi
    return angle


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
