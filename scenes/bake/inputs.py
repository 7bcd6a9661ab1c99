"""The files of a bake, read: meshes as its plan has them."""

from __future__ import annotations

import glob
import os
import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, Self

import numpy as np

from obscurance import ao
from obscurance.raytrace.errors import ConflictError

from ..asset.asset import Asset
from ..asset.objects import ObjectSelection, match, select_objects
from ..formats.load import load
from ..show.progress import progress

if TYPE_CHECKING:
    from obscurance.raytrace.mesh.mesh import Mesh

    from .pages import Layout
    from .plan import Plan


_FAR = 100.0  # radii, from which on an occluder hardly counts


class BakeInputs(NamedTuple):
    """The meshes of a bake.

    Attributes:
        source: the input. chosen: what is baked of it. layout: of its texture, if one is baked.
        fine: the finer meshes as one. occluders: besides.
        arguments: those of `ao.bake` and `ao.bake_texture` that are made of files, but for the mesh.
        files: all that were read. content: of the input, if it is no file's. notes: warnings about the meshes.
        refined: a line about the vertices that `--between` has added, or nothing.
        started: when reading began, in seconds of `time.perf_counter`.
    """

    source: Asset
    chosen: ObjectSelection
    layout: Layout | None
    fine: Mesh | None
    occluders: list[Mesh]
    arguments: dict[str, Any]
    files: list[Path]
    content: bytes | None
    notes: list[str]
    started: float
    refined: str = ""

    @property
    def solids(self) -> list[Mesh]:
        """The meshes that occlude."""
        return [*self.occluders, self.fine or self.chosen.mesh]

    @property
    def meshes(self) -> list[Mesh]:
        """Occluders, the mesh of the input and the fine mesh, if there is one; the last is baked."""
        return [*self.occluders, self.chosen.mesh, *([self.fine] if self.fine else [])]

    @property
    def alpha(self) -> str:
        """A line about alpha of the mesh whose w is baked, after a summary; empty without."""
        opacity = (self.fine or self.source.mesh).opacity
        return f"\n{opacity.summary}" if opacity else ""


def opened(mesh: Any, **how: Any) -> Asset:
    """A mesh file's content, by its name, or a mesh in memory as one. Args: how: arguments of `load`."""
    if isinstance(mesh, str | os.PathLike):
        return load(mesh, **how)
    file = mesh if isinstance(mesh, Asset) else Asset.of(mesh)
    whole = file.mesh
    if not how["alpha"]:
        whole = replace(whole, opacity=None)
    if how.get("up"):
        whole = replace(whole, up=how["up"])
    return file.with_mesh(whole.reversed() if how.get("flip") else whole)


def _beside(source: Asset, mesh: Any, **how: Any) -> Asset:
    """`opened`, in the frame of the input; arrays, which are no file's, are in that of its vertices."""
    file = opened(mesh, **how)
    return file.in_frame_of(source) if isinstance(mesh, str | os.PathLike | Asset) else file


def read_inputs(plan: Plan, content: bytes | None = None, source: Any = None) -> BakeInputs:
    """Read the files of a plan. Args: content: of the input, if it is no file's. source: the input, if in memory.

    Raises: InputError: a file cannot be read; OptionError: as `select_objects`, `Layout.of`, `match`.
    """
    started = time.perf_counter()
    options = plan.options
    reading = partial(progress, options.quiet, "reading", form=options.progress)
    with reading():
        source = _source(plan, plan.mesh if source is None else source, content)
    chosen = _chosen(plan, source)
    layout = None
    if plan.kind == "texture":  # whose pages may be refused, before more is read
        from .pages import Layout

        layout = Layout.of(plan, source, chosen)
    with reading():
        beside = _FilesBeside.read(plan, source)
    arguments = beside.arguments(plan, source, chosen.mesh)
    files = [source, *beside.walls, *beside.high, *beside.cage]
    notes = [note for file in files for note in file.notes]
    notes += _doubts(plan, source.mesh, [wall.mesh for wall in beside.walls])
    paths = [path for file in files for path in file.files]
    inputs = BakeInputs(
        source, chosen, layout, arguments["high"], arguments["occluders"], arguments, paths, content, notes, started
    )  # fmt: skip
    return inputs if options.between is None else _refined(plan, inputs)


def _by_name(plan: Plan) -> tuple[Sequence[str], Sequence[str], Sequence[str]]:
    """Names and patterns of the objects that get w, that occlude, and that do neither."""
    return plan.options.receive or (), plan.options.cast or (), plan.options.exclude or ()


def _source(plan: Plan, mesh: Any, content: bytes | None) -> Asset:
    """The input, by its name or in memory, with what its output is to keep of it."""
    options = plan.options
    names = any(_by_name(plan)) or options.match_names or options.occluded_by != "all"
    # Images need the objects and materials that a .ply keeps.
    target = plan.glb or "images.ply" if plan.kind == "texture" else f"vertices{plan.ending}"
    source = opened(
        mesh, target=target, content=content, alpha=options.alpha == "auto", up=options.up, names=names,
        flip=options.flip, points=options.points,
    )  # fmt: skip
    if options.points and not source.cloud:
        raise ConflictError("points", "needs", "the name of a file of points")
    return source


