"""The `obscurance` command: its options and what they call. Heavy imports wait until a command runs."""

import gc
import os
import sys

from obscurance import interrupts

os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")  # or every package installed is searched for some

from pathlib import Path
from typing import Annotated, Any

import typer
from typer.exceptions import TyperException
from typer.main import get_command

from raytrace.errors import InputError, ObscuranceError, OptionError, OutputError
from scenes.bake import options as choices
from scenes.bake.console import columns, note, output_failed, readable_output, reopen_streams
from scenes.bake.options import BAKE, MERGE, ROWS, BakeOptions
from scenes.commands.parameters import EXAMPLES, TableCommand, name_of, parameter, parameters
from scenes.commands.render import RENDER, RenderOptions, run_render
from scenes.commands.usage import fault_in_words

interrupts.all_imported()

app = typer.Typer(
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
    help="Bake ambient occlusion or obscurance (1 = open) and render scenes, with Embree.",
    epilog="\b\nTo begin with:  obscurance demo\n                obscurance view demo/temple.ply --open\n"
    "More of each:   obscurance COMMAND -h",
)

Threads = Annotated[int | None, parameter(ROWS["threads"])]


@app.command(cls=TableCommand, epilog=EXAMPLES)
@parameters(BAKE)
def bake(**options: Any) -> None:
    """Bake ambient occlusion or obscurance to vertices or a texture.

    The result is w, one number for each vertex or texel: 1 where it is open, 0 where it is closed.
    """
    from scenes.commands.bake import run_bake

    raise typer.Exit(run_bake(BakeOptions(**options)))


@app.command(cls=TableCommand)
@parameters(MERGE)
def merge(parts: Path, mesh: Path | None, **options: Any) -> None:
    """Write the output of a bake, or a batch, traced in parts."""
    from scenes.commands.bake import run_merge

    raise typer.Exit(run_merge(parts, mesh, options))


@app.command()
def view(
    result: Annotated[
        Path, typer.Argument(metavar="RESULT", help="A baked file: .ply .glb .gltf .npz .npy; or any mesh.")
    ],
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
    """Make a page to look at a bake, or at any mesh: one file."""
    from scenes.commands.view import run_view

    run_view(result, other, output, mesh, up, open_, quiet)


@app.command()
def falloff(
    baked: Annotated[Path, typer.Argument(metavar="BAKED", help="A file of bake --profile: .npz .ply .glb .gltf .exr")],
    half_distance: Annotated[
        str, typer.Option(help='Mesh units, or "12%" of the radius; or several, "3%,40%", whose w is multiplied.')
    ],
    output: Annotated[Path, typer.Option("--output", "-o", help="Output file, format by ending, as of bake.")],
    power: Annotated[str | None, typer.Option(help="Of w at each half-distance, 1 by default: 1,0.5.")] = None,
    mesh: Annotated[Path | None, typer.Option(help="The mesh file that a .npz belongs to.")] = None,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No summary.")] = False,
) -> None:
    """Change the falloff of a bake that has a profile, without rays."""
    from scenes.commands.falloff import change_falloff
    from scenes.formats.falloffs import make_scales

    summary = change_falloff(baked, make_scales(half_distance, power), output, mesh)
    if not quiet:
        print(summary)


@app.command()
def info(
    mesh: Annotated[Path, typer.Argument(metavar="MESH", help="A mesh file, or - for standard input.")],
    json: Annotated[bool, typer.Option("--json", help="As JSON, for other programs.")] = False,
) -> None:
    """Describe a mesh file and its defects."""
    from scenes.commands.info import describe, facts
    from scenes.formats.load import load_mesh

    source = load_mesh(mesh)
    if json:
        from json import dumps

        print(dumps(facts(source), indent=2, allow_nan=False))
    else:
        print(columns(describe(source)))


@app.command()
def validate(
    samples: Annotated[int, typer.Option(help="Rays per vertex; allowed errors depend on it.")] = 4096,
    seed: Annotated[int, typer.Option(help="Random seed of rays.")] = 0,
    threads: Threads = None,
    moved: Annotated[bool, typer.Option("--stress", "--generated", "--long", hidden=True)] = False,
) -> None:
    """Compare bakes with exact solutions; exit status 1 on failure."""
    from ao.options import Options
    from scenes.validation.table import run_validation, validation_table

    if moved:
        where = "python -m pytest tests/stress tests/random_meshes, in the source folder"
        note(f"validate: stress tests and random meshes are test suites: {where}")
        raise typer.Exit(2)
    Options(samples=samples, seed=seed, threads=threads)
    results = run_validation(samples=samples, seed=seed, threads=threads)
    print(validation_table(results))
    raise typer.Exit(0 if all(result.ok for result in results) else 1)


@app.command()
@parameters(RENDER)
def render(**options: Any) -> None:
    """Render a scene to an image; an .exr holds every layer."""
    run_render(RenderOptions(**options))


@app.command()
def scenes(
    name: Annotated[
        str | None, name_of("scenes.library.catalogue.BUILTIN", "A built-in scene; without, a list.")
    ] = None,
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Write the scene to this .toml file.")] = None,
) -> None:
    """List the built-in scenes, or print or write one as TOML."""
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
    name: Annotated[str | None, name_of("raytrace.materials.presets.PRESETS", "A preset; without, a list.")] = None,
    check: Annotated[bool, typer.Option("--check", hidden=True)] = False,
) -> None:
    """List the material presets, or print one as TOML."""
    from scenes.commands.materials import preset_toml, presets

    if check:
        in_python = "albedo(material, angle) and asymmetry(material) of raytrace.materials.reflect, in Python"
        raise OptionError("check", in_python, "--check, which is no more")
    if name is None:
        print(columns(presets()))
    else:
        print(preset_toml(name), end="")


