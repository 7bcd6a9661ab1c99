"""Batches by a cluster: the files of one machine, and one line for what is amiss."""

import json

import pytest
from clusters import LEFT_SOCKETS, impatient, left_sockets, scheduler, small_blocks
from command import obscurance
from mesh_files import obj
from meshes import hills

__all__ = ["impatient", "left_sockets", "small_blocks"]
pytestmark = LEFT_SOCKETS
OPTIONS = "--samples", 64, "--format", "npz"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Five hills, and a file that is no mesh."""
    for number in range(5):
        (tmp_path / f"hill{number}.obj").write_bytes(obj(*hills(6 + 2 * number)))
    (tmp_path / "noise.obj").write_text("not a mesh\n")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def bake(output, *options):
    return obscurance("bake", "*.obj", "--output-dir", output, *OPTIONS, *options)


def manifest(folder, **changes):
    """What a manifest says but for seconds and times, with texts replaced."""
    text = (folder / "manifest.json").read_text()
    for before, after in changes.items():
        text = text.replace(f"{before}/", f"{after}/")
    found = json.loads(text)
    return [{**each, "seconds": 0, "message": each["message"].split(" rays")[0]} for each in found["inputs"]], found


def same_files(folder, one, other):
    names = [path.name for path in (folder / one).glob("*.npz")]
    assert len(names) == 5
    assert all((folder / one / name).read_bytes() == (folder / other / name).read_bytes() for name in names)


@pytest.mark.usefixtures("small_blocks")
def test_a_batch_by_a_cluster_is_that_of_one_machine_and_can_be_resumed(folder):
    with (folder / "hill4.obj").open("ab") as file:
        file.write(b"#" * (1 << 21))  # a large file
    whole = bake("whole")
    with scheduler(1) as cluster:
        done = bake("out", "--cluster", cluster.scheduler_address)
        assert (whole.returncode, done.returncode) == (1, 1)
        assert sorted(done.stderr.replace("out/", "whole/").splitlines()) == sorted(whole.stderr.splitlines())
        assert done.stdout.startswith("5 of 6 meshes baked to out, 1 failed in ")
        assert " made by workers\n" in done.stdout
        same_files(folder, "whole", "out")
        names = [*(f"hill{number}.npz" for number in range(5)), "manifest.json"]
        assert sorted(path.name for path in (folder / "out").iterdir()) == names
        assert manifest(folder / "out", out="whole")[0] == manifest(folder / "whole")[0]
        before = (folder / "out" / "hill1.npz").stat().st_mtime_ns
        (folder / "out" / "hill0.npz").unlink()
        (folder / "noise.obj").write_bytes(obj(*hills(4)))
        again = bake("out", "--cluster", cluster.scheduler_address, "--resume")
    assert again.returncode == 0
    assert all("the faces are too large for it" in line for line in again.stderr.splitlines())
    assert (folder / "out" / "hill1.npz").stat().st_mtime_ns == before
    assert manifest(folder / "out")[1]["done"] == 6
