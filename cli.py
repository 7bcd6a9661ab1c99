"""The `obscurance` command: its options and what they call. Heavy imports wait until a command runs."""

import gc
import os
import sys

from obscurance.raytrace.system import interrupts

interrupts.take()
if gc.isenabled():
    gc.set_threshold(100_000)  # what is imported stays: to look for garbage in it takes 5 % of a short bake
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # or NumPy starts threads that no command uses, and they spin

from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from obscurance.ao.declared import Option
from obscurance.raytrace.errors import InputError, ObscuranceError, OptionError, OutputError
from obscurance.scenes.bake.console import columns, note, output_failed, readable_output, reopen_streams, unforeseen
from obscurance.scenes.bake.options import (
    BAKE,
    RENDER,
    BakeOptions,
    Metric,
    PrunedBy,
    RenderOptions,
    SeenFrom,
    Up,
    named,
    of_bake,
    plain,
)
from obscurance.scenes.commands.parameters import TableCommand

interrupts.raise_interrupt()

_COMPLETE = "_OBSCURANCE_COMPLETE"  # a variable by which a shell asks for completions
_QUIET = Option("quiet", bool, False, "No summary.", short="-q")
_SEED = Option("seed", int, 0, "Random seed of rays.")
EXAMPLES = """\b
Examples, with the mesh that obscurance demo writes:
  obscurance bake demo/temple.ply -o temple.glb
  obscurance bake demo/temple.ply -o temple.html --falloff binary --tolerance 0.02
  obscurance bake 'demo/*.ply' --output-dir baked --format glb
  obscurance bake demo/temple.ply -o temple.png --uv unwrap --mesh-output temple.glb
"""


