"""Damaged files of every format are refused in one line or accepted: no crash, hang, traceback, or stray file.

Each finding prints its number; `python tests/helpers/fuzz_worker.py SEED INDEX` repeats it alone.
"""

import sys

import fuzz_mutations
import fuzz_seeds
import fuzz_worker
import fuzzing
import pytest

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="limits by /proc and RLIMIT_AS")


def report(findings, seed):
    return "\n".join(f"fuzz_worker.py {seed} {each['index']}: {each['finding']}" for each in findings)


def test_damaged_files():
    findings, counts, _ = fuzzing.run(1600, "short", batch=800)
    assert not findings, report(findings, "short")
    assert sum(map(sum, (each.values() for each in counts.values()))) == 1600
    assert all(each["refused"] for each in counts.values())
    assert sum(each["accepted"] for each in counts.values()) > 100


@pytest.mark.slow
def test_very_many_damaged_files():
    findings, counts, most = fuzzing.run()
    print(fuzzing.table(counts, most))
    assert not findings, report(findings, "0")


def test_the_same_number_is_the_same_file():
    for index in range(2 * len(fuzz_seeds.seeds())):
        family = fuzz_worker.family_of(index)
        first, second = (fuzz_mutations.spoiled(family, fuzz_worker.random_of("a", index)) for _ in range(2))
        assert first == second


def hostile(step):
    """A target that does something that it must not."""

    def consume(family, path, made, index):
        step(path)

    return consume


@pytest.fixture
def judge(tmp_path, monkeypatch):
    """How the worker judges a step."""
    inside = tmp_path / "inside"
    inside.mkdir()
    path = inside / "m.ply"
    path.write_bytes(b"x")

    def judge(step):
        monkeypatch.setattr(fuzz_worker, "consume", hostile(step))
        return fuzz_worker.checked("ply", path, tmp_path, 0, [])

    return judge


def refuse(text):
    from raytrace.errors import InputError

    def step(path):
        raise InputError(str(path) if text is None else text, "a", "b", "c")

    return step


def ramble(path):
    from raytrace.errors import LINE, InputError

    error = InputError(path, "a", "b", "c")
    error.args = (f"{path}: ".ljust(LINE + 1, "x"),)
    raise error


def test_the_judge_lets_clear_refusals_pass(judge):
    message, _, _ = judge(refuse(None))
    assert message.endswith("m.ply: a: expected b, got c")


@pytest.mark.parametrize(
    ("step", "finding"),
    [
        (lambda path: {}["a"], "KeyError"),
        (lambda path: sys.exit(), "SystemExit"),
        (lambda path: bytearray(1 << 30).find(b"\1"), "MiB for 1 bytes"),
        (refuse("elsewhere"), "names no file"),
        (ramble, "a message of"),
    ],
)
def test_the_judge_notices(judge, step, finding):
    with pytest.raises(fuzz_worker.Finding, match=finding):
        judge(step)


@pytest.mark.parametrize(
    ("step", "finding"),
    [
        ("os.kill(os.getpid(), 11)", "SIGSEGV"),
        ("while True: pass", "SIGPROF"),
        ("open(path.parent.parent / 'secret.bin').close()", "secret.bin"),
        ("print('loose words')", "loose words"),
        ("bytearray(1 << 33)", "MemoryError"),
    ],
)
def test_the_driver_notices(tmp_path, monkeypatch, step, finding):
    worker = tmp_path / "worker.py"
    lines = [
        "import os, sys",
        "import fuzz_worker",
        "fuzz_worker.SECONDS = 0.3",
        "fuzz_worker.warm = lambda inside, made: None",
        "def consume(family, path, made, index):",
        f"    {step}",
        "fuzz_worker.consume = consume",
        "fuzz_worker.main(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]), os.open(sys.argv[4], os.O_WRONLY))",
    ]
    worker.write_text("\n".join(lines))
    monkeypatch.setattr(fuzzing, "WORKER", worker)
    findings, _, _ = fuzzing.run(2, "x", 1)
    assert [each["index"] for each in findings] == [0, 1]
    assert all(finding in each["finding"] for each in findings), findings
