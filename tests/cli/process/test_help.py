"""`--help`, `--version` and completion in a shell."""

import os

import pytest
from command import obscurance, process
from typer.main import get_command

from cli import app
from scenes.bake.options import BAKE


@pytest.mark.parametrize("arguments", [(), ("-h",), ("--help",)])
def test_help_of_the_whole(arguments):
    result = obscurance(*arguments)
    assert (result.returncode, result.stderr) == (0, "")
    assert result.stdout.startswith("Usage: obscurance [OPTIONS] COMMAND")
    assert result.stdout.count("\n") > 10
    assert "..." not in result.stdout.split("Commands:")[1]  # no sentence cut short


def test_help_of_every_command():
    listed = obscurance().stdout.split("Commands:\n")[1].split("\n\n")[0]
    commands = [line.split()[0] for line in listed.splitlines()]
    assert "bake" in commands
    for command in commands:
        short, long = (obscurance(command, flag) for flag in ("-h", "--help"))
        assert short.returncode == 0
        assert short.stdout == long.stdout
        assert short.stdout.isascii()
        assert short.stdout.startswith(f"Usage: obscurance {command}")


def test_the_help_of_bake_has_a_place_for_every_option_and_examples_that_work(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shown = obscurance("bake", "--help").stdout
    assert [str(item.name) for item in get_command(app).commands["bake"].params] == [row.name for row in BAKE]
    for title in ("Arguments", "Options", *(row.section for row in BAKE if row.section)):
        assert shown.count(f"\n{title}:\n") == 1
    for option in ("--output-dir", "--falloff", "--size", "--options", "--quiet"):
        assert shown.count(f"  {option} ") + shown.count(f", {option} ") == 1
    examples = [line.split()[1:] for line in shown.splitlines() if line.startswith("    obscurance ")]
    assert len(examples) >= 3
    for words in examples:
        result = obscurance(*(word.strip("'") for word in words))
        assert "file: expected an existing file" in result.stderr or "which matches none" in result.stderr


def test_the_version():
    result = obscurance("--version")
    assert result.returncode == 0
    lines = dict(line.split(maxsplit=1) for line in result.stdout.splitlines())
    assert list(lines) == ["obscurance", "Embree", "CPU", "Python"]
    assert lines["Embree"].startswith("4.")
    assert "lanes of float32" in lines["CPU"]


def test_a_shell_completes_commands_options_and_choices():
    for words, count, expected in (
        ("obscurance be", 1, "bench"),
        ("obscurance bake --fal", 2, "--falloff"),
        ("obscurance bake --falloff b", 3, "binary"),
        ("obscurance render a.ply --shading g", 4, "gouraud"),
        ("obscurance scenes cor", 2, "cornell"),
        ("obscurance materials red_p", 2, "red_plastic"),
    ):
        asked = {"_OBSCURANCE_COMPLETE": "complete_bash", "COMP_WORDS": words, "COMP_CWORD": str(count)}
        assert process(env={**os.environ, **asked}).stdout.split() == [expected]