class Commands(click.Group):
    """The commands, in the order of this file."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(self.commands)


@click.group(
    cls=Commands,
    invoke_without_command=True,
    context_settings={"help_option_names": ["-h", "--help"], "show_default": True},
    epilog="\b\nTo begin with:  obscurance demo\n                obscurance view demo/temple.ply --open\n"
    "More of each:   obscurance COMMAND -h",
)
@click.option("--version", is_flag=True, help="Show versions and the processor, and exit.")
@click.pass_context
def commands(context: click.Context, version: bool) -> None:
    """Bake ambient occlusion or obscurance (1 = open) and render scenes, with Embree."""
    if version:
        from obscurance.ao.report import versions
        from obscurance.raytrace.kernel.processor import processor

        found = versions()
        print("obscurance", found["obscurance"])
        print(columns([("Embree", found["embree"]), ("CPU", processor()), ("Python", found["python"])]))
        context.exit()
    if context.invoked_subcommand is None:
        print(context.get_help())


def command(*rows: Option, **settings: Any) -> Callable[[Callable[..., int | None]], click.Command]:
    """Make a function a command, whose help it describes and whose arguments are the values of `rows`."""
    return commands.command(cls=TableCommand, rows=rows, **settings)


@command(*BAKE, epilog=EXAMPLES)
def bake(**options: Any) -> int:
    """Bake ambient occlusion or obscurance to vertices or a texture.

    The result is w, one number for each vertex or texel: 1 where it is open, 0 where it is closed.
    """
    from obscurance.scenes.commands.bake import run_bake

    return run_bake(BakeOptions(**options))


@command(
    Option("result", Path, ..., "A baked file: .ply .glb .gltf .npz .npy .tif; or any mesh.", is_argument=True),
    Option("other", Path | None, None, "Another bake of the same mesh, with a slider between.", is_argument=True),
    Option("output", Path | None, None, "The page, .html; by default beside RESULT, with its name.", short="-o"),
    Option("mesh", Path | None, None, "The mesh file that a .npz, .npy or .tif belongs to."),
    Option("up", Up | None, None, "Up axis at first, by default what it says, or y."),
    Option("open", bool, False, "Open it in the browser."),
    _QUIET,
)
def view(**options: Any) -> None:
    """Make a page to look at a bake, or at any mesh: one file."""
    from obscurance.scenes.commands.view import run_view

    run_view(**options)


@command(
    Option("files", list[Path], ..., "Meshes with w, vertex colours or occlusion textures, images, .npz .npy .tif.",
           is_argument=True),
    Option("of", Path | None, None, "The mesh file that they belong to.", metavar="MESH"),
    Option("within", float | None, None, "Exit status 1 if the RMS error of one is surely above it."),
    *(of_bake(name, kind=str | None, default=None) for name in ("falloff", "half_distance", "max_distance")),
    *map(of_bake, ("tau", "ground", "occluder")),
    Option("output", Path | None, None, "Also write a page that shows the difference, .html.", short="-o"),
    Option("json", bool, False, "As JSON, a list, for other programs."),
    _SEED._replace(help="Random seed of places and rays."),
    of_bake("threads"),
)  # fmt: skip
def check(files: list[Path], json: bool, **options: Any) -> int:
    """Compare w in files, of any program, with rays."""
    from obscurance.scenes.commands.check import check_files

    return check_files(files, json, **options)


@command(
    Option("baked", Path, ..., "A file of bake --profile: .npz .ply .glb .gltf .exr", is_argument=True),
    Option("half_distance", str, ..., 'Mesh units, or "12%" of the radius; or "3%,40%", whose w is multiplied.'),
    Option("output", Path, ..., "Output file, format by ending, as of bake.", short="-o"),
    Option("power", str | None, None, "Of w at each half-distance, 1 by default: 1,0.5."),
    Option("mesh", Path | None, None, "The mesh file that a .npz belongs to."),
    _QUIET,
)
def falloff(baked: Path, half_distance: str, output: Path, power: str | None, mesh: Path | None, quiet: bool) -> None:
    """Change the falloff of a bake that has a profile, without rays."""
    from obscurance.scenes.commands.falloff import change_falloff
    from obscurance.scenes.falloffs import make_scales

    summary = change_falloff(baked, make_scales(half_distance, power), output, mesh)
    if not quiet:
        print(summary)


@command(
    Option("mesh", Path, ..., "A mesh file: .glb .gltf .obj .ply .stl .off .3mf", is_argument=True),
    Option("output", Path, ..., "The file to write: .glb, with materials, .ply .obj .stl .off", short="-o"),
    Option("by", PrunedBy, "faces", "What goes as a whole, if nothing of it is seen."),
    Option("from", SeenFrom, "outside", "Where it is seen from; above: by lines that rise, by the up axis."),
    of_bake("up", help="Up axis, by default what the file says, or y."),
    Option("depth", int, 0, "Bounces from a seen side into a cavity, whose faces stay.", metavar="N"),
    Option("keep_neighbours", int, 0, "Rings of faces around seen ones that stay.", metavar="N"),
    _SEED,
    of_bake("threads"),
    _QUIET,
)
def prune(mesh: Path, output: Path, quiet: bool, **options: Any) -> None:
    """Drop the faces that nothing outside sees."""
    from obscurance.scenes.commands.prune import prune as prune_file

    above = options.pop("from") == "above"
    summary = prune_file(mesh, output, quiet, above=above, **options)
    if not quiet:
        print(summary)


@command(
    Option("mesh", Path, ..., "A mesh file, or - for standard input.", is_argument=True),
    Option("json", bool, False, "As JSON, for other programs."),
)
def info(mesh: Path, json: bool) -> None:
    """Describe a mesh file and its defects."""
    from obscurance.scenes.commands.info import describe, facts
    from obscurance.scenes.formats.load import load_mesh

    source = load_mesh(mesh)
    if json:
        from json import dumps

        print(dumps(facts(source), indent=2, allow_nan=False))
    else:
        print(columns(describe(source)))


@command(
    Option("samples", int, 4096, "Rays per vertex; allowed errors depend on it."),
    _SEED,
    of_bake("threads"),
    *(Option(name, bool, False) for name in ("stress", "generated", "long")),
)
def validate(samples: int, seed: int, threads: int | None, **moved: bool) -> int:
    """Compare bakes with exact solutions; exit status 1 on failure."""
    from obscurance.ao.options import Options
    from obscurance.scenes.validation.table import run_validation, validation_table

    if any(moved.values()):
        where = "python -m pytest tests/stress tests/random_meshes, in the source folder"
        note(f"validate: stress tests and random meshes are test suites: {where}")
        return 2
    Options(samples=samples, seed=seed, threads=threads)
    results = run_validation(samples=samples, seed=seed, threads=threads)
    print(validation_table(results))
    return 0 if all(result.ok for result in results) else 1


@command(*RENDER)
def render(**options: Any) -> None:
    """Render a scene to an image; an .exr holds every layer."""
    from obscurance.scenes.commands.render import run_render

    run_render(RenderOptions(**options))


def _scene_names() -> list[str]:
    from obscurance.scenes.library import BUILTIN

    return list(BUILTIN)


@command(
    Option("name", str | None, None, "A built-in scene; without, a list.", is_argument=True, words=_scene_names),
    Option("output", Path | None, None, "Write the scene to this .toml file.", short="-o"),
)
def scenes(name: str | None, output: Path | None) -> None:
    """List the built-in scenes, or print or write one as TOML."""
    from obscurance.scenes.library import BUILTIN, builtin_toml, write_builtin

    if name is None:
        if output is not None:
            raise OptionError("name", "the scene to write", "nothing")
        print(columns(list(BUILTIN.items())))
    elif output is None:
        print(builtin_toml(name), end="")
    else:
        write_builtin(name, output)


def _preset_names() -> list[str]:
    from obscurance.raytrace import PRESETS

    return list(PRESETS)


@command(
    Option("name", str | None, None, "A preset; without, a list.", is_argument=True, words=_preset_names),
    Option("check", bool, False),
)
def materials(name: str | None, check: bool) -> None:
    """List the material presets, or print one as TOML."""
    from obscurance.scenes.commands.materials import preset_toml, presets

    if check:
        in_python = "albedo(material, angle) and asymmetry(material) of raytrace.brdf.reflect, in Python"
        raise OptionError("check", in_python, "--check, which is no more")
    if name is None:
        print(columns(presets()))
    else:
        print(preset_toml(name), end="")


@command(
    Option("a", Path, ..., "The reference image.", is_argument=True),
    Option("b", Path, ..., "The image to compare with it.", is_argument=True),
    Option("threshold", float | None, None, "Exit status 1 if the metric is above it."),
    Option("metric", Metric, "flip", "Metric that --threshold applies to."),
    Option("difference", Path | None, None, "Write the FLIP difference map: .png .tif .jpg"),
)
def compare(a: Path, b: Path, threshold: float | None, metric: Metric, difference: Path | None) -> int:
    """Compare two images: mean, RMS and maximum error, PSNR, FLIP."""
    from obscurance.raytrace.image.compare import compare as compared
    from obscurance.raytrace.image.write import check_image_target

    if threshold is not None and not threshold >= 0:
        raise OptionError("threshold", "a number in [0, inf)", threshold)
    if difference:
        with named("difference"):
            check_image_target(difference, layers=("beauty",))
    found = compared(a, b, difference)
    names = ("mean_error", "rms_error", "max_error", "psnr", "flip")
    print(columns([(name, f"{getattr(found, name):.6g}") for name in names]))
    return 0 if threshold is None or found.within(threshold, metric) else 1


@command(
    Option("mesh", Path | None, None, "A mesh file; without one, the built-in temple.", is_argument=True),
    of_bake("falloff"),
    of_bake("max_distance"),
    _SEED._replace(help="Random seed of the first round; later rounds count up."),
    of_bake("threads"),
    Option("report", Path | None, None, "Also write every round as JSON."),
)
def bench(report: Path | None, **options: Any) -> None:
    """Measure bake time against error on this machine."""
    from obscurance.scenes.commands.bench import bench_file
    from obscurance.scenes.falloffs import make_falloff

    written = {name: plain(value) for name, value in options.items()}
    falloff = make_falloff(options["falloff"], None, None, options["max_distance"])
    bench_file(options["mesh"], falloff, options["seed"], options["threads"], report, written)


@command(Option("output", Path, "demo", "Folder for the mesh and the image.", short="-o"), of_bake("quiet"))
def demo(output: Path, quiet: bool) -> None:
    """Bake the built-in temple and render it."""
    from obscurance.scenes.commands.demo import make_demo

    make_demo(output, quiet)


def main() -> None:
    """Run the command. Exit status: 0 done, 2 the user's input, 1 anything else, 130 interrupted, 143 by SIGTERM."""
    status: Any
    try:
        status = _run()
    except KeyboardInterrupt:
        print("interrupted; no file is half-written", file=sys.stderr)
        status = interrupts.exit_status()
    except SystemExit as end:  # a batch, which has said what is baked
        status = interrupts.exit_status() if end.code == 130 else end.code
    interrupts.end_process()
    if "OpenImageIO" not in sys.modules:  # which complains of what is left
        gc.freeze()  # or the interpreter, as it ends, looks for garbage in what was imported
    sys.exit(status)


def _run() -> int:
    reopen_streams()
    arguments = sys.argv[1:]
    with interrupts.watched(), readable_output():
        try:
            status = _called(arguments)
            sys.stdout.flush()
        except (click.UsageError, ObscuranceError) as fault:
            from obscurance.scenes.commands.usage import fault_in_words

            note(fault_in_words(fault, commands, arguments))
            status = 2 if isinstance(fault, click.UsageError | InputError | OutputError) else 1
        except MemoryError:
            note("out of memory: the system or a limit, ulimit -v for instance, gives no more")
            status = 2
        except OSError as failure:
            status = output_failed(failure)
        except Exception as fault:
            if sys.flags.dev_mode:  # python -X dev
                raise
            note(unforeseen(fault))
            status = 1
    return status


def _called(arguments: list[str]) -> int:
    """Call a command, or complete the line of a shell. Returns: the exit status."""
    if instruction := os.environ.get(_COMPLETE):
        from click.shell_completion import shell_complete

        return shell_complete(commands, {}, "obscurance", _COMPLETE, instruction)
    try:
        with commands.make_context("obscurance", list(arguments)) as context:
            return commands.invoke(context) or 0
    except click.exceptions.Exit as end:
        return end.exit_code


if __name__ == "__main__":
    main()