@app.command()
def compare(
    a: Annotated[Path, typer.Argument(metavar="A", help="The reference image.")],
    b: Annotated[Path, typer.Argument(metavar="B", help="The image to compare with it.")],
    threshold: Annotated[float | None, typer.Option(help="Exit status 1 if the metric is above it.")] = None,
    metric: Annotated[choices.Metric, typer.Option(help="Metric that --threshold applies to.")] = "flip",
    difference: Annotated[Path | None, typer.Option(help="Write the FLIP difference map: .png .tif .jpg")] = None,
) -> None:
    """Compare two images: mean, RMS and maximum error, PSNR, FLIP."""
    from raytrace.image.compare import compare as compared
    from raytrace.image.write import check_image_target

    if threshold is not None and not threshold >= 0:
        raise OptionError("threshold", "a number in [0, inf)", threshold)
    if difference:
        with choices.named("difference"):
            check_image_target(difference, layers=("beauty",))
    found = compared(a, b, difference)
    names = ("mean_error", "rms_error", "max_error", "psnr", "flip")
    print(columns([(name, f"{getattr(found, name):.6g}") for name in names]))
    raise typer.Exit(0 if threshold is None or found.within(threshold, metric) else 1)


@app.command()
def bench(
    mesh: Annotated[
        Path | None, typer.Argument(metavar="MESH", help="A mesh file; without one, the built-in temple.")
    ] = None,
    falloff: Annotated[str, parameter(ROWS["falloff"])] = "exponential",
    max_distance: Annotated[str, parameter(ROWS["max_distance"])] = "inf",
    seed: Annotated[int, typer.Option(help="Random seed of the first round; later rounds count up.")] = 0,
    threads: Threads = None,
    report: Annotated[Path | None, typer.Option(help="Also write every round as JSON.")] = None,
) -> None:
    """Measure bake time against error on this machine."""
    options = {name: choices.plain(value) for name, value in locals().items() if name != "report"}
    from scenes.commands.bench import bench_file
    from scenes.formats.falloffs import make_falloff

    bench_file(mesh, make_falloff(falloff, None, None, max_distance), seed, threads, report, options)


@app.command()
def demo(
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder for the mesh and the image.")] = Path("demo"),
    quiet: Annotated[bool, parameter(ROWS["quiet"])] = False,
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
    """Run the command. Exit status: 0 done, 2 the user's input, 1 anything else, 130 interrupted, 143 by SIGTERM."""
    try:
        status = _run()
    except KeyboardInterrupt:
        status = 130
    if status == 130:
        print("interrupted; no file is half-written", file=sys.stderr)
        status = interrupts.exit_status()
    sys.exit(status)


def _run() -> int:
    gc.set_threshold(20_000)  # what is imported stays: to look for garbage in it takes 5 % of a short bake
    reopen_streams()
    arguments, commands = sys.argv[1:], get_command(app)
    with readable_output():
        try:
            status = commands.main(arguments, "obscurance", standalone_mode=False)
            sys.stdout.flush()
        except (TyperException, ObscuranceError) as fault:
            note(fault_in_words(fault, commands, arguments))
            status = 2 if isinstance(fault, TyperException | InputError | OutputError) else 1
        except MemoryError:
            note("out of memory: the system or a limit, ulimit -v for instance, gives no more")
            status = 2
        except OSError as failure:
            status = output_failed(failure)
    return status


if __name__ == "__main__":
    main()
