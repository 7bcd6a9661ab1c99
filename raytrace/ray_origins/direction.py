"""Directions of ray origins from points that touch other faces: in front of these, too.

A point may lie on faces that it is no corner of: beside a hard edge whose sides are stored apart, on the edge of a
larger face (a T-junction), or on other geometry. It is taken to be in front of all of them. Faces that coincide and
look opposite ways cannot both be obeyed: the one that surrounds the point with the larger angle wins, as a floor does
over the foot of a box that stands on it, and the point's own in a tie, as in a sheet with two sides.
"""

from typing import NamedTuple

import numpy as np

from ..kernel.counting_sort import counting_sort
from ..kernel.jit import inline
from ..kernel.vector import add, angle_between, cross, divide, dot, length, load, scale, store, subtract
from ..mesh.placement import NEAR, ULP
from ..system.parallel import parallel
from ..types import Bools, Float64Rows, Float64s, Int32s, Int64s
from .clearance import MANY, outermost_normal
from .surface import Contacts, Surface

_SAME_PLANE = 0.9999
_RISE = 1e-3


class PointFaces(NamedTuple):
    """Faces at each of k points: faces[starts[i] : ends[i]] of point i."""

    faces: Int32s | Int64s  # of all points one after another, ascending at each
    starts: Int64s  # (k,), where those of a point begin, and where they end
    ends: Int64s


