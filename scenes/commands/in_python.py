"""`obscurance.bake`, `render` and `view`: what the commands do, in Python, of files or of what is in memory."""

from __future__ import annotations

import os
import tempfile
import webbrowser
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from obscurance import raytrace
from obscurance.ao.declared import known_names
from obscurance.ao.falloff import Falloffs, Length, falloffs_of
from obscurance.ao.options import At, BackFaces, Interior, Method, Normals, Weight
from obscurance.raytrace.errors import ConflictError
from obscurance.raytrace.types import Bools

from ..asset.asset import Asset
from ..bake.inputs import read_inputs
from ..bake.options import BAKE, ROWS, Alpha, BakeOptions, OccludedBy, Up, check_together
from ..bake.plan import plan_bake
from ..bake.vertices import bake_inputs
from ..show.progress import in_notebook
from ..show.progress import progress as shown_progress

if TYPE_CHECKING:
    from obscurance.ao import Bake
    from obscurance.ao.execute.kept import Kept
    from obscurance.ao.execute.tracer import Progress
    from obscurance.raytrace import Camera, Frame, Settings
    from obscurance.raytrace.mesh.mesh import Mesh

Surface = str | os.PathLike[str] | Any
"""A mesh in any form that `ao.bake` takes, or the name of its file."""
_IN_MEMORY = Path("w.npz")  # holds all that a bake can have


@known_names
def bake(
    mesh: Surface,
    falloff: Falloffs = None,
    samples: int | None = None,
    seed: int = 0,
    threads: int | None = None,
    normals: Normals = "file",
    *,
    half_distance: Length | None = None,
    max_distance: Length = "inf",
    tau: float | None = None,
    ground: float | bool | Literal["auto"] | None = None,
    occluder: Surface | list[Surface] | None = None,
    receive: str | Sequence[str] | None = None,
    cast: str | Sequence[str] | None = None,
    exclude: str | Sequence[str] | None = None,
    occluded_by: OccludedBy = "all",
    points: bool = False,
    flip: bool = False,
    alpha: Alpha = "auto",
    up: Up | None = None,
    high: Surface | list[Surface] | None = None,
    match_names: bool = False,
    cage: Length | Mesh | Any | None = None,
    progress: bool | Literal["bar", "json"] | Progress | None = None,
    tolerance: float | None = None,
    denoise: bool = True,
    interior: Interior = "auto",
    thickness: bool = False,
    spread: float = 180.0,
    weight: Weight = "cosine",
    back_faces: BackFaces = "occlude",
    profile: bool = False,
    method: Method = "vertex",
    at: At = "vertices",
    both_sides: bool = False,
    only: Bools | None = None,
    occluders: Sequence[Mesh | Any] = (),
    checkpoint: Kept | None = None,
) -> Bake:
    """w at every vertex, or face, of a mesh or a mesh file, by the options of `obscurance bake`.

    Args:
        mesh: a mesh as `ao.bake` takes it, a file that `load` has read, or the name of one.
        falloff: as `ao.bake` takes it; or a name that the command has, "exponential" (the default), "binary",
            "linear", "smooth" or "table:FILE", with the next three.
        half_distance: the distance at which a hit occludes half, in mesh units or "50%" of the radius.
        max_distance: the distance from which on hits are ignored, likewise, or inf.
        tau: rate of the exponential falloff, per mesh unit.
        ground: a plane without end below: True or "auto" just below the lowest vertex, or its height.
        occluder: a mesh, or a file's name, that occludes and gets no w; or a list of several.
        receive, cast, exclude: names or patterns of objects that alone get w, that alone occlude, that do neither.
        occluded_by: "all", or the own "object" alone, or objects of its "name".
        points: whether the file is a cloud of points with normals.
        flip: turn the faces over. alpha: "ignore" takes all faces as opaque. up: the axis that is up.
        high: a finer mesh whose w is baked, in any form of `mesh`; or a list of several, which are one.
        match_names: with `high`, objects NAME_low show objects NAME_high alone.
        cage: as `ao.bake` takes it, or the name of a mesh file.
        progress: True shows a bar, "json" prints lines of JSON, a function is called with what is done, in all and the
            stage. None: a line in notebooks.
        samples, seed, threads, normals, tolerance, denoise, interior, thickness, spread: as `ao.bake` takes them.
        weight, back_faces, profile, method, at, both_sides, only, occluders, checkpoint: likewise.

    Raises:
        OptionError: as `ao.bake`; a name or a value that the command refuses, or arguments that do not go together.
        MeshError: a file cannot be read, or is no mesh. Others: as `ao.bake`.
    """
    if only is not None and (points or occluded_by != "all"):
        raise ConflictError("only", "does not go with", "points" if points else "occluded_by")
    options = _as_options(locals())
    check_together(options, BAKE)
    plan = plan_bake(options)
    inputs = read_inputs(plan, source=None if _is_name(mesh) else mesh)
    wanted = inputs.chosen.only
    arguments = inputs.arguments | {"occluders": [*occluders, *inputs.arguments["occluders"]]}
    if only is not None:
        arguments["only"] = only if wanted is None else np.asarray(only) & wanted
    inputs = inputs._replace(arguments=arguments)
    if callable(progress):
        return bake_inputs(plan, inputs, checkpoint, progress)
    with shown_progress(options.quiet, "rays", form=options.progress) as (advance,):
        return bake_inputs(plan, inputs, checkpoint, advance)


