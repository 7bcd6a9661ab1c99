"""Commands of the documents are ones that the command line takes: their names, options and values."""

import re
import shlex

import click
import pytest
from project import ROOT
from typer.main import get_command

import cli

PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
BLOCK = re.compile(r"^```(?:sh|bat)\n(.*?)^```", re.DOTALL | re.MULTILINE)
INLINE = re.compile(r"`(obscurance [^`]+)`")
CALL = re.compile(r"(?:^|[\s/'\\])obscurance ([a-z]+(?: .*)?)")
REST_OF_LINE = re.compile(r" (?:#|&&|\||&$).*")
KNOWN = get_command(cli.app).commands
ABBREVIATED = (
    "-h",
    "--json",
    "--install-completion",
    "--options",
)  # of a command that is named alone, or needs its file


def calls(text):
    """The words of each call of obscurance in a page's blocks and between backticks."""
    lines = [*"\n".join(BLOCK.findall(text)).replace("\\\n", " ").splitlines(), *INLINE.findall(text)]
    for line in lines:
        for call in CALL.findall(line):
            call = REST_OF_LINE.sub("", call)
            inside_quotes = call.count("'") % 2
            words = shlex.split(call[: call.rindex("'")] if inside_quotes else call)
            if "…" not in words and not set(ABBREVIATED) & set(words) and len(words) > 1:
                yield words


def parse(words):
    KNOWN[words[0]].make_context(words[0], words[1:])


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_every_command_parses(page):
    for words in calls(page.read_text(encoding="utf-8")):
        try:
            parse(words)
        except (click.ClickException, KeyError) as error:
            pytest.fail(f"obscurance {shlex.join(words)}: {error!r}")


def test_commands_are_found_and_wrong_ones_noticed():
    text = "```sh\nsbatch --wrap 'obscurance bake a.ply \\\n --samples 8 -o b.ply' # x\n```\nas `obscurance view a.ply` does"
    assert list(calls(text)) == [["bake", "a.ply", "--samples", "8", "-o", "b.ply"], ["view", "a.ply"]]
    for wrong in (["bake", "a.ply", "--no-such"], ["bake", "a.ply", "-o", "b.ply", "--occlusion", "auto"]):
        with pytest.raises(click.ClickException):
            parse(wrong)
    assert sum(len(list(calls(page.read_text(encoding="utf-8")))) for page in PAGES) > 80
