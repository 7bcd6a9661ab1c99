"""`--help`, `--version` and completion in a shell."""

import os
import re

import pytest
from command import obscurance, process, succeeded

from obscurance.cli import commands
from obscurance.scenes.bake.options import BAKE


@pytest.mark.parametrize("arguments", [(), ("-h",), ("--help",)])
def test_help_of_the_whole(arguments):
    result = obscurance(*arguments)
    assert (result.returncode, result.stderr) == (0, "")
    assert result.stdout.startswith("Usage: obscurance [OPTIONS] [COMMAND]")
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


def test_the_help_of_bake_begins_with_examples_that_work_and_has_a_place_for_every_option(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    few, every = (obscurance("bake", *words).stdout for words in (["-h"], ["--help", "all"]))
    assert [str(item.name) for item in commands.commands["bake"].params] == [row.name for row in BAKE]
    matter = [row for row in BAKE if not row.section and not row.is_argument]
    assert len(matter) == 10
    for row in BAKE[1:]:
        flag = re.compile(rf"^  (-\w, )?{row.flags[0].split('/')[0]} ", re.MULTILINE)
        assert len(flag.findall(every)) == 1
        assert len(flag.findall(few)) == (row in matter)
    titles = [row.section for row in BAKE if row.section]
    for title in ("Positional arguments", "Options", *titles):
        assert every.count(f"\n{title}:\n") == 1
        assert few.count(f"\n{title}:\n") == (title not in titles)
    assert few.endswith(f"\n{len(BAKE) - 1 - len(matter)} more options: obscurance bake -h all\n")
    assert few.index("Examples") < few.index("Options:")
    examples = [line.split()[1:] for line in few.splitlines() if line.startswith("    obscurance ")]
    assert len(examples) >= 3
    for words in examples:
        result = obscurance(*(word.strip("'") for word in words))
        assert "file: expected an existing file" in result.stderr or "which matches none" in result.stderr


def test_the_version():
    result = succeeded("--version")
    lines = dict(line.split(maxsplit=1) for line in result.stdout.splitlines())
    assert list(lines) == ["obscurance", "Embree", "CPU", "Python"]
    assert lines["Embree"].startswith("4.")
    assert "lanes of float32" in lines["CPU"]


def test_a_shell_completes_commands_options_and_choices():
    for words, count, expected in (
        ("obscurance be", 1, "plain,bench"),
        ("obscurance bake --fal", 2, "plain,--falloff"),
        ("obscurance bake --falloff b", 3, "plain,binary"),
        ("obscurance render a.ply --shading g", 4, "plain,gouraud"),
        ("obscurance render a.ply --alpha i", 4, "plain,ignore"),
        ("obscurance scenes cor", 2, "plain,cornell"),
        ("obscurance materials red_p", 2, "plain,red_plastic"),
    ):
        asked = {"_OBSCURANCE_COMPLETE": "bash_complete", "COMP_WORDS": words, "COMP_CWORD": str(count)}
        assert process(env={**os.environ, **asked}).stdout.split() == [expected]
