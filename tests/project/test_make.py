"""`make` finds a Python that serves, the newest first, and says which; it is stopped before it would install."""

import shutil
import stat
import subprocess
import sys
import tomllib

import pytest
from project import ROOT

pytestmark = pytest.mark.skipif(shutil.which("make") is None, reason="needs make")
PYTHON = """#!/bin/sh
case "$2" in
    *ensurepip*) exit {status} ;;
    *version.split*) echo Python of {name} ;;
    *) echo "would run $*" && exit 3 ;;
esac
"""


@pytest.fixture
def make(tmp_path):
    """Calls `make install` where these Pythons are all that is found, by name, with whether each is suitable."""

    def run(pythons, *arguments):
        folder = tmp_path / "bin"
        folder.mkdir()
        (tmp_path / ".venv" / "bin").mkdir(parents=True)
        for tool in ("sh", "echo"):
            (folder / tool).symlink_to(shutil.which(tool))
        for name, suitable in pythons.items():
            path = folder / name if "/" not in name else tmp_path / name
            path.write_text(PYTHON.format(status=int(not suitable), name=name))
            path.chmod(path.stat().st_mode | stat.S_IXUSR)
        shutil.copy(ROOT / "Makefile", tmp_path)
        (tmp_path / "pyproject.toml").touch()
        words = [shutil.which("make"), "-C", tmp_path, "install", *arguments]
        return subprocess.run(words, capture_output=True, text=True, check=False, env={"PATH": str(folder)})

    return run


@pytest.mark.parametrize(
    ("pythons", "arguments", "chosen"),
    [
        ({"python3.11": True, "python3.13": True}, [], "python3.13"),
        ({"python3.14": False, "python3.12": True, "python3": True}, [], "python3.12"),
        ({"python3": True}, [], "python3"),
        ({"python3.13": True, ".venv/bin/python": True}, [], ".venv/bin/python"),
        ({"python3.13": True, "python3.11": True}, ["PYTHON=python3.11"], "python3.11"),
    ],
)
def test_the_newest_suitable_python_is_taken_and_named(make, pythons, arguments, chosen):
    done = make(pythons, *arguments)
    assert f"Python of {chosen}\n" in done.stdout
    assert "would run -m venv" in done.stdout


@pytest.mark.parametrize(
    ("pythons", "arguments", "got"), [({"python3": False}, [], "none"), ({}, ["PYTHON=/no/python"], "/no/python")]
)
def test_without_one_a_line_says_what_is_expected(make, pythons, arguments, got):
    done = make(pythons, *arguments)
    assert done.returncode == 2
    assert f"expected Python 3.11 to 3.14 with its venv module, got {got}; set PYTHON=" in done.stderr
    assert "would run" not in done.stdout


def test_make_the_package_and_continuous_integration_support_the_same_versions():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    versions = [name.rsplit(" ", 1)[1] for name in project["classifiers"] if " :: 3." in name]
    assert project["requires-python"] == f">={versions[0]},<3.{int(versions[-1][2:]) + 1}"
    low, high = (version.replace(".", ", ") for version in (versions[0], versions[-1]))
    assert f"({low}) <= sys.version_info[:2] <= ({high})" in (ROOT / "Makefile").read_text()
    assert f"python: {versions}".replace("'", '"') in (ROOT / ".github/workflows/ci.yml").read_text()
    assert f"{sys.version_info[0]}.{sys.version_info[1]}" in versions


def test_no_tracked_file_is_larger_than_a_megabyte():
    """The repository holds sources, and results and pictures that pages show: nothing that an installation fetches."""
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=False)
    if listed.returncode != 0:
        pytest.skip("not a checkout of git")
    paths = [ROOT / name for name in listed.stdout.split("\0") if name]
    assert [str(path) for path in paths if path.exists() and path.stat().st_size > 1_000_000] == []
