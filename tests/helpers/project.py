"""Folders of the project, and the environment of processes that import it and these helpers."""

import os
from pathlib import Path

HELPERS = Path(__file__).resolve().parent
ROOT = HELPERS.parent.parent


def environment(**variables):
    """This process's environment with these folders on the path of imports, and `variables`."""
    folders = [folder for folder in HELPERS.iterdir() if folder.is_dir() and folder.name != "__pycache__"]
    path = [*map(str, (ROOT, HELPERS, *sorted(folders))), *filter(None, [os.environ.get("PYTHONPATH")])]
    return {**os.environ, "PYTHONPATH": os.pathsep.join(path), **variables}


def hide_compiler(monkeypatch):
    """Let kernels come from the library alone, as in a copy that is installed without Numba."""
    monkeypatch.setattr("obscurance.raytrace.kernel.jit.find_spec", lambda name: None)