def render(
    source: Surface | raytrace.Scene | Bake,
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
    from ..description.mesh_scene import mesh_scene
    from ..description.obscurance import with_obscurance
    from ..description.read import read_scene

    used = settings or raytrace.Settings()
    if isinstance(source, str | os.PathLike):
        described = read_scene(source, (used.width, used.height) if settings else None)
        used = settings or described.settings
        scene, _ = with_obscurance(described, threads)
        camera = camera or described.camera
    elif isinstance(source, raytrace.Scene):
        scene = source
        camera = camera or raytrace.Camera.framing(scene.flattened(), aspect=used.width / used.height)
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
    from ..formats.write import write

    target = Path(path or Path(tempfile.mkdtemp()) / "baked.html")
    if isinstance(baked, str | os.PathLike):
        from .view import view_results

        view_results(Path(baked), None, target, None, None)
    else:
        write(target, baked)
    if path is None:
        webbrowser.open(target.resolve().as_uri())
    return target


def _is_name(mesh: Surface) -> bool:
    return isinstance(mesh, str | os.PathLike)


def _as_options(given: dict[str, Any]) -> BakeOptions:
    """Arguments of `bake` as options of the command, whose values are texts and lists. Raises: OptionError."""
    options = {name: value for name, value in given.items() if name in ROWS}
    mesh, falloff, ground, progress = (given[name] for name in ("mesh", "falloff", "ground", "progress"))
    options["mesh"] = [mesh.path if isinstance(mesh, Asset) else Path(mesh if _is_name(mesh) else "mesh")]
    options["output"] = _IN_MEMORY
    options["falloff"] = falloff or "exponential" if isinstance(falloff, str | None) else falloffs_of(falloff)
    options["progress"] = progress if isinstance(progress, str) else "bar"
    options["quiet"] = callable(progress) or not (in_notebook() if progress is None else progress)
    options["profile"] = given["profile"] or None
    if isinstance(ground, bool):
        options["ground"] = "auto" if ground else None
    elif ground is not None:
        options["ground"] = str(ground)
    for name in ("receive", "cast", "exclude"):
        options[name] = [given[name]] if isinstance(given[name], str) else given[name] or None
    for name in ("high", "occluder"):
        options[name] = given[name] if isinstance(given[name], list | None) else [given[name]]
    for name in ("occluded_by", "points", "flip", "alpha", "up", "match_names", "progress"):
        if options[name] is not None:
            ROWS[name].parsed(options[name])
    return BakeOptions(**options)
