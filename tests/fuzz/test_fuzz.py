"""Damaged files of every format are refused in one line or accepted: no crash, hang, traceback, or stray file.

Each finding prints its number; `python tests/helpers/fuzz/fuzz_worker.py SEED INDEX` repeats it alone.
"""

import subprocess
import sys

import fuzz_commands
import fuzz_worker
import fuzzing
import pytest

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="limits by /proc and RLIMIT_AS")


def report(findings, seed):
    return "\n".join(f"fuzz_worker.py {seed} {each['index']}: {each['finding']}" for each in findings)


def test_damaged_files():
    findings, counts, _ = fuzzing.run(380, "short", processes=1)
    assert not findings, report(findings, "short")
    assert sum(map(sum, (each.values() for each in counts.values()))) == 380
    assert all(each["refused"] for family, each in counts.items() if family != "mtl")  # whatever is none is left out
    assert sum(each["accepted"] for each in counts.values()) > 18


@pytest.mark.slow
def test_very_many_damaged_files():
    findings, counts, most = fuzzing.run()
    print(fuzzing.table(counts, most))
    assert not findings, report(findings, "0")


@pytest.mark.slow
def test_very_many_damaged_files_through_the_commands():
    findings, counts, most = fuzzing.run(15_000, "commands")
    print(fuzzing.table(counts, most))
    assert not findings, report(findings, "commands")


@pytest.mark.parametrize(
    ("status", "output", "errors", "makes", "finding"),
    [
        (1, "", "Traceback (most recent call last):\n", "", "status 1"),
        (0, "", "a.py:1: RuntimeWarning: overflow\n", "page.html", "RuntimeWarning"),
        (0, "", "", "", "page.html is there: False"),
        (2, "", "obscurance: a: expected b, got c\n", "page.html", "page.html is there: True"),
        (0, "", "", ".obscurance-12.part", "left"),
        (2, "", "obscurance: a\nb\n", "", "no one line"),
        (2, "some rows\n", "obscurance: a\n", "", "no one line"),
        (2, "", f"obscurance: {'x' * 2000}\n", "", "not a line for people"),
        (2, "", "obscurance: \x1b[31m\n", "", "not a line for people"),
    ],
)
def test_the_check_of_commands_notices(tmp_path, status, output, errors, makes, finding):
    def command(*arguments):
        if makes:
            (tmp_path / makes).write_text("x")
        return subprocess.CompletedProcess(arguments, status, output, errors)

    with pytest.raises(fuzz_worker.Finding, match=finding):
        fuzz_commands.checked_command(["view", "m.ply"], tmp_path / "page.html", tmp_path, command)


def hostile(step):
    """A target that does something that it must not."""

    def consume(family, path, made, index):
        step(path)

    return consume


@pytest.fixture
def checked(tmp_path):
    """A function: the worker's check of a step."""
    inside = tmp_path / "inside"
    inside.mkdir()
    path = inside / "m.ply"
    path.write_bytes(b"x")

    return lambda step: fuzz_worker.checked("ply", path, tmp_path, 0, [], hostile(step))


def refuse(text):
    from obscurance.raytrace.errors import InputError

    def step(path):
        raise InputError(str(path) if text is None else text, "a", "b", "c")

    return step


def ramble(path):
    from obscurance.raytrace.errors import LINE, InputError

    error = InputError(path, "a", "b", "c")
    error.args = (f"{path}: ".ljust(LINE + 1, "x"),)
    raise error


def test_clear_refusals_pass(checked):
    message, _, _ = checked(refuse(None))
    assert message.endswith("m.ply: a: expected b, got c")


@pytest.mark.parametrize(
    ("step", "finding"),
    [
        (lambda path: {}["a"], "KeyError"),
        (lambda path: sys.exit(), "SystemExit"),
        (lambda path: bytearray(1 << 27).find(b"\1"), "MiB for 1 bytes"),
        (refuse("elsewhere"), "names no file"),
        (ramble, "a message of"),
    ],
)
def test_what_a_step_must_not_do_is_a_finding(checked, step, finding):
    with pytest.raises(fuzz_worker.Finding, match=finding):
        checked(step)
