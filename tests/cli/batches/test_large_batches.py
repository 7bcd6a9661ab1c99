"""Batches by a cluster and in parts: the files of one machine, and one line for what is amiss."""

import json
import pickle

import pytest
from clusters import LEFT_SOCKETS, impatient, left_sockets, scheduler, small_blocks
from command import obscurance, refused
from mesh_files import obj
from meshes import hills

from scenes.bake.cluster import SharedPlans
from scenes.bake.manifest import assign_shards
from scenes.bake.options import BakeOptions
from scenes.bake.plan import plan_bake

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
        assert " blocks traced by 1 worker\n" in done.stdout
        same_files(folder, "whole", "out")
        names = [*(f"hill{number}.npz" for number in range(5)), "manifest.json"]
        assert sorted(path.name for path in (folder / "out").iterdir()) == names
        assert manifest(folder / "out", out="whole")[0] == manifest(folder / "whole")[0]
        before = (folder / "out" / "hill1.npz").stat().st_mtime_ns
        (folder / "out" / "hill0.npz").unlink()
        (folder / "noise.obj").write_bytes(obj(*hills(4)))
        again = bake("out", "--cluster", cluster.scheduler_address, "--resume")
    assert (again.returncode, again.stderr) == (0, "")
    assert (folder / "out" / "hill1.npz").stat().st_mtime_ns == before
    assert manifest(folder / "out")[1]["done"] == 6


def test_files_that_a_worker_does_not_see_are_named(folder):
    plan = plan_bake(BakeOptions(mesh=[folder / "hill0.obj"], output=folder / "w.npz", falloff="binary"))
    stored = pickle.dumps(SharedPlans((plan,)))
    assert [shared.described() for shared in pickle.loads(stored).plans] == [plan.described()]
    (folder / "hill0.obj").unlink()
    with pytest.raises(FileNotFoundError) as fault:
        pickle.loads(stored)
    assert fault.value.filename == str(folder / "hill0.obj")


@pytest.mark.parametrize("of", [1, 2, 7])
def test_meshes_are_dealt_by_size(of):
    sizes = [5, 1, 0, 9, 4, 4, 3]
    shards = assign_shards(sizes, of)
    loads = [sum(size for size, shard in zip(sizes, shards, strict=True) if shard == part + 1) for part in range(of)]
    assert set(shards) == set(range(1, of + 1))
    assert max(loads) - min(loads) <= max(sizes)
    assert sum(loads) == 26


def test_parts_of_a_batch_make_its_files_and_its_manifest(folder):
    assert bake("whole").returncode == 1
    failed = [bake("out", "--part", f"{number}/3") for number in (3, 1, 2)]
    assert sorted(done.returncode for done in failed) == [0, 0, 1]
    same_files(folder, "whole", "out")
    merged = obscurance("merge", "out")
    assert (merged.returncode, merged.stderr) == (1, "")
    assert merged.stdout == "out/manifest.json: 5 of 6 meshes baked, 1 failed\n"
    assert manifest(folder / "out", out="whole")[0] == manifest(folder / "whole")[0]
    assert manifest(folder / "out")[1].keys() == manifest(folder / "whole")[1].keys()
    made = {path: path.stat().st_mtime_ns for path in (folder / "out").glob("*.npz")}
    (folder / "noise.obj").write_bytes(obj(*hills(4)))
    for number in (1, 2, 3):  # nothing but what failed is done again
        assert bake("out", "--part", f"{number}/3").returncode == 0
    assert all(path.stat().st_mtime_ns == before for path, before in made.items())
    assert obscurance("merge", "out").returncode == 0


def test_parts_of_a_batch_that_are_missing_or_foreign_are_named(folder):
    assert bake("out", "--part", "2/3").returncode == 0
    refused(obscurance("merge", "out"), "out: parts: expected all of 1 to 3, got 1 of them; missing: 1, 3")
    bake("out", "--part", "1/3", "--seed", 5)
    refused(obscurance("merge", "out"), "out/manifest-2-of-3.json: seed: expected 5, as in the first part, got 0")
    bake("out", "--part", "1/3")
    (folder / "hill9.obj").write_bytes(obj(*hills(4)))
    bake("out", "--part", "3/3")
    refused(obscurance("merge", "out"), "out/manifest-3-of-3.json: inputs: expected [")
    (folder / "out" / "manifest-3-of-3.json").write_text("{}")
    refused(obscurance("merge", "out"), "manifest-3-of-3.json: manifest_version: expected the manifest of a part")
    assert not (folder / "out" / "manifest.json").exists()


@pytest.mark.usefixtures("impatient")
def test_mistakes_are_reported_in_a_line(folder):
    refused(bake("out", "--part", "4/3"), "bake --part: expected K/N")
    refused(bake("out", "--part", "1/3", "--cluster", "local"), "bake: --part and --cluster exclude each other")
    refused(bake("out", "--part", "1/3", "--dry-run"), "bake: --part and --dry-run exclude each other")
    refused(bake("out", "--shared", "."), "bake: --shared needs --cluster")
    refused(obscurance("merge", "out"), "merge --output: expected a file")
    pytest.importorskip("distributed", reason="pip install '.[cluster]'")
    refused(bake("out", "--cluster", "tcp://127.0.0.1:1"), "bake --cluster: expected", "nothing that answers")
    assert not (folder / "out").exists()
