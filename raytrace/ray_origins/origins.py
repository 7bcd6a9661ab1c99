"""Ray origins in front of everything that meets at a point, and short of what is almost in contact."""

import numpy as np

from ..bvh.bvh16 import BVH16
from ..types import Bools, Float64s, Int64s
from .clearance import SHARP
from .contacts import Contacts, find_contacts
from .direction import turn_directions
from .offset import offsets_and_reaches, ray_offset, stay_near, stop_short
from .surface import Surface


def ray_origins(
    tree: BVH16,
    surface: Surface,
    points: Float64s,
    directions: Float64s,
    clearance: Float64s,
    face_points: Int64s,
    numbers: Int64s,
    magnitude: Float64s,
) -> tuple[Float64s, Bools]:
    """Ray origins (k, 3) of `points` (k, 3) in render space, and which (k,) are decided by faces beside them.

    Args:
        tree: over the faces of `surface`.
        directions: (k, 3), unit, or zero for points without origins; in front of the point's own faces with the least
            cosine `clearance` (k,).
        face_points: int64 (m, 3), the number of the point that each face corner is.
        numbers: int64 (k,), the number of each point; points may share one.
        magnitude: (k,), what `surface.magnitudes(face_points, …)` has for that number.
    """
    offset, touching, reach = offsets_and_reaches(points, directions, magnitude, clearance)
    decided = np.zeros(len(points), np.bool_)
    near = find_contacts(tree, surface, points, reach, face_points, numbers)
    touches = near.distance <= np.maximum(touching[near.point], surface.rounding[near.face])
    touched, blurred = near.only(touches), near.point[~touches & (near.distance <= (reach * clearance)[near.point])]
    if len(touched.point):
        directions, clearance, magnitude = directions.copy(), clearance.copy(), magnitude.copy()
        found = directions, clearance, decided
        turn_directions(found, surface, points, touched, face_points, numbers)
        np.maximum.at(magnitude, touched.point, np.maximum(surface.extent[touched.face], surface.flat[touched.face]))
        offset = ray_offset(directions, magnitude, clearance)
        farther = np.where((reach >= 0.0) & (2.0 * offset > reach), 2.0 * offset, -1.0)
        more = find_contacts(tree, surface, points, farther, face_points, numbers)
        near = Contacts(*(np.append(a, b) for a, b in zip(near, more, strict=True)))
    decided[blurred] = True
    sharp = np.flatnonzero((reach >= 0.0) & (clearance < SHARP))
    if len(sharp):
        offset[sharp] = stay_near(offset[sharp], surface.shortest_edges(face_points, numbers[sharp]))
    stop_short(offset, points, directions, touching, near, surface)
    return points + offset[:, None] * directions, decided
