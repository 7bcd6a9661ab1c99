"""Vertices exactly or nearly on other geometry, against the w of their open side."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from meshes import grid

from obscurance.ao import Binary, bake
from obscurance.scenes.geometry.polyhedra import RawMesh, hull, join

from .line import ERROR, Line, undefined
from .pose import Pose
from .solids import inward

GAP = 1e-6


@dataclass(frozen=True, eq=False)
class Contact:
    """A mesh with the binary w expected at some of its vertices."""

    name: str
    part: RawMesh
    points: list[int]
    expected: list[float]


def contacts(long: bool) -> Iterator[Line]:
    """A line for each contact: the largest error over the poses."""
    poses = [Pose(), Pose(turn=1), Pose(1e-6, 1e3, 2), Pose(1e6, 1e6, 3)]
    poses += [Pose(turn=turn) for turn in range(4, 24)] if long else []
    for contact in _contacts():
        worst, missing = 0.0, 0
        for pose in poses:
            mesh = pose.mesh(contact.part)
            w = bake(mesh, Binary(), samples=4096, denoise=False, interior="ignore").w
            worst = float(np.maximum(worst, np.abs(w[contact.points] - contact.expected).max()))
            missing += undefined(w)
        yield Line(contact.name, f"{len(poses)} poses", "error of w", worst, ERROR, missing)


def _contacts() -> Iterator[Contact]:
    floor = grid(1, 8.0)
    fine = grid(8, 8.0)  # vertices at whole numbers
    box = hull([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (0, 2)])
    feet = [int(k) for k in np.flatnonzero(box[0][:, 2] == 0)]
    tilted = 0.5 * (1 - 3**-0.5)  # the normal leans 125° from the floor's
    yield Contact("box on a floor, its feet", join([box, floor]), feet, [tilted] * 4)

    corners = box[0][box[1]]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    loose: RawMesh = corners.reshape(-1, 3), np.arange(36).reshape(-1, 3)
    low = np.flatnonzero(loose[0][:, 2] == 0)
    bottom = np.repeat(normal[:, 2] < 0, 3)[low]
    expected = np.where(bottom, 0.0, 0.5).tolist()
    yield Contact("box with hard edges on a floor, its feet", join([loose, floor]), low.tolist(), expected)

    under = [8 + _at(fine, *place) for place in ((0, 0), (1, 0), (1, 1))]
    yield Contact("floor under the middle, an edge and a corner of a box", join([box, fine]), under, [0.0, 0.5, 0.75])

    wall: RawMesh = (
        np.array([[0, -1, 0], [0, 1, 0], [0, 1, 2], [0, -1, 2], [0, 0, 0.0]]),
        np.array([[0, 4, 3], [4, 2, 3], [4, 1, 2]]),
    )
    yield Contact("wall on a floor, its foot", join([wall, floor]), [4], [0.5])
    tall: RawMesh = wall[0] * [1, 1e3, 1e3], wall[1]
    yield Contact("floor, at the foot of a wall", join([tall, fine]), [5 + _at(fine, 0, 0)], [0.5])

    sheet = grid(2)
    yield Contact("sheet with two sides", join([sheet, inward(sheet)]), list(range(18)), [1.0] * 18)

    plate, middle = grid(4), 12
    lifted: RawMesh = plate[0] + [0, 0, GAP], plate[1]
    facing = join([plate, inward(lifted)])
    yield Contact("plates 10⁻⁶ apart, face to face", facing, [middle, 25 + middle], [0.0, 0.0])
    yield Contact("plates 10⁻⁶ apart, back to back", join([inward(plate), lifted]), [middle, 25 + middle], [1.0, 1.0])

    other: RawMesh = box[0] * 0.999 + [0.7, 0.6, 0.5], box[1]
    crossing = join([box, other])
    hidden = [8 + k for k in range(8) if (np.abs(other[0][k] - [0, 0, 1]) < 1).all()]
    yield Contact("boxes that cross, a corner inside the other", crossing, hidden, [0.0] * len(hidden))


def _at(part: RawMesh, x: float, y: float) -> int:
    return int(np.argmin(np.abs(part[0] - [x, y, 0]).sum(axis=1)))
