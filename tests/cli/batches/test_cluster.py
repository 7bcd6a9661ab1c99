"""`obscurance bake --cluster`: the file of one process, and one line where it cannot be."""

import os
import subprocess
import sys
import time

import pytest
from clusters import LEFT_SOCKETS, impatient, left_sockets, small_blocks
from command import obscurance, refused, started, succeeded
from mesh_files import ply
from meshes import hills
from project import environment

from obscurance.scenes.bake.batch import _bake
from obscurance.scenes.bake.options import BakeOptions
from obscurance.scenes.bake.plan import plan_bake

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
    succeeded("bake", mesh, "--samples", "64", "-o", tmp_path / "whole.npz")
    result = obscurance("bake", mesh, "--samples", "64", "-o", tmp_path / "w.npz", "--cluster", "local")
    assert (result.returncode, result.stderr) == (0, "")
    assert result.stdout.splitlines()[-1].startswith("local: ")
    assert result.stdout.endswith(" made by workers\n")
    assert (tmp_path / "w.npz").read_bytes() == (tmp_path / "whole.npz").read_bytes()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["hills.ply", "w.npz", "whole.npz"]


@pytest.mark.usefixtures("small_blocks")
def test_a_picture_by_workers_started_here_is_the_file_of_one_process(tmp_path):
    pytest.importorskip("distributed", reason="pip install '.[cluster]'")
    succeeded("scenes", "plane_wall", "-o", tmp_path / "scene.toml")
    text = (tmp_path / "scene.toml").read_text()
    assert "[obscurance]" in text
    (tmp_path / "scene.toml").write_text(text.replace("[obscurance]", "[obscurance]\nsamples = 16"))
    render = "render", tmp_path / "scene.toml", "--width", 96, "--height", 64
    succeeded(*render, "-o", tmp_path / "whole.exr")
    result = obscurance(*render, "-o", tmp_path / "picture.exr", "--cluster", "local", "--report", tmp_path / "r.json")
    assert (result.returncode, result.stderr) == (0, "")
    assert result.stdout.splitlines()[-1].startswith("local: ")
    assert result.stdout.endswith(" made by workers\n")
    assert (tmp_path / "picture.exr").read_bytes() == (tmp_path / "whole.exr").read_bytes()
    found = sorted(path.name for path in tmp_path.iterdir())
    assert found == ["picture.exr", "r.json", "scene.toml", "whole.exr"]


def test_without_dask_a_line_says_what_to_install(tmp_path, mesh, monkeypatch):
    bake = "bake", mesh, "-o", tmp_path / "w.npz"
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
def test_an_interrupt_of_a_bake_and_its_workers_is_one_line_at_once(tmp_path, mesh):
    """As the ninth block is handed over."""
    pytest.importorskip("distributed", reason="pip install '.[cluster]'")
    program = """if __name__ == "__main__":
        import itertools, os
        import obscurance.ao.cluster.workers, obscurance.ao.execute.work
        from obscurance.cli import main
        obscurance.ao.execute.work._BLOCK_RAYS, obscurance.ao.cluster.workers._FEW_RAYS = 1 << 14, 0
        keys = iter(range(8))
        def count():
            yield from keys
            os.killpg(0, 2)
            yield from itertools.count(8)
        obscurance.ao.cluster.workers.count = count
        main()
    """
    command = [sys.executable, "-c", program, "bake", mesh, "-o", tmp_path / "w.npz", "--samples", 20_000, "--quiet"]
    command += ["--cluster", "local:2"]
    with started(command, env=environment(), stderr=subprocess.PIPE, text=True) as running:
        errors = running.communicate(timeout=60)[1]
    kept, last = errors.splitlines()[:-1], errors.splitlines()[-1]
    assert (running.returncode, last) == (130, "interrupted; no file is half-written")
    assert len(kept) == sum(".partial-" in path.name for path in tmp_path.iterdir()) <= 1  # after ten seconds


CLOSING = """if __name__ == "__main__":
    import os, threading
    from distributed import LocalCluster
    from obscurance.cli import main
    close = LocalCluster.close
    def interrupted(cluster):
        print("closing", flush=True)
        threading.Timer(0.02, os.kill, (os.getpid(), 2)).start()
        close(cluster)
    LocalCluster.close = interrupted
    main()
"""


@pytest.mark.skipif(os.name == "nt", reason="signals")
def test_an_interrupt_as_workers_are_ended_waits_for_nothing(tmp_path, mesh):
    """Dask would close the cluster once more at the end, and wait for ten seconds."""
    pytest.importorskip("distributed", reason="pip install '.[cluster]'")
    command = [sys.executable, "-c", CLOSING, "bake", mesh, "-o", tmp_path / "w.npz", "--quiet", "--cluster", "local"]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    with started(command, env=environment(), **pipes) as running:
        assert running.stdout.readline() == "closing\n"
        begun = time.monotonic()
        errors = running.communicate(timeout=60)[1]
        seconds = time.monotonic() - begun
    assert (running.returncode, errors) == (130, "interrupted; no file is half-written\n")
    assert seconds < 9


def test_a_worker_that_does_not_see_the_files_of_a_batch_is_named(tmp_path):
    plan = plan_bake(BakeOptions(mesh=[tmp_path / "gone" / "hill.obj"], output=tmp_path / "w.npz", falloff="binary"))
    with pytest.raises(FileNotFoundError, match="gone"):
        _bake(None, plan)
