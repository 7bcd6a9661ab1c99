"""THE table of the options of `bake` and `render`: each is declared here, and acts somewhere, once.

Names stand for options that `ao.bake` or `ao.bake_texture` has, too, which are declared in `ao/options.py`. The class
`BakeOptions`, parameters of the command and sections of its help, what goes together, `--options`, what a report
and a manifest say of a bake, and the line of a report that repeats it are made from the rows.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal, Self

from obscurance.ao.declared import EVERY_BAKE, IMAGE, Option, options_of
from obscurance.ao.options import Normals, TextureOptions, VertexOptions
from obscurance.raytrace.errors import ConflictError, InputError, OptionError

PRESETS: dict[str, dict[str, Any]] = {
    "unreal": {"format": "glb", "occlusion": "texture", "bits": "8", "bent_space": "tangent-directx"},
    "unity": {"format": "png", "occlusion": "texture", "bits": "8", "bent_space": "tangent"},
    "godot": {"format": "glb", "occlusion": "texture", "bits": "8", "bent_space": "tangent"},
    "blender": {"format": "glb", "colors": "rgb", "bits": "16", "bent_space": "tangent"},
    "three": {"format": "glb", "occlusion": "ramp", "bits": "8", "bent_space": "tangent"},
    "meshlab": {"format": "ply", "ply_name": "quality"},
}
"""`--preset`: values of options by program, as docs/programs.md explains them; a plan has them where they apply."""


REPORTS = ".json", ".html"  # endings
Metric = Literal["flip", "rms", "max"]
PrunedBy = Literal["faces", "parts", "objects"]
SeenFrom = Literal["outside", "above"]
Alpha = Literal["auto", "ignore"]
OccludedBy = Literal["all", "object", "name"]
Up = Literal["x", "y", "z", "-x", "-y", "-z"]
Format = Literal["npy", "npz", "ply", "glb", "obj", "vtp", "html", "png", "exr", "tif"]
InputFormat = Literal["ply", "obj", "stl", "off", "glb", "gltf", "vrm", "3mf", "dae", "zae", "vtp"]
ProgressForm = Literal["bar", "json"]

_SECTIONS: dict[str, tuple[Option | str, ...]] = {
    "": (
        Option("mesh", list[Path], ..., "A mesh file: PLY, OBJ, STL, OFF, GLB, glTF, 3MF, ...; several; a pattern "
               "('meshes/*.obj'); or - for standard input.", role="input", metavar="INPUT...", is_argument=True),
        Option("output", Path | None, None, "Output file, format by ending: .npy .npz .ply .glb .obj .vtp of the "
               "vertices; .html to look at them; .png .exr .tif a texture, with <UDIM>, <MATERIAL>, <OBJECT> in the "
               "name one for each.",
               EVERY_BAKE, "output", short="-o"),
        Option("output_dir", Path | None, None, "For several inputs: folder of their outputs, and of manifest.json.",
               EVERY_BAKE, "run", excludes=("output",), metavar="FOLDER"),
        Option("preset", Literal[*PRESETS] | None, None, "Options that suit a program, where they apply and are not "
               "given here.", EVERY_BAKE, "output"),
        "tolerance",
        Option("falloff", str, "exponential", "How occlusion fades with distance; not at all (binary: ambient "
               "occlusion); or a table of two columns, distance and what a hit there leaves open, 0 to 1: .csv .txt "
               ".npy.", metavar="exponential|binary|linear|smooth|table:FILE",
               words=("exponential", "binary", "linear", "smooth", "table:")),
        Option("half_distance", str | None, None,
               'Distance at which a hit occludes half: mesh units, or "50%" (the default) of the radius '
               'that info prints of the input, as of all percentages.', metavar="LENGTH"),
        Option("max_distance", str, "inf", 'Ignore hits farther away: mesh units, "25%" of the radius, or inf.',
               metavar="LENGTH"),
        Option("ground", str | None, None, "A ground plane without end: auto, just below the lowest vertex along the "
               "up axis, or its height.", EVERY_BAKE, excludes=("high",), metavar="auto|HEIGHT"),
        Option("size", str | None, None, "Texture: texels across and down, 1024 by default.", IMAGE, metavar="N|WxH"),
        Option("uv", str | None, None, "Texture: the file's texture coordinates, of a glTF the N-th; new ones (pip "
               "install uvunwrap) of all, or filled in where there are none; or the file's charts packed side by side.",
               IMAGE, metavar="auto|N|unwrap|fill|pack"),
    ),
    "What occludes": (
        "thickness",
        Option("tau", float | None, None, "Rate of the exponential falloff, per mesh unit."),
        Option("occluder", list[Path] | None, None, "A mesh file that occludes and gets no w; several, one option for "
               "each.", EVERY_BAKE, "input", excludes=("high",), metavar="MESH"),
        Option("points", bool, False, "The input is a cloud of points with normals, a .ply without faces: w of each, "
               "which occludes as a disc, or with --occluder not at all.", "vertices", "input",
               excludes=("high", "at", "both_sides", "receive", "cast", "exclude", "cluster", "occluded_by", "report",
                         "debug_image", "flip", "thickness", "method")),
        Option("receive", list[str] | None, None, "Only objects of this name get w, a pattern ('body*') or all others "
               "('!glass*'); several, one option for each.", EVERY_BAKE, excludes=("high",), metavar="PATTERN"),
        Option("cast", list[str] | None, None, "Only objects of this name occlude, likewise.", EVERY_BAKE,
               excludes=("high",), metavar="PATTERN"),
        Option("exclude", list[str] | None, None, "Objects of this name neither get w nor occlude, likewise.",
               EVERY_BAKE, excludes=("high",), metavar="PATTERN"),
        Option("occluded_by", OccludedBy, "all", "By all, the own object alone, or objects of its name: as if each "
               "were in a file of its own, with occluders and ground.", EVERY_BAKE,
               excludes=("high", "cluster")),
        Option("flip", bool, False, "Turn all faces of the input over, for meshes that look inwards; outputs have them "
               "turned."),
        "normals", "interior", "back_faces",
        Option("alpha", Alpha, "auto",
               "auto: what glTF and OBJ materials cut out or blend lets light through; ignore: opaque."),
    ),
    "Sampling": ("samples", "method", "denoise", "profile", "seed", "threads"),
    "What .glb and .ply show": (
        Option("between", float | None, None, "Also cut faces in two until w interpolated between vertices errs by no "
               "more, as RMS over the surface; into .glb and .ply.", "vertices batch",
               excludes=("high", "at", "both_sides", "receive", "cast", "exclude", "occluded_by", "points", "thickness",
                         "method"), metavar="E"),
        Option("colors", Literal["rgb", "r", "g", "b", "a"] | None, None, "Write w as vertex colours, COLOR_0 of .glb, "
               "replacing a .ply's own; or into one channel, where the others stay as they are in the input.",
               "vertices batch", "output", metavar="[r|g|b|a]"),
        Option("ply_name", str | None, None, "A further property of .ply that holds w: quality, which MeshLab shows.",
               "vertices batch", "output", metavar="NAME"),
        Option("occlusion", Literal["none", "ramp", "texture"] | None, None, "Occlusion texture of .glb materials, for "
               "viewers: ramp (w of the vertices, default without --colors), texture (of texels) or none.", EVERY_BAKE,
               "output"),
        Option("replace_occlusion", bool, False, "Also where a material has an occlusion texture of its own.",
               EVERY_BAKE, "output"),
        Option("orm", bool, False, "Texture: w into R of the metallic-roughness images of a .glb, one image for both.",
               "texture batch", "output"),
    ),
    "Textures": (
        Option("texel_size", str | None, None, 'Texture: what a texel covers at most, in mesh units or "1%" of the '
               "radius; sets the size.", IMAGE, excludes=("size",), metavar="LENGTH"),
        Option("mesh_output", Path | None, None, "Texture: also write the mesh with it, and with new coordinates.",
               "texture", "output", metavar="GLB"),
        "overlap",
        Option("instances", Literal["mean", "first", "own"], "mean", "Texture: where several nodes of a glTF show one "
               "mesh, and so one layout: the mean of their w, that of the first, or a texture for each.", IMAGE,
               excludes=("overlap",)),
        Option("bent_normals", Path | None, None, "Texture: also write the mean open directions.", "texture",
               "output", metavar="IMAGE"),
        "bent_space",
        Option("error_map", Path | None, None, "Texture: also write the standard error of w.", "texture",
               "output", metavar="IMAGE"),
        Option("high", list[Path] | None, None, "Bake w of this finer mesh onto the input's vertices or texture; of "
               "several as one, an option for each.", EVERY_BAKE, "input", metavar="MESH"),
        "cage",
        Option("match_names", bool, False, "With --high: objects NAME_low of the input show objects NAME_high alone; "
               "all of these occlude.", EVERY_BAKE, needs={"high": ...}),
        Option("half", bool, False, "Texture: 16-bit floats in .exr and .tif.", "texture batch", "output"),
        Option("bits", Literal["8", "16"] | None, None, "Texture: of a channel of w and bent normals in .png, 16 by "
               "default.", "texture batch", "output"),
    ),
    "More than one machine": (
        Option("cluster", str | None, None, "Trace by N workers on this machine, or by those of a Dask scheduler (pip "
               "install dask distributed cryptography).", EVERY_BAKE, "run", excludes=("dry_run",),
               metavar="local[:N]|tls://HOST:PORT"),
    ),
    "Reports, repeats, other programs": (
        Option("format", Format | None, None,
               "Format of the outputs in --output-dir, or of -o - (standard output); by default ply.",
               EVERY_BAKE, "run"),
        Option("input_format", InputFormat | None, None,
               "With - as INPUT: its format, if its first bytes do not tell.", EVERY_BAKE, "run"),
        Option("quiet", bool, False, "No progress bar and no summary.", EVERY_BAKE, "run", short="-q"),
        Option("report", Path | None, None, "Also write a report, .html to read or .json.", "vertices texture",
               "run"),
        Option("debug_image", Path | None, None, "Also write an image that marks flagged vertices.", "vertices",
               "output"),
        Option("up", Up | None, None, "With --ground, --debug-image, .html, .ply or .glb: the up axis, by default "
               "what the file says, or y.", EVERY_BAKE, "output", is_setting=False),
        Option("resume", bool, False, "Continue an interrupted batch; a bake of one input goes on by itself.",
               EVERY_BAKE, "run", {"output_dir": ...}),
        Option("dry_run", bool, False, "Write nothing; tell rays, memory, time and what would be written.",
               EVERY_BAKE, "run"),
        Option("progress", ProgressForm, "bar",
               "A bar on a terminal, or lines of JSON on standard error for other programs.", EVERY_BAKE, "run"),
        Option("options", Path | None, None, "Options of an earlier bake, from its --report or manifest.json; those "
               "given here override them.", EVERY_BAKE, "run", metavar="REPORT"),
    ),
}  # fmt: skip
BAKER = {
    row.name: row for record in (VertexOptions, TextureOptions) for row in options_of(record).values() if row.bake_kinds
}
"""The options that `ao.bake` or `ao.bake_texture` has, too; one that the table does not name is of "Sampling"."""
_SECTIONS["Sampling"] += tuple(name for name in BAKER if not any(name in listed for listed in _SECTIONS.values()))
BAKE = tuple(
    (BAKER[row] if isinstance(row, str) else row)._replace(section=section)
    for section, listed in _SECTIONS.items()
    for row in listed
)
ROWS = {row.name: row for row in BAKE}


def of_bake(name: str, **changes: Any) -> Option:
    """The row of an option of `bake`, for the table of another command, whose help has no sections."""
    return ROWS[name]._replace(section="", **changes)


RENDER = (
    Option("scene", Path, ..., "A .toml scene, a .glb or .gltf, or any mesh.", is_argument=True),
    of_bake("output", help="Output image, format by ending: .exr .png .tif .jpg"),
    Option("width", int | None, None, "Image width in pixels; needs --height.", needs={"height": ...}),
    Option("height", int | None, None, "Image height in pixels; needs --width.", needs={"width": ...}),
    Option("samples", int | None, None, "Most camera rays per pixel."),
    Option("shading", str | None, None, "Interpolation over a face: constant, flat, gouraud, phong or quadratic.",
           words=("constant", "flat", "gouraud", "phong", "quadratic")),
    of_bake("normals", kind=Normals | None, default=None),
    Option("obscurance", str | None, None, "What w scales: ambient (ambient light only), "
           "'ambient and diffuse' (light, as in the textbook's equation 12.75), or off (nothing)."),
    Option("baked", Path | None, None, "Read w from a baked file: .npy .npz .ply .glb .tif"),
    Option("half_distance", str | None, None, "Of the baked file's profile: mesh units, or \"12%\" of the radius; or "
           "several with commas between, whose w are multiplied."),
    Option("power", str | None, None, "Of w at each half-distance, 1 by default: 1,0.5 for instance.",
           needs={"half_distance": ...}),
    Option("own_occlusion", bool, True, "Use a glTF file's own occlusion textures; otherwise bake there, too."),
    of_bake("alpha", help="auto: as the file has it; ignore: faces are opaque."),
    Option("shadows", bool | None, None, "Trace shadow rays."),
    of_bake("up", help="Up axis of a mesh file, by default what it says, or y."),
    Option("view", str | None, None, "Where a mesh file is seen from: front, back, left, right, top, bottom, or a "
           "direction X,Y,Z from it to the camera.", words=("front", "back", "left", "right", "top", "bottom")),
    Option("turntable", int | None, None, "So many pictures on one turn around the scene, into OUTPUT_0001.png and so "
           "on.", excludes=("show", "report"), metavar="N"),
    Option("crop", str | None, None, "Render only these pixels.", metavar="X,Y,W,H"),
    of_bake("seed", kind=int | None, default=None, help="Random seed of the pixel samples."),
    Option("preview", bool, False, "A quarter of the width and height, few samples."),
    of_bake("half", help="16-bit floats in an .exr."),
    Option("show", bool, False, "Show the image in the terminal, too, or instead.", role="run"),
    *(of_bake(name) for name in ("threads", "cluster", "report", "progress", "quiet")),
)  # fmt: skip


class OptionValues:
    """Values of the options of a command as attributes: as given, or the defaults of its table."""

    table: ClassVar[Sequence[Option]] = ()

    def __init__(self, **values: Any) -> None:
        defaults = {row.name: row.default for row in self.table}
        if unknown := values.keys() - defaults.keys():
            raise TypeError(f"no options: {unknown}")
        vars(self).update(defaults | values)

    if TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any: ...

    def replaced(self, **changes: Any) -> Self:
        """A copy with some values changed."""
        return type(self)(**vars(self) | changes)


class BakeOptions(OptionValues):
    """The options of `bake`."""

    table = BAKE


class RenderOptions(OptionValues):
    """The options of `render`."""

    table = RENDER


def _is_given(row: Option, options: OptionValues) -> bool:
    return row.default is not ... and getattr(options, row.name) != row.default


def check_together(options: OptionValues, table: Iterable[Option]) -> None:
    """Check that no option is given that needs another, or excludes one. Raises: ConflictError."""
    rows = {row.name: row for row in table}
    for row in rows.values():
        if not _is_given(row, options):
            continue
        for name in row.excludes:
            if name in rows and _is_given(rows[name], options):
                raise ConflictError(row.name, "excludes", name)
        for name, value in row.needs.items():
            if not _is_given(rows[name], options) if value is ... else getattr(options, name) != value:
                raise ConflictError(row.name, "needs", name if value is ... else (name, value))


def check_kind(options: OptionValues, kind: str) -> None:
    """Check that all options that are given are of this kind of bake, a word of `Option.bake_kinds`.

    Raises: ConflictError.
    """
    for row in BAKE:
        if _is_given(row, options) and kind not in row.bake_kinds.split():
            if kind == "vertices":
                raise ConflictError(row.name, "needs", "an image as --output, or --occlusion texture")
            if kind == "texture":
                raise ConflictError(row.name, "does not go with", "a texture")
            raise ConflictError(row.name, "excludes", {"batch": "output_dir"}.get(kind, kind))


def check_stored(source: Path, options: Mapping[str, Any]) -> None:
    """Check options by their names as a JSON file has them. Raises: InputError: one of another type than its."""
    for name, value in options.items():
        row = ROWS[name]
        if value is None and row.default is None:
            continue
        if row.is_list and not isinstance(value, list):
            raise InputError(source, f"options.{name}", "a list of texts", repr(value))
        try:
            for item in value if row.is_list else [value]:
                row.parsed(item)
        except OptionError as fault:
            raise InputError(source, f"options.{name}", fault.expected, fault.got, fault.nearest) from None


@contextmanager
def named(option: str) -> Iterator[None]:
    """Errors raised within about the option `option`, whatever the function called has for a name."""
    try:
        yield
    except OptionError as fault:
        raise OptionError(option, fault.expected, fault.got, nearest=fault.nearest) from None


def plain(value: object) -> object:
    """An option as a JSON report has it."""
    if isinstance(value, list):
        return [plain(item) for item in value]
    return str(value) if isinstance(value, Path) else value


def absolute(value: Any) -> Any:
    """A path, or several, whatever folder is the current one; anything else stays."""
    if isinstance(value, list):
        return [item.absolute() for item in value]
    return value.absolute() if isinstance(value, Path) else value
