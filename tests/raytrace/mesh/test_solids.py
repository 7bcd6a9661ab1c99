"""Closed parts that look inwards are found by their signed volumes, but for cavities."""

import numpy as np
import pytest
from meshes import hills

from obscurance import ao, scenes
from obscurance.raytrace import Mesh
from obscurance.raytrace.mesh.solids import inward_looking, inward_warnings
from obscurance.scenes.geometry.polyhedra import join


def ball(radius=1.0, at=(0.0, 0.0, 0.0), inverted=False, split=False):
    mesh = scenes.Sphere(radius=radius, fineness=0.3).geometry().mesh
    vertices, faces = mesh.vertices + at, mesh.faces[:, ::-1] if inverted else mesh.faces
    return (vertices[faces].reshape(-1, 3), np.arange(faces.size).reshape(-1, 3)) if split else (vertices, faces)


CASES = {
    "a ball": ([ball()], 0),
    "an inverted ball": ([ball(inverted=True)], 1),
    "an inverted ball of separate triangles": ([ball(inverted=True, split=True)], 1),
    "a hollow ball": ([ball(), ball(0.5, inverted=True)], 0),
    "a hollow ball turned over": ([ball(inverted=True), ball(0.5)], 1),
    "a ball in a hollow ball": ([ball(), ball(0.7, inverted=True), ball(0.3)], 0),
    "an inverted ball beside another": ([ball(), ball(0.5, (3, 0, 0), inverted=True)], 1),
    "an inverted ball beside a ball, in its box": (
        [ball(), ball(0.1, (0.9, 0.9, 0.9), inverted=True)],
        1,
    ),
    "an open surface turned over": ([(hills(5)[0], hills(5)[1][:, ::-1])], 0),
}


@pytest.mark.parametrize("name", CASES)
def test_parts_that_look_inwards_are_counted(name):
    parts, expected = CASES[name]
    vertices, faces = join(parts)
    assert inward_looking(np.asarray(vertices, np.float32), np.asarray(faces, np.int32))[0] == expected
    assert len(inward_warnings(Mesh(vertices, faces))) == bool(expected)


def test_bakes_say_so_and_thickness_does_not():
    mesh = Mesh(*ball(inverted=True))
    (line,) = ao.bake(mesh, samples=4).shortfalls
    assert line.endswith("its faces look inwards, so the inside is baked: --flip turns all faces over")
    assert ao.bake(mesh.reversed(), samples=4).shortfalls == ()
    assert ao.bake(mesh.reversed(), samples=4, thickness=True).shortfalls == ()


@pytest.mark.parametrize(("radius", "remedy"), [(1.1, "--flip turns all faces over"), (0.9, "turn only these over")])
def test_flip_is_advised_where_it_turns_more_of_the_surface_right_than_wrong(radius, remedy):
    mesh = Mesh(*join([ball(), ball(radius, (3, 0, 0), inverted=True)]))
    (line,) = inward_warnings(mesh)
    assert f"1 of 2 closed parts look inwards, so the inside is baked: {remedy}" in line


def test_faces_that_enclose_a_volume_by_rounding_and_have_no_area():
    far = -(2.0**127)
    vertices = [(0, 0, 0), (1, 0, 0), (1, 0, 0), (1, 1, far), (3.6e-43, 0.5, 0.25), (2, 0, 0), (9, 9, 9)]
    assert inward_warnings(Mesh(vertices, [(0, 1, 3), (0, 3, 4), (2, 5, 3)])) == []


@pytest.mark.parametrize("seed", range(4))
def test_of_many_parts_those_within_others_are_cavities(seed):
    """Shells about common centres, some of them turned over: cavities are those about which an outward one lies."""
    random = np.random.default_rng(seed)
    boxes, expected = [], 0
    for place in range(60):
        outward = random.random(random.integers(1, 4)) < 0.5
        for layer, looks_out in enumerate(outward):  # the largest first
            box = scenes.Box(size=(0.8 - 0.2 * layer,) * 3, fineness=1).geometry().mesh
            faces = box.faces if looks_out else box.faces[:, ::-1]
            boxes.append((box.vertices + np.array([place % 8, place // 8, 0]), faces))
            expected += not looks_out and not outward[:layer].any()
    starts = np.cumsum([0, *(len(vertices) for vertices, _ in boxes)])
    vertices = np.concatenate([vertices for vertices, _ in boxes]).astype(np.float32)
    faces = np.concatenate([faces + start for (_, faces), start in zip(boxes, starts[:-1], strict=True)])
    assert inward_looking(vertices, faces.astype(np.int32))[:2] == (expected, len(boxes))
