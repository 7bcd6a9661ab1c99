"""`--high` of several files, and `--cage` of a mesh file, by the command."""

import json

import numpy as np
import OpenImageIO as oiio
import pytest
from command import obscurance, refused, succeeded
from mesh_files import obj
from meshes import hills

FEW = ("--samples", 16, "-q")


def with_uv(vertices, faces):
    return obj(vertices, faces, uv=vertices[:, :2])


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A unit square, a cage of it that leans, and hills in two files."""
    vertices, faces = hills(9)
    flat = (vertices * [1, 1, 0] + [1, 1, 0]) / 2
    (tmp_path / "low.obj").write_bytes(with_uv(flat, faces))
    (tmp_path / "cage.obj").write_bytes(with_uv(flat + np.outer(0.1 + 0.4 * flat[:, 0], [0.5, 0, 1]), faces))
    (tmp_path / "even.obj").write_bytes(with_uv(flat + np.array([0, 0, 0.25]), faces))
    (tmp_path / "other.obj").write_bytes(with_uv(*hills(8)))
    fine, whole = hills(24)
    fine = fine * [1, 1, 0.2] + [0.5, 0.5, 0]
    left = fine[whole].mean(axis=1)[:, 0] < 0.5
    for name, some in (("left", left), ("right", ~left), ("whole", left | ~left)):
        (tmp_path / f"{name}.obj").write_bytes(with_uv(fine, whole[some]))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def bake(*arguments):
    return succeeded("bake", "low.obj", *arguments, *FEW)


def test_a_cage_file_at_an_even_height_is_that_distance_and_another_is_not(folder):
    for name, cage in (("a", 0.25), ("b", "even.obj"), ("c", "cage.obj")):
        bake("--high", "whole.obj", "--cage", cage, "-o", f"{name}.npy", "--report", f"{name}.json")
        bake("--high", "whole.obj", "--cage", cage, "-o", f"{name}.exr", "--size", 16)
    for read, ending in ((np.load, "npy"), (lambda path: oiio.ImageBuf(str(path)).get_pixels(), "exr")):
        one, same, unlike = (read(folder / f"{name}.{ending}") for name in "abc")
        np.testing.assert_allclose(one, same, atol=1e-5)
        assert np.abs(one - unlike).max() > 0.01
    report = json.loads((folder / "c.json").read_text())
    assert report["options"]["cage"] == "cage.obj"
    assert [each["path"] for each in report["inputs"]] == ["low.obj", "whole.obj", "cage.obj"]
    bake("-o", "again.npy", "--options", "c.json")
    assert (folder / "again.npy").read_bytes() == (folder / "c.npy").read_bytes()


def test_several_fine_files_are_as_one(folder):
    """Points of the left half are met in one file, and occluded by the other, too."""
    halves = "--high", "left.obj", "--high", "right.obj", "--cage", "even.obj"
    bake(*halves, "-o", "both.npy", "--falloff", "binary")
    bake("--high", "whole.obj", "--cage", "even.obj", "-o", "whole.npy", "--falloff", "binary")
    both, whole = (np.load(f"{name}.npy") for name in ("both", "whole"))
    np.testing.assert_allclose(both, whole, atol=0.15)  # of other faces' numbers other rays
    assert np.abs(both - whole).mean() < 0.03
    bake(*halves, "-o", "one.npy", "--report", "r.json")
    assert json.loads((folder / "r.json").read_text())["options"]["high"] == ["left.obj", "right.obj"]


def test_batches_have_the_cage(folder):
    options = "--high", "left.obj", "--high", "right.obj", "--cage", "cage.obj"
    bake(*options, "-o", "w.npy")
    bake(*options, "--output-dir", "all", "--format", "npy")
    assert (folder / "all" / "low.npy").read_bytes() == (folder / "w.npy").read_bytes()


def square(height, number, left=0.0, right=1.0):
    corners = ((left, 0), (right, 0), (right, 1), (left, 1))
    lines = [f"v {x} {y} {height}\nvt {x} {number / 2 + y / 2.01}" for x, y in corners]
    return "\n".join([*lines, "f -4/-4 -3/-3 -2/-2 -1/-1", ""])


def test_objects_are_matched_by_name(tmp_path, monkeypatch):
    """A lid over a floor, within its cage: by their names the floor is found under the lid, which occludes it."""
    monkeypatch.chdir(tmp_path)
    floor, lid = square(0, 0), square(0.1, 1)
    (tmp_path / "low.obj").write_text(f"o floor_low\n{floor}o lid_low\n{lid}")
    halves = [f"o floor_high_{k}\n{square(-0.01, 0, *ends)}" for k, ends in enumerate(((-9, 0.55), (0.55, 9)))]
    (tmp_path / "floor.obj").write_text(halves[0])
    (tmp_path / "rest.obj").write_text(f"{halves[1]}o lid_high\n{square(0.11, 1, -9, 9)}")
    options = "--high", "floor.obj", "--high", "rest.obj", "--cage", 0.3, "--falloff", "binary"
    for output in ("w.npy", "w.exr"):
        for names in ((), ("--match-names",)):
            bake(*options, *names, "-o", output, *(("--size", 16) if output == "w.exr" else ()))
            w = np.load(output) if output == "w.npy" else oiio.ImageBuf(output).get_pixels()[..., 0][::-1].ravel()
            of_floor, of_lid = w[: len(w) // 2], w[len(w) // 2 :]
            assert of_lid.min() == 1
            assert of_floor.max() < 0.7 if names else of_floor.min() == 1
    lacking = obscurance("bake", "low.obj", "-o", "w.ply", "--high", "floor.obj", "--match-names")
    refused(lacking, "low.obj: match_names: expected an object of --high for each of the input, got no lid_high")
    refused(obscurance("bake", "low.obj", "-o", "w.npy", "--match-names"), "--match-names needs --high")
