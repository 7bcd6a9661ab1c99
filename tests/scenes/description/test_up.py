"""The up axis of pictures of mesh files."""

from pathlib import Path

import numpy as np
import pytest
from command import obscurance, refused, succeeded
from fuzz_seeds import DAE
from gltf_files import TRIANGLE, Builder, check_glb, values
from mesh_files import ply, stl

from obscurance import ao, scenes
from obscurance.raytrace import Camera, Mesh
from obscurance.raytrace.errors import MeshError, OptionError
from obscurance.raytrace.image.read import read_image
from obscurance.raytrace.mesh.mesh import TO_Y_UP, UP
from obscurance.scenes.description.read import read_scene
from obscurance.scenes.formats.load import load
from obscurance.scenes.formats.write import write

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
    succeeded(*arguments)
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


def write_camera(folder):
    """Write c.glb, a triangle and a camera; the builder of the triangle."""
    builder = Builder()
    builder.mesh(builder.primitive(TRIANGLE, [[0, 1, 2]]))
    camera = {"type": "perspective", "perspective": {"yfov": 1, "znear": 0.1}}
    (folder / "c.glb").write_bytes(builder.glb([{"mesh": 0}, {"camera": 0}], cameras=[camera]))
    return builder


def test_it_is_refused_where_it_would_do_nothing(folder):
    (folder / "s.toml").write_text('[[objects]]\nmesh = "z.ply"\n')
    refused(obscurance("render", "s.toml", "-o", "p.png", "--up", "z"), "--up: expected a mesh file")
    refused(obscurance("render", "z.ply", "-o", "p.png", "--up", "w"), "--up", "w")
    builder = write_camera(folder)
    refused(obscurance("render", "c.glb", "-o", "p.png", "--up", "z"), "--up: expected a file without a camera")
    (folder / "n.glb").write_bytes(builder.glb([{"mesh": 0}]))
    assert read_scene("n.glb", up="z").camera.up == (0, 0, 1)
    assert read_scene("n.glb").camera.up == (0, 1, 0)
    with pytest.raises(OptionError, match="one of x, y, z"):
        read_scene("z.ply", up="w")


VIEWS = {  # forward, and upwards in the picture: of Blender's views where z is up
    "front": ((0, 1, 0), (0, 0, 1)),
    "back": ((0, -1, 0), (0, 0, 1)),
    "right": ((-1, 0, 0), (0, 0, 1)),
    "left": ((1, 0, 0), (0, 0, 1)),
    "top": ((0, 0, -1), (0, 1, 0)),
    "bottom": ((0, 0, 1), (0, -1, 0)),
    "0,0,2": ((0, 0, -1), (0, 1, 0)),
    "-3,0,0": ((1, 0, 0), (0, 0, 1)),
    "1,0,1": ((-(0.5**0.5), 0, -(0.5**0.5)), (-(0.5**0.5), 0, 0.5**0.5)),
}


@pytest.mark.parametrize("view", VIEWS)
def test_a_view_is_that_side_of_the_mesh(folder, view):
    _, above, forward = read_scene("z.ply", up="z", view=view).camera.axes()
    np.testing.assert_allclose([forward, above], VIEWS[view], atol=1e-12)


@pytest.mark.parametrize("axis", UP)
def test_views_turn_with_what_is_up(folder, axis):
    turn = np.array(TO_Y_UP[axis])
    for view in ("front", "left", "top", "bottom"):
        expected = read_scene("y.ply", up="y", view=view).camera.axes()
        np.testing.assert_allclose(read_scene("z.ply", up=axis, view=view).camera.axes(), expected @ turn, atol=1e-12)


def test_a_view_is_in_the_picture_and_takes_the_place_of_a_camera(folder):
    render = ("-o", "p.exr", *SIZE, "--obscurance", "off")
    top = picture("render", "z.stl", *render, "--view", "top")
    np.testing.assert_array_equal(picture("render", "z.stl", *render, "--view", "0,0,1"), top)
    covered = np.argwhere(picture("render", "z.stl", *render, "--view", "bottom")[..., 3] > 0.5)
    wide, high = np.ptp(covered[:, 1]) + 1, np.ptp(covered[:, 0]) + 1
    assert 1.8 < wide / high < 2.2  # the floor below the roof is 4 by 2
    write_camera(folder)
    np.testing.assert_allclose(read_scene("c.glb", view="back").camera.axes()[2], [0, 0, 1])
    (folder / "s.toml").write_text('[[objects]]\nmesh = "z.ply"\n')
    refused(obscurance("render", "s.toml", "-o", "p.png", "--view", "top"), "--view: expected a mesh file")
    for wrong in ("tpo", "1,2", "0,0,0", "nan,0,1", "inf,0,1", "1,2,x", ""):
        refused(obscurance("render", "z.ply", "-o", "p.png", "--view", wrong), "render --view: expected front, back")


def stored(name):
    """Positions as a .glb stores them, its vertices in the world, and the names of the nodes of its scene."""
    header, binary = check_glb((Path.cwd() / name).read_bytes())
    positions = values(header, binary, header["meshes"][0]["primitives"][0]["attributes"]["POSITION"])
    return positions, load(name).mesh.vertices, [header["nodes"][n]["name"] for n in header["scenes"][0]["nodes"]]


