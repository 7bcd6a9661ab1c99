"""A bake, decided once: from options and names of files to a `Plan`, after which nothing is decided any more."""

from __future__ import annotations

import re
from collections.abc import Callable
from contextlib import AbstractContextManager, suppress
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from obscurance import ao
from obscurance.ao.falloff import Falloffs, resolve_length
from obscurance.ao.options import FITS_INPUT, Options, TextureOptions, VertexOptions
from obscurance.raytrace.errors import ConflictError, OptionError, Relation, Term
from obscurance.raytrace.system.checks import check_ending, check_outputs
from obscurance.raytrace.system.threads import thread_count

from ..falloffs import make_falloff, table_of
from ..formats.images import ENDINGS as IMAGES
from ..formats.images import MATERIAL, PLACEHOLDERS, UDIM, check_texture_target
from ..formats.load import unit_of
from ..formats.table import Channels, format_of, is_raster
from ..formats.write import ENDINGS, channels, check_holds, check_target
from .options import BAKER, PRESETS, REPORTS, ROWS, BakeOptions, absolute, check_kind, named, plain

if TYPE_CHECKING:
    from obscurance.ao.execute.kept import Kept

Kind = Literal["vertices", "texture"]
OpenCheckpoint = Callable[[Path], AbstractContextManager["Kept"]]
"""From the path of an output to what keeps the rays of it, or of one page."""
_RECORDS: dict[Kind, type[Options]] = {"vertices": VertexOptions, "texture": TextureOptions}
_MEANT = {".stl": ".ply", ".gltf": ".glb", ".jpg": ".png", ".jpeg": ".png"}  # which can hold w
_READS = {
    "unreal": (".glb", ".png", ".exr", ".tif"),
    "unity": (".glb", ".png", ".exr", ".tif"),
    "godot": (".glb", ".png", ".exr"),
    "blender": (".glb", ".ply", ".png", ".exr", ".tif"),
    "three": (".glb", ".ply", ".png", ".exr"),
    "meshlab": (".ply", ".obj", ".png"),
}
"""The endings of outputs that a preset's program reads."""
_LEAST_BETWEEN = 1e-3
_METRES = {"mm": 1e-3, "cm": 1e-2, "m": 1.0, "km": 1e3}


