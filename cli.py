"""The `obscurance` command: its options and what they call. Heavy imports wait until a command runs."""

from __future__ import annotations

import gc
import os
import sys

from obscurance import interrupts

os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")  # or every package installed is searched for some

from pathlib import Path
from typing import Annotated

import typer
from typer.exceptions import TyperException
from typer.main import get_command

from scenes.commands.usage import mistake_in_words, option_in_words
from scenes.jobs import options as choices
from scenes.jobs.console import columns, note, output_failed, readable_output, reopen_streams
from scenes.jobs.parameters import EXAMPLES, SectionedCommand, saved_options

interrupts.all_imported()

app = typer.Typer(
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
    help="Bake ambient occlusion or obscurance (1 = open) and render scenes, with Embree.",
    epilog="\b\nTo begin with:  obscurance demo\n                obscurance view demo/temple.ply --open\n"
    "More of each:   obscurance COMMAND -h",
)

Threads = Annotated[int | None, typer.Option(help="Number of threads, by default all cores; results are the same.")]
Form = Annotated[
    str,
    typer.Option(
        metavar="exponential|binary|linear|smooth|table:FILE",
        autocompletion=lambda incomplete: [name for name in choices.FALLOFFS if name.startswith(incomplete)],
        help="How occlusion fades with distance; not at all (binary: ambient occlusion); or a table of two columns, "
        "distance and what a hit there leaves open, 0 to 1: .csv .txt .npy.",
    ),
]
MaxDistance = Annotated[str, typer.Option(help='Ignore hits farther away: mesh units, "25%" of the radius, or inf.')]
NORMALS = typer.Option(help="Vertex normals: face normals weighted by angle, by area or equally, or the file's own.")
Report = Annotated[Path | None, typer.Option(help="Also write a report, .html to read or .json.")]
Progress = Annotated[
    choices.ProgressForm,
    typer.Option(help="A bar on a terminal, or lines of JSON on standard error for other programs."),
]
Cluster = Annotated[
    str | None,
    typer.Option(
        metavar="local[:N]|tls://HOST:PORT",
        help="Trace by N workers on this machine, or by those of a Dask scheduler (pip install dask distributed "
        "cryptography).",
    ),
]
Shared = Annotated[
    Path | None,
    typer.Option(metavar="FOLDER", help="With --cluster: a folder that all workers see; that of the output."),
]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="No progress bar and no summary.")]


def _take_options(context: typer.Context, report: Path | None) -> None:
    """Let options that are not given have the values that they had in an earlier bake."""
    if report is not None:
        context.default_map = saved_options(report)


FromReport = Annotated[
    None,
    typer.Option(
        "--options",
        parser=Path,
        metavar="REPORT",
        is_eager=True,
        callback=_take_options,
        help="Options of an earlier bake, from its --report or manifest.json; those given here override them.",
    ),
]


