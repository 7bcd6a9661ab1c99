"""Polygons in shading: one light for each under constant shading, and interpolation that no diagonal shows in."""

from dataclasses import replace

import numpy as np
import pytest
from meshes import newell_normal
from rendered import white

from obscurance.raytrace import Lambert, Mesh, Phong
from obscurance.raytrace.brdf.reflect import reflect
from obscurance.raytrace.camera import Camera
from obscurance.raytrace.errors import MeshError
from obscurance.raytrace.lights.sources import AmbientLight, PointLight
from obscurance.raytrace.renderer.geometry import build_geometry
from obscurance.raytrace.renderer.render import render, seen_vertices
from obscurance.raytrace.scene import Object, Scene, Shape
from obscurance.raytrace.settings import Settings
from obscurance.scenes.description.read import read_scene
from obscurance.scenes.formats.load import load
from obscurance.scenes.geometry.polygons import triangulate

SIZE = 96
ABOVE = Camera((0, 0, 9), (0, 0, 0), (0, 1, 0), height=4)
SETTINGS = Settings(width=SIZE, height=SIZE, samples=1)
AT = (2 * np.arange(SIZE) + 1 - SIZE) * 2 / SIZE
PIXELS = np.stack(np.meshgrid(AT, -AT), axis=-1)
SQUARE = np.array([[-1.5, -1.2, 0], [1.6, -1.3, 0], [1.4, 1.7, 0], [-1.7, 1.1, 0]])
ARROW = np.array([[-1.5, -1.6, 0], [0.1, -0.3, 0], [1.7, -1.5, 0], [1.2, 1.4, 0], [-0.2, 1.8, 0], [-1.3, 0.7, 0]])
BENT = np.add(SQUARE, [[0, 0, 0], [0, 0, 0.3], [0, 0, -0.2], [0, 0, 0.4]])
LAMP = np.array([0.4, -0.3, 3.0])


def test_polygons_with_coordinates_whose_cube_overflows():
    item = Object(Shape(cut(SQUARE * 1e120), Lambert(albedo=0.5)))
    assert len(build_geometry((item,), "file").arrays.first_edge) == 2  # one polygon, and nothing is warned of


def cut(polygon, turn=0, **fields):
    """The polygon as a mesh, cut from another corner on."""
    corners = np.roll(np.arange(len(polygon)), -turn)
    faces = triangulate(polygon, corners, np.array([len(polygon)])).take(corners)
    return Mesh(polygon, faces, polygons=np.full(len(faces), 7), **fields)


def mean_values(polygon):
    """Weights (h, w, k) of the corners at the pixels' places, by the angles themselves."""
    towards = polygon[:, :2] - PIXELS[..., None, :]
    distance = np.linalg.norm(towards, axis=-1)
    angle = np.arctan2(towards[..., 1], towards[..., 0])
    half = np.tan(((np.roll(angle, -1, axis=-1) - angle + np.pi) % (2 * np.pi) - np.pi) / 2)
    weight = (half + np.roll(half, 1, axis=-1)) / distance
    return weight / weight.sum(axis=-1, keepdims=True)


def picture(item, shading, lights=(AmbientLight(intensity=1),), **fields):
    return render(Scene((item,), lights), ABOVE, replace(SETTINGS, shading=shading, **fields)).layers


@pytest.mark.parametrize("turn", [0, 1])
@pytest.mark.parametrize("polygon", [SQUARE, ARROW])
def test_corners_are_weighted_by_mean_values(polygon, turn):
    """Light under Gouraud shading, by w in ambient light, and normals under Phong shading; concave polygons, too."""
    rng = np.random.default_rng(len(polygon))
    w, normals = rng.uniform(0.2, 1, len(polygon)), rng.normal(size=(len(polygon), 3)) / 2 + [0, 0, 2]
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    item = Object(Shape(cut(polygon, turn, normals=normals), Lambert(albedo=1)), w=w)
    hit = picture(item, "gouraud")["object_id"][..., 0] == 1
    assert hit.mean() > 0.3
    weights = mean_values(polygon)
    np.testing.assert_allclose(picture(item, "gouraud")["ambient"][hit, 0], (weights @ w)[hit], atol=2e-5)
    expected = weights @ normals
    expected /= np.linalg.norm(expected, axis=-1, keepdims=True)
    np.testing.assert_allclose(picture(item, "phong")["normal"][hit], expected[hit], atol=2e-5)