def baked(*arguments):
    succeeded("bake", *arguments, "--samples", 8, "--quiet")


def test_an_stl_stands_upright_in_a_glb_once(folder):
    corners = ROOF[FACES].reshape(-1, 3)
    baked("z.stl", "-o", "once.glb")
    baked("once.glb", "-o", "twice.glb")
    for name in ("once.glb", "twice.glb"):
        positions, world, roots = stored(name)
        np.testing.assert_array_equal(positions, corners)
        np.testing.assert_array_equal(world, np.stack([corners[:, 0], corners[:, 2], -corners[:, 1]], axis=1))
        assert roots == ["z up"]
    baked("z.stl", "-o", "lying.glb", "--up", "y")
    assert stored("lying.glb")[2] == ["z"]


def test_a_textured_glb_stands_upright_too(folder):
    (folder / "t.obj").write_text(
        "v 0 0 0\nv 1 0 0\nv 1 0 1\nv 0 0 1\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3 4/4\n"
    )
    texture = "--occlusion", "texture", "--size", 8
    baked("t.obj", "-o", "t.glb", *texture, "--up", "z")
    assert stored("t.glb")[2] == ["z up"]
    baked("t.glb", "-o", "again.glb", *texture)
    assert stored("again.glb")[2] == ["z up"]
    assert load("again.glb").mesh.bounds[1].tolist() == [1, 1, 0]


def test_a_ply_says_what_is_up(folder):
    baked("z.stl", "-o", "one.ply")
    baked("one.ply", "-o", "two.ply")
    baked("two.ply", "-o", "y.glb")
    baked("two.ply", "-o", "three.ply", "--up", "y")
    baked("y.ply", "-o", "four.ply")
    assert [load(f"{name}.ply").mesh.up for name in ("one", "two", "three", "four")] == ["z", "z", None, None]
    assert (folder / "two.ply").read_bytes().count(b"\ncomment up z\n") == 1
    assert b"comment up" not in (folder / "three.ply").read_bytes() + (folder / "four.ply").read_bytes()
    assert stored("y.glb")[2] == ["z up"]
    render = "-o", "p.exr", *SIZE, "--obscurance", "off"
    np.testing.assert_array_equal(picture("render", "one.ply", *render), picture("render", "z.stl", *render))
    succeeded("view", "one.ply", "y.glb", "-o", "both.html")
    for name, axis in (("one.ply", "z"), ("y.glb", "y")):
        assert f"up {axis}" in [" ".join(line.split()) for line in obscurance("info", name).stdout.splitlines()]


@pytest.mark.parametrize("axis", ["x", "y", "z", "-x", "-y", "-z"])
def test_each_axis_becomes_y_in_a_glb_and_is_upwards_in_a_picture(folder, axis):
    source = load("z.ply")
    bake = ao.bake(source.mesh, samples=8)
    write("m.glb", bake, source, up=axis)
    sign, column = (-1 if axis[0] == "-" else 1), "xyz".index(axis[-1])
    world = stored("m.glb")[1][: len(source.mesh.vertices)]  # others repeat them at creases
    np.testing.assert_array_equal(world[:, 1], sign * source.mesh.vertices[:, column])
    assert np.linalg.det(TO_Y_UP[axis]) == pytest.approx(1)
    np.testing.assert_allclose(world, source.mesh.vertices @ np.transpose(TO_Y_UP[axis]))
    write("m.ply", bake, source, up=axis)
    camera = Camera.framing(load("m.ply").mesh)
    assert camera.up == UP[axis]
    turned = Camera.framing(Mesh(world, source.mesh.faces))
    np.testing.assert_allclose(turned.position, np.array(TO_Y_UP[axis]) @ camera.position)


def test_a_gltf_that_lies_is_set_up_when_asked(folder):
    builder = Builder()
    builder.mesh(builder.primitive(TRIANGLE, [[0, 1, 2]]))
    (folder / "n.glb").write_bytes(builder.glb([{"mesh": 0, "name": "a"}, {"mesh": 0, "name": "b"}]))
    baked("n.glb", "-o", "same.glb")
    baked("n.glb", "-o", "up.glb", "--up", "z")
    before, after = load("same.glb").mesh.vertices, load("up.glb").mesh.vertices
    np.testing.assert_array_equal(after, np.stack([before[:, 0], before[:, 2], -before[:, 1]], axis=1))
    assert stored("up.glb")[2] == ["z up"]


def test_python_has_the_convention_of_the_command():
    assert Camera.framing((ROOF, FACES)).up == (0, 1, 0)
    assert scenes.Temple(fineness=1).geometry().mesh.up == "z"
    assert Camera.framing(scenes.Temple(fineness=1).geometry().mesh).up == (0, 0, 1)
    assert load("m.dae", content=DAE).mesh.up == "z"
    with pytest.raises(MeshError, match="up: expected one of x, y, z, -x, -y, -z"):
        Mesh(ROOF, FACES, up="w")
