"""Gouraud shading: shadow rays of vertices begin in front of everything that meets there, and of nothing more."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from stress.solids import cube, inward

from obscurance.raytrace import Lambert
from obscurance.raytrace.camera import Camera
from obscurance.raytrace.lights.sources import PointLight
from obscurance.raytrace.mesh.mesh import Mesh
from obscurance.raytrace.renderer.render import render
from obscurance.raytrace.scene import Object, Scene, Shape
from obscurance.raytrace.settings import Settings
from obscurance.scenes.geometry import primitives
from obscurance.scenes.geometry.polyhedra import generic_rotation

SETTINGS = Settings(width=48, height=48, samples=4, shading="gouraud")
WHITE = Lambert(albedo=0.8)
TWO_SIDED = Lambert(albedo=0.8, two_sided="viewer")
POSES = [(size, away, turn) for size in (1e-4, 1.0, 1e5) for away in (0.0, 1e6) for turn in (0, 1)]
ROOM = Mesh(*inward(cube(6)))  # within ±1/2
LAMPS = np.array([[3, 2, 2.5], [-3, 2.5, -2], [0.3, -4, 0.2], [0, 0, 3.0]])


def similarity(size, away, turn):
    matrix = np.eye(4)
    if turn:
        matrix[:3, :3] = generic_rotation(turn).apply(np.eye(3)).T
    matrix[:3, :3] *= size
    matrix[:3, 3] = away * np.array([1.0, -0.7, 0.4])
    return matrix


def apply(matrix, points):
    return np.asarray(points) @ matrix[:3, :3].T + matrix[:3, 3]


def seen(objects, matrix, eye, target=(0.45, 0.4, -0.4), lamps=LAMPS):
    """The picture (h, w, 3), lamps, eye and target given in the frame before `matrix`."""
    size = np.cbrt(abs(np.linalg.det(matrix[:3, :3])))
    lights = [PointLight(position=tuple(p), intensity=30 * size**2) for p in apply(matrix, lamps)]
    eye, target = (tuple(p) for p in apply(matrix, [eye, target]))
    camera = Camera(eye, target, up=(0.3, 0.2, 1), field_of_view=100)
    return render(Scene(tuple(objects), tuple(lights)), camera, SETTINGS).layers["beauty"][..., :3]


def moved(mesh, matrix):
    faces = mesh.faces[:, ::-1] if np.linalg.det(matrix[:3, :3]) < 0 else mesh.faces
    return Mesh(apply(matrix, mesh.vertices), faces)


@pytest.mark.parametrize(("size", "away", "turn"), POSES)
def test_a_closed_room_is_black(size, away, turn):
    """Also one that is placed, and one of two instances."""
    matrix, shape, second = similarity(size, away, turn), Shape(ROOM, WHITE), np.eye(4)
    second[2, 3] = -8
    placed = Object(shape, matrix)
    for objects in ([Object(Shape(moved(ROOM, matrix), WHITE))], [placed], [placed, Object(shape, matrix @ second)]):
        assert not seen(objects, matrix, (-0.4, -0.3, 0.35)).any()


@pytest.mark.parametrize("lamp", [(0.2, -0.1, 0.1), (-0.45, -0.45, 0.45)])
@pytest.mark.parametrize("material", [WHITE, TWO_SIDED])
def test_a_lamp_in_the_room_lights_all_of_it(lamp, material):
    """As though nothing cast shadows: nothing is hidden from anything in a convex room."""
    for turn in range(3):
        matrix = similarity(1, 0, turn)
        mesh = Mesh(*(cube(6) if material.two_sided else inward(cube(6))))
        assert (seen([Object(Shape(mesh, material), matrix)], matrix, (-0.4, -0.3, 0.35), lamps=[lamp]) > 0).all()


@pytest.mark.parametrize("away", [0.0, 1e6])
@pytest.mark.parametrize("inside", [False, True])
@pytest.mark.parametrize("mirrored", [False, True])
def test_no_vertex_of_a_lit_sphere_is_dark(away, inside, mirrored):
    """Nor any face within or without, save those around the horizon of the light."""
    ball = trimesh.creation.icosphere(subdivisions=4)
    mesh = Mesh(ball.vertices, ball.faces[:, ::-1] if inside else ball.faces)
    matrix = similarity(1, away, 2) @ np.diag([1, 1, -1 if mirrored else 1, 1])
    eye, target = ((0, 0, 0), (1, 1, 1)) if inside else ((2, -1, 1), (0, 0, 0))
    (lamp, at, to) = apply(matrix, [(0.1, 0.2, 0.3) if inside else (30, 0, 0), eye, target])
    lights = (PointLight(position=tuple(lamp), intensity=1, attenuation=(1, 0, 0)),)
    camera = Camera(tuple(at), tuple(to), up=(0.3, 0.2, 1))
    scene = Scene((Object(Shape(mesh, WHITE), matrix),), lights)
    shaded, bare = (render(scene, camera, replace(SETTINGS, shadows=s)).layers["diffuse"] for s in (True, False))
    lit = bare > 0.2 * bare.max()
    assert lit.mean() > 0.2
    np.testing.assert_array_equal(shaded[lit], bare[lit])


@pytest.mark.parametrize("turn", range(4))
@pytest.mark.parametrize("instanced", [False, True])
def test_the_foot_of_a_box_is_in_front_of_the_floor_it_stands_on(turn, instanced):
    """From above it is lit in full, from below not at all."""
    matrix = similarity(1, 0, turn)
    floor = primitives.plane((-4, -4, 0), (8, 0, 0), (0, 8, 0), 0.5).mesh
    shape = Shape(primitives.box((0, 0, 0.5), (1, 1, 1), 0.25).mesh, WHITE)
    objects = [Object(Shape(floor, WHITE), matrix), Object(shape, matrix)]
    objects += [Object(shape, matrix @ similarity(1, 30, 0))] * instanced
    eye, target, up, *lamps = apply(matrix, [(0, -3, 1), (0, 0, 0.5), (0, 0, 1), (0, -2, 2), (0, -2, -2)])
    camera = Camera(tuple(eye), tuple(target), tuple(up))

    def picture(lamp, shadows=True):
        scene = Scene(tuple(objects), (PointLight(position=tuple(lamp), intensity=30),))
        return render(scene, camera, replace(SETTINGS, samples=1, shadows=shadows)).layers

    above, below = (picture(lamp) for lamp in lamps)
    box = above["object_id"][..., 0] == 2
    assert box.mean() > 0.05
    np.testing.assert_array_equal(above["beauty"][box], picture(lamps[0], shadows=False)["beauty"][box])
    assert not below["beauty"][..., :3].any()


@pytest.mark.parametrize("wound", [1, -1])
def test_normals_of_the_source_decide_which_side_a_vertex_is_on(wound):
    """A ball in front of a wall: no shadow falls on its near side, however its faces are wound."""
    ball = trimesh.creation.icosphere(subdivisions=3)
    mesh = Mesh(ball.vertices, ball.faces[:, ::wound], ball.vertices)
    lights = (PointLight(position=(0.5, -5, 1), intensity=30),)
    scene = Scene((Object(Shape(mesh, WHITE)),), lights)
    camera = Camera((0, -4, 0), (0, 0, 0), field_of_view=10)
    shaded, bare = (render(scene, camera, replace(SETTINGS, shadows=s)).layers["beauty"] for s in (True, False))
    assert (bare[..., :3] > 0).all()
    np.testing.assert_array_equal(shaded, bare)


@pytest.mark.parametrize(("fineness", "flat"), [(6, 1.0), pytest.param(40, 0.125, marks=pytest.mark.slow)])
def test_instanced_rooms_whose_walls_meet_in_the_middle_of_the_world_are_black(fineness, flat):
    """Coordinates are small there, but a ray's way into an instance's frame is rounded as where they are not."""
    shape = Shape(Mesh(*inward(cube(fineness))), WHITE)
    lamps = [(0.6, 0.1, 3), (0.1, 3, 3), (0.3, 5, 1), (1, -4, 0), (0.3, -2, -3), (0.9, -1, 3)]
    beside = np.eye(4)
    beside[0, 3] = 1
    for turn in range(1, 12):
        matrix, low = similarity(1, 0, turn), np.diag([1, 1, flat, 1])
        objects = [Object(shape, matrix @ low), Object(shape, matrix @ beside @ low)]
        for eye in ((0, 0, 0), (1, 0, 0)):
            assert not seen(objects, matrix, eye, (0.5, 0, 0), lamps).any()


def test_very_many_small_objects_are_lit_by_few_kernels(watch):
    calls = watch("obscurance.raytrace.renderer.render_job.light_vertices")
    shape = Shape(Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]), WHITE)
    places = np.tile(np.eye(4), (1200, 1, 1))
    places[:, 0, 3] = np.arange(1200)
    scene = Scene(tuple(Object(shape, place) for place in places), (PointLight(position=(0, 0, 5), intensity=9.0),))
    render(scene, Camera((0, -1, 9), (0, 0, 0)), SETTINGS, threads=1)
    assert 0 < len(calls) < 50
