"""Directions of ray origins: in front of every face around a vertex, and of the other faces that a point touches.

Averages of normals need not be in front of all faces around a vertex, as ray origins need them.

A point may lie on faces that it is no corner of: beside a hard edge whose sides are stored apart, on the edge of a
larger face (a T-junction), or on other geometry. It is taken to be in front of all of them. Faces that coincide and
look opposite ways cannot both be obeyed: the one that surrounds the point with the larger angle wins, as a floor does
over the foot of a box that stands on it, and the point's own in a tie, as in a sheet with two sides.
"""

from typing import NamedTuple

import numpy as np

from ..kernel.arrays import counting_sort
from ..kernel.jit import inline, kernel
from ..kernel.vector import add, angle_between, cross, divide, dot, length, load, scale, store, subtract
from ..mesh.placement import NEAR, ULP
from ..system.parallel import parallel
from ..types import Bools, Float64Rows, Float64s, Int32Rows, Int32s, Int64s
from .surface import Contacts, Surface, front

_SAME_PLANE = 0.9999
_RISE = 1e-3
SHARP, ENOUGH = 0.1, 0.3  # clearances: of folds, and with which a search for a better direction ends
MANY = 1 << 10  # faces at a point; of more, some stand for all where each is compared with each
_LEAST = 1 << 12  # points of a thread that looks at all faces
_MOVES, _FEW = 1000, 100  # at most, where few and where many points are moved


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
    face_points: Int32s,
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
            n = front(surface, f)
            if dot(n, direction) < 0.0:  # seen from its other side
                n = scale(-1.0, n)
        else:
            f = touched_faces[j]
            j += 1
            n = front(surface, f)
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


def outermost_normals(
    normals: Float64s, face_points: Int32s, faces: Float64s | Surface
) -> tuple[Float64s, Float64s, Float64s]:
    """Normals in front of all the faces that meet at a point, directions (k, 3) to move a ray origin along, and the
    clearance (k,) of these: the smallest cosine to a face's normal.

    Only a normal behind a face is moved, see `_moved`. Directions are these, or, where these clear a face by `SHARP` or
    less, others that clear all by more. Where nothing is to be moved, both are the array `normals` itself.

    Args: normals: (k, 3), unit or zero. face_points: int32 (m, any), the rows of `normals` that each face counts for.
        faces: their unit normals (m, 3), or a surface of them.
    """
    moved = directions = normals
    clearance = least_cosines(normals, face_points, faces)
    is_sharp = clearance <= SHARP
    sharp = np.flatnonzero(is_sharp)
    if len(sharp):
        moved = normals.copy()
        directions = normals.copy()
        corners = np.flatnonzero(is_sharp[face_points])
        order, starts = counting_sort(np.searchsorted(sharp, face_points.ravel()[corners]), len(sharp))
        rows = corners[order] // face_points.shape[1]
        around = faces.normals(rows) if isinstance(faces, Surface) else faces[rows]
        _outermost(moved, directions, clearance, sharp, starts, around)
    return moved, directions, clearance


def least_cosines(normals: Float64s, face_points: Int32s, faces: Float64s | Surface) -> Float64s:
    """The least cosine (k,) between each of the `normals` and those of its faces, 1 without any; as `outermost_normals`
    takes them."""
    cosines = np.ones(len(normals))
    if isinstance(faces, Surface):
        _lower_to_faces(normals, face_points, faces, cosines)
    else:
        _lower_to_normals(normals, face_points, faces, cosines)
    return cosines


@parallel("normals", _LEAST, alone=True)
def _lower_to_faces(
    start: int, stop: int, normals: Float64Rows, face_points: Int32Rows, surface: Surface, clearance: Float64s
) -> None:
    """Lower `clearance` to the least cosine between a point's normal and those of its faces."""
    for f in range(len(face_points)):
        a = face_points[f, 0]
        b = face_points[f, 1]
        c = face_points[f, 2]
        if start <= a < stop or start <= b < stop or start <= c < stop:
            normal = front(surface, f)
            for row in (a, b, c):
                if start <= row < stop:
                    clearance[row] = min(clearance[row], dot(load(normals, row), normal))


@parallel("normals", _LEAST, alone=True)
def _lower_to_normals(
    start: int, stop: int, normals: Float64Rows, face_points: Int32Rows, face_normals: Float64Rows, clearance: Float64s
) -> None:
    """Lower clearances by the normals (m, 3) of faces, polygons of any number of corners."""
    for f in range(len(face_points)):
        for corner in range(face_points.shape[1]):
            row = face_points[f, corner]
            if start <= row < stop:
                clearance[row] = min(clearance[row], dot(load(normals, row), load(face_normals, f)))


@kernel
def _outermost(
    normals: Float64Rows,
    directions: Float64Rows,
    clearance: Float64s,
    sharp: Int64s,
    starts: Int64s,
    faces: Float64Rows,
) -> None:
    """Move normals of `sharp` points in front of their faces, and directions further, and write the clearance of
    these.

    Args: starts, faces: the unit normals of the faces at point k are faces[starts[k] : starts[k + 1]].
    """
    for k in range(len(sharp)):
        row = sharp[k]
        around = faces[starts[k] : starts[k + 1]]
        direction = load(normals, row)
        if clearance[row] <= 0.0:
            direction, clearance[row] = _moved(direction, around, 0.0, _MOVES)
            store(normals, row, direction)
        if clearance[row] > 0.0:
            direction, clearance[row] = _moved(direction, around, ENOUGH, _FEW)
        store(directions, row, direction)


@inline
def outermost_normal(normal, faces):
    """A normal that clears faces by `ENOUGH` if one does, and its clearance. Args: faces: (any, 3), unit normals."""
    least = 1.0
    for f in range(len(faces)):
        least = min(least, dot(normal, load(faces, f)))
    return (normal, least) if least > ENOUGH else _moved(normal, faces, ENOUGH, _MOVES)


@inline
def _moved(before, faces, enough, moves):
    """A normal moved towards the face it clears least until it clears all `faces` by `enough`, and its clearance.

    The perceptron (Rosenblatt 1958) ends within 1/γ² moves if some normal has the clearance γ and none is asked for.
    After all `moves` the best normal found is kept, but not for the two sides of a sheet, in which it would lie: there
    the normal stays what it was, or is the first face's where it was zero.
    """
    normal, best, moved = before, -2.0, before
    for _ in range(moves):
        size = length(normal)
        if size < 1e-12:
            normal, size = load(faces, 0), 1.0
        least, worst = 2.0, 0
        for f in range(len(faces)):
            cosine = dot(normal, load(faces, f)) / size
            if cosine < least:
                least, worst = cosine, f
        if least > best:
            best, moved = least, divide(normal, size)
        if least > enough:
            break
        normal = add(normal, load(faces, worst))
    if best <= 0.0 and _two_sides(faces):
        return (load(faces, 0) if dot(before, before) == 0.0 else before), -1.0
    return moved, best


@inline
def _two_sides(normals):
    """Whether two of the normals look opposite ways, as those of the two sides of a sheet."""
    step = 1 + len(normals) // MANY
    for i in range(len(normals)):
        for j in range(i % step, i, step):
            if dot(load(normals, i), load(normals, j)) < -0.9999:
                return True
    return False
