"""Files appear whole or not at all."""

import json
import os
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import pytest
from project import ROOT

from obscurance.raytrace.errors import OutputError
from obscurance.raytrace.system.atomic import atomic_write, check_writable, write_json


def names(folder):
    return sorted(entry.name for entry in folder.iterdir())


def test_the_content_appears_when_the_block_ends(tmp_path):
    target = tmp_path / "w.npy"
    with atomic_write(target) as file:
        file.write(b"all of it")
        assert not target.exists()
    assert target.read_bytes() == b"all of it"
    assert names(tmp_path) == ["w.npy"]


@pytest.mark.parametrize("failure", [KeyboardInterrupt, ValueError, MemoryError])
def test_a_failing_block_leaves_an_existing_file_and_nothing_else(tmp_path, failure):
    target = tmp_path / "w.npy"
    target.write_bytes(b"before")

    def interrupted():
        with atomic_write(target) as file:
            file.write(b"half")
            raise failure

    with pytest.raises(failure):
        interrupted()
    assert target.read_bytes() == b"before"
    assert names(tmp_path) == ["w.npy"]


@pytest.mark.parametrize("call", ["fsync", "replace"])
def test_a_full_disk_is_one_line_and_leaves_an_existing_file(tmp_path, fail_call, call):
    target = tmp_path / "w.npy"
    target.write_bytes(b"before")
    fail_call(call)
    with pytest.raises(OutputError) as error, atomic_write(target) as file:
        file.write(b"half")
    assert str(error.value) == f"{target}: cannot write: No space left on device"
    assert target.read_bytes() == b"before"
    assert names(tmp_path) == ["w.npy"]


@pytest.mark.skipif(os.name == "nt", reason="POSIX limits")
@pytest.mark.parametrize("size", [10, 10_000_000])
def test_a_write_the_system_refuses(tmp_path, size):
    """The error may come from the write itself or, for a small one, from the flush."""
    import resource

    unlimited = resource.getrlimit(resource.RLIMIT_FSIZE)

    def write():
        with atomic_write(tmp_path / "w.npy") as file:
            file.write(bytes(size))

    resource.setrlimit(resource.RLIMIT_FSIZE, (5, unlimited[1]))
    try:
        with pytest.raises(OutputError, match="File too large"):
            write()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, unlimited)
    assert names(tmp_path) == []


@pytest.mark.skipif(os.name == "nt", reason="POSIX modes")
@pytest.mark.parametrize(("mask", "mode"), [(0o022, 0o644), (0o077, 0o600), (0o002, 0o664)])
def test_the_mode_is_the_umasks(tmp_path, mask, mode):
    before = os.umask(mask)
    try:
        with atomic_write(tmp_path / "w.npy") as file:
            file.write(b"x")
    finally:
        os.umask(before)
    assert (tmp_path / "w.npy").stat().st_mode & 0o777 == mode


def test_a_link_keeps_pointing_at_the_file_it_names(tmp_path):
    (tmp_path / "real").mkdir()
    link = tmp_path / "link.npy"
    link.symlink_to(tmp_path / "real" / "w.npy")
    with atomic_write(link) as file:
        file.write(b"x")
    assert link.is_symlink()
    assert (tmp_path / "real" / "w.npy").read_bytes() == b"x"


def test_a_name_as_long_as_the_system_allows(tmp_path):
    with atomic_write(tmp_path / ("n" * 255)) as file:
        file.write(b"x")
    assert names(tmp_path) == ["n" * 255]


def unwritable(tmp_path):
    (tmp_path / "folder").mkdir()
    (tmp_path / "file").write_bytes(b"")
    (tmp_path / "null.npy").symlink_to(os.devnull)
    return {
        "folder": "it is a folder",
        "missing/w.npy": "there is no folder",
        "file/w.npy": "there is no folder",
        "n" * 256: "too long",
        "null.npy": "not a regular file",
    }


@pytest.mark.parametrize("kind", range(5))
def test_targets_that_cannot_be_written_are_refused_before_and_during(tmp_path, kind):
    name, reason = list(unwritable(tmp_path).items())[kind]
    before = names(tmp_path)
    with pytest.raises(OutputError, match=reason) as early:
        check_writable(tmp_path / name)
    with pytest.raises(OutputError, match=reason) as late, atomic_write(tmp_path / name):
        pass
    assert str(early.value) == str(late.value)
    assert str(early.value).startswith(str(tmp_path / name))
    assert "\n" not in str(early.value)
    assert names(tmp_path) == before


@pytest.mark.skipif(not os.path.isdir("/proc/self"), reason="needs a folder that refuses files even to root")
def test_a_folder_that_refuses_files():
    with pytest.raises(OutputError, match=r"/proc/self/w\.npy: cannot write: "):
        check_writable("/proc/self/w.npy")


def open_files(folder):
    """The files in a folder, deleted ones too, that this process has open, as Linux lists them."""
    found = []
    for descriptor in Path("/proc/self/fd").glob("*"):
        with suppress(OSError):  # that of the listing itself
            found.append(os.readlink(descriptor))
    return [name for name in found if name.startswith(str(folder))]


def test_checking_leaves_nothing_and_touches_nothing(tmp_path):
    target = tmp_path / "w.npy"
    check_writable(target)
    assert not open_files(tmp_path)
    assert names(tmp_path) == []
    target.write_bytes(b"before")
    check_writable(target)
    assert target.read_bytes() == b"before"


def test_json_is_written_whole_or_not_at_all(tmp_path):
    target = tmp_path / "r.json"
    write_json(target, {"a": [1, 2.5], "β": None})
    assert json.loads(target.read_text()) == {"a": [1, 2.5], "β": None}
    before = target.read_bytes()
    with pytest.raises(ValueError, match="JSON"):
        write_json(target, {"a": float("nan")})
    assert target.read_bytes() == before
    assert names(tmp_path) == ["r.json"]


KILLED = """
import os, signal, sys
from obscurance.raytrace.system.atomic import atomic_path, atomic_write
with {call}(sys.argv[1]) as made:
    print("writing", flush=True)
    {then}
"""
KILL, WAIT = "os.kill(os.getpid(), signal.SIGKILL)", "sys.stdin.read()"


def writer(call, then, target):
    command = [sys.executable, "-c", KILLED.format(call=call, then=then), str(target)]
    return subprocess.Popen(command, cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)


@pytest.mark.skipif(os.name == "nt", reason="locks")
@pytest.mark.parametrize("call", ["atomic_write", "atomic_path"])
def test_what_a_killed_process_left_is_removed_but_not_what_another_is_writing(tmp_path, call):
    with writer(call, KILL, tmp_path / "w.npy") as killed:
        assert killed.wait() == -9
    with writer(call, WAIT, tmp_path / "other.npy") as alive:
        assert alive.stdout.readline() == "writing\n"
        (left,) = names(tmp_path)  # the killed one's is gone
        check_writable(tmp_path / "w.npy")
        with atomic_write(tmp_path / "w.npy") as file:
            file.write(b"whole")
        assert names(tmp_path) == [left, "w.npy"]
        alive.communicate()
    assert names(tmp_path) == ["other.npy", "w.npy"]
