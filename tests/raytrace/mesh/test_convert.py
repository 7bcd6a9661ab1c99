"""Meshes of other libraries: stand-ins for what these have, and the recipes of docs/python.md with the real ones."""

import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from gltf_files import Builder
from gltf_samples import quad
from project import ROOT

from obscurance import ao
from obscurance.raytrace import Camera, Lambert, Mesh, MeshError, Shape
from obscurance.raytrace.mesh.mesh import mesh_of
from obscurance.raytrace.mesh.normals import face_normals

POINTS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 0.5, 2]], float)
FACES = np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]])
RECIPES = re.findall(r"```python\n(.*?)```", (ROOT / "docs" / "python.md").read_text(), re.DOTALL)
LIBRARIES = ("trimesh", "pyvista", "meshio", "open3d")


def meshio_like(*cells, points=POINTS):
    blocks = [SimpleNamespace(type=kind, data=np.array(data)) for kind, data in cells]
    return SimpleNamespace(points=points, cells=blocks)


def polydata_like(faces, all_triangles=True):
    padded = np.insert(faces, 0, 3, axis=1).ravel()
    return SimpleNamespace(points=POINTS.astype(np.float32), faces=padded, strips=[], is_all_triangles=all_triangles)


class Sequence:
    """What Open3D's vectors show of themselves: rows, and an array when NumPy asks."""

    def __init__(self, rows):
        self.rows = rows

    def __array__(self, dtype=None, copy=None):
        return np.array(self.rows, dtype)


class Tensor:
    """A tensor on a graphics card, which NumPy cannot look into."""

    def __init__(self, rows):
        self.rows = rows

    def cpu(self):
        return SimpleNamespace(numpy=lambda: self.rows)


def tensor_mesh(**attributes):
    names = {"vertex": "positions", "triangle": "indices"}
    return SimpleNamespace(**{name: {key: attributes[key]} if key in attributes else {} for name, key in names.items()})


@pytest.mark.parametrize(
    "given",
    [
        SimpleNamespace(vertices=Sequence(POINTS), triangles=Sequence(FACES.astype(np.int32))),
        tensor_mesh(positions=Tensor(POINTS.astype(np.float32)), indices=Tensor(FACES)),
        Mesh(POINTS, FACES),
        (POINTS, FACES),
        [POINTS.tolist(), FACES.tolist()],
        SimpleNamespace(vertices=POINTS, faces=FACES),
        polydata_like(FACES),
        meshio_like(("line", [[0, 1]]), ("triangle", FACES[:2]), ("vertex", [[0]]), ("triangle", FACES[2:])),
    ],
)
def test_vertices_and_faces_are_those_given(given):
    mesh = mesh_of(given, "here")
    np.testing.assert_array_equal(mesh.vertices, POINTS)
    np.testing.assert_array_equal(mesh.faces, FACES)


def test_polygons_are_cut_by_the_library_that_has_them():
    whole = polydata_like(FACES[:1], all_triangles=False)
    whole.triangulate = lambda: polydata_like(FACES)
    np.testing.assert_array_equal(mesh_of(whole, "here").faces, FACES)


@pytest.mark.parametrize("first", range(4))
def test_quads_are_cut_where_they_stay_what_they_are(first):
    arrow = np.array([[0, 0, 0], [2, -1, 0], [0.5, 0, 0], [2, 1, 0]])  # with a notch at its third corner
    quad = np.roll([0, 1, 2, 3], first)
    mesh = mesh_of(meshio_like(("quad", [quad]), points=arrow), "here")
    normals, areas = face_normals(mesh.vertices, mesh.faces)
    assert abs(normals[0, 2] - normals[1, 2]) < 1e-12
    assert areas.sum() == pytest.approx(0.5)


WRONG = {
    "a name": (
        "ball.obj",
        r"mesh: expected a raytrace\.Mesh, a pair .*; did you mean scenes\.load\(\"ball\.obj\"\)",
    ),
    "a path": (Path("a") / "ball.obj", r'did you mean scenes\.load\("a.ball\.obj"\)\?'),
    "an empty tensor mesh": (tensor_mesh(), r"expected vertex\.positions and triangle\.indices, got an empty mesh"),
    "a volume": (meshio_like(("tetra", [[0, 1, 2, 3]])), "cells: expected triangle or quad, got tetra"),
    "lines": (meshio_like(("line", [[0, 1]])), "cells: expected triangle or quad, got none of them"),
    "a grid": (SimpleNamespace(points=POINTS, extract_surface=None), r"did you mean its extract_surface\(\)\?"),
    "a scene": (SimpleNamespace(geometry={}, to_mesh=None), r"did you mean its to_mesh\(\)\?"),
    "numbers": ((1, 2), "vertices: expected shape"),
    "faces of fractions": ((POINTS, FACES + 0.5), "faces: expected integers"),
    "a row too many": ((POINTS, FACES + 2), "expected indices from 0 to 4"),
    "rows that are none of 32 bits": ((POINTS, FACES + (1 << 32)), "expected indices from 0 to 4"),
}


@pytest.mark.parametrize("name", WRONG)
def test_what_is_none_is_refused_in_one_line(name):
    given, words = WRONG[name]
    with pytest.raises(
        MeshError, match=rf"^here: {words}" if name in ("a name", "a volume", "lines") else words
    ) as fault:
        mesh_of(given, "here")
    assert "\n" not in str(fault.value)


def test_a_mesh_may_have_any_form_wherever_one_is_taken():
    pair = POINTS, FACES
    uv = POINTS[:, :2] * 0.9
    assert len(ao.bake(pair, samples=8).w) == 5
    assert ao.bake_texture(pair, uv, 8, samples=8, high=pair).w.shape == (8, 8)
    assert Shape(pair, Lambert(albedo=0.5)).mesh.faces.shape == (4, 3)
    assert Camera.framing(pair, (0, 0, 1)) == Camera.framing(Mesh(*pair), (0, 0, 1))


@pytest.mark.parametrize("recipe", RECIPES, ids=[recipe.split("\n")[0][:40] for recipe in RECIPES])
def test_a_recipe_runs(recipe, tmp_path, monkeypatch):
    import obscurance
    from obscurance import scenes

    monkeypatch.chdir(tmp_path)
    builder = Builder()
    builder.mesh(quad(builder, 0))
    (tmp_path / "meshes").mkdir()
    for name in ("duck.glb", "meshes/a.glb"):
        (tmp_path / name).write_bytes(builder.glb([{"mesh": 0}]))
    used = {name: pytest.importorskip(name) for name in LIBRARIES if name in recipe}
    given = {"vertices": POINTS, "faces": FACES, "wall": Mesh(np.add(POINTS, 3.0), FACES)}
    given["file"] = scenes.load("duck.glb")
    names = {"np": np, "ao": ao, "scenes": scenes, "obscurance": obscurance, **given, **used}
    exec(compile(recipe.replace("1024", "128"), "python.md", "exec"), names)
    for saved in re.findall(r'(?:save|write|view)\((?:baked, )?"(.+?)"', recipe):
        assert (tmp_path / saved).stat().st_size > 50
    shown = [names[name] for name in ("mesh", "surface", "grid") if name in names]
    for each in shown:
        w = np.asarray(each.visual.vertex_colors[:, 0] / 255 if hasattr(each, "visual") else each.point_data["w"])
        assert 0 < w.min() <= w.max() <= 1
        assert len(w) == len(mesh_of(each, "here").vertices)
