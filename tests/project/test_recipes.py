"""Recipes of the documents: shell and YAML parse, and every option that a command has in YAML exists."""

import re
import shlex
import subprocess

import pytest
import yaml
from project import ROOT

from obscurance.scenes.bake.options import BAKE
from obscurance.scenes.commands.render import RENDER

PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
OPTIONS = {"bake": BAKE, "render": RENDER}
COMMAND = re.compile(r"obscurance[ \"',]+(bake|render)\b([^|&)'\"#\n]*)")


def blocks(kind):
    """Blocks of a kind of language, and where they are."""
    fence = re.compile(rf"```{kind}\n(.*?)```", re.DOTALL)
    found = [(page.name, text) for page in PAGES for text in fence.findall(page.read_text())]
    return [pytest.param(text, id=f"{name}-{number}") for number, (name, text) in enumerate(found)]


@pytest.mark.parametrize("text", blocks("sh"))
def test_blocks_are_shell(text):
    done = subprocess.run(["bash", "-n"], input=text, text=True, capture_output=True)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize("text", [text for text in blocks("yaml") if not text.id.startswith("checking")])
def test_manifests_parse_and_mount_what_they_name(text):
    for manifest in yaml.safe_load_all(text):
        assert {"apiVersion", "kind", "metadata", "spec"} <= manifest.keys()
        pod = manifest["spec"].get("template", manifest)["spec"]
        volumes = {volume["name"] for volume in pod.get("volumes", ())}
        for container in pod.get("containers", ()):
            assert {mount["name"] for mount in container["volumeMounts"]} == volumes


@pytest.mark.parametrize("text", blocks("yaml"))
def test_commands_have_the_options(text):
    for command, rest in COMMAND.findall(text.replace("\\\n", " ")):
        known = {name for row in OPTIONS[command] for flag in row.flags for name in flag.split("/")}
        given = {word.partition("=")[0] for word in shlex.split(rest) if re.match(r"--?[a-zA-Z]", word)}
        assert given <= known | {"-o", "-q", "-h"}, command
