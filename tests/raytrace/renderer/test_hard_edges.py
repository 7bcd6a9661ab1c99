"""Pictures of meshes whose vertices are shared across hard edges: each side is shaded with its own normal."""

import numpy as np
import pytest
from hard_edges import CORNERS, FACES, INWARDS, OF, box

from obscurance.raytrace import Camera, DirectionalLight, Lambert, Mesh, Object, Scene, Settings, Shape, render
from obscurance.raytrace.mesh.normals import vertex_normals
from obscurance.raytrace.renderer.render import seen_vertices

MATERIAL = Lambert(albedo=0.8)
CAMERA = Camera(position=(0.9, 0.7, 4), target=(0.5, 0.5, 0))
LIGHT = DirectionalLight(direction=(-1, -2, -3), intensity=(3, 3, 3))


def picture(mesh, shading, w=None, **settings):
    scene = Scene((Object(Shape(mesh, MATERIAL), w=w),), (LIGHT,))
    size = Settings(48, 48, samples=4, shading=shading, shadows=False, **settings)
    return render(scene, CAMERA, size).layers["beauty"][..., 0]


@pytest.mark.parametrize("shading", ["gouraud", "phong", "quadratic"])
@pytest.mark.parametrize("form", ["shared", "apart", "corners", "zero", "behind"])
def test_sides_of_a_box_are_flat(form, shading):
    np.testing.assert_allclose(picture(box(form), shading), picture(box("apart"), "flat"), atol=1e-5)


@pytest.mark.parametrize("shading", ["gouraud", "phong"])
def test_a_files_smooth_normals_stay_smooth(shading):
    """At corners as at vertices, also across edges of 90°."""
    smooth = vertex_normals(CORNERS, FACES)
    at_vertices = picture(Mesh(CORNERS, FACES, smooth), shading)
    at_corners = picture(Mesh(CORNERS, FACES, corner_normals=(smooth, FACES)), shading)
    np.testing.assert_allclose(at_corners, at_vertices, atol=1e-6)
    assert np.abs(at_vertices - picture(box("corners"), shading)).max() > 0.05


def test_normals_that_were_asked_for_mark_hard_edges_though_the_file_has_its_own():
    mesh = Mesh(CORNERS, FACES, vertex_normals(CORNERS, FACES))
    np.testing.assert_allclose(picture(mesh, "phong", normals="angle"), picture(box("apart"), "flat"), atol=1e-5)


def test_both_sides_have_w_of_their_vertex():
    w = np.linspace(0.2, 1, len(CORNERS))
    shape = Shape(box("shared"), MATERIAL)
    (item,) = Scene((Object(shape, w=w),)).shaded.objects
    np.testing.assert_array_equal(item.w[item.shape.mesh.faces], w[FACES])
    np.testing.assert_allclose(item.shape.mesh.normals[item.shape.mesh.faces], INWARDS[OF], atol=1e-12)
    apart = Scene((Object(Shape(box("apart"), MATERIAL)),))
    assert apart.shaded is apart


def test_w_of_a_scene_stands_on_the_normals_that_are_shaded():
    turn = np.diag([1.0, 2.0, -1.0, 1.0])
    mesh = Mesh(CORNERS, FACES, CORNERS - 0.4)
    flat = Scene((Object(Shape(mesh, MATERIAL), turn), Object(Shape(box("shared"), MATERIAL)))).flattened()
    expected = (CORNERS - 0.4) / [1, 2, -1]
    found = flat.normals[: len(CORNERS)]
    np.testing.assert_allclose(found, expected, atol=1e-12)
    assert np.isnan(flat.normals[len(CORNERS) :]).all()
    assert Scene((Object(Shape(box("shared"), MATERIAL)),)).flattened().normals is None


PLACES = np.array([[0, 0, 0], [3, 0, 0], [6, 0, 0]])


def test_vertices_that_are_seen_are_those_of_the_scene_whose_edges_are_split():
    """A corner is seen if one of the sides that it is split for is."""
    camera, found = Camera(position=(3.4, 0.3, 9), target=(3.5, 0.5, 0)), {}
    for form in ("shared", "apart"):
        boxes = [Object(Shape(Mesh(box(form).vertices + place, box(form).faces), MATERIAL)) for place in PLACES]
        found[form] = seen_vertices(Scene(tuple(boxes)), camera, Settings(48, 48, samples=1))
    expected = np.zeros((3, len(CORNERS)), np.bool_)
    for k, at_corners in enumerate(found["apart"].reshape(3, -1)):
        expected[k, FACES.ravel()[at_corners]] = True
    assert 0 < expected[2].sum() < len(CORNERS)
    np.testing.assert_array_equal(found["shared"], expected.ravel())
