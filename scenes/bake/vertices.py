"""A bake to vertices: from the meshes of a plan to w in a file, a report and an image of the flagged vertices."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from obscurance import ao
from obscurance.ao.baking import VertexArguments, bake_vertices
from obscurance.ao.options import VertexOptions
from obscurance.ao.result import VISIBLE
from obscurance.raytrace.errors import MeshError, OptionError
from obscurance.raytrace.system.checks import check_outputs
from obscurance.raytrace.types import Float64s

from ..formats.table import is_raster
from ..formats.unsupported import unsupported_features
from ..formats.write import write_vertices
from ..show.progress import progress
from ..show.report.verdict import COARSE
from .console import HARD, bake_summary, warn
from .report import OutputSummary, WorkSize, command_again, hashed_inputs, write_bake_report

if TYPE_CHECKING:
    from obscurance.ao.execute.kept import Kept
    from obscurance.ao.execute.tracer import Progress

    from ..formats.load import MeshFile
    from ..show.report.pictures import Picture
    from .inputs import BakeInputs
    from .plan import OpenCheckpoint, Plan


def work_size(plan: Plan, inputs: BakeInputs) -> WorkSize:
    """The size of the bake."""
    from obscurance.ao.memory import bytes_at_vertices
    from obscurance.raytrace.mesh.normals import face_normals

    chosen = inputs.chosen
    used = np.zeros(len(chosen.mesh.vertices), np.bool_)
    used[chosen.mesh.faces[face_normals(chosen.mesh.vertices, chosen.mesh.faces)[1] > 0]] = True
    points = int(np.count_nonzero(used if chosen.only is None else used & chosen.only))
    if inputs.source.cloud:
        points = len(inputs.source.cloud[0])
    return WorkSize(points, "vertices", bytes_at_vertices(inputs.solids, plan.arguments, points))


def run(plan: Plan, inputs: BakeInputs, open_checkpoint: OpenCheckpoint) -> Iterator[OutputSummary]:
    """Bake and write. Raises: as `ao.bake` and writers."""
    options = plan.options
    check_outputs(plan.outputs, inputs.files)
    loaded = time.perf_counter()
    hashes = hashed_inputs(plan, inputs) if options.report else []
    losses = [*unsupported_features(plan.output, inputs.source, plan.channels), *_hard_edges(plan, inputs)]
    warnings = warn(inputs.meshes, [*inputs.notes, *losses], plan.falloff)
    with open_checkpoint(plan.output) as checkpoint:
        baked = trace(plan, inputs, checkpoint)
        # Warnings about the result, before it is written.
        coarse = _coarse(plan, inputs.source, baked)
        lines = [*coarse, *baked.shortfalls]
        missed = baked.flagged["missed"]
        if missed:
            outside = "outside the cage of the fine mesh; they take its closest point"
            lines.append(f"{plan.output}: {missed:,} of {len(baked.w):,} vertices lie {outside}")
        warnings = [*warn([], lines), *warnings]
        traced = time.perf_counter()
        channels = plan.channels
        if plan.ending == ".html":
            channels = channels._replace(again=command_again(plan, inputs.source), warning="".join(coarse))
        with progress(options.quiet, "writing", form=options.progress):
            write_vertices(plan.output, baked, inputs.source, channels)
    seconds = {"load": loaded - inputs.started, "write": time.perf_counter() - traced}
    if options.report:
        from obscurance.ao.report import report

        def pictures() -> list[list[Picture]]:
            from ..show.report.pictures import pictures_of_vertices

            return [pictures_of_vertices(inputs.source.baked_mesh(len(baked.w)), baked.w, baked.error)]

        write_bake_report(plan, report(baked, plan.described(), seconds, warnings), hashes, pictures)
    if options.debug_image:
        from ..show.report.pictures import write_marked

        write_marked(options.debug_image, inputs.source.baked_mesh(len(baked.w)), baked)
    yield OutputSummary(bake_summary(baked, plan.output) + inputs.alpha, warnings)


def _hard_edges(plan: Plan, inputs: BakeInputs) -> list[str]:
    """A line about vertices on hard edges, which have one value, in a file that is looked at; nothing without any."""
    mesh = inputs.chosen.mesh
    one_each = plan.ending in (".ply", ".obj", ".vtp", ".glb") and plan.options.at == "vertices"
    if not one_each or plan.arguments.normals == "up" or plan.options.high or inputs.source.cloud:
        return []
    from obscurance.raytrace.mesh.corners import on_hard_edges

    count = len(on_hard_edges(mesh))
    sides = "one value stands for all sides; textures have one for each"
    return [f"{plan.output}: {count:,} of {len(mesh.vertices):,} {HARD}: {sides}"] if count else []


def _coarse(plan: Plan, source: MeshFile, baked: ao.Bake) -> list[str]:
    """A line about values that are wrong between the vertices, and what makes them right in this output; none for
    cells of a raster, which have nothing between them."""
    if not baked.coarse or baked.interpolation is None or is_raster(plan.output):
        return []
    text = f"{plan.output}: {COARSE} {baked.interpolation.rmse:.2f}, as the faces are too large for it"
    uv = None
    with suppress(MeshError):  # malformed coordinates, of which nothing else here makes use
        uv = source.uv
    texture = "--occlusion texture" if uv is not None else "--occlusion texture --uv unwrap"
    if plan.ending == ".glb" and not plan.channels.colors and not is_raster(plan.mesh):
        return [f"{text}: add {texture}"]
    if baked.interpolation.best <= VISIBLE and _can_be_fitted(plan):
        return [f"{text}: add --method surface"]
    if plan.ending in (".npy", ".npz") or is_raster(plan.mesh):
        return [f"{text}: subdivide them"]
    return [f"{text}: subdivide them, or bake a texture, {texture} into a .glb"]


def _can_be_fitted(plan: Plan) -> bool:
    """Whether the bake of a plan would be another by the surface method, with which some options do not go."""
    arguments = plan.arguments
    if isinstance(arguments, VertexOptions) and arguments.method == "vertex":
        with suppress(OptionError):
            profile = arguments.profile and plan.ending != ".html"  # which has one by itself with the other method
            replace(arguments, method="surface", profile=profile)
            return True
    return False


def trace(plan: Plan, inputs: BakeInputs, checkpoint: Kept) -> ao.Bake:
    """Bake, and show how far it is."""
    options = plan.options
    with progress(options.quiet, "rays", form=options.progress, status=checkpoint.status) as (advance,):
        return bake_inputs(plan, inputs, checkpoint, advance)


def bake_inputs(plan: Plan, inputs: BakeInputs, checkpoint: Kept | None, advance: Progress | None) -> ao.Bake:
    """Bake: all objects at once, or one group of them after the other."""
    options = plan.options
    if options.occluded_by != "all":
        return _bake_groups(plan, inputs)
    if inputs.source.cloud:
        return _bake_cloud(plan, inputs, inputs.source.cloud, advance)
    chosen = {"only": inputs.chosen.only, "threads": options.threads} | inputs.arguments
    arguments = VertexArguments.of(
        plan.arguments, inputs.chosen.mesh, progress=advance, checkpoint=checkpoint, **chosen
    )  # fmt: skip
    return bake_vertices(arguments)


def _bake_cloud(plan: Plan, inputs: BakeInputs, cloud: tuple[Float64s, Float64s], advance: Progress | None) -> ao.Bake:
    """Bake the points of a cloud: among themselves, or if there are others that occlude, among these alone."""
    places, normals = cloud
    from obscurance.ao.methods.point_values import TAKEN

    arguments = {name: getattr(plan.arguments, name) for name in TAKEN if name != "threads"}
    walls = inputs.occluders
    alone = plan.options.occluder is None
    mesh = None if alone else walls[0]
    others = walls if alone else walls[1:]
    threads = plan.options.threads
    return ao.bake_points(mesh, places, normals, occluders=others, progress=advance, threads=threads, **arguments)


def _bake_groups(plan: Plan, inputs: BakeInputs) -> ao.Bake:
    """Bake groups of objects one by one; vertices of several groups have w of the last."""
    from obscurance.ao.estimate.calibration import Calibration

    chosen = inputs.chosen
    only = chosen.only
    count = len(chosen.mesh.vertices)
    falloff = chosen.absolute(plan.falloff)
    parts = list[ao.Bake]()
    values: dict[str, Any] = {"w": np.ones(count), "error": np.zeros(count), "bent_normals": np.zeros((count, 3))}
    values["flags"] = np.full(count, ao.Flag.UNREFERENCED, np.uint8)
    values["flags"][chosen.mesh.faces] = 0
    # Each group alone, among the occluders that all have.
    for vertices, mesh in chosen.parts():
        requested = None if only is None else only[vertices]
        options = {"falloff": falloff, "only": requested, "threads": plan.options.threads}
        part = bake_vertices(VertexArguments.of(plan.arguments, mesh, **options, **inputs.arguments))
        for name, column in values.items():
            column[vertices] = getattr(part, name)
        parts.append(part)
    calibrations = [part.calibration for part in parts if part.calibration]
    columns = zip(*calibrations, strict=True)
    rmse = float(np.sqrt(np.sum(values["error"] ** 2) / max(count if only is None else int(only.sum()), 1)))
    return ao.Bake(
        **values, mesh=chosen.mesh, mu=parts[0].mu, rmse=rmse, rmses=(rmse,), rays=sum(part.rays for part in parts),
        rays_skipped=_sums([part.rays_skipped for part in parts]), seconds=_sums([part.seconds for part in parts]),
        shortfalls=tuple(dict.fromkeys(line for part in parts for line in part.shortfalls)),
        calibration=Calibration(*map(np.concatenate, columns)) if calibrations else None,
    )  # fmt: skip


def _sums(tables: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    names = dict.fromkeys(name for table in tables for name in table)
    return {name: sum(table.get(name, 0) for table in tables) for name in names}
