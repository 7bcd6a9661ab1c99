"""`obscurance bake --part` and `obscurance merge`: the files of one bake, and one line where they cannot be."""

import json

import pytest
from command import obscurance, refused
from mesh_files import ply
from meshes import hills, two_boxes
from uv_meshes import grid_charts

from scenes.bake.parts import part_numbers


@pytest.fixture
def mesh(tmp_path):
    path = tmp_path / "boxes.ply"
    path.write_bytes(ply(*two_boxes()))
    return path


def bake_parts(of, folder, *arguments):
    for number in range(of, 0, -1):
        result = obscurance("bake", *arguments, "--part", f"{number}/{of}", "-o", folder)
        assert result.returncode == 0, result.stderr
        assert f"part-{number}-of-{of}.part: " in result.stdout


@pytest.mark.parametrize("ending", ["npz", "ply", "glb"])
def test_merged_parts_are_the_file_of_one_bake(tmp_path, mesh, ending):
    options = "--falloff", "binary", "--max-distance", "50%", "--samples", "64", "--seed", "3", "--normals", "up"
    whole, output, report = tmp_path / f"whole.{ending}", tmp_path / f"merged.{ending}", tmp_path / "report.json"
    first = obscurance("bake", mesh, *options, "-o", whole)
    bake_parts(2, tmp_path / "parts", mesh, *options)
    (tmp_path / "elsewhere").mkdir()
    moved = mesh.rename(tmp_path / "elsewhere" / mesh.name)
    refused(obscurance("merge", tmp_path / "parts", "-o", output), "boxes.ply: file: expected")
    result = obscurance("merge", tmp_path / "parts", "-o", output, "--mesh", moved, "--report", report, "--threads", 1)
    assert (result.returncode, result.stderr) == (0, first.stderr.replace(str(whole), str(output)))
    assert output.read_bytes() == whole.read_bytes()
    assert json.loads(report.read_text())["options"]["seed"] == 3


def test_merged_parts_of_a_texture_are_the_file_of_one_bake(tmp_path):
    vertices, faces = hills(8)
    uv = grid_charts(len(faces)).reshape(-1, 2)
    lines = [f"v {x} {y} {z}" for x, y, z in vertices] + [f"vt {u} {v}" for u, v in uv]
    lines += ["f " + " ".join(f"{v + 1}/{3 * i + k + 1}" for k, v in enumerate(face)) for i, face in enumerate(faces)]
    mesh = tmp_path / "hills.obj"
    mesh.write_text("\n".join(lines))
    options = mesh, "--size", "32", "--samples", "32"
    bent = tmp_path / "bent.exr", tmp_path / "merged_bent.exr"
    whole = obscurance("bake", *options, "-o", tmp_path / "whole.exr", "--bent-normals", bent[0])
    assert whole.returncode == 0, whole.stderr
    bake_parts(2, tmp_path / "parts", *options)
    result = obscurance("merge", tmp_path / "parts", "-o", tmp_path / "merged.exr", "--bent-normals", bent[1])
    assert (result.returncode, result.stderr) == (0, "")
    assert (tmp_path / "merged.exr").read_bytes() == (tmp_path / "whole.exr").read_bytes()
    assert bent[1].read_bytes() == bent[0].read_bytes()
    refused(obscurance("merge", tmp_path / "parts", "-o", tmp_path / "w.ply"), "an image or a .glb: the parts are")


@pytest.mark.parametrize("part", ["0/3", "4/3", "3", "1/x", "-1/2", "1/0", "1/2/3", ""])
def test_a_part_is_two_numbers(part):
    with pytest.raises(ValueError, match="part: expected K/N"):
        part_numbers(part)


def test_mistakes_are_reported_in_a_line(tmp_path, mesh):
    parts = tmp_path / "parts"
    bake = "bake", mesh, "--part", "1/2", "-o", parts
    refused(obscurance(*bake, "--tolerance", "0.01"), "bake: --tolerance and --part exclude each other")
    refused(obscurance(*bake, "--colors"), "bake: --colors and --part exclude each other")
    refused(obscurance(*bake, "--uv", "1"), "bake: --uv needs an image as --output")
    refused(obscurance(*bake[:-1], mesh), "boxes.ply: cannot make this folder: it is a file")
    refused(obscurance("merge", parts, "-o", tmp_path / "w.ply"), "folder of parts")
    assert not parts.exists()
    assert obscurance(*bake).returncode == 0
    refused(obscurance(*bake, "--seed", "1"), "part-1-of-2.part: header: expected no such file, or this part of this")
    refused(obscurance("merge", parts, "-o", tmp_path / "w.ply"), "expected all of 1 to 2, got 1 of them; missing: 2")
    assert obscurance("bake", mesh, "--part", "2/2", "-o", parts, "--seed", "1").returncode == 0
    refused(obscurance("merge", parts, "-o", tmp_path / "w.ply"), "part-2-of-2.part: seed: expected 0", "got 1")
    assert not (tmp_path / "w.ply").exists()


def test_parts_of_a_table_of_mu_find_it_from_elsewhere(tmp_path, mesh, monkeypatch):
    (tmp_path / "mu.csv").write_text("0,0\n10%,.5\n80%,1\n")
    monkeypatch.chdir(tmp_path)
    options = mesh, "--falloff", "table:mu.csv", "--samples", "64"
    report = tmp_path / "report.json"
    assert obscurance("bake", *options, "-o", "whole.npz", "--report", report).returncode == 0
    bake_parts(2, "parts", *options)
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    assert obscurance("merge", "../parts", "-o", "w.npz").returncode == 0
    assert (tmp_path / "elsewhere" / "w.npz").read_bytes() == (tmp_path / "whole.npz").read_bytes()
    found = json.loads(report.read_text())
    assert [entry["path"] for entry in found["inputs"]] == [str(mesh), "mu.csv"]
    assert found["falloff"]["form"] == "table"
    assert found["falloff"]["knots"][1][1] == 0.5
    monkeypatch.chdir(tmp_path)
    assert obscurance("bake", "-o", "again.npz", "--options", report).returncode == 0
    assert (tmp_path / "again.npz").read_bytes() == (tmp_path / "whole.npz").read_bytes()
    (tmp_path / "mu.csv").write_text("0,0\n10%,.6\n80%,1\n")
    refused(obscurance("merge", "parts", "-o", "w.npz"), "parts: header: expected that of this very bake")
