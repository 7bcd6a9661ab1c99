"""`obscurance view`: from baked files to a page."""

import webbrowser
from pathlib import Path

from raytrace.errors import printable
from raytrace.system.atomic import atomic_write
from raytrace.system.outputs import check_ending, check_outputs

from .document import html_of_bakes
from .results import check_results, read_results


def view_results(
    result: Path, other: Path | None, output: Path | None, mesh: Path | None, up: str | None, show: bool = False
) -> str:
    """Write the page of one bake, or of two with a slider between, and return a line about it.

    Args:
        output: by default beside `result` and with its name. mesh: what `.npy` and `.npz` belong to.
        up: in place of `Mesh.up`. show: open it in a browser.

    Raises:
        OptionError: a name of another kind of file. OutputError: the page cannot be written.
        MeshError, SceneError: as `read_results`.
    """
    results = [result] if other is None else [result, other]
    check_results(results, mesh)
    name = "-".join(path.stem for path in results) + ".html"
    target = result.with_name(name) if output is None else output
    check_ending("output", target, ".html")
    check_outputs({"--output": target}, [*results, *([mesh] if mesh else [])])
    read = read_results(results, mesh)
    check_outputs({"--output": target}, read.files)
    title = " and ".join(path.name for path in results)
    page = html_of_bakes(read.mesh, read.bakes, title, up, read.base)
    with atomic_write(target) as file:
        file.write(page)
    if show:
        webbrowser.open(target.resolve().as_uri())
    return printable(f"{target}: {len(read.mesh.vertices):,} vertices, {len(page) / 1e6:.2f} MB; open it in a browser")
