"""`obscurance bake --cluster`: the file of one process, and one line where it cannot be."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from clusters import LEFT_SOCKETS, impatient, left_sockets, small_blocks
from command import obscurance, process, refused, started
from mesh_files import ply
from meshes import hills
from project import environment

__all__ = ["impatient", "left_sockets", "small_blocks"]
pytestmark = LEFT_SOCKETS


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
    assert obscurance("scenes", "plane_wall", "-o", tmp_path / "scene.toml").returncode == 0
    render = "render", tmp_path / "scene.toml", "--width", 96, "--height", 64
    assert obscurance(*render, "-o", tmp_path / "whole.exr").returncode == 0
    result = obscurance(*render, "-o", tmp_path / "picture.exr", "--cluster", "local", "--report", tmp_path / "r.json")
    assert (result.returncode, result.stderr) == (0, "")
    assert result.stdout.splitlines()[-1].startswith("local: ")
    assert result.stdout.endswith(" blocks traced by 1 worker\n")
    assert (tmp_path / "picture.exr").read_bytes() == (tmp_path / "whole.exr").read_bytes()
    found = sorted(path.name for path in tmp_path.iterdir())
    assert found == ["picture.exr", "r.json", "scene.toml", "whole.exr"]


def test_mistakes_with_pictures_are_reported_in_a_line(tmp_path, mesh, monkeypatch):
    render = "render", mesh, "-o", tmp_path / "picture.png"
    refused(obscurance(*render, "--cluster", "here"), "render --cluster: expected local, local:N or the address")
    refused(obscurance(*render, "--shared", tmp_path), "render: --shared needs --cluster")
    refused(obscurance(*render, "--cluster", "local", "--shared", mesh), "render --shared: expected a folder")
    monkeypatch.setitem(sys.modules, "distributed", None)
    refused(obscurance(*render, "--cluster", "local"), "render --cluster: expected Dask")
    assert [path.name for path in tmp_path.iterdir()] == ["hills.ply"]


def test_mistakes_are_reported_in_a_line(tmp_path, mesh, monkeypatch):
    bake = "bake", mesh, "-o", tmp_path / "w.npz"
    refused(obscurance(*bake, "--cluster", "here"), "bake --cluster: expected local, local:N or the address", "'here'")
    refused(obscurance(*bake, "--cluster", "local", "--part", "1/2"), "bake: --cluster and --part exclude each other")
    refused(obscurance(*bake, "--shared", tmp_path), "bake: --shared needs --cluster")
    refused(obscurance(*bake, "--cluster", "local", "--shared", mesh), "bake --shared: expected a folder")
    monkeypatch.setitem(sys.modules, "distributed", None)
    refused(
        obscurance(*bake, "--cluster", "local"),
        "bake --cluster: expected Dask",
        "pip install dask distributed cryptography",
    )
    assert [path.name for path in tmp_path.iterdir()] == ["hills.ply"]


@pytest.mark.usefixtures("impatient")
def test_a_scheduler_that_does_not_answer_is_named(tmp_path, mesh):
    pytest.importorskip("distributed", reason="pip install '.[cluster]'")
    for command, output in (("bake", "w.npz"), ("render", "picture.png")):
        result = obscurance(command, mesh, "-o", tmp_path / output, "--cluster", "tcp://127.0.0.1:1")
        expected = f"{command} --cluster: expected local, local:N or the address of a Dask scheduler"
        refused(result, expected, "nothing that answers")
    assert [path.name for path in tmp_path.iterdir()] == ["hills.ply"]


@pytest.mark.skipif(os.name == "nt", reason="signals")
def test_sigterm_to_a_bake_and_its_workers_is_one_line(tmp_path, mesh):
    """As the ninth block is handed over: what Dask is asked to run is there, and nothing awaits it yet."""
    pytest.importorskip("distributed", reason="pip install '.[cluster]'")
    program = """if __name__ == "__main__":
        import os, signal, sys
        from ao.cluster.dask_cluster import DaskCluster
        import ao.cluster.session
        from clusters import SMALL_BLOCKS
        from cli import main
        ao.cluster.session.PACE = SMALL_BLOCKS
        call, number = DaskCluster._call, iter(range(1000))
        def strike(*arguments):
            waiting = call(*arguments)
            if next(number) == 8:
                os.killpg(0, signal.SIGTERM)
            return waiting
        DaskCluster._call = strike
        main()
    """
    command = [sys.executable, "-c", program, "bake", mesh, "-o", tmp_path / "w.npz", "--samples", 20_000, "--quiet"]
    command += ["--cluster", "local:2"]
    with started(command, env=environment(), stderr=subprocess.PIPE, text=True) as running:
        errors = running.communicate(timeout=60)[1]
    assert (running.returncode, errors) == (143, "interrupted; no file is half-written\n")
    assert [path.name for path in tmp_path.iterdir()] == ["hills.ply"]


@pytest.mark.usefixtures("small_blocks")
def test_a_shared_folder_that_vanishes_does_not_lose_the_bake(tmp_path, mesh, monkeypatch):
    pytest.importorskip("distributed", reason="pip install '.[cluster]'")
    import ao.execute.checkpoint

    shared, added = tmp_path / "shared", ao.execute.checkpoint.Checkpoint.put
    shared.mkdir()

    def vanish(*arguments):
        if shared.is_dir():
            assert list(shared.glob(".w.npz-*.scene"))
            shutil.rmtree(shared)
            shared.touch()
        added(*arguments)

    monkeypatch.setattr("ao.execute.checkpoint.Checkpoint.put", vanish)
    bake = "bake", mesh, "--samples", "64", "--quiet", "-o"
    result = obscurance(*bake, tmp_path / "w.npz", "--cluster", "local", "--shared", shared)
    assert (result.returncode, result.stderr) == (0, "")
    assert shared.is_file()
    assert obscurance(*bake, tmp_path / "whole.npz").returncode == 0
    assert (tmp_path / "w.npz").read_bytes() == (tmp_path / "whole.npz").read_bytes()


@pytest.mark.skipif(sys.platform == "win32", reason="limits of POSIX")
@pytest.mark.parametrize("options", [("--cluster", "local"), ("--part", "1/2")])
def test_a_shared_folder_that_is_full_is_reported_in_a_line(tmp_path, mesh, options):
    pytest.importorskip("distributed", reason="pip install '.[cluster]'")
    import resource

    def confine():
        resource.setrlimit(resource.RLIMIT_FSIZE, (4096, 4096))

    target = tmp_path / ("w.npz" if "--cluster" in options else "parts")
    words = "bake", mesh, "--samples", "1024", "-o", target, *options
    unwritten = environment(PYTHONDONTWRITEBYTECODE="1")  # Python leaves half of a compiled module where a disk is full
    result = process(*words, preexec_fn=confine, env=unwritten)
    refused(result, str(tmp_path), "File too large")
    assert not list(Path(tmp_path).glob("*.scene"))
