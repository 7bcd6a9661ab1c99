"""`obscurance bake --cluster`: the file of one process, and one line where it cannot be."""

import pytest
from clusters import small_blocks
from command import obscurance, refused
from mesh_files import ply
from meshes import hills

__all__ = ["small_blocks"]


@pytest.fixture
def mesh(tmp_path):
    path = tmp_path / "hills.ply"
    path.write_bytes(ply(*hills(30)))
    return path


@pytest.mark.usefixtures("small_blocks")
def test_workers_started_here_make_the_file_of_one_process(tmp_path, mesh):
    pytest.importorskip("distributed", reason="pip install '.[cluster]'")
    assert obscurance("bake", mesh, "--samples", "64", "-o", tmp_path / "whole.npz").returncode == 0
    result = obscurance("bake", mesh, "--samples", "64", "-o", tmp_path / "w.npz", "--cluster", "local")
    assert (result.returncode, result.stderr) == (0, "")
    assert result.stdout.splitlines()[-1].startswith("local: ")
    assert result.stdout.endswith(" blocks traced by 1 worker\n")
    assert (tmp_path / "w.npz").read_bytes() == (tmp_path / "whole.npz").read_bytes()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["hills.ply", "w.npz", "whole.npz"]


@pytest.mark.usefixtures("small_blocks")
def test_a_picture_by_workers_started_here_is_the_file_of_one_process(tmp_path):
    pytest.importorskip("distributed", reason="pip install '.[cluster]'")
    assert obscurance("scenes", "still_life", "-o", tmp_path / "scene.toml").returncode == 0
    render = "render", tmp_path / "scene.toml", "--width", 96, "--height", 64
    assert obscurance(*render, "-o", tmp_path / "whole.exr").returncode == 0
    result = obscurance(*render, "-o", tmp_path / "picture.exr", "--cluster", "local", "--report", tmp_path / "r.json")
    assert (result.returncode, result.stderr) == (0, "")
    assert result.stdout.splitlines()[-1].startswith("local: ")
    assert result.stdout.endswith(" blocks traced by 1 worker\n")
    assert (tmp_path / "picture.exr").read_bytes() == (tmp_path / "whole.exr").read_bytes()
    found = sorted(path.name for path in tmp_path.iterdir())
    assert found == ["picture.exr", "r.json", "scene.toml", "whole.exr"]


def test_mistakes_with_pictures_are_told_in_a_line(tmp_path, mesh, monkeypatch):
    render = "render", mesh, "-o", tmp_path / "picture.png"
    refused(obscurance(*render, "--cluster", "here"), "render --cluster: expected local, local:N or the address")
    refused(obscurance(*render, "--shared", tmp_path), "render: --shared needs --cluster")
    refused(obscurance(*render, "--cluster", "local", "--shared", mesh), "render --shared: expected a folder")
    monkeypatch.setattr("scenes.jobs.workers.find_spec", lambda _: None)
    refused(obscurance(*render, "--cluster", "local"), "render --cluster: expected Dask")
    assert [path.name for path in tmp_path.iterdir()] == ["hills.ply"]


def test_mistakes_are_told_in_a_line(tmp_path, mesh, monkeypatch):
    bake = "bake", mesh, "-o", tmp_path / "w.npz"
    refused(obscurance(*bake, "--cluster", "here"), "bake --cluster: expected local, local:N or the address", "'here'")
    refused(
        obscurance(*bake, "--cluster", "local", "--part", "1/2"), "bake --part: expected one of --part, --cluster and"
    )
    refused(obscurance(*bake, "--shared", tmp_path), "bake: --shared needs --cluster")
    refused(obscurance(*bake, "--cluster", "local", "--shared", mesh), "bake --shared: expected a folder")
    monkeypatch.setattr("scenes.jobs.workers.find_spec", lambda _: None)
    refused(
        obscurance(*bake, "--cluster", "local"),
        "bake --cluster: expected Dask",
        "pip install dask distributed cryptography",
    )
    assert [path.name for path in tmp_path.iterdir()] == ["hills.ply"]


def test_a_scheduler_that_does_not_answer_is_told(tmp_path, mesh, monkeypatch):
    pytest.importorskip("distributed", reason="pip install '.[cluster]'")
    monkeypatch.setattr("ao.cluster.dask_cluster._CONNECT", 0.3)
    for command, output in (("bake", "w.npz"), ("render", "picture.png")):
        result = obscurance(command, mesh, "-o", tmp_path / output, "--cluster", "tcp://127.0.0.1:1")
        expected = f"{command} --cluster: expected local, local:N or the address of a Dask scheduler"
        refused(result, expected, "nothing that answers")
    assert [path.name for path in tmp_path.iterdir()] == ["hills.ply"]