def resolve_contacts(
    results: tuple[Float64s, Float64s, Bools],
    surface: Surface,
    points: Float64s,
    touched: Contacts,
    face_points: Int64s,
    numbers: Int64s,
) -> None:
    """Turn the directions of touched `points` in front of what they touch, where possible.

    Args: touched: at least one, sorted by point. face_points, numbers: as `find_contacts` takes them.
        results: directions (k, 3), their clearance (k,), and whether (k,) a touched face decides what is seen: it rises
            above the plane across the direction, or lies in it and looks the other way. Changed in place.
    """
    first_contact = np.flatnonzero(np.diff(touched.point, prepend=-1))
    point_rows = touched.point[first_contact]
    needed = np.zeros(max(int(face_points.max()), int(numbers.max())) + 1, np.bool_)
    needed[numbers[point_rows]] = True
    packed_rows = np.where(needed, np.cumsum(needed) - 1, -1)
    corners, starts = counting_sort(packed_rows[face_points], int(np.count_nonzero(needed)))
    at = packed_rows[numbers[point_rows]]
    own_faces = PointFaces(corners // 3, starts[at], starts[at + 1])
    touched_faces = PointFaces(touched.face, first_contact, np.append(first_contact, len(touched.point))[1:])
    _turn(surface, points, results, point_rows, own_faces, touched_faces)


@parallel("point_rows", 1 << 7)
def _turn(
    start: int,
    stop: int,
    surface: Surface,
    points: Float64Rows,
    results: tuple[Float64Rows, Float64s, Bools],
    point_rows: Int32s,
    own_faces: PointFaces,
    touched_faces: PointFaces,
) -> None:
    """`resolve_contacts` of the points `point_rows[start:stop]`, from the faces that they are a corner of, or touch."""
    directions, clearance, ambiguous = results
    largest = 0
    for k in range(start, stop):
        own_count = own_faces.ends[k] - own_faces.starts[k]
        largest = max(largest, own_count + touched_faces.ends[k] - touched_faces.starts[k])
    listed = np.empty((largest, 3)), np.empty(largest), np.empty(largest, np.bool_)  # see `_list_faces`
    front = np.empty((largest, 3))  # normals of the faces that a point is in front of
    for k in range(start, stop):
        row = point_rows[k]
        direction = load(directions, row)
        own_here = own_faces.faces[own_faces.starts[k] : own_faces.ends[k]]
        touched_here = touched_faces.faces[touched_faces.starts[k] : touched_faces.ends[k]]
        count, decides = _list_faces(load(points, row), direction, surface, own_here, touched_here, listed)
        ambiguous[row] |= decides
        mean, fronts = _mean_in_front(count, listed, direction, front)
        turned, least = outermost_normal(mean, front[:fronts])
        if least > 0.0:
            store(directions, row, turned)
            clearance[row] = least


@inline
def _list_faces(p, direction, surface, own_faces, touched_faces, listed):
    """List the faces that a point is a corner of, and those that it touches, both ascending, as one.

    Returns their number, and whether a touched one decides what is seen. Args: listed: normals (k, 3), those of its
    own faces on the side of `direction`; the angles (k,) about the point; whether (k,) a face is its own. Filled.
    """
    normals, angles, is_own = listed
    decides = False
    i = 0
    j = 0
    count = len(own_faces) + len(touched_faces)
    for row in range(count):
        is_own[row] = j == len(touched_faces) or (i < len(own_faces) and own_faces[i] < touched_faces[j])
        if is_own[row]:
            f = own_faces[i]
            i += 1
            n = load(surface.normals, f)
            if dot(n, direction) < 0.0:  # seen from its other side
                n = scale(-1.0, n)
        else:
            f = touched_faces[j]
            j += 1
            n = load(surface.normals, f)
            decides |= dot(n, direction) < -_SAME_PLANE or _rises(p, direction, surface, f)
        store(normals, row, n)
        angles[row] = _angle_about(p, surface.vertices, surface.faces, f)
    return count, decides


@inline
def _mean_in_front(count, listed, direction, front):
    """The mean normal, by angles, of the listed faces that a point is in front of, `direction` if they cancel; and
    how many there are, whose normals fill `front`.

    Args: listed: by `_list_faces`, the first `count`.
    """
    normals, angles, is_own = listed
    total = (0.0, 0.0, 0.0)
    fronts = 0
    for i in range(count):
        if _is_in_front(i, normals[:count], angles, is_own):
            n = load(normals, i)
            total = add(total, scale(angles[i], n))
            store(front, fronts, n)
            fronts += 1
    size = length(total)
    return (divide(total, size) if size > 1e-9 else direction), fronts


@inline
def _rises(p, direction, surface, f):
    """Whether a face that a point touches rises above the plane through the point across a direction."""
    height = 0.0
    size = 0.0
    for k in range(3):
        away = subtract(load(surface.vertices, surface.faces[f, k]), p)
        height = max(height, dot(away, direction))
        size = max(size, length(away))
    return height > _RISE * size


@inline
def _is_in_front(i, normals, angles, is_own):
    """Whether a point is taken to be in front of the i-th of its faces.

    Faces that look the same way are weighed by their angles against faces that look the opposite way, see the module.
    """
    balance = 0.0
    opposed = False
    n = load(normals, i)
    step = 1 + len(normals) // MANY
    for j in range(i % step, len(normals), step):
        cosine = dot(n, load(normals, j))
        if cosine > _SAME_PLANE:
            balance += angles[j]
        elif cosine < -_SAME_PLANE:
            balance -= angles[j]
            opposed = True
    return not opposed or balance > 1e-3 or (balance > -1e-3 and is_own[i])


@inline
def _angle_about(p, vertices, faces, f):
    """Angle that a face fills about a point on it: a corner's own, π on an edge, 2π inside."""
    angle = 2.0 * np.pi
    tiny = 16.0 * ULP * max(1.0, max(abs(p[0]), abs(p[1]), abs(p[2])) / NEAR)
    for k in range(3):
        a = subtract(load(vertices, faces[f, k]), p)
        b = subtract(load(vertices, faces[f, (k + 1) % 3]), p)
        if length(a) <= tiny:
            return angle_between(b, subtract(load(vertices, faces[f, (k + 2) % 3]), p))
        if length(cross(a, b)) <= tiny * length(subtract(b, a)):
            angle = np.pi
    return angle
