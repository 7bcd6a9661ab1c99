"""Files of others are drawn evenly, and what is no refusal in one line counts as a fault."""

import subprocess
import tarfile
import zipfile
from pathlib import Path

import pytest
from command import obscurance

from benchmarks import foreign


def test_files_are_drawn_in_turn_of_origin_and_ending(tmp_path):
    for name in [*(f"a/{number}.obj" for number in range(9)), "a/deep/x.stl", "b/y.PLY", "b/large.ply", "b/z.txt"]:
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(name * (9 if "large" in name else 1))
    (tmp_path / "b/zz.ply").write_text("b/y.PLY")
    found = foreign.drawn(tmp_path, 5, seed=1, largest=50)
    names = [path.relative_to(tmp_path).as_posix() for path in found]
    assert len(set(names)) == 5
    assert {names[0][:2], *names[1:3]} == {"a/", "a/deep/x.stl", "b/y.PLY"}
    assert names == [p.relative_to(tmp_path).as_posix() for p in foreign.drawn(tmp_path, 5, seed=1, largest=50)]
    assert len(foreign.drawn(tmp_path, 99, seed=1, largest=50)) == 11


def test_packages_are_unpacked_once(tmp_path, monkeypatch):
    monkeypatch.setattr("sys.argv", ["foreign", str(tmp_path), "9"])
    with pytest.raises(SystemExit, match=r"^/.*: expected packages or folders that hold files in .*, got none$"):
        foreign.main()
    with zipfile.ZipFile(tmp_path / "robots-1.0-py3-none-any.whl", "w") as wheel:
        wheel.writestr("robots/arm.stl", "solid")
    (tmp_path / "m.off").write_text("OFF")
    with tarfile.open(tmp_path / "models_v2.tar.xz", "w:xz") as package:
        package.add(tmp_path / "m.off", "package/m.off")
    for _ in range(2):
        foreign.unpack(tmp_path)
    found = foreign.drawn(tmp_path, 9, seed=1, largest=50)
    assert {path.relative_to(tmp_path).parts[0] for path in found} == {"robots", "m.off"}
    assert (tmp_path / "models/package/m.off").read_text() == "OFF"


def test_refusals_and_faults_are_told_apart(tmp_path, monkeypatch):
    (tmp_path / "m.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")

    def in_this_process(command, cwd, **_):
        monkeypatch.chdir(cwd)
        return obscurance(*command[3:])

    monkeypatch.setattr(subprocess, "run", in_this_process)
    found = foreign.tried(tmp_path / "m.obj")
    assert found.pop("image") == "refused"  # it has no texture coordinates
    assert set(found.values()) == {"done"}
    ended = subprocess.CompletedProcess([], 1, "", "warning: a\nTraceback (most recent call last):\nValueError: b\n")
    monkeypatch.setattr(subprocess, "run", lambda *_, **__: ended)
    assert foreign.tried(tmp_path / "m.obj")["info"].endswith("ValueError: b")
    assert "view" not in foreign.tried(tmp_path / "m.obj")

    def refused_late(command, cwd, **_):
        (Path(cwd) / "half").write_text("")
        return subprocess.CompletedProcess(command, 2, "", "obscurance: no\n")

    monkeypatch.setattr(subprocess, "run", refused_late)
    assert foreign.tried(tmp_path / "m.obj")["info"] == "obscurance: no"
