"""Normals in front of every face around a vertex, as ray origins need them and averages need not be."""

import numpy as np

from ..kernel.counting_sort import counting_sort
from ..kernel.jit import bind, inline, kernel
from ..kernel.vector import add, divide, dot, length, load, store
from ..system.threads import run_ranges, thread_count
from ..types import Float64s, Int64s

SHARP, ENOUGH = 0.1, 0.3  # clearances: of folds, and with which a search for a better direction ends
MANY = 1 << 10  # faces at a point; of more, some stand for all where each is compared with each
_LEAST = 1 << 12  # points of a thread that looks at all faces
_MOVES, _FEW = 1000, 100  # at most, where few and where many points are moved


def outermost_normals(
    normals: Float64s, face_points: Int64s, face_normals: Float64s
) -> tuple[Float64s, Float64s, Float64s]:
    """Normals in front of all the faces that meet at a point, directions (k, 3) to move a ray origin along, and the
    clearance (k,) of these: the smallest cosine to a face's normal.

    Only a normal behind a face is moved, see `_moved`. Directions are these, or, where these clear a face by `SHARP` or
    less, others that clear all by more.

    Args: normals: (k, 3), unit or zero. face_points: int64 (m, any), the rows of `normals` that each face counts for.
        face_normals: (m, 3), unit.
    """
    moved = normals.copy()
    directions = normals.copy()
    clearance = least_cosines(normals, face_points, face_normals)
    is_sharp = clearance <= SHARP
    sharp = np.flatnonzero(is_sharp)
    if len(sharp):
        corners = np.flatnonzero(is_sharp[face_points])
        order, starts = counting_sort(np.searchsorted(sharp, face_points.ravel()[corners]), len(sharp))
        faces = face_normals[corners[order] // face_points.shape[1]]
        _outermost(moved, directions, clearance, sharp, starts, faces)
    return moved, directions, clearance


def least_cosines(normals: Float64s, face_points: Int64s, face_normals: Float64s) -> Float64s:
    """The least cosine (k,) between each of the `normals` and those of its faces, 1 without any; as `outermost_normals`
    takes them."""
    cosines = np.ones(len(normals))
    work = bind(_least_cosines, normals, face_points, face_normals, cosines)
    run_ranges(len(normals), _LEAST, work, thread_count(None))
    return cosines


@kernel
def _least_cosines(normals, face_points, face_normals, clearance, start, stop):
    """Lower `clearance` to the least cosine between a point's normal and those of its faces."""
    for f in range(len(face_points)):
        for corner in range(face_points.shape[1]):
            row = face_points[f, corner]
            if start <= row < stop:
                clearance[row] = min(clearance[row], dot(load(normals, row), load(face_normals, f)))


@kernel
def _outermost(normals, directions, clearance, sharp, starts, faces):
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
