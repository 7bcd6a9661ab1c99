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


def unlisted_kernels():
    """The project's kernels that this process has loaded and that are not in the list."""
    from raytrace.kernel import build, jit

    loaded = {line for line in jit.loaded if line.startswith(("raytrace.", "ao.", "scenes."))}
    return loaded.difference(build.LIST.read_text().splitlines())
