"""`obscurance view`: a page of baked files; a mesh in which no bake has left w is baked first, for a look."""

import webbrowser
from pathlib import Path

from obscurance.raytrace.errors import SceneError
from obscurance.raytrace.system.checks import check_ending

from ..bake.console import note
from ..bake.options import BakeOptions
from ..formats.stored_w import ENDINGS, read_w
from ..formats.table import format_of
from ..show.page.view import view_results
from .bake import run_bake

_TOLERANCE = 0.02  # of w that is only looked at


def run_view(
    result: Path, other: Path | None, output: Path | None, mesh: Path | None, up: str | None, open: bool, quiet: bool
) -> None:
    """Write the page, print a line, and open it in the browser if it is to `open`. Args: as of `view_results`."""
    if other is None and mesh is None and _is_unbaked(result):
        target = output or result.with_suffix(".html")
        check_ending("output", target, ".html")
        run_bake(BakeOptions(mesh=[result], output=target, tolerance=_TOLERANCE, up=up, quiet=quiet))
        if not quiet:
            note(f"{result}: there is no w in it; it was baked with --tolerance {_TOLERANCE:g}, for a look")
        if open:
            webbrowser.open(target.resolve().as_uri())
        return
    summary = view_results(result, other, output, mesh, up, open)
    if not quiet:
        print(summary)


def _is_unbaked(path: Path) -> bool:
    """Whether a file is a mesh without w, or may be."""
    if not format_of(path).read:
        return False
    if path.suffix.lower() not in ENDINGS:
        return path.is_file()
    try:
        read_w(path)
    except SceneError as fault:
        return fault.field == "w" and fault.got == "none"
    return False
