"""One rule for hard edges, whatever the file and the output: each side has its own normal, and its own w."""

import numpy as np
import pytest
from command import obscurance, succeeded
from gltf_files import check_glb, values
from hard_edges import CORNERS, FACES, INWARDS, OF, OPENING, SIDES
from mesh_files import ascii_stl, obj, ply
from uv_meshes import icosphere

from obscurance.ao.closed_forms import polygon_form_factor
from obscurance.scenes.formats.load import load
from obscurance.scenes.formats.stored_w import read_w

OF_OPENING = 0.2  # the part of the opening that a side of the box sees: .1998 the floor, .2000 a wall
BINARY = "--falloff", "binary"


FILES = {
    "shared.ply": ply(CORNERS, FACES),
    "shared.obj": obj(CORNERS, FACES),
    "corners.obj": obj(CORNERS, FACES, INWARDS, of=OF),
    "apart.stl": ascii_stl(("box", CORNERS[FACES])),
}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name, content in FILES.items():
        (tmp_path / name).write_bytes(content)
    return tmp_path


def bake(*arguments):
    return succeeded("bake", *arguments).stderr


def normals_and_w(path):
    """Positions at corners (m, 3, 3) of the faces of a .glb, normals there, and w (m, 3)."""
    header, binary = check_glb(path.read_bytes())
    ((primitive,),) = (mesh["primitives"] for mesh in header["meshes"])
    found = {name: values(header, binary, accessor) for name, accessor in primitive["attributes"].items()}
    corners = values(header, binary, primitive["indices"]).reshape(-1, 3)
    return [found[name][corners] for name in ("POSITION", "NORMAL", "_OBSCURANCE")]


def test_a_texture_of_an_open_box(folder):
    """Also baked again, of the .glb that was written."""
    unwrapped = ["--uv", "unwrap", "--size", 64, "--mesh-output", "page.glb"]
    bake("shared.obj", "-o", "page.exr", *unwrapped, "--seed", 3, *BINARY)
    bake("page.glb", "-o", "again.exr", "--size", 64, "--uv", 0, "--seed", 4, *BINARY)
    for page in ("page.exr", "again.exr"):
        assert mean_on_page(folder / page, folder / "page.glb") == pytest.approx(OF_OPENING, abs=0.008)


def mean_on_page(page, mesh_file):
    """The mean of w over the faces, looked up at points inside of them."""
    from obscurance.raytrace.image.read import read_image

    (layer,) = read_image(page)[0].values()
    uv = load(mesh_file, "x.glb").uv
    rng = np.random.default_rng(1)
    weights = rng.dirichlet(np.ones(3), 400)
    u, v = np.moveaxis(np.einsum("kc,mcd->mkd", weights, uv), -1, 0)
    height, width = layer.shape[:2]
    return layer[((1 - v) * height).astype(int), (u * width).astype(int)].mean()


@pytest.mark.parametrize("name", FILES)
def test_vertices_of_a_glb_have_w_of_each_side(folder, name):
    said = bake(name, "-o", "box.glb", "--samples", 4096, *BINARY)
    assert "hard edges" not in said
    places, normals, w = normals_and_w(folder / "box.glb")
    np.testing.assert_allclose(normals, INWARDS[OF], atol=1e-6)
    np.testing.assert_array_equal(places, CORNERS[FACES])
    floor = (places[..., 2] == 0) & (normals[..., 2] == 1)
    at_corner = polygon_form_factor(OPENING, (0, 0, 0), (0, 0, 1))
    np.testing.assert_allclose(w[floor], at_corner, atol=0.02)
    np.testing.assert_allclose(w[places[..., 2] == 1], 0.5, atol=0.02)  # a wall's rim sees all that is above
    bake(name, "-o", "box.html", "--samples", 64)
    bake("box.glb", "-o", "again.npy", "--samples", 4096, *BINARY)
    np.testing.assert_allclose(np.load("again.npy"), read_w("box.glb"), atol=0.02)


def test_a_ply_has_one_value_a_vertex_and_says_so(folder):
    for name in ("shared.ply", "corners.obj"):
        said = bake(name, "-o", "w.ply", "--samples", 64)
        assert "warning: w.ply: 8 of 8 vertices lie on hard edges: one value stands for all sides" in said
        assert len(load(folder / "w.ply").w) == len(CORNERS)
    for arguments in (("apart.stl", "-o", "w.ply"), ("shared.ply", "-o", "w.ply", "--normals", "up")):
        assert "hard edges" not in bake(*arguments, "--samples", 16)
    assert "hard edges" not in bake("shared.ply", "-o", "w.npz", "--samples", 16)


def test_a_smooth_mesh_says_nothing(folder):
    sphere = icosphere(3)[0]
    (folder / "sphere.ply").write_bytes(ply(sphere.vertices, sphere.faces))
    assert not bake("sphere.ply", "-o", "w.ply", "--samples", 16)
    bake("sphere.ply", "-o", "w.glb", "--samples", 16)
    np.testing.assert_array_equal(load(folder / "w.glb").w, np.float32(load(folder / "w.ply").w))


@pytest.mark.parametrize(
    ("normals", "useless"),
    [
        ([[0, 0, 0]] * 5, 30),
        ([["nan", 0, 0]] * 5, 30),
        (-INWARDS, 30),
        ([[0, 0, 0], *INWARDS[1:]], 6),
    ],
)
def test_normals_of_no_use_are_counted_and_ours_take_their_place(folder, normals, useless):
    (folder / "bad.obj").write_bytes(obj(CORNERS, FACES, normals, of=OF))
    said = bake("bad.obj", "-o", "bad.glb", "--samples", 4096, *BINARY)
    assert f"bad.obj: {useless} of 30 normals at corners are missing, zero, not finite or behind their face" in said
    bake("shared.obj", "-o", "good.glb", "--samples", 4096, *BINARY)
    for found, expected in zip(normals_and_w(folder / "bad.glb"), normals_and_w(folder / "good.glb"), strict=True):
        np.testing.assert_allclose(found, expected, atol=0.02)
    said = obscurance("render", "bad.obj", "-o", "bad.png", "--width", 16, "--height", 16, "--samples", 1).stderr
    assert "normals at corners are missing" in said


def test_faces_of_a_mesh_whose_normals_differ_at_vertices(folder):
    for normals in ("file", "angle"):
        bake("corners.obj", "-o", "w.npy", "--at", "faces", "--normals", normals, *BINARY)
        assert np.load("w.npy").mean() == pytest.approx(OF_OPENING, abs=0.005)
    assert len(np.load("w.npy")) == 2 * len(SIDES)
