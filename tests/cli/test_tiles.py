"""`obscurance bake --tiles`: the file of one process, from meshes that stay on the disk."""

import resource
import sys
import time

import numpy as np
import pytest
from command import obscurance, process, refused, started
from mesh_files import obj, stl
from meshes import crumpled, hills, two_boxes
from project import ROOT, environment

import raytrace.system.atomic
from raytrace.errors import MeshError
from scenes.formats.stored_mesh import open_mesh

OPTIONS = "--samples", "16", "--max-distance", "20%", "--no-denoise", "--interior", "ignore", "--falloff", "binary"


def stored_ply(vertices, faces, kind="<f4", order="little"):
    """A PLY with properties besides, which outputs keep."""
    sign = {"little": "<", "big": ">"}[order]
    row = np.dtype([("x", sign + kind[1:]), ("y", sign + kind[1:]), ("z", sign + kind[1:]), ("quality", sign + "f4")])
    face = np.dtype([("n", "u1"), ("v", sign + "u4", 3), ("part", "u1")])
    vertex_rows, face_rows = np.zeros(len(vertices), row), np.zeros(len(faces), face)
    for axis, column in zip("xyz", vertices.T, strict=True):
        vertex_rows[axis] = column
    vertex_rows["quality"], face_rows["n"], face_rows["v"] = np.arange(len(vertices)), 3, faces
    face_rows["part"] = np.arange(len(faces)) % 200
    name = {"4": "float", "8": "double"}[kind[-1]]
    header = f"ply\nformat binary_{order}_endian 1.0\ncomment a test\nelement vertex {len(vertices)}\n"
    header += "".join(f"property {name} {axis}\n" for axis in "xyz") + "property float quality\n"
    header += f"element face {len(faces)}\nproperty list uchar uint vertex_indices\nproperty uchar part\nend_header\n"
    return header.encode() + vertex_rows.tobytes() + face_rows.tobytes()


MESHES = {
    "hills.ply": stored_ply(*hills(20)),
    "double.ply": stored_ply(*crumpled(hills(12), 0.5, 1), "<f8"),
    "big.ply": stored_ply(*hills(12), order="big"),
    "boxes.stl": stl(two_boxes()[0][two_boxes()[1]]),
}


@pytest.mark.parametrize("ending", ["npy", "ply"])
@pytest.mark.parametrize("name", MESHES)
def test_tiles_make_the_file_of_the_whole_bake(tmp_path, name, ending):
    mesh, whole, tiled = tmp_path / name, tmp_path / f"whole.{ending}", tmp_path / f"tiled.{ending}"
    mesh.write_bytes(MESHES[name])
    assert obscurance("bake", mesh, "-o", whole, *OPTIONS).returncode == 0
    result = obscurance("bake", mesh, "-o", tiled, *OPTIONS, "--tiles", "2x2x1")
    assert result.returncode == 0, result.stderr
    assert "4 tiles, " in result.stdout
    assert "more faces than without" in result.stdout
    assert tiled.read_bytes() == whole.read_bytes()
    assert len(list(tmp_path.iterdir())) == 3


def test_a_table_of_mu_limits_the_distance_too(tmp_path):
    mesh, table = tmp_path / "hills.ply", tmp_path / "mu.csv"
    mesh.write_bytes(MESHES["hills.ply"])
    table.write_text("0,0\n10%,.7\n20%,1\n")
    options = mesh, *OPTIONS[:2], *OPTIONS[4:7], "--falloff", f"table:{table}"
    assert obscurance("bake", *options, "-o", tmp_path / "whole.npy").returncode == 0
    result = obscurance("bake", *options, "-o", tmp_path / "tiled.npy", "--tiles", "2x1x1")
    assert result.returncode == 0, result.stderr
    assert (tmp_path / "tiled.npy").read_bytes() == (tmp_path / "whole.npy").read_bytes()