@app.command(cls=SectionedCommand, epilog=EXAMPLES)
def bake(
    mesh: Annotated[
        list[Path],
        typer.Argument(
            metavar="INPUT",
            help="A mesh file: PLY, OBJ, STL, OFF, GLB, glTF, 3MF, ...; several; a pattern ('meshes/*.obj'); or - for "
            "standard input.",
        ),
    ],
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            help="Output file, format by ending: .npy .npz .ply .glb of the vertices; .html to look at them; "
            ".png .exr .tif a texture, with <UDIM>, <MATERIAL>, <OBJECT> in the name one for each.",
        ),
    ] = None,
    output_dir: Annotated[
        Path | None,
        typer.Option(metavar="FOLDER", help="For several inputs: folder of their outputs, and of manifest.json."),
    ] = None,
    format: Annotated[
        choices.Format | None,
        typer.Option(help="Format of the outputs in --output-dir, or of -o - (standard output); by default ply."),
    ] = None,
    input_format: Annotated[
        choices.InputFormat | None, typer.Option(help="With - as INPUT: its format, if its first bytes do not tell.")
    ] = None,
    method: Annotated[
        choices.Method, typer.Option(help="Sample at the vertices, or all over the faces with a least-squares fit.")
    ] = "vertex",
    falloff: Form = "exponential",
    tau: Annotated[float | None, typer.Option(help="Rate of the exponential falloff, per mesh unit.")] = None,
    half_distance: Annotated[
        str | None,
        typer.Option(help='Distance at which a hit occludes half: mesh units, or "50%" of the radius (the default).'),
    ] = None,
    max_distance: MaxDistance = "inf",
    samples: Annotated[
        int | None,
        typer.Option(help="Rays per vertex or texel, 256 by default; with --tolerance the most, by default 16384."),
    ] = None,
    tolerance: Annotated[
        float | None, typer.Option(help="Target RMS error of w; ray counts are chosen to meet it.")
    ] = None,
    reconstruct: Annotated[bool, typer.Option(help="Denoise: shrink estimates towards those of neighbours.")] = True,
    traversal: Annotated[
        choices.Traversal, typer.Option(help="Who traces rays; embree is slower, and checks auto.")
    ] = "auto",
    seed: Annotated[int, typer.Option(help="Random seed.")] = 0,
    threads: Threads = None,
    normals: Annotated[choices.NormalsFrom, NORMALS] = "angle",
    hidden: Annotated[
        choices.Hidden,
        typer.Option(
            help="Vertices inside closed solids: ignore, flag (mark), or fill from visible neighbours; auto fills "
            "those inside parts of the mesh that are closed."
        ),
    ] = "auto",
    alpha: Annotated[
        choices.Alpha,
        typer.Option(help="auto: what glTF and OBJ materials cut out or blend lets light through; ignore: opaque."),
    ] = "auto",
    report: Report = None,
    debug_image: Annotated[Path | None, typer.Option(help="Also write an image that marks flagged vertices.")] = None,
    up: Annotated[
        choices.Up | None,
        typer.Option(help="With --debug-image, .html, .ply or .glb: the up axis, by default what the file says, or y."),
    ] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Continue an interrupted bake, or batch, to this output.")
    ] = False,
    colors: Annotated[
        bool, typer.Option("--colors", help="Write w as vertex colours: COLOR_0 of .glb, replacing a .ply's own.")
    ] = False,
    occlusion: Annotated[
        choices.Occlusion | None,
        typer.Option(
            help="Occlusion texture of .glb materials, for viewers: ramp (w of the vertices), texture (of texels), "
            "auto (default without --colors: a texture where it errs less between the vertices, else a ramp) or none."
        ),
    ] = None,
    replace_occlusion: Annotated[
        bool, typer.Option("--replace-occlusion", help="Also where a material has an occlusion texture of its own.")
    ] = False,
    size: Annotated[
        str | None, typer.Option(metavar="N|WxH", help="Texture: texels across and down, 1024 by default.")
    ] = None,
    texel_size: Annotated[
        str | None,
        typer.Option(help='Texture: what a texel covers at most, in mesh units or "1%" of the radius; sets the size.'),
    ] = None,
    uv: Annotated[
        str | None,
        typer.Option(
            metavar="auto|N|unwrap|fill",
            help="Texture: the file's texture coordinates, of a glTF the N-th; new ones (pip install uvunwrap) of all, "
            "or filled in where there are none.",
        ),
    ] = None,
    mesh_output: Annotated[
        Path | None, typer.Option(metavar="GLB", help="Texture: also write the mesh with it, and with new coordinates.")
    ] = None,
    overlap: Annotated[
        choices.Overlap | None,
        typer.Option(
            help="Texture: where faces overlap, w is their mean (the default within a material), the first's, or an "
            "error."
        ),
    ] = None,
    bent_normals: Annotated[
        Path | None, typer.Option(metavar="IMAGE", help="Texture: also write the mean open directions.")
    ] = None,
    bent_space: Annotated[
        choices.BentSpace | None, typer.Option(help="Of bent normals: the mesh's own (the default), or tangent, +Y up.")
    ] = None,
    error_map: Annotated[
        Path | None, typer.Option(metavar="IMAGE", help="Texture: also write the standard error of w.")
    ] = None,
    high: Annotated[
        Path | None,
        typer.Option(metavar="MESH", help="Bake w of this finer mesh onto the input's vertices or texture."),
    ] = None,
    cage: Annotated[
        str | None,
        typer.Option(
            help='With --high: how far it may be from the input, mesh units or "2%" of the radius (the default).'
        ),
    ] = None,
    half: Annotated[bool, typer.Option("--half", help="Texture: 16-bit floats in .exr and .tif.")] = False,
    part: Annotated[
        str | None,
        typer.Option(
            metavar="K/N",
            help="Trace only the K-th of N parts, into the folder --output, for obscurance merge; of a texture, if "
            "--size or --texel-size is given. With --output-dir: bake the K-th part of the inputs.",
        ),
    ] = None,
    cluster: Cluster = None,
    shared: Shared = None,
    tiles: Annotated[
        str | None,
        typer.Option(
            metavar="AxBxC",
            help="For a mesh larger than memory, a binary PLY or STL: so many tiles along x, y and z, one at a time; "
            "with --max-distance, --no-reconstruct and --hidden ignore.",
        ),
    ] = None,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Write nothing; tell rays, memory, time and what would be written.")
    ] = False,
    progress: Progress = "bar",
    orm: Annotated[
        bool,
        typer.Option("--orm", help="Texture: w into R of the metallic-roughness images of a .glb, one image for both."),
    ] = False,
    quiet: Quiet = False,
    from_report: FromReport = None,
) -> None:
    """Bake ambient occlusion or obscurance to vertices or a texture.

    The result is w, one number for each vertex or texel: 1 where it is open, 0 where it is closed.
    """
    options = {name: value for name, value in locals().items() if name != "from_report"}
    from scenes.jobs.run import run_bake

    raise typer.Exit(run_bake(options))


