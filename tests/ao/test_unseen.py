"""Faces that nothing outside sees, where it is known which they are."""

import numpy as np
import trimesh

from obscurance import ao
from obscurance.raytrace import Mesh


def joined(*parts):
    return Mesh(*trimesh.util.append_faces([part.vertices for part in parts], [part.faces for part in parts]))


def test_a_box_in_a_closed_box_is_unseen():
    found = ao.unseen_faces(joined(trimesh.creation.box((2, 2, 2)), trimesh.creation.box((1, 1, 1))))
    assert (found.faces == np.repeat([False, True], 12)).all()
    assert found.rays == 16 + 128 + 1024 + 4096
    assert 0 < found.share < 0.001


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


def test_a_pinhole_shows_what_is_straight_behind_it():
    """A sphere of which one face is missing holds a plate: what lines through the hole meet is seen, its back is not
    what keeps it."""
    shell = trimesh.creation.icosphere(subdivisions=3)
    hole = int(np.argmax(shell.triangles_center[:, 2]))
    shell.update_faces(np.arange(len(shell.faces)) != hole)
    plate = trimesh.creation.box((0.2, 0.2, 0.01)).apply_translation([0, 0, -0.5])
    unseen = ao.unseen_faces(joined(shell, plate)).faces
    upper = plate.face_normals[:, 2] > 0.5
    assert not unseen[-12:][upper].any()
    assert unseen[-12:][plate.face_normals[:, 2] < -0.5].all()
    assert not unseen[:-12].any()  # from outside
