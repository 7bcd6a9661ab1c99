"""A rendering, and a page to look at a bake, in one call: `obscurance.render` and `obscurance.view`."""

from __future__ import annotations

import os
import tempfile
import webbrowser
from pathlib import Path
from typing import TYPE_CHECKING, Any

from obscurance import raytrace
from obscurance.raytrace import Camera, Frame, Scene, Settings

from ..asset.asset import Asset
from ..description.mesh_scene import mesh_scene
from ..description.obscurance import with_obscurance
from ..description.read import read_scene
from ..formats.write import write
from .page.view import view_results

if TYPE_CHECKING:
    from obscurance.ao import Bake


def render(
    source: str | os.PathLike[str] | Scene | Bake | Any,
    camera: Camera | None = None,
    settings: Settings | None = None,
    *,
    threads: int | None = None,
) -> Frame:
    """A picture; `save` of the result writes it.

    Args:
        source: a file that `read_scene` reads, whose w is baked for the picture as the command does; a `raytrace.Scene`
            with its w; a bake, w on grey; or a mesh, of
            `load` with what w a bake left in its file, or in any form that `ao.bake` takes.
        camera: in place of the file's own, or of one that frames everything from the front, the right and above.
        settings: in place of the file's own; size, samples, shading.
        threads: by default all cores; the picture is the same.

    Raises: InputError: as `read_scene`, `ao.bake` and `raytrace.render`.
    """
    used = settings or Settings()
    if isinstance(source, str | os.PathLike):
        described = read_scene(source, (used.width, used.height) if settings else None)
        used = settings or described.settings
        scene, _ = with_obscurance(described, threads)
        camera = camera or described.camera
    elif isinstance(source, Scene):
        scene = source
        camera = camera or Camera.framing(scene.flattened(), aspect=used.width / used.height)
    else:
        w = getattr(source, "w", None)
        described = mesh_scene(source if isinstance(source, Asset) else Asset.of(source), used)
        scene = described.scene
        if w is not None:
            scene = scene.with_obscurance(w[described.file_vertices()[0]])
        camera = camera or described.camera
    return raytrace.render(scene, camera, used, threads=threads)


def view(baked: str | os.PathLike[str] | Bake, path: str | os.PathLike[str] | None = None) -> Path:
    """Write the page of a bake, or of a baked file, and return its path.

    Args: path: the page, .html; None: in a new temporary folder, and shown in the browser.

    Raises: InputError: the file cannot be read, or has no w. OutputError.
    """
    target = Path(path or Path(tempfile.mkdtemp()) / "baked.html")
    if isinstance(baked, str | os.PathLike):
        view_results(Path(baked), None, target, None, None)
    else:
        write(target, baked)
    if path is None:
        webbrowser.open(target.resolve().as_uri())
    return target