class Plan(NamedTuple):
    """One bake: of which files, into which, and how.

    Attributes:
        options: those in effect, of presets too, with one `mesh`.
        arguments: the options of `ao.bake` or `ao.bake_texture`, checked.
        channels: where a file of vertices holds w for viewers.
        ground: the height of the ground plane, None just below the mesh.
        size: texels across and down of a texture, None if `texel_size` says so.
    """

    kind: Kind
    options: BakeOptions
    arguments: Options
    channels: Channels
    ground: float | None
    size: tuple[int, int] | None

    @property
    def falloff(self) -> ao.Falloff:
        """The falloff of w; further ones are of other columns."""
        return self.arguments.falloffs[0]

    @property
    def mesh(self) -> Path:
        """The input."""
        path: Path = self.options.mesh[0]
        return path

    @property
    def output(self) -> Path:
        """The file of w."""
        path: Path = self.options.output
        return path

    @property
    def ending(self) -> str:
        """The output's ending, in lower case."""
        return self.output.suffix.lower()

    @property
    def inputs(self) -> list[Path]:
        """The files that are read, as far as the options name them."""
        options = self.options
        cage = [options.cage] if isinstance(options.cage, Path) else []
        tables = table_of(options.falloff)
        return [self.mesh, *(options.high or ()), *cage, *(options.occluder or ()), *tables]

    @property
    def has_sides(self) -> bool:
        """Whether w of each side of hard edges is baked, for an output that repeats vertices there."""
        options = self.options
        has_several = options.at == "vertices" and not (options.points or options.high) and options.normals != "up"
        return self.kind == "vertices" and has_several and self.ending in (".glb", ".html")

    @property
    def images(self) -> dict[str, Path]:
        """The images of a texture, by option, with placeholders in their names."""
        names = ("bent_normals", "error_map") if self.ending == ".glb" else ("output", "bent_normals", "error_map")
        return {name: getattr(self.options, name) for name in names if getattr(self.options, name)}

    @property
    def glb(self) -> Path | None:
        """The .glb that textures are written into."""
        path: Path | None = self.options.output if self.ending == ".glb" else self.options.mesh_output
        return path

    @property
    def keeps_uv(self) -> bool:
        """Whether new texture coordinates have a file to be written into."""
        return self.glb is not None

    @property
    def outputs(self) -> dict[str, Path]:
        """The files to write, by option; names of images with placeholders."""
        names: tuple[str, ...] = ("output", "report", "debug_image")
        if self.kind == "texture":
            names = ("report", "mesh_output", "output", "bent_normals", "error_map")
        paths = {f"--{name.replace('_', '-')}": getattr(self.options, name) for name in names}
        return {option: path for option, path in paths.items() if path}

    def described(self) -> dict[str, Any]:
        """Every effective option, as a JSON report has it."""
        names = [row.name for row in ROWS.values() if row.role != "run" and self.kind in row.bake_kinds.split()]
        values = {name: plain(getattr(self.options, name)) for name in names}
        values["tolerance"] = self.arguments.tolerance
        if self.kind == "vertices":
            values["occlusion"] = "ramp" if self.channels.ramp else "none"
        return values | {"mesh": str(self.mesh), "threads": thread_count(self.options.threads)}

    def changed(self) -> dict[str, Any]:
        """The options of results and of further inputs that are not at their defaults, as a JSON report has them."""
        options = vars(self.options)
        rows = [row for row in ROWS.values() if row.role in ("result", "input") and self.kind in row.bake_kinds.split()]
        changed = [row for row in rows if row.name != "mesh" and options[row.name] != row.default]
        return {row.name: plain(options[row.name]) for row in changed}

    def with_options(self, **changes: Any) -> Plan:
        """The plan with other files, or run in another way. Args: changes: options that do not decide what is baked."""
        return self._replace(options=self.options.replaced(**changes))

    def absolute(self) -> Plan:
        """The plan with names of files that hold in any folder."""
        names = ("mesh", "output", "high", "occluder", "cage")
        return self.with_options(**{name: absolute(getattr(self.options, name)) for name in names})

    def check_files(self) -> None:
        """Check that all outputs can be written, and are no inputs. Raises: OptionError, OutputError."""
        if self.kind == "texture":
            for name, path in self.images.items():
                check_texture_target(name, path, self.options.half)
        else:
            check_target(self.output)
        if self.options.debug_image:
            from obscurance.raytrace.image.write import check_image_target

            with named("debug_image"):
                check_image_target(self.options.debug_image, layers=("beauty",))
        if self.options.report:
            check_ending("--report", self.options.report, *REPORTS)
        check_outputs(self.outputs, self.inputs)


def plan_bake(options: BakeOptions, content: bytes | None = None) -> Plan:
    """The bake of one input, to vertices or a texture, as its output asks for. Args: content: if it is no file's.

    Raises: OptionError, ConflictError: of an option; InputError: of the table of a falloff.
    """
    # The kind of the bake: by the output's ending.
    output: Path = options.output
    ending = output.suffix.lower()
    if ending not in (*ENDINGS, *IMAGES):
        meant = str(output.with_suffix(_MEANT[ending])) if ending in _MEANT else None
        raise OptionError("output", "a name ending in " + ", ".join((*ENDINGS, *IMAGES)), output, nearest=meant)
    options = in_mesh_units(options, options.mesh[0], content)
    options = _with_defaults(_with_preset(options, ending), ending)
    if options.occlusion == "texture" and ending != ".glb" and ending not in IMAGES:
        raise ConflictError(("occlusion", "texture"), "needs", "a .glb output")
    of_terrain = is_raster(output) and is_raster(options.mesh[0])
    kind: Kind = "texture" if (ending in IMAGES and not of_terrain) or options.occlusion == "texture" else "vertices"
    check_kind(options, kind)
    # The arguments of `ao.bake` or `ao.bake_texture`, checked by their record.
    of_kind = {row.name: getattr(options, row.name) for row in BAKER.values() if kind in row.bake_kinds.split()}
    values = {name: value for name, value in of_kind.items() if not isinstance(value, Path | None)}
    arguments = _RECORDS[kind](falloff=_falloffs(options), **values)
    if isinstance(options.cage, str) and resolve_length("cage", options.cage, 1.0) == float("inf"):
        raise OptionError("cage", "a finite length", options.cage)
    # Where the output holds w for viewers, and the size of the page.
    for_viewers = Channels()
    if kind == "vertices":
        replaced = options.replace_occlusion
        for_viewers = channels(output, options.colors, options.occlusion, replaced, ply_name=options.ply_name)
        for_viewers = for_viewers._replace(alone=options.preset == "blender" and not options.profile)
    size = None if kind == "vertices" or options.texel_size else _texels(options.size or "1024")
    plan = Plan(kind, options, arguments, for_viewers, _ground_height(options.ground), size)
    if kind == "vertices":
        _check_vertices(plan)
    else:
        _check_texture(plan)
    # An up axis is of use only to what stands on it, or points up.
    standing = {".html", ".ply", ".glb"}
    paths = (options.report, options.debug_image, output if kind == "vertices" else plan.glb)
    stands = any(path.suffix.lower() in standing for path in paths if path)
    if options.up and not (stands or options.ground or options.debug_image or options.normals == "up"):
        needed = "--ground, --normals up, --debug-image or .html, .ply, .glb: else w is the same"
        raise ConflictError("up", "needs", needed)
    return plan