@app.command()
def merge(
    parts: Annotated[Path, typer.Argument(metavar="FOLDER", help="Where bake --part has put all parts.")],
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Output file, as of bake; none for parts of a batch.")
    ] = None,
    mesh: Annotated[Path | None, typer.Option(help="The mesh file, if it is elsewhere than for the parts.")] = None,
    high: Annotated[Path | None, typer.Option(help="The finer mesh file, likewise.")] = None,
    report: Report = None,
    debug_image: Annotated[Path | None, typer.Option(help="As of bake, and so are all below.")] = None,
    up: Annotated[choices.Up | None, typer.Option()] = None,
    colors: Annotated[bool, typer.Option("--colors")] = False,
    occlusion: Annotated[choices.Occlusion | None, typer.Option()] = None,
    replace_occlusion: Annotated[bool, typer.Option("--replace-occlusion")] = False,
    mesh_output: Annotated[Path | None, typer.Option(metavar="GLB")] = None,
    bent_normals: Annotated[Path | None, typer.Option(metavar="IMAGE")] = None,
    bent_space: Annotated[choices.BentSpace | None, typer.Option()] = None,
    error_map: Annotated[Path | None, typer.Option(metavar="IMAGE")] = None,
    half: Annotated[bool, typer.Option("--half")] = False,
    orm: Annotated[bool, typer.Option("--orm")] = False,
    threads: Threads = None,
    quiet: Quiet = False,
) -> None:
    """Write the output of a bake, or a batch, traced in parts."""
    options = {name: value for name, value in locals().items() if name != "parts"}
    from scenes.jobs.run import run_merge

    raise typer.Exit(run_merge(parts, options))


@app.command()
def view(
    result: Annotated[Path, typer.Argument(metavar="RESULT", help="A baked file: .ply .glb .gltf .npz .npy")],
    other: Annotated[
        Path | None, typer.Argument(metavar="OTHER", help="Another bake of the same mesh, with a slider between.")
    ] = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="The page, .html; by default beside RESULT, with its name.")
    ] = None,
    mesh: Annotated[Path | None, typer.Option(help="The mesh file that a .npz or .npy belongs to.")] = None,
    up: Annotated[choices.Up | None, typer.Option(help="Up axis at first, by default what it says, or y.")] = None,
    open_: Annotated[bool, typer.Option("--open", help="Open it in the browser.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No summary.")] = False,
) -> None:
    """Make a page to look at a bake: one file, no network."""
    from scenes.show.page.view import view_results

    summary = view_results(result, other, output, mesh, up, open_)
    if not quiet:
        print(summary)


@app.command()
def info(
    mesh: Annotated[Path, typer.Argument(metavar="MESH", help="A mesh file, or - for standard input.")],
    json: Annotated[bool, typer.Option("--json", help="As JSON, for other programs.")] = False,
) -> None:
    """Describe a mesh file and its defects."""
    from scenes.commands.info import describe, facts
    from scenes.formats.standard_input import load_mesh

    source = load_mesh(mesh)
    if json:
        from json import dumps

        print(dumps(facts(source), indent=2, allow_nan=False))
    else:
        print(columns(describe(source)))