def test_mistakes_are_reported_in_a_line(tmp_path):
    mesh, text = tmp_path / "m.ply", tmp_path / "m.obj"
    mesh.write_bytes(stored_ply(*hills(8)))
    text.write_bytes(obj(*hills(8)))
    bake = "bake", mesh, "-o", tmp_path / "w.npy", "--tiles", "2x2x2"
    limited = *bake, "--max-distance", "10%"
    for tiles in ("2", "0x1x1", "2x2", "axbxc"):
        refused(obscurance(*bake[:-1], tiles, *OPTIONS), "bake --tiles: expected how many along x, y and z")
    refused(obscurance(*limited), "bake: --tiles needs --no-denoise; see")
    refused(obscurance(*limited, "--no-denoise"), "bake: --tiles needs --interior ignore; see")
    refused(obscurance(*bake, "--no-denoise", "--interior", "ignore"), "bake: --tiles needs --max-distance; see")
    good = *limited, "--no-denoise", "--interior", "ignore"
    refused(obscurance(*good, "--tolerance", "0.1"), "bake: --tolerance and --tiles exclude each other")
    refused(obscurance(*good, "--method", "surface"), "bake: --method and --tiles exclude each other")
    refused(obscurance(*good, "--normals", "file"), "bake: --tiles does not go with --normals file")
    refused(obscurance(*good, "--cluster", "local"), "bake: --cluster and --tiles exclude each other")
    refused(obscurance(*good, "-o", tmp_path / "w.glb"), "bake --output: expected a name ending in .npy or .ply")
    refused(obscurance("bake", text, *good[2:]), "m.obj: ending: expected a binary PLY of vertices, then triangles")
    (tmp_path / "ascii.ply").write_bytes(mesh.read_bytes().replace(b"binary_little_endian", b"ascii"))
    refused(
        obscurance("bake", tmp_path / "ascii.ply", *good[2:]),
        "ascii.ply: content: expected a binary PLY",
        "a text file",
    )
    (tmp_path / "cut.ply").write_bytes(mesh.read_bytes()[:-5])
    refused(obscurance("bake", tmp_path / "cut.ply", *good[2:]), "cut.ply: content: expected", "an end elsewhere")
    spoilt = bytearray(mesh.read_bytes())
    spoilt[-14 * 3] = 4
    (tmp_path / "quad.ply").write_bytes(spoilt)
    refused(obscurance("bake", tmp_path / "quad.ply", *good[2:]), "expected three vertices, for tiles, got 4")
    refused(obscurance("bake", tmp_path / "none.ply", *good[2:]), "none.ply: file: expected an existing file")
    (tmp_path / "empty.stl").write_bytes(bytes(84))
    refused(obscurance("bake", tmp_path / "empty.stl", *good[2:]), "empty.stl: content: expected a binary PLY")
    assert not list(tmp_path.glob("w.*"))
    assert not list(tmp_path.glob(".obscurance*"))


def confined(mesh, target, limit):
    """A tiled bake that may write files of so many bytes."""

    def confine():
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))

    return process("bake", mesh, "-o", target, *OPTIONS, "--tiles", "2x1x1", preexec_fn=confine)


@pytest.mark.parametrize("room", [0.5, 2, 20])  # bytes a vertex: none of the arrays fits, the smaller ones do, most do
def test_a_disk_without_space_for_tiles_is_reported_before_they_are_traced(tmp_path, room):
    mesh = tmp_path / "m.ply"
    mesh.write_bytes(MESHES["hills.ply"])
    result = confined(mesh, tmp_path / "w.npy", int(room * 400))
    refused(result, "cannot write", "bytes beside the output, for tiles: File too large")
    assert [path.name for path in tmp_path.iterdir()] == ["m.ply"]


@pytest.mark.parametrize("rows", ["vertices", "faces"])
def test_a_mesh_that_is_cut_short_while_its_tiles_are_baked_is_reported(tmp_path, rows):
    path = tmp_path / "m.ply"
    path.write_bytes(MESHES["hills.ply"])
    mesh = open_mesh(path)
    whole = getattr(mesh, rows)(0, 8)
    with path.open("r+b") as file:
        file.truncate(path.stat().st_size // 8)
    with pytest.raises(MeshError, match=r"m\.ply: file: expected one that stays as it is while it is baked"):
        getattr(mesh, rows)(0, 8)
    path.write_bytes(MESHES["hills.ply"])
    assert np.array_equal(getattr(open_mesh(path), rows)(0, 8), whole)
    path.unlink()
    with pytest.raises(MeshError, match=r"m\.ply: file: expected a readable file, got No such file"):
        getattr(mesh, rows)(0, 8)


def test_the_folder_of_a_tiled_bake_that_was_killed_is_removed_by_the_next_one(tmp_path):
    mesh, bake = tmp_path / "m.ply", ("-o", tmp_path / "w.npy", *OPTIONS[2:], "--tiles", "2x1x1")
    mesh.write_bytes(MESHES["hills.ply"])
    command = [sys.executable, ROOT / "cli.py", "bake", mesh, *map(str, bake), "--samples", "100000"]
    with started(command, env=environment()) as running:
        while not list(tmp_path.glob(".obscurance-*/w")):
            time.sleep(0.02)
            assert running.poll() is None
        assert obscurance("bake", mesh, *bake, "--samples", "16").returncode == 0
        (folder,) = tmp_path.glob(".obscurance-*")  # of the one that goes on
        running.kill()
        running.wait()
    assert folder.exists()
    raytrace.system.atomic._remove_left_over.cache_clear()
    assert obscurance("bake", mesh, *bake, "--samples", "16").returncode == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["m.ply", "w.npy"]
