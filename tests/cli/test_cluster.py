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
    pytest.importorskip("distributed", reason="needs obscurance[cluster]")
    assert obscurance("bake", mesh, "--samples", "64", "-o", tmp_path / "whole.npz").returncode == 0
    result = obscurance("bake", mesh, "--samples", "64", "-o", tmp_path / "w.npz", "--cluster", "local")
    assert (result.returncode, result.stderr) == (0, "")
    assert result.stdout.splitlines()[-1].startswith("local: ")
    assert result.stdout.endswith(" blocks traced by 1 worker\n")
    assert (tmp_path / "w.npz").read_bytes() == (tmp_path / "whole.npz").read_bytes()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["hills.ply", "w.npz", "whole.npz"]


def test_mistakes_are_told_in_a_line(tmp_path, mesh, monkeypatch):
    bake = "bake", mesh, "-o", tmp_path / "w.npz"
    refused(obscurance(*bake, "--cluster", "here"), "bake --cluster: expected local, local:N or the address", "'here'")
    refused(
        obscurance(*bake, "--cluster", "local", "--part", "1/2"), "bake --part: expected one of --part, --cluster and"
    )
    refused(obscurance(*bake, "--shared", tmp_path), "bake --shared: expected --cluster with it")
    refused(obscurance(*bake, "--cluster", "local", "--shared", mesh), "bake --shared: expected a folder")
    monkeypatch.setattr("scenes.cluster.workers.find_spec", lambda _: None)
    refused(
        obscurance(*bake, "--cluster", "local"), "bake --cluster: expected Dask", "pip install 'obscurance[cluster]'"
    )
    assert [path.name for path in tmp_path.iterdir()] == ["hills.ply"]


def test_a_scheduler_that_does_not_answer_is_told(tmp_path, mesh, monkeypatch):
    pytest.importorskip("distributed", reason="needs obscurance[cluster]")
    monkeypatch.setattr("ao.cluster.dask_cluster._CONNECT", 0.3)
    result = obscurance("bake", mesh, "-o", tmp_path / "w.npz", "--cluster", "tcp://127.0.0.1:1")
    refused(
        result, "bake --cluster: expected local, local:N or the address of a Dask scheduler", "nothing that answers"
    )