@app.command()
def validate(
    samples: Annotated[
        int, typer.Option(help="Rays per vertex; allowed errors depend on it.")
    ] = choices.VALIDATION_SAMPLES,
    seed: Annotated[int, typer.Option(help="Random seed of rays.")] = 0,
    threads: Threads = None,
    moved: Annotated[bool, typer.Option("--stress", "--generated", "--long", hidden=True)] = False,
) -> None:
    """Compare bakes with exact solutions; exit status 1 on failure."""
    from scenes.commands.validate import validate_closed_forms

    if moved:
        where = "python -m pytest tests/stress tests/random_meshes, in the source folder"
        raise typer.Exit(_fail(f"validate: stress tests and random meshes are test suites: {where}", 2))
    if not validate_closed_forms(samples, seed, threads):
        raise typer.Exit(1)


@app.command()
def render(
    scene: Annotated[Path, typer.Argument(metavar="SCENE", help="A .toml scene, a .glb or .gltf, or any mesh.")],
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Output image, format by ending: .exr .png .tif .jpg")
    ] = None,
    width: Annotated[int | None, typer.Option(help="Image width in pixels; needs --height.")] = None,
    height: Annotated[int | None, typer.Option(help="Image height in pixels; needs --width.")] = None,
    samples: Annotated[int | None, typer.Option(help="Most camera rays per pixel.")] = None,
    shading: Annotated[
        str | None, typer.Option(help="Interpolation over a face: constant, flat, gouraud, phong or quadratic.")
    ] = None,
    normals: Annotated[choices.NormalsFrom | None, NORMALS] = None,
    obscurance: Annotated[
        str | None,
        typer.Option(
            help="What w scales: ambient (ambient light only), book (ambient and diffuse light, as in the textbook's "
            "equation 12.75), or off (nothing)."
        ),
    ] = None,
    baked: Annotated[Path | None, typer.Option(help="Read w from a baked file: .npy .npz .ply .glb")] = None,
    own_occlusion: Annotated[
        bool, typer.Option(help="Use a glTF file's own occlusion textures; otherwise bake there, too.")
    ] = True,
    alpha: Annotated[choices.Alpha, typer.Option(help="auto: as the file has it; ignore: faces are opaque.")] = "auto",
    shadows: Annotated[bool | None, typer.Option("--shadows/--no-shadows", help="Trace shadow rays.")] = None,
    up: Annotated[
        choices.Up | None, typer.Option(help="Up axis of a mesh file, by default what it says, or y.")
    ] = None,
    crop: Annotated[str | None, typer.Option(metavar="X,Y,W,H", help="Render only these pixels.")] = None,
    seed: Annotated[int | None, typer.Option(help="Random seed of the pixel samples.")] = None,
    preview: Annotated[bool, typer.Option("--preview", help="A quarter of the width and height, few samples.")] = False,
    half: Annotated[bool, typer.Option("--half", help="16-bit floats in an .exr.")] = False,
    show: Annotated[bool, typer.Option("--show", help="Show the image in the terminal, too, or instead.")] = False,
    threads: Threads = None,
    cluster: Cluster = None,
    shared: Shared = None,
    report: Report = None,
    progress: Progress = "bar",
    quiet: Quiet = False,
) -> None:
    """Render a scene to an image; an .exr holds every layer."""
    options = locals()
    from scenes.commands.render_file import render_command

    render_command(options).run()


@app.command()
def scenes(
    name: Annotated[str | None, typer.Argument(metavar="NAME", help="A built-in scene; without, a list.")] = None,
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Write the scene to this .toml file.")] = None,
) -> None:
    """List the built-in scenes, or print or write one as TOML."""
    from raytrace.errors import OptionError
    from scenes.library.catalogue import BUILTIN, builtin_toml, write_builtin

    if name is None:
        if output is not None:
            raise OptionError("name", "the scene to write", "nothing")
        print(columns(list(BUILTIN.items())))
    elif output is None:
        print(builtin_toml(name), end="")
    else:
        write_builtin(name, output)


