"""The up axis of pictures of mesh files."""

import numpy as np
import pytest
from command import obscurance, refused
from gltf_files import TRIANGLE, Builder
from mesh_files import ply, stl

from raytrace.errors import OptionError
from raytrace.image.read import read_image
from scenes.description.read import read_scene

SIZE = ("--width", 40, "--height", 40, "--samples", 4)
ROOF = np.array([[0, 0, 0], [4, 0, 0], [4, 2, 0], [0, 2, 0], [0, 1, 3], [4, 1, 1]], float)  # its ridge is up in z
FACES = np.array([[0, 1, 5], [0, 5, 4], [2, 3, 4], [2, 4, 5], [3, 0, 4], [1, 2, 5]])
TURNED = {"x": [2, 0, 1], "z": [0, 1, 2]}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """The same roof with each axis up."""
    monkeypatch.chdir(tmp_path)
    for axis, columns in TURNED.items():
        (tmp_path / f"{axis}.ply").write_bytes(ply(ROOF[:, columns], FACES))
    (tmp_path / "y.ply").write_bytes(ply(np.stack([ROOF[:, 0], ROOF[:, 2], -ROOF[:, 1]], axis=1), FACES))
    (tmp_path / "z.stl").write_bytes(stl(ROOF[FACES]))
    return tmp_path


def picture(*arguments):
    done = obscurance(*arguments)
    assert done.returncode == 0, done.stderr
    return read_image("p.exr" if "p.exr" in arguments else "p.png")[0]["beauty"]


def test_the_same_shape_looks_the_same_whichever_axis_is_up(folder):
    render = ("-o", "p.exr", *SIZE, "--obscurance", "off")
    expected = picture("render", "z.ply", *render, "--up", "z")
    for axis in "xy":
        np.testing.assert_allclose(picture("render", f"{axis}.ply", *render, "--up", axis), expected, atol=1e-3)
    assert np.abs(picture("render", "z.ply", *render) - expected).max() > 0.1
    np.testing.assert_array_equal(picture("render", "y.ply", *render), picture("render", "y.ply", *render, "--up", "y"))
    np.testing.assert_array_equal(picture("render", "z.stl", *render), picture("render", "z.stl", *render, "--up", "z"))


def test_the_picture_of_a_bake_goes_by_it_and_w_does_not(folder):
    bake = ("bake", "z.ply", "--samples", 16, "--debug-image", "p.png", "-o")
    lying, standing = picture(*bake, "one.npy"), picture(*bake, "two.npy", "--up", "z")
    assert np.abs(lying - standing).max() > 0.1
    assert (folder / "one.npy").read_bytes() == (folder / "two.npy").read_bytes()
    upright = picture("bake", "y.ply", "--samples", 16, "--debug-image", "p.png", "-o", "w.npy")
    assert np.abs(upright - standing).mean() < 0.03


def test_it_is_refused_where_it_would_do_nothing(folder):
    (folder / "s.toml").write_text('[[objects]]\nmesh = "z.ply"\n')
    refused(obscurance("render", "s.toml", "-o", "p.png", "--up", "z"), "--up: expected a mesh file")
    refused(obscurance("bake", "z.ply", "-o", "w.npy", "--up", "z"), "--up: expected --debug-image or an .html with it")
    refused(obscurance("render", "z.ply", "-o", "p.png", "--up", "w"), "--up", "w")
    builder = Builder()
    builder.mesh(builder.primitive(TRIANGLE, [[0, 1, 2]]))
    camera = {"type": "perspective", "perspective": {"yfov": 1, "znear": 0.1}}
    (folder / "c.glb").write_bytes(builder.glb([{"mesh": 0}, {"camera": 0}], cameras=[camera]))
    refused(obscurance("render", "c.glb", "-o", "p.png", "--up", "z"), "--up: expected a file without a camera")
    (folder / "n.glb").write_bytes(builder.glb([{"mesh": 0}]))
    assert read_scene("n.glb", up="z").camera.up == (0, 0, 1)
    assert read_scene("n.glb").camera.up == (0, 1, 0)
    with pytest.raises(OptionError, match="one of x, y, z"):
        read_scene("z.ply", up="w")