@pytest.mark.parametrize("shading", ["constant", "flat", "gouraud", "phong"])
@pytest.mark.parametrize("instanced", [False, True])
def test_no_diagonal_shows(shading, instanced):
    """The same picture of a polygon in space however it is cut, also of instances and of mirrored ones."""
    lights = PointLight(position=tuple(LAMP), intensity=9), AmbientLight(intensity=0.2)
    mirror = np.diag([-1.0, 1.0, 1.0, 1.0])
    mirror[1, 3] = 0.05
    frames = []
    for turn in (0, 1):
        shape = Shape(cut(ARROW, turn), Phong(k_d=0.5, k_s=0.4, exponent=4))
        objects = [Object(shape, mirror)] + [Object(shape, np.diag([0.1, 0.1, 0.1, 1]))] * instanced
        frames.append(render(Scene(tuple(objects), lights), ABOVE, replace(SETTINGS, shading=shading)).layers)
    a, b = frames
    assert (a["object_id"] > 0).mean() > 0.3
    for name in ("beauty", "normal"):
        np.testing.assert_allclose(a[name], b[name], atol=1e-5)


@pytest.mark.parametrize("turn", [0, 1])
@pytest.mark.parametrize("shading", ["constant", "flat"])
@pytest.mark.parametrize("mirrored", [False, True])
def test_a_polygon_has_one_light_by_its_newell_normal(shading, turn, mirrored):
    """That of the mean of its corners, though it is not flat."""
    matrix = np.diag([-1.0 if mirrored else 1.0, 1, 1, 1])
    material = Phong(k_d=(0.5, 0.4, 0.3), k_s=0.4 if shading == "flat" else 0.0, exponent=4)
    lights = (PointLight(position=tuple(LAMP), intensity=9),)
    camera = Camera((0.3, -0.2, 7), (0, 0, 0), (0, 1, 0))
    scene = Scene((Object(Shape(cut(BENT, turn), material), matrix),), lights)
    layers = render(scene, camera, replace(SETTINGS, shading=shading, shadows=False)).layers
    corners = BENT * matrix.diagonal()[:3]
    centre, normal = corners.mean(axis=0), newell_normal(corners[:: -1 if mirrored else 1])
    to_lamp = LAMP - centre
    light = 9 / (to_lamp @ to_lamp) * reflect(material, normal, to_lamp, np.array(camera.position) - centre)
    hit = layers["object_id"][..., 0] == 1
    assert hit.mean() > 0.3
    found = layers["beauty"][hit][:, :3]
    assert (found == found[0]).all()
    np.testing.assert_allclose(found[0], light, rtol=1e-5)
    np.testing.assert_allclose(layers["normal"][hit][0], normal, atol=1e-6)


@pytest.mark.parametrize("shading", ["constant", "flat", "gouraud", "phong", "quadratic"])
@pytest.mark.parametrize(
    ("faces", "polygons"),
    [
        ([[0, 1, 2], [0, 2, 3]], [5, -2]),  # triangles
        ([[0, 1, 2], [0, 3, 2]], [1, 1]),  # a fold
        ([[0, 1, 1], [2, 2, 2]], [1, 1]),  # no area
    ],
)
def test_what_is_no_polygon_is_lit_as_triangles_are(shading, faces, polygons):
    lights = (PointLight(position=tuple(LAMP), intensity=9),)
    bare = Mesh(BENT, [*faces, [0, 1, 3]])
    without = picture(white(bare), shading, lights)
    shown = picture(white(replace(bare, polygons=[*polygons, 9])), shading, lights)
    for name, layer in without.items():
        np.testing.assert_array_equal(shown[name], layer)