@app.command()
def materials(
    name: Annotated[
        str | None, typer.Argument(metavar="NAME", help="A preset; with --check also a scene file; without, a list.")
    ] = None,
    check: Annotated[
        bool,
        typer.Option("--check", help="Measure albedo by angle and reciprocity, and the error of Oren-Nayar's fit."),
    ] = False,
) -> None:
    """List the material presets, print one as TOML, or measure."""
    from scenes.commands import materials as command

    if check:
        print("\n\n".join(command.check(*each) for each in command.chosen_materials(name)))
    elif name is None:
        print(columns(command.presets()))
    else:
        print(command.preset_toml(name), end="")


@app.command()
def compare(
    a: Annotated[Path, typer.Argument(metavar="A", help="The reference image.")],
    b: Annotated[Path, typer.Argument(metavar="B", help="The image to compare with it.")],
    threshold: Annotated[float | None, typer.Option(help="Exit status 1 if the metric is above it.")] = None,
    metric: Annotated[choices.Metric, typer.Option(help="Metric that --threshold applies to.")] = "flip",
    difference: Annotated[Path | None, typer.Option(help="Write the FLIP difference map: .png .tif .jpg")] = None,
) -> None:
    """Compare two images: mean, RMS and maximum error, PSNR, FLIP."""
    from scenes.commands.compare import compare_files

    if not compare_files(a, b, threshold, metric, difference):
        raise typer.Exit(1)


@app.command()
def bench(
    mesh: Annotated[
        Path | None, typer.Argument(metavar="MESH", help="A mesh file; without one, the built-in temple.")
    ] = None,
    falloff: Form = "exponential",
    max_distance: MaxDistance = "inf",
    seed: Annotated[int, typer.Option(help="Random seed of the first round; later rounds count up.")] = 0,
    threads: Threads = None,
    report: Annotated[Path | None, typer.Option(help="Also write every round as JSON.")] = None,
) -> None:
    """Measure bake time against error on this machine."""
    options = {name: choices.plain(value) for name, value in locals().items() if name != "report"}
    from scenes.commands.bench import bench_file
    from scenes.falloffs import make_falloff

    bench_file(mesh, make_falloff(falloff, None, None, max_distance), seed, threads, report, options)


@app.command()
def demo(
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder for the mesh and the image.")] = Path("demo"),
    quiet: Quiet = False,
) -> None:
    """Bake the built-in temple and render it."""
    from scenes.commands.demo import make_demo

    make_demo(output, quiet)


@app.callback(invoke_without_command=True)
def start(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Show versions and the processor, and exit.")] = False,
) -> None:
    """Bake ambient occlusion or obscurance (1 = open) and render scenes, with Embree."""
    if version:
        from ao.report import versions
        from raytrace.system.processor import processor

        found = versions()
        print("obscurance", found["obscurance"])
        print(columns([("Embree", found["embree"]), ("CPU", processor()), ("Python", found["python"])]))
        raise typer.Exit
    if context.invoked_subcommand is None:
        print(context.get_help())


def main() -> None:
    """Run the command. Exit status: 0 done, 2 the user's input, 1 anything else, 130 interrupted."""
    try:
        status = _run()
    except KeyboardInterrupt:
        status = 130
    if status == 130:
        print("interrupted; no file is half-written", file=sys.stderr)
    sys.exit(status)


def _run() -> int:
    from raytrace.errors import InputError, ObscuranceError, OutputError

    gc.set_threshold(20_000)  # what is imported stays: to look for garbage in it takes 5 % of a short bake
    reopen_streams()
    arguments, commands = sys.argv[1:], get_command(app)
    with readable_output():
        try:
            status = commands.main(arguments, "obscurance", standalone_mode=False)
            sys.stdout.flush()
        except TyperException as mistake:
            status = _fail(mistake_in_words(mistake, commands, arguments), 2)
        except InputError as mistake:
            status = _fail(option_in_words(mistake, commands, arguments), 2)
        except OutputError as mistake:
            status = _fail(str(mistake), 2)
        except ObscuranceError as failure:
            status = _fail(str(failure), 1)
        except MemoryError:
            status = _fail("out of memory", 1)
        except OSError as failure:
            status = output_failed(failure)
    return status


def _fail(message: str, status: int) -> int:
    note(message)
    return status


if __name__ == "__main__":
    main()