def _falloffs(options: BakeOptions) -> Falloffs:
    """The falloff that the options name, or what Python made. Raises: OptionError, InputError."""
    of_named = {name: getattr(options, name) for name in ("tau", "half_distance", "max_distance")}
    if isinstance(options.falloff, str):
        return make_falloff(options.falloff, **of_named)
    for name, value in of_named.items():
        if value != ROWS[name].default:
            raise ConflictError(name, "needs", "a falloff by its name")
    made: Falloffs = options.falloff
    return made


def in_mesh_units(options: BakeOptions, mesh: Path, content: bytes | None = None) -> BakeOptions:
    """The options with lengths, "10mm" or "10 km", in the unit of a mesh file. Args: content: if it is no file's.

    Raises: OptionError: one has a unit, and the file none. MeshError: as `unit_of`.
    """
    changes: dict[str, str] = {}
    for name in ("half_distance", "max_distance", "cage", "texel_size", "ground"):
        length = getattr(options, name)
        match = re.fullmatch(r"\s*(\d[.\de+-]*|\.\d+)\s*(mm|cm|m|km)\s*", str(length))
        if not match:
            continue
        unit = unit_of(mesh, content)
        if not unit:
            expected = f'a length above 0 without a unit, which {mesh} does not name, such as 0.5 or "25%"'
            raise OptionError(name, expected, repr(length))
        with suppress(ValueError):  # whoever takes the length refuses it
            changes[name] = repr(float(match[1]) * _METRES[match[2]] / unit)
    return options.replaced(**changes)


def preset_format(options: BakeOptions) -> str:
    """The format of outputs whose names do not tell it: as given, of the preset, or PLY."""
    return options.format or PRESETS.get(options.preset, {}).get("format") or "ply"


def _with_preset(options: BakeOptions, ending: str) -> BakeOptions:
    """The options with those of their preset, where it applies and they are not given."""
    preset = options.preset
    if preset is None:
        return options
    if ending not in _READS[preset]:
        raise ConflictError(("preset", preset), "needs", "an output that ends in " + " ".join(_READS[preset]))
    bent = options.bent_normals
    applies = {
        "colors": ending in (".glb", ".ply") and options.occlusion is None,
        "occlusion": ending == ".glb" and not options.colors,
        "bits": ending == ".png" or (bent and bent.suffix.lower() == ".png"),
        "bent_space": bent is not None,
        "ply_name": ending == ".ply",
    }
    values = PRESETS[preset]
    if options.size or options.texel_size:
        values = values | {"occlusion": "texture", "colors": None}
    chosen = {name: value for name, value in values.items() if applies.get(name) and not getattr(options, name)}
    return options.replaced(**chosen)


def _with_defaults(options: BakeOptions, ending: str) -> BakeOptions:
    """The options with those whose default depends on others."""
    changes: dict[str, Any] = {"cage": cage_of(options.cage)}
    if options.profile is None:
        is_page = ending == ".html" and options.falloff == "exponential" and options.method == "vertex"
        changes["profile"] = is_page  # takes no more rays, and w as baked lies between its columns
    if ending == ".glb" and options.occlusion is None and options.thickness:
        changes["occlusion"] = "none"
    return options.replaced(**changes)


def cage_of(given: Any) -> Any:
    """`--cage` as a length, or as the mesh file that it names; a mesh as it is."""
    if not isinstance(given, str | PathLike):
        return given
    try:
        float(str(given).strip().removesuffix("%"))
    except ValueError:
        return Path(given) if Path(given).suffix else given  # no file without an ending is a mesh
    return given


