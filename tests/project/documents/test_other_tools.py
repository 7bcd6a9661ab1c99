"""Files that other tools read: GitHub's action, hooks of pre-commit, the citation."""

import os
import subprocess
import sys
import tomllib

import pytest
from project import ROOT

yaml = pytest.importorskip("yaml")


def test_the_action_checks_files(tmp_path):
    steps = yaml.safe_load((ROOT / "action.yml").read_text())["runs"]["steps"]
    script = steps[-1]["run"]
    assert steps[-1]["env"] == {"FILES": "${{ inputs.files }}", "OPTIONS": "${{ inputs.options }}"}
    command = tmp_path / "obscurance"
    command.write_text(f'#!/bin/sh\nexec {sys.executable} {ROOT / "cli.py"} "$@"\n')
    command.chmod(0o755)
    quads = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nf 1 2 3 4\nf 1 5 6 2\n"
    (tmp_path / "quads.obj").write_text(quads)
    subprocess.run([command, "bake", "quads.obj", "-o", "a.ply", "-q", "--samples", "4096"], cwd=tmp_path, check=True)

    def status(files, options):
        environment = os.environ | {"PATH": f"{tmp_path}:{os.environ['PATH']}", "FILES": files, "OPTIONS": options}
        done = subprocess.run(
            ["bash", "-e", "-c", script], cwd=tmp_path, env=environment, capture_output=True, text=True
        )
        return done.returncode, done.stderr

    assert status("*.ply", "--within 0.1")[0] == 0
    assert status("*.ply", "--within 0.01 --falloff binary")[0] == 1
    assert "no match" in status("*.glb", "--within 0.1")[1]


def test_the_hook_is_a_command():
    (hook,) = yaml.safe_load((ROOT / ".pre-commit-hooks.yaml").read_text())
    help_text = subprocess.run([sys.executable, ROOT / "cli.py", *hook["entry"].split()[1:], "-h"], capture_output=True)
    assert help_text.returncode == 0
    assert hook["language"] == "python"


def test_the_citation_and_the_extension_are_of_this_version():
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    manifest = tomllib.loads((ROOT / "blender" / "blender_manifest.toml").read_text())
    assert (manifest["version"], manifest["license"]) == (project["version"], [f"SPDX:{project['license']}"])
    assert {name: str(citation[name]) for name in ("title", "version", "license")} == {
        "title": project["name"], "version": project["version"], "license": project["license"],
    }  # fmt: skip
