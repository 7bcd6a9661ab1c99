"""Several inputs in one command: the same bytes as one at a time, and no file brings the others down."""

import json
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from command import BEGUN, obscurance, refused, started, succeeded
from found_faults import triangle
from mesh_files import obj
from meshes import hills
from PIL import Image
from project import ROOT

SAMPLES = ("--samples", 16)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Eight hills, two of them large ones, and a file that is no mesh."""
    for number in range(8):
        (tmp_path / f"hill{number}.obj").write_bytes(obj(*hills(6 + number)))
    (tmp_path / "noise.obj").write_text("not a mesh\n")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def manifest(folder):
    return json.loads((folder / "out" / "manifest.json").read_text())


@pytest.mark.parametrize("large", [0, 3, 8])
def test_every_output_is_the_one_of_a_bake_of_its_own(folder, large):
    for number in range(large):
        with (folder / f"hill{number}.obj").open("ab") as file:
            file.write(b"#" * (1 << 21))
    options = (*SAMPLES, "--falloff", "binary", "--seed", 3)
    done = succeeded("bake", "hill*.obj", "--output-dir", "out", "--format", "npz", "--threads", 3, *options)
    assert done.stdout.startswith("8 of 8 meshes baked to out in ")
    for number in range(8):
        succeeded("bake", f"hill{number}.obj", "-o", "single.npz", *options)
        assert (folder / "out" / f"hill{number}.npz").read_bytes() == (folder / "single.npz").read_bytes()
    assert len(list((folder / "out").iterdir())) == 9


def test_a_bad_file_has_its_line_and_the_others_are_baked(folder):
    near = "--half-distance", "5%"  # which vertices so far apart cannot show
    names = "hill0.obj", "noise.obj", "gone.obj", "hill1.obj"
    done = obscurance("bake", *names, "--output-dir", "out/deep", *SAMPLES, *near)
    assert done.returncode == 1
    lines = sorted(done.stderr.splitlines())
    assert "gone.obj: file: expected an existing file, got none" in lines[0]
    assert "noise.obj: faces: expected at least one triangle" in lines[1]
    assert any("hill0.ply: between the vertices w, the openness, errs by " in line for line in lines)
    assert all(line.startswith("warning: out/deep/hill") for line in lines[2:])
    assert done.stdout.startswith("2 of 4 meshes baked to out/deep, 2 failed in ")
    found = json.loads((folder / "out" / "deep" / "manifest.json").read_text())
    assert (found["done"], found["failed"], found["options"]["samples"]) == (2, 2, 16)
    assert [each["input"] for each in found["inputs"]] == [*names]
    assert [each["status"] for each in found["inputs"]] == ["done", "failed", "failed", "done"]
    assert "got none" in found["inputs"][2]["message"]
    warned = [f"warning: {line}" for each in found["inputs"] for line in each["warnings"]]
    assert sorted(warned) == lines[2:]
    assert len(found["inputs"][0]["sha256"]) == 64


def test_equal_names_have_outputs_in_folders_like_those_of_the_inputs(folder):
    for name in ("a", "b/deep"):
        (folder / "set" / name).mkdir(parents=True)
        (folder / "set" / name / "x.obj").write_bytes((folder / f"hill{len(name)}.obj").read_bytes())
    succeeded("bake", "set/**/x.obj", "set/a/../../hill2.obj", "--output-dir", "out", "--format", "npy", *SAMPLES)
    outputs = [each["output"] for each in manifest(folder)["inputs"]]
    assert outputs == ["out/set/a/x.npy", "out/set/b/deep/x.npy", "out/hill2.npy"]
    for output, number in zip(outputs, (1, 6, 2), strict=True):
        succeeded("bake", f"hill{number}.obj", "-o", "single.npy", *SAMPLES)
        assert (folder / output).read_bytes() == (folder / "single.npy").read_bytes()
    again = obscurance(
        "bake", "set/**/x.obj", "hill2.obj", "--output-dir", "out", "--format", "npy", "--resume", *SAMPLES
    )
    assert "3 of 3 meshes baked" in again.stdout


def test_a_dry_run_leaves_no_folders_behind(folder):
    for name in ("a", "b"):
        (folder / name).mkdir()
        (folder / name / "x.obj").write_bytes((folder / "hill0.obj").read_bytes())
    done = obscurance("bake", "a/x.obj", "b/x.obj", "--output-dir", "out", "--dry-run")
    assert "out/b/x.ply" in done.stdout
    assert not (folder / "out").exists()
    (folder / "a" / "x.stl").write_bytes(b"")
    line = obscurance("bake", "a/x.obj", "a/x.stl", "b/x.obj", "--output-dir", "out")
    refused(line, "different names in each folder, got a/x.obj and a/x.stl, both for out/a/x.ply")
    (folder / "file").write_text("")
    line = obscurance("bake", "a/x.obj", "b/x.obj", "--output-dir", "new/../file/out")
    assert line.returncode == 2
    assert not (folder / "new").exists()


def test_a_resumed_batch_bakes_what_is_missing_changed_or_failed(folder):
    command = ("bake", "hill*.obj", "noise.obj", "--output-dir", "out", *SAMPLES)
    assert obscurance(*command).returncode == 1
    outputs = {path: path.stat().st_mtime_ns for path in (folder / "out").glob("*.ply")}
    (folder / "out" / "hill1.ply").unlink()
    (folder / "hill2.obj").write_bytes(obj(*hills(4)))
    (folder / "noise.obj").write_bytes(obj(*hills(4)))
    succeeded(*command, "--resume")
    again = {path.name for path, before in outputs.items() if path.stat().st_mtime_ns != before}
    assert again == {"hill1.ply", "hill2.ply"}
    assert manifest(folder)["done"] == 9
    assert "other options" in obscurance(*command[:-1], 17, "--resume").stderr
    assert all(path.stat().st_mtime_ns != before for path, before in outputs.items())


def test_a_resumed_batch_bakes_again_where_any_file_that_was_read_or_written_has_changed(folder):
    builder = triangle()
    for name in ("near", "far"):
        (folder / f"{name}.gltf").write_text(json.dumps(builder.gltf([{"mesh": 0}], uri=f"{name}.bin")))
        (folder / f"{name}.bin").write_bytes(builder.binary)

    def again(*command):
        outputs = {path: path.stat().st_mtime_ns for path in (folder / "out").glob("*.npz")}
        succeeded("bake", *command, "--output-dir", "out", *SAMPLES, "--format", "npz", "--resume")
        return {path.stem for path in (folder / "out").glob("*.npz") if path.stat().st_mtime_ns != outputs.get(path)}

    assert again("near.gltf", "far.gltf", "hill[0-2].obj") == {"near", "far", "hill0", "hill1", "hill2"}
    assert again("near.gltf", "far.gltf", "hill[0-2].obj") == set()
    (folder / "far.bin").write_bytes((2 * np.frombuffer(builder.binary, "<f4")).tobytes())
    (folder / "out" / "hill0.npz").write_bytes(b"")
    (folder / "out" / "hill1.npz").write_bytes((folder / "out" / "hill1.npz").read_bytes()[:-1])
    assert again("near.gltf", "far.gltf", "hill[0-2].obj") == {"far", "hill0", "hill1"}
    fine = ("hill6.obj", "--high", "fine.obj")
    (folder / "fine.obj").write_bytes((folder / "hill6.obj").read_bytes())
    assert again(*fine) == {"hill6"}
    assert again(*fine) == set()
    (folder / "fine.obj").write_bytes((folder / "hill6.obj").read_bytes() + b"# changed\n")
    assert again(*fine) == {"hill6"}


def test_a_resumed_batch_bakes_an_obj_again_where_its_materials_or_their_pictures_have_changed(folder):
    vertices, faces = hills(4)
    lines = [b"mtllib leaf.mtl", obj(vertices, faces), b"vt 0 0", b"usemtl leaf", b"f 1/1 2/1 3/1"]
    (folder / "leaf.obj").write_bytes(b"\n".join(lines))
    library, picture = folder / "leaf.mtl", folder / "leaf.png"
    library.write_text("newmtl leaf\nmap_d leaf.png\n")
    Image.new("L", (2, 2), 255).save(picture)
    command = "bake", "leaf.obj", "hill0.obj", "--output-dir", "out", *SAMPLES, "--format", "npz", "--resume"

    def again():
        before = {path: path.stat().st_mtime_ns for path in (folder / "out").glob("*.npz")}
        succeeded(*command)
        return {path.stem for path in (folder / "out").glob("*.npz") if path.stat().st_mtime_ns != before.get(path)}

    assert again() == {"leaf", "hill0"}
    assert again() == set()
    Image.new("L", (2, 2), 0).save(picture)
    assert again() == {"leaf"}
    library.write_text("newmtl leaf\nd .5\n")
    assert again() == {"leaf"}
    library.unlink()
    assert again() == {"leaf"}
    assert again() == set()


@pytest.mark.parametrize("content", ["[]", "{}", '{"manifest_version": 99, "options": 1, "versions": 1, "inputs": []}'])
def test_what_is_no_manifest_is_not_resumed(folder, content):
    (folder / "out").mkdir()
    (folder / "out" / "manifest.json").write_text(content)
    refused(obscurance("bake", "hill0.obj", "--output-dir", "out", *SAMPLES, "--resume"), "manifest.json")
    assert (folder / "out" / "manifest.json").read_text() == content


def test_a_refused_batch_leaves_no_folder(folder):
    refused(obscurance("bake", "hill0.obj", "--output-dir", "out/deep", "--samples", 0), "--samples")
    assert not (folder / "out").exists()


@pytest.mark.skipif(os.name == "nt", reason="signals")
def test_an_interrupt_leaves_whole_files_and_says_how_far_it_was(folder):
    for number in range(60):
        (folder / f"more{number}.obj").write_bytes(obj(*hills(30)))
    command = ["bake", "more*.obj", "--output-dir", "out", "--samples", "1024", "--threads", "2"]
    code = [sys.executable, "-c", BEGUN.format(module="obscurance.scenes.bake.batch"), *command]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    with started(code, cwd=folder, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as run:
        assert run.stdout.readline() == "begun\n"
        while len(list((folder / "out").glob("*.ply"))) < 3:
            time.sleep(0.01)
        run.send_signal(signal.SIGTERM)
        _, errors = run.communicate(timeout=60)
    assert run.returncode == 128 + signal.SIGTERM
    found = manifest(folder)
    names = {path.name for path in (folder / "out").iterdir()} - {"manifest.json"}
    assert 3 <= found["done"] == len(names) < 60
    assert names == {f"{each['input'][:-4]}.ply" for each in found["inputs"] if each["status"] == "done"}
    assert f"interrupted: {found['done']} of 60 meshes baked to out; the same command with --resume" in errors
    assert "Traceback" not in errors
