"""Commands of the documents are ones that the command line takes: their names, options and values."""

import re
import shlex
import tomllib

import click
import pytest
from project import ROOT

from obscurance import cli

PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
BLOCK = re.compile(r"^```(?:sh|bat)\n(.*?)^```", re.DOTALL | re.MULTILINE)
INLINE = re.compile(r"`(obscurance [^`]+)`")
CALL = re.compile(r"(?:^|[\s/'\\])obscurance ([a-z]+(?: .*)?)")
REST_OF_LINE = re.compile(r" (?:#|&&|\||&$).*")
VARIABLE = re.compile(r"\$\w+")  # of the shell
PARTIAL = ("-h", "--json", "--options")  # a command without its file, or one that needs it
KNOWN = cli.commands.commands


def calls(text):
    """The words of each call of obscurance in a page's blocks and between backticks."""
    lines = [*"\n".join(BLOCK.findall(text)).replace("\\\n", " ").splitlines(), *INLINE.findall(text)]
    for line in lines:
        for call in CALL.findall(line):
            call = VARIABLE.sub("1", REST_OF_LINE.sub("", call))
            inside_quotes = call.count("'") % 2
            words = shlex.split(call[: call.rindex("'")] if inside_quotes else call)
            if "…" not in words and not set(PARTIAL) & set(words) and len(words) > 1:
                yield words


CALLS = [(page.name, words) for page in PAGES for words in calls(page.read_text(encoding="utf-8"))]


def parse(words):
    """Parse below the group, as the program does: a command keeps the names of help that it is first asked with."""
    above = click.Context(cli.commands, **cli.commands.context_settings)
    KNOWN[words[0]].make_context(words[0], words[1:], parent=above)


@pytest.mark.parametrize(("page", "words"), CALLS, ids=[f"{page}: {shlex.join(words)}" for page, words in CALLS])
def test_a_command_parses(page, words):
    parse(words)


def test_what_is_to_be_installed_is_on_an_index_and_every_extra_stands_in_the_table():
    """The package itself is none of it."""
    pages = "".join(page.read_text(encoding="utf-8") for page in PAGES)
    assert pages.count("python -m pip install") > 8
    code = "".join(
        path.read_text("utf-8") for part in ("ao", "raytrace", "scenes") for path in (ROOT / part).rglob("*.py")
    )
    assert "pip install 'obscurance" not in pages + code
    assert not re.findall("(?<!python -m )pip install", pages)
    table = (ROOT / "docs" / "installation.md").read_text(encoding="utf-8").split("## Extras")[1].split("\n## ")[0]
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    for name in ("formats", "terrain", "cluster", "unwrap"):
        assert f"'.[{name}]'" in table
        for package in extras[name]:
            assert re.match("[A-Za-z]+", package)[0] in table


def test_pages_after_the_readme_call_the_command_in_one_way():
    for page in PAGES[1:]:
        calls_by_path = re.findall(r"\.venv/bin/obscurance|python -m obscurance", page.read_text(encoding="utf-8"))
        assert not calls_by_path or page.name == "installation.md", page.name