def test_values_on_corners_and_edges_are_those_of_the_corners_and_edges():
    """Pixels fall on them exactly."""
    square = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    w = np.array([0.1, 0.9, 0.4, 0.6])
    item = Object(Shape(cut(square), Lambert(albedo=1)), w=w)
    camera = Camera((0, 0, 9), (0, 0, 0), (0, 1, 0), height=10 / 4)
    layers = render(Scene((item,), (AmbientLight(intensity=1),)), camera, Settings(5, 5, 1, shading="gouraud")).layers
    light, hit = layers["ambient"][..., 0], layers["object_id"][..., 0] == 1
    assert hit[2, 2]
    grid = np.array(
        [[0.6, 0.55, 0.5, 0.45, 0.4], [0, 0, 0, 0, 0], [0, 0, 0.5, 0, 0], [0, 0, 0, 0, 0], [0.1, 0.3, 0.5, 0.7, 0.9]]
    )
    grid[1:4, 0], grid[1:4, 4] = [0.475, 0.35, 0.225], [0.525, 0.65, 0.775]
    known = hit & (grid > 0)
    assert known.sum() > 3
    np.testing.assert_allclose(light[known], grid[known], atol=1e-6)


def test_gouraud_sees_all_vertices_of_a_polygon():
    scene, camera = Scene((white(cut(SQUARE)),)), Camera((1.4, -0.9, 3), (1.4, -0.9, 0), (0, 1, 0), field_of_view=2)
    for shading, count in (("gouraud", 4), ("phong", 3)):
        assert seen_vertices(scene, camera, replace(SETTINGS, shading=shading)).sum() == count


OBJ = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 .5\nv 2 0 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
PLY = "ply\nformat ascii 1.0\nelement vertex 5\nproperty float x\nproperty float y\nproperty float z\n"
ROWS = "0 0 0\n1 0 0\n1 1 0\n0 1 .5\n2 0 0\n"
FILES = {
    "q.obj": OBJ + "f 2 5 3\nf 1 2 3 4\n",
    "q.ply": PLY
    + "element face 2\nproperty list uchar int vertex_indices\nend_header\n"
    + ROWS
    + "3 1 4 2\n4 0 1 2 3\n",
    "q.off": "OFF\n5 2 0\n" + ROWS + "3 1 4 2\n4 0 1 2 3\n",
}


@pytest.mark.parametrize("name", FILES)
def test_readers_keep_polygons(tmp_path, name):
    target = tmp_path / name
    target.write_text(FILES[name])
    mesh = load(target).mesh
    assert mesh.polygons.tolist() == [0, 1, 1]
    target.write_text(FILES[name].replace("f 1 2 3 4", "f 1 2 3").replace("4 0 1 2 3", "3 0 1 2"))
    assert load(target).mesh.polygons is None


@pytest.mark.parametrize("field", ["", 'texture = "paint.png"\n'])
def test_objects_of_scene_files_keep_polygons(tmp_path, field):
    (tmp_path / "q.obj").write_text(OBJ + "f 1/1 2/2 3/3 4/4\n")
    (tmp_path / "paint.png").write_bytes(b"it is read when a ray has seen it")
    (tmp_path / "scene.toml").write_text('[[objects]]\nmesh = "q.obj"\n' + field)
    (item,) = read_scene(tmp_path / "scene.toml").scene.objects
    assert item.shape.mesh.polygons.tolist() == [0, 0]


@pytest.mark.parametrize(
    ("given", "got"), [([1], "shape (1,) of int64"), ([0.5, 1], "shape (2,) of float64"), ("ab", "shape () of <U2")]
)
def test_polygons_are_one_integer_a_face(given, got):
    with pytest.raises(MeshError, match="polygons: expected 2 integers, one a face, got ") as caught:
        Mesh(SQUARE, [[0, 1, 2], [0, 2, 3]], polygons=given)
    assert got in str(caught.value)
