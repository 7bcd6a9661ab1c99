"""Built-in scenes and shapes: each TOML stands alone, each mesh is closed, oriented and exact."""

import tomllib
from dataclasses import replace
from importlib import resources

import numpy as np
import pytest

from obscurance.raytrace import material_from_dict
from obscurance.raytrace.brdf.presets import PRESETS
from obscurance.raytrace.brdf.registry import reflection_models
from obscurance.raytrace.errors import OptionError
from obscurance.raytrace.mesh.normals import face_normals
from obscurance.scenes.description.read import read_scene
from obscurance.scenes.geometry.builtin_shapes import SOLIDS, Box, Cylinder, Plane, Solid, Sphere, Sponge
from obscurance.scenes.library import BUILTIN, builtin_toml, write_builtin

COUNTS = {  # objects, shapes, lights
    "plane_wall": (2, 2, 3),
    "cornell": (9, 7, 2),
    "temple": (2, 2, 2),
    "sponge": (2, 2, 2),
    "materials": (len(PRESETS) + 5, len(PRESETS) + 5, 4),
    "metals": (9, 9, 2),
    "still_life": (12, 8, 3),
}


def test_all_are_counted_and_every_file_is_listed():
    assert set(COUNTS) == set(BUILTIN)
    files = (resources.files("obscurance.scenes") / "library").iterdir()
    assert {file.name for file in files if file.name.endswith(".toml")} == {f"{name}.toml" for name in BUILTIN}


@pytest.mark.parametrize("name", COUNTS)
def test_written_and_read(tmp_path, name):
    path = tmp_path / "scene.toml"
    write_builtin(name, path)
    assert path.read_text(encoding="utf-8") == builtin_toml(name)
    made = read_scene(path)
    shapes = {id(item.shape) for item in made.scene.objects}
    assert (len(made.scene.objects), len(shapes), len(made.scene.lights)) == COUNTS[name]
    table = tomllib.loads(builtin_toml(name))
    assert made.camera.position == tuple(table["camera"]["position"])
    assert 5_000 < sum(len(item.shape.mesh.vertices) for item in made.scene.objects) < 250_000
    assert builtin_toml(name).startswith("# ")


def test_the_cornell_box_is_closed_around_camera_and_lamp(tmp_path):
    write_builtin("cornell", tmp_path / "scene.toml")
    made = read_scene(tmp_path / "scene.toml")
    walls = [
        item for item in made.scene.objects if item.name.split()[0] in ("floor", "ceiling", "back", "left", "right")
    ]
    mesh = replace(made.scene, objects=tuple(walls)).flattened()
    corners = mesh.vertices[mesh.faces]
    for point in (made.camera.position, made.scene.lights[0].position):
        a, b, c = np.moveaxis(corners - point, 1, 0)
        la, lb, lc = (np.linalg.norm(side, axis=1) for side in (a, b, c))
        ab, bc, ca = (np.einsum("ij,ij->i", *pair) for pair in ((a, b), (b, c), (c, a)))
        volume = np.einsum("ij,ij->i", a, np.cross(b, c))
        # van Oosterom & Strackee 1983: the solid angle of a triangle
        angles = 2 * np.arctan2(-volume, la * lb * lc + ab * lc + bc * la + ca * lb)
        assert angles.sum() == pytest.approx(4 * np.pi)


def test_the_materials_scene_has_every_model(tmp_path):
    write_builtin("materials", tmp_path / "scene.toml")
    objects = read_scene(tmp_path / "scene.toml").scene.objects
    shown = [item.shape.material for item in objects]
    assert all(material_from_dict({"preset": name}) in shown for name in PRESETS)
    assert {type(material) for material in shown} == set(reflection_models())


def volume(mesh):
    a, b, c = (mesh.vertices[mesh.faces[:, corner]] for corner in range(3))
    return np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6


def is_closed(mesh):
    """Whether every directed edge meets its opposite, seams and hard edges welded."""
    _, index = np.unique(np.round(mesh.vertices, 9), axis=0, return_inverse=True)
    faces = index.ravel()[mesh.faces]
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    key, opposite = edges @ [len(mesh.vertices), 1], edges @ [1, len(mesh.vertices)]
    return np.array_equal(np.sort(key), np.sort(opposite))


@pytest.mark.parametrize(
    ("solid", "exact", "tolerance"),
    [
        (Box(size=(1, 2, 3), fineness=0.3), 6, 1e-12),
        (Box(size=2), 8, 1e-12),
        (Sphere(radius=2, fineness=0.05), 4 / 3 * np.pi * 8, 2e-3),
        (Cylinder(radius=0.5, height=3, fineness=0.02), np.pi * 0.75, 1e-3),
        *((Sponge(level=level, size=3), 27 * (20 / 27) ** level, 1e-12) for level in range(4)),
    ],
)
def test_solids_are_closed_and_outward(solid, exact, tolerance):
    mesh = solid.geometry().mesh
    assert is_closed(mesh)
    assert volume(mesh) == pytest.approx(exact, rel=tolerance)
    np.testing.assert_allclose(mesh.vertices.max(axis=0) + mesh.vertices.min(axis=0), 0, atol=0.02)


@pytest.mark.parametrize("kind", SOLIDS)
def test_normals_agree_with_the_faces(kind):
    mesh = SOLIDS[kind]().geometry().mesh
    normals, areas = face_normals(mesh.vertices, mesh.faces)
    assert (areas > 0).all()
    np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1)
    assert np.einsum("ij,ikj->ik", normals, mesh.normals[mesh.faces]).min() > 0.99


@pytest.mark.parametrize("solid", [Plane(size=(2, 1)), Box(), Sphere(), Cylinder()])
def test_texture_coordinates_fill_the_square_and_follow_the_surface(solid):
    made = solid.geometry()
    np.testing.assert_array_equal([made.uv.min(axis=0), made.uv.max(axis=0)], [[0, 0], [1, 1]])
    corners = made.uv[made.mesh.faces]
    (a, b), (c, d) = (corners[:, 1] - corners[:, 0]).T, (corners[:, 2] - corners[:, 0]).T
    assert (a * d - b * c > 0).all()


@pytest.mark.parametrize("fineness", [0.5, 0.1, 0.03])
def test_no_leg_is_longer_than_the_fineness(fineness):
    for solid in (Plane(size=(2, 1), fineness=fineness), Box(fineness=fineness), Sponge(level=1, fineness=fineness)):
        mesh = solid.geometry().mesh
        corners = mesh.vertices[mesh.faces]
        edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
        assert np.sort(edges, axis=1)[:, 1].max() <= fineness * (1 + 1e-9)


@pytest.mark.parametrize("kind", [kind for kind in SOLIDS.values() if kind is not SOLIDS["temple"]])
def test_the_same_shape_at_any_size(kind):
    small, large = kind(), kind(**{name: 1e6 * np.array(value) for name, value in sizes(kind()).items()})
    a, b = small.geometry().mesh, large.geometry().mesh
    np.testing.assert_array_equal(a.faces, b.faces)
    np.testing.assert_allclose(b.vertices, 1e6 * a.vertices, atol=1e-6)


def sizes(solid: Solid):
    return {name: getattr(solid, name) for name in ("size", "radius", "height") if hasattr(solid, name)}


def test_too_fine_a_mesh_is_refused_before_it_is_made():
    for solid in (Plane(size=(1e9, 1e-9), fineness=0.1), Sponge(level=4, fineness=1e-5), Sphere(fineness=1e-100)):
        with pytest.raises(OptionError, match="fineness: expected a length that makes at most 20,000,000 triangles"):
            solid.geometry()
