"""The repository holds sources and the results and pictures that pages show, nothing that an installation fetches."""

import subprocess

import pytest
from project import ROOT

LARGEST = 1_000_000


def test_no_tracked_file_is_larger_than_a_megabyte():
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True)
    if listed.returncode != 0:
        pytest.skip("not a checkout of git")
    paths = [ROOT / name for name in listed.stdout.split("\0") if name]
    assert [str(path) for path in paths if path.exists() and path.stat().st_size > LARGEST] == []
