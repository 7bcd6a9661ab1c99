"""Faces that nothing outside sees, where it is known which they are."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import trimesh

from obscurance import ao
from obscurance.raytrace import Mesh


def joined(*parts):
    return Mesh(*trimesh.util.append_faces([part.vertices for part in parts], [part.faces for part in parts]))


def test_a_box_in_a_closed_box_is_unseen():
    found = ao.unseen_faces(joined(trimesh.creation.box((2, 2, 2)), trimesh.creation.box((1, 1, 1))))
    assert (found.faces == np.repeat([False, True], 12)).all()
    rays = found.rays[found.faces].sum()
    assert rays > 1 << 15, "for the room between the boxes"
    assert found.share(found.faces) == 3 / rays
    assert found.share(found.faces & (np.arange(24) < 13)) > 10 * found.share(found.faces)


def test_closed_rooms_end_early():
    """A ball of 5,120 faces in a box: few rays each are enough for all together."""
    ball = trimesh.creation.icosphere(subdivisions=4)
    found = ao.unseen_faces(joined(trimesh.creation.box((4, 4, 4)), ball))
    assert found.faces[12:].all()
    assert found.rays[12:].max() <= 128


def test_what_a_window_shows_is_kept():
    """The near half of a ball in a box without its top: faces below its horizon from the rim are unseen."""
    box = trimesh.creation.box((2, 2, 2))
    box.update_faces(box.face_normals[:, 2] < 0.5)
    ball = trimesh.creation.icosphere(subdivisions=2, radius=0.9)
    unseen = ao.unseen_faces(joined(box, ball)).faces
    height = ball.triangles_center[:, 2]
    assert not unseen[:10].any()
    assert not unseen[10:][height > 0.1].any()
    assert unseen[10:][height < -0.75].all()


@pytest.mark.parametrize("subdivisions", [3, 5])
def test_a_pinhole_shows_what_is_straight_behind_it(subdivisions):
    """A sphere of which one face is missing holds a plate: what lines through the hole meet is seen, its back is not
    what keeps it."""
    shell = trimesh.creation.icosphere(subdivisions=subdivisions)
    hole = int(np.argmax(shell.triangles_center[:, 2]))
    shell.update_faces(np.arange(len(shell.faces)) != hole)
    plate = trimesh.creation.box((0.2, 0.2, 0.01)).apply_translation([0, 0, 1 - 0.8 * 0.5 ** (subdivisions - 2)])
    unseen = ao.unseen_faces(joined(shell, plate)).faces
    upper = plate.face_normals[:, 2] > 0.5
    assert not unseen[-12:][upper].any()
    assert unseen[-12:][plate.face_normals[:, 2] < -0.5].all()
    assert not unseen[:-12].any()  # from outside


@pytest.mark.parametrize("up", ["x", "y", "z", "-z"])
def test_from_above_only_what_rising_lines_reach_is_seen(up):
    """A table: its underside, its legs' undersides and what lies inside of their contact see no sky; legs do, sideways.
    A roof's eaves that face downwards at a slant see what is above the horizon."""
    top = trimesh.creation.box((4, 4, 0.2)).apply_translation([0, 0, 2])
    leg = trimesh.creation.box((0.3, 0.3, 1.9)).apply_translation([0, 0, 0.95])
    slant = trimesh.creation.box((1, 1, 1)).apply_transform(trimesh.transformations.rotation_matrix(0.3, [1, 0, 0]))
    slant.apply_translation([9, 0, 0])
    mesh = trimesh.util.concatenate([top, leg, slant])
    height = mesh.face_normals[:, 2]
    axis = "xyz".index(up[-1])
    turned = np.roll(mesh.vertices, axis + 1, axis=1) * (-1 if up[0] == "-" else 1)
    faces = mesh.faces[:, ::-1] if up[0] == "-" else mesh.faces
    found = ao.unseen_faces(replace(Mesh(turned, faces), up=up), above=True)
    contact = (height > 0.9) & (np.arange(len(height)) < 24) & (np.arange(len(height)) >= 12)  # of the leg with the top
    np.testing.assert_array_equal(found.faces, (height < -0.999) | contact)
    sides = ao.unseen_faces(replace(Mesh(turned, faces), up=up))
    assert not sides.faces[~contact].any()


def test_cavities_are_kept_by_bounces():
    """A corridor with two bends, open at its end: what its far end is seen from is seen one bounce later."""
    plan = np.array([[0, 0], [4, 0], [4, 4], [8, 4], [8, 8]], float)
    left, right = [], []
    for side, offset in ((left, [0, 1]), (right, [0, 0])):
        side += [plan[0] + offset, plan[1] + [-offset[1], offset[1]], plan[2] + [-offset[1], offset[1]]]
        side += [plan[3] + [-offset[1], offset[1]], plan[4] + [-offset[1], 0]]
    walls = [trimesh.Trimesh([[*a, 0], [*b, 0], [*b, 1], [*a, 1]], [[0, 1, 2], [0, 2, 3]], process=False)
             for line in (left, right) for a, b in pairwise(line)]  # fmt: skip
    walls = [wall.subdivide().subdivide() for wall in walls]
    outline = [[-0.01, -0.01], [9, -0.01], [9, 9], [-0.01, 9]]
    lids = [trimesh.Trimesh([[*p, z] for p in outline], [[0, 1, 2], [0, 2, 3]], process=False) for z in (0, 1)]
    shell = trimesh.Trimesh(
        [[*p, z] for p in outline for z in (0, 1)],
        [[0, 1, 3], [0, 3, 2], [2, 3, 5], [2, 5, 4], [6, 7, 1], [6, 1, 0]], process=False,
    )  # fmt: skip
    mesh = joined(*walls, *lids, shell)
    kept = [int(np.count_nonzero(~ao.unseen_faces(mesh, depth=depth).faces)) for depth in (0, 1, 2, 3)]
    assert kept[0] < kept[1] <= kept[2] <= kept[3], kept
    closed = joined(trimesh.creation.box((2, 2, 2)), trimesh.creation.box((1, 1, 1)))
    assert ao.unseen_faces(closed, depth=9).faces.sum() == 12, "no bounce leads into a closed room"