def _chosen(plan: Plan, source: Asset) -> ObjectSelection:
    """What is baked of the input: objects by their names, and each side of hard edges, where the output has both."""
    has_sides = plan.has_sides and not (source.is_scene and plan.ending == ".glb")  # which keeps the file's vertices
    baked = source.with_mesh(source.split) if has_sides else source
    return select_objects(baked, *_by_name(plan), plan.options.occluded_by, plan.options.output_dir is not None)


class _FilesBeside(NamedTuple):
    """The files besides the input: finer meshes, occluders, and the cage or nothing."""

    high: list[Asset]
    walls: list[Asset]
    cage: list[Asset]

    @classmethod
    def read(cls, plan: Plan, source: Asset) -> Self:
        """The files that a plan names. Raises: as `load`."""
        options = plan.options
        alpha, names = options.alpha == "auto", options.match_names
        cage = [options.cage] if isinstance(options.cage, Path) else []
        given = (options.high or (), options.occluder or (), cage)
        return cls(*([_beside(source, mesh, alpha=alpha, names=names) for mesh in meshes] for meshes in given))

    def arguments(self, plan: Plan, source: Asset, chosen: Mesh) -> dict[str, Any]:
        """The arguments of a bake that are made of files. Args: chosen: what is baked of the input."""
        fine = None
        if self.high:
            from obscurance.ao.points.occluders import joined

            fine = joined([file.mesh for file in self.high], all_normals=True)
        arguments: dict[str, Any] = {"high": fine, "occluders": _occluders(plan, source.mesh, chosen, self.walls)}
        if plan.options.match_names:
            arguments["groups"] = match(source, self.high)
        if self.cage:
            arguments["cage"] = self.cage[0].mesh
        return arguments


def _refined(plan: Plan, inputs: BakeInputs) -> BakeInputs:
    """The inputs with the mesh cut as `--between` asks for, whose w is that of the mesh as it was."""
    from obscurance.ao.baking import VertexArguments
    from obscurance.ao.points.occluders import joined
    from obscurance.ao.points.projection import PlacedMesh
    from obscurance.ao.refine import refine
    from obscurance.raytrace.mesh.corners import split_creases

    from ..asset.refined import refined_asset
    from ..formats.gltf.vertices import check_no_skin, refined_glb

    check_no_skin(inputs.source)
    options, source = plan.options, inputs.source
    split = None if source.is_scene else split_creases(source.mesh)  # each side of hard edges is to have its w
    before = split.mesh if split else source.mesh
    with progress(options.quiet, "cutting", form=options.progress):
        arguments = VertexArguments.of(plan.arguments, before, occluders=inputs.occluders, threads=options.threads)
        refined = refine(arguments, options.between)
    if split:
        source = refined_asset(source, split, refined.cuts)
    elif refined.cuts:
        document = refined_glb(source, refined.cuts)
        name = source.path.with_suffix(".glb")
        source = load(name, plan.output, document, options.alpha == "auto", options.up)
    mesh = source.mesh
    fine = joined([before, *inputs.occluders])
    placed = PlacedMesh.of(mesh, refined.places(mesh.faces, len(mesh.vertices)))
    became = f"{len(inputs.source.mesh.vertices):,} vertices became {len(mesh.vertices):,}"
    return inputs._replace(
        source=source,
        chosen=ObjectSelection(placed, np.ones(len(mesh.faces), np.bool_)),
        arguments={"high": fine, "occluders": []},
        refined=f"\n{became}, between which w errs by {refined.error:.4f}, as RMS over the surface",
    )


def _occluders(plan: Plan, mesh: Mesh, chosen: Mesh, walls: Iterable[Asset]) -> list[Mesh]:
    """What occludes besides the input's mesh, of which some is chosen: rasters with sides, and the ground."""
    occluders = [_solid(wall, float(mesh.vertices[:, 2].min())) for wall in walls]
    return [*occluders, ao.ground(chosen, plan.ground)] if plan.options.ground else occluders


def _solid(wall: Asset, low: float) -> Mesh:
    """The mesh of an occluder, of terrain with sides down to z = `low`."""
    if wall.to_system is None:
        return wall.mesh
    from ..formats.raster import with_sides

    return with_sides(wall.mesh, low)


def _doubts(plan: Plan, mesh: Mesh, walls: Iterable[Mesh]) -> Iterator[str]:
    """Lines about occluders of another size or far away, and about an input that may lie on its side."""
    for wall in walls:
        size = wall.radius / (mesh.radius or 1.0)
        if not 1e-3 < size < 1e3:
            yield f"{wall.source}: its radius is {size:.2g} of the mesh's: is its unit another?"
        away = np.linalg.norm(wall.centre - mesh.centre) / (wall.radius + mesh.radius or 1.0)
        if away > _FAR:
            yield f"{wall.source}: it lies {away:.2g} radii away: is its reference system another?"
    options = plan.options
    shown = any(path.suffix.lower() in (".html", ".glb") for path in (plan.output, options.report) if path)
    if options.ground or options.debug_image or shown:
        from obscurance.raytrace.mesh.warnings import lying_notes

        yield from lying_notes(mesh)


def is_pattern(path: Path) -> bool:
    """Whether a name is no file's, but a pattern of `glob`."""
    return glob.has_magic(str(path)) and not os.path.exists(path)