def _ground_height(ground: str | None) -> float | None:
    """The height of `--ground`, None for "auto" or none. Raises: OptionError."""
    if ground in (None, "auto"):
        return None
    try:
        return float(ground)
    except ValueError:
        raise OptionError("ground", "auto, or a height in mesh units", repr(ground)) from None


def _texels(text: str) -> tuple[int, int]:
    """The width and height of a page of "N" or "WxH". Raises: OptionError."""
    from obscurance.ao.texture.uv_layout import page_size

    try:
        sides = [int(part) for part in text.lower().split("x")]
    except ValueError:
        sides = []
    if len(sides) not in (1, 2):
        raise OptionError("size", "a number of texels, such as 1024, or WIDTHxHEIGHT", repr(text))
    return page_size(sides[0] if len(sides) == 1 else sides)


def _check_vertices(plan: Plan) -> None:
    """Check options that a bake to vertices, or to this output, cannot have together. Raises: ConflictError."""
    options = plan.options
    check_holds(plan.output, "points" if options.points else options.at, options.both_sides)
    if options.high is not None and options.method == "surface":
        raise ConflictError("high", "does not go with", ("method", "surface"), why=FITS_INPUT)
    if options.between is not None:
        if plan.ending not in (".glb", ".ply"):
            raise ConflictError("between", "needs", "an output that ends in .glb .ply, whose faces can be others")
        if not _LEAST_BETWEEN <= options.between <= 1:
            raise OptionError("between", f"an error from {_LEAST_BETWEEN} to 1", options.between)
    if options.profile and "profile" not in format_of(plan.output).holds:
        raise ConflictError("profile", "needs", "an output that holds one: .npz .ply .glb .html")


def _check_texture(plan: Plan) -> None:
    """Check options that a bake to a texture, or to its outputs, cannot have together.

    Raises: OptionError, ConflictError.
    """
    options = plan.options
    glb = plan.glb
    named_layouts = (None, "auto", "unwrap", "fill", "pack")
    if options.uv not in named_layouts and not (options.uv.isdecimal() and len(options.uv) < 4):
        expected = "auto, unwrap, fill, pack or the number of a set of texture coordinates"
        raise OptionError("uv", expected, repr(options.uv))
    for placeholder in PLACEHOLDERS:
        if plan.ending == ".glb" and placeholder in plan.output.name:
            expected = f"{placeholder} in names of images alone: a .glb holds all textures"
            raise OptionError("output", expected, plan.output)
        is_free = plan.ending == ".glb" and placeholder == MATERIAL  # its sets have names
        for name, path in plan.images.items():
            if (placeholder in path.name) != (placeholder in plan.output.name) and not is_free:
                raise OptionError(name, f"{placeholder} in all names of images, or in none", path)
    if options.mesh_output is not None:
        check_ending("mesh_output", options.mesh_output, ".glb")
    is_one_page = plan.ending != ".glb" and UDIM not in plan.output.name
    in_png = plan.ending == ".png" or (options.bent_normals and options.bent_normals.suffix.lower() == ".png")
    holds_profile = plan.ending == ".exr"
    against: Relation = "does not go with"
    conflicts: list[tuple[object, Term, Relation, Term]] = [
        (options.mesh_output and not is_one_page, "mesh_output", "needs", "an image of one page as --output"),
        (options.replace_occlusion and not glb, "replace_occlusion", "needs", "a .glb to write"),
        (glb and options.occluded_by != "all", ("occluded_by", options.occluded_by), against, "textures in a .glb"),
        (options.orm and not glb, "orm", "needs", "a .glb to write, as --output or --mesh-output"),
        (options.occlusion not in (None, "texture"), ("occlusion", options.occlusion), against, "a texture"),
        (options.uv in ("unwrap", "pack") and options.instances != "mean", "instances", against, ("uv", options.uv)),
        (options.uv in ("unwrap", "fill", "pack") and not plan.keeps_uv, ("uv", options.uv), "needs", "mesh_output"),
        (options.half and not plan.images, "half", "needs", "images that end in .exr or .tif"),
        (options.bits and not in_png, "bits", "needs", "w or bent normals in an image that ends in .png"),
        (options.profile and not holds_profile, "profile", "needs", "a texture that holds one: .exr"),
    ]
    for is_conflict, term, relation, other in conflicts:
        if is_conflict:
            raise ConflictError(term, relation, other)
