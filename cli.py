"""The `obscurance` command: parsing, calling and printing, nothing else. Heavy imports wait until a command runs."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Annotated, Any
from warnings import catch_warnings

import typer
from typer.exceptions import TyperException
from typer.main import get_command

from scenes.commands import options as choices
from scenes.commands.console import (
    bake_summary,
    columns,
    compiling,
    note,
    output_failed,
    progress,
    readable_output,
    warn,
)
from scenes.commands.usage import mistake_in_words, option_in_words

app = typer.Typer(
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
    help="Bake ambient occlusion and obscurance, 1 = open, with Embree.",
)

Threads = Annotated[int | None, typer.Option(help="Threads; all cores by default. Results don't depend on it.")]
Form = Annotated[choices.FalloffForm, typer.Option(help="How occlusion fades with distance.")]
MaxDistance = Annotated[str, typer.Option(help='No occlusion from farther: mesh units, "25%" or inf.')]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="No progress bar, no summary.")]


@app.command()
def bake(
    mesh: Annotated[Path, typer.Argument(metavar="INPUT", help="A mesh file: PLY, OBJ, STL, OFF, GLB, glTF, 3MF, ...")],
    output: Annotated[Path, typer.Option("--output", "-o", help="Target, by ending: .npy .npz .ply .glb")],
    method: Annotated[
        choices.Method, typer.Option(help="Sample at the vertices, or all over the faces and fit the vertices to it.")
    ] = choices.Method.vertex,
    falloff: Form = choices.FalloffForm.exponential,
    tau: Annotated[float | None, typer.Option(help="Rate of the exponential falloff, per mesh unit.")] = None,
    half_distance: Annotated[
        str | None, typer.Option(help='Distance that closes half, in mesh units or "50%" of the radius (the default).')
    ] = None,
    max_distance: MaxDistance = "inf",
    samples: Annotated[int | None, typer.Option(help="Rays a vertex, 256; the most with --tolerance.")] = None,
    tolerance: Annotated[float | None, typer.Option(help="RMS error of w to bake to, by as few rays as do.")] = None,
    reconstruct: Annotated[bool, typer.Option(help="Let vertices learn from their neighbours.")] = True,
    skip: Annotated[bool, typer.Option(help="Leave out rays that certainly meet nothing; w is the same.")] = True,
    seed: Annotated[int, typer.Option(help="Another seed, another set of rays.")] = 0,
    threads: Threads = None,
    normals: Annotated[
        choices.NormalsFrom, typer.Option(help="Vertex normals: face weighting, or the file's.")
    ] = choices.NormalsFrom.angle,
    hidden: Annotated[
        choices.Hidden,
        typer.Option(help="Vertices inside solids: fill inside closed parts (auto), ignore; mark or fill by backs."),
    ] = choices.Hidden.auto,
    report: Annotated[Path | None, typer.Option(help="Also write a JSON report.")] = None,
    debug_image: Annotated[Path | None, typer.Option(help="Also write a picture that marks flagged vertices.")] = None,
    up: Annotated[choices.Up | None, typer.Option(help="With --debug-image: the axis that is up; y, of STL z.")] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Continue an interrupted bake to this target.")] = False,
    colors: Annotated[
        bool, typer.Option("--colors", help="Vertex colours w: COLOR_0 of .glb, or in place of a .ply's own.")
    ] = False,
    quiet: Quiet = False,
) -> None:
    """Bake obscurance w(p) at every vertex of a mesh."""
    options = {key: choices.plain(value) for key, value in locals().items() if key not in ("report", "quiet", "resume")}
    import ao
    from ao.options import Options
    from ao.trace.checkpoint import Checkpoint
    from raytrace.errors import OptionError
    from raytrace.system.outputs import check_ending, check_outputs
    from scenes.writers.write import check_target, write

    chosen = choices.make_falloff(falloff, tau, half_distance, max_distance)
    choices.only_in_meshes(colors, output)
    ways: Any = {"tolerance": tolerance, "reconstruct": reconstruct, "hidden": hidden.value, "skip": skip}
    Options(method.value, samples, seed, threads, **ways)
    check_target(output)
    if report:
        check_ending("--report", report, ".json")
    if debug_image:
        from scenes.commands.flag_image import check_marked_target

        with choices.named("debug_image"):
            check_marked_target(debug_image)
    elif up:
        raise OptionError("up", "--debug-image with it; w does not depend on it", "none")
    outputs = {"--output": output, "--report": report, "--debug-image": debug_image}
    check_outputs(outputs, [mesh])
    from scenes.readers.load import load
    from scenes.writers.losses import lost

    start = time.perf_counter()
    source = load(mesh, output)
    check_outputs(outputs, source.files)
    loaded = time.perf_counter()
    warnings = warn([source.mesh], [*source.notes, *lost(output, source, colors)])
    with Checkpoint(f"{output}.partial", resume, note) as checkpoint:
        make: Any = partial(ao.bake, method=method.value, checkpoint=checkpoint, **ways)
        kernels = "hemisphere" if method is choices.Method.vertex else "face_moments"
        unmet = catch_warnings(record=True, action="always", category=ao.ToleranceWarning)
        with progress(quiet, "rays") as (advance,), compiling(kernels), unmet as raised:
            baked = make(source.mesh, chosen, samples, seed, threads, normals.value, advance)
        warnings += warn([], [str(warning.message) for warning in raised])
        tracing = time.perf_counter()
        write(output, baked, source, colors=colors)
    seconds = {"load": loaded - start, "write": time.perf_counter() - tracing}
    if report:
        from ao.report import write_report
        from raytrace.system.threads import thread_count

        options["threads"] = thread_count(threads)
        write_report(report, baked, options, seconds, warnings)
    if debug_image:
        from scenes.commands.flag_image import write_marked
        from scenes.description.defaults import up_axis

        write_marked(debug_image, source.mesh, baked, up_axis(mesh, up))
    if not quiet:
        print(bake_summary(baked, output))


@app.command()
def info(mesh: Annotated[Path, typer.Argument(metavar="MESH", help="A mesh file.")]) -> None:
    """Tell what a mesh file holds and what would be baked of it."""
    from scenes.commands.info import describe
    from scenes.readers.load import load

    print(columns(describe(load(mesh))))


@app.command()
def validate(
    meshes: Annotated[
        list[Path] | None, typer.Argument(metavar="[MESH]...", help="With --generated: in place of those at hand.")
    ] = None,
    samples: Annotated[int, typer.Option(help="Rays a vertex; the error allowed goes by it.")] = 4096,
    seed: Annotated[int | None, typer.Option(help="Another seed, other rays and other generated meshes.")] = None,
    threads: Threads = None,
    stress: Annotated[bool, typer.Option("--stress", help="Instead, everything that strains numbers.")] = False,
    generated: Annotated[bool, typer.Option("--generated", help="Instead, --tolerance on meshes drawn anew.")] = False,
    long: Annotated[bool, typer.Option("--long", help="With --stress, minutes; with --generated, hours.")] = False,
    family: Annotated[list[str] | None, typer.Option(help="With --generated: only this family; repeatable.")] = None,
) -> None:
    """Bake scenes of known obscurance; exit status 1 if one is off."""
    from ao.options import Options
    from raytrace.errors import OptionError
    from scenes.stress import line, suite
    from scenes.validation import table as validation

    if long and not (stress or generated):
        raise OptionError("long", "--stress or --generated with it", "neither")
    if stress and (samples, seed, generated) != (4096, None, False):
        raise OptionError(
            "--samples, --seed, --generated", "none of them with --stress", f"{samples}, {seed}, {generated}"
        )
    if (meshes or family) and not generated:
        raise OptionError("meshes" if meshes else "family", "--generated with it", "no --generated")
    if generated:
        from scenes.generated.command import validate_generated

        with compiling("hemisphere"):
            if not validate_generated(meshes or [], samples, seed, threads, long, family or ()):
                raise typer.Exit(1)
        return
    Options("vertex", samples, seed or 0, threads)
    results: Any
    table: Callable[[Any], str]
    with compiling("hemisphere"), progress(not stress, "groups") as (advance,):
        if stress:
            results, table = suite.run(long, threads, advance), line.table
        else:
            results, table = validation.run(samples=samples, seed=seed or 0, threads=threads), validation.table
    print(table(results))
    if not all(result.ok for result in results):
        raise typer.Exit(1)


@app.command()
def render(
    scene: Annotated[Path, typer.Argument(metavar="SCENE", help="A .toml scene, a .glb or .gltf, or any mesh.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="Image, by ending: .exr .png .tif .jpg")],
    width: Annotated[int | None, typer.Option(help="Pixels; with --height, in place of the scene's.")] = None,
    height: Annotated[int | None, typer.Option(help="Pixels.")] = None,
    samples: Annotated[int | None, typer.Option(help="Most rays a pixel.")] = None,
    shading: Annotated[str | None, typer.Option(help="constant, flat, gouraud, phong or quadratic.")] = None,
    normals: Annotated[
        choices.NormalsFrom | None,
        typer.Option(help="Vertex normals: face weighting, or the file's where it has some."),
    ] = None,
    obscurance: Annotated[
        str | None,
        typer.Option(help="What w weights: ambient light; book: diffuse too, as the textbook has it (12.75); off."),
    ] = None,
    baked: Annotated[Path | None, typer.Option(help="w from this file of a bake: .npy .npz .ply .glb")] = None,
    shadows: Annotated[bool | None, typer.Option("--shadows/--no-shadows", help="Trace shadow rays.")] = None,
    up: Annotated[choices.Up | None, typer.Option(help="The axis that is up in a mesh file; y, of STL z.")] = None,
    crop: Annotated[str | None, typer.Option(metavar="X,Y,W,H", help="Only these pixels.")] = None,
    seed: Annotated[int | None, typer.Option(help="Another seed, other places in the pixels.")] = None,
    preview: Annotated[bool, typer.Option("--preview", help="A quarter of the size, few rays.")] = False,
    half: Annotated[bool, typer.Option("--half", help="16-bit floats in an .exr.")] = False,
    threads: Threads = None,
    report: Annotated[Path | None, typer.Option(help="Also write a JSON report.")] = None,
    quiet: Quiet = False,
) -> None:
    """Render a scene; an .exr holds every layer."""
    from raytrace.image.write import check_image_target
    from raytrace.system.outputs import check_ending, check_outputs
    from raytrace.system.threads import thread_count

    size = choices.parse_size(width, height)
    thread_count(threads)
    check_image_target(output, half)
    if report:
        check_ending("--report", report, ".json")
    outputs = {"--output": output, "--report": report}
    check_outputs(outputs, [scene])
    given: dict[str, Any] = {"samples": samples, "shading": shading, "obscurance": obscurance}
    given["normals"] = None if normals is None else normals.value
    given |= {"shadows": shadows, "seed": seed, "crop": None if crop is None else choices.parse_crop(crop)}
    from scenes.commands.render import adjusted, make_picture, write_render_report
    from scenes.description.read import read_scene
    from scenes.readers.stored_w import check_stored

    if baked:
        check_stored(baked)
    description = adjusted(read_scene(scene, size, up), given, preview, baked)
    check_outputs(outputs, description.files)
    warnings = warn((item.shape.mesh for item in description.scene.objects), description.notes)
    with compiling("tile"), progress(quiet, "rays", "tiles") as (baking, rendering):
        picture = make_picture(scene, description, output, half, threads, baking, rendering)
    if report:
        write_render_report(report, scene, description.settings, picture, thread_count(threads), warnings)
    if not quiet:
        print(picture.summary(output, description.settings))


@app.command()
def scenes(
    name: Annotated[str | None, typer.Argument(help="A built-in scene; without one they are listed.")] = None,
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Write it as TOML, to edit.")] = None,
) -> None:
    """List the built-in scenes, or write one."""
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
    name: Annotated[str | None, typer.Argument(help="A preset, or a scene file with --check.")] = None,
    check: Annotated[
        bool, typer.Option("--check", help="Measure albedo by angle and reciprocity; an Oren-Nayar fit's error.")
    ] = False,
) -> None:
    """List the material presets, write one as TOML, or measure."""
    from scenes.commands import materials as material_figures

    if check:
        print("\n\n".join(material_figures.check(*each) for each in material_figures.named_materials(name)))
    elif name is None:
        print(columns(material_figures.presets()))
    else:
        print(material_figures.preset_toml(name), end="")


@app.command()
def compare(
    a: Annotated[Path, typer.Argument(metavar="A", help="The reference image.")],
    b: Annotated[Path, typer.Argument(metavar="B", help="The image to judge.")],
    threshold: Annotated[float | None, typer.Option(help="Exit status 1 if the metric is above it.")] = None,
    metric: Annotated[choices.Metric, typer.Option(help="What the threshold applies to.")] = choices.Metric.flip,
    difference: Annotated[Path | None, typer.Option(help="Write the FLIP map: .png .tif .jpg")] = None,
) -> None:
    """Tell how far apart two images are."""
    from raytrace.errors import OptionError
    from raytrace.image.compare import compare as measure
    from raytrace.image.write import check_image_target

    if threshold is not None and not threshold >= 0:
        raise OptionError("threshold", "a number in [0, inf)", threshold)
    if difference:
        with choices.named("difference"):
            check_image_target(difference, layers=("beauty",))
    found = measure(a, b, difference)
    figures = ("mean_error", "rms_error", "max_error", "psnr", "flip")
    print(columns([(name, f"{getattr(found, name):.6g}") for name in figures]))
    if threshold is not None and not found.within(threshold, metric.value):
        raise typer.Exit(1)


@app.command()
def bench(
    mesh: Annotated[Path | None, typer.Argument(metavar="[MESH]", help="A mesh file; without one, a temple.")] = None,
    falloff: Form = choices.FalloffForm.exponential,
    max_distance: MaxDistance = "inf",
    seed: Annotated[int, typer.Option(help="Of the first round; the next ones follow.")] = 0,
    threads: Threads = None,
    report: Annotated[Path | None, typer.Option(help="Also write every round as JSON.")] = None,
) -> None:
    """Measure bake time against error on this machine."""
    options = {key: choices.plain(value) for key, value in locals().items() if key != "report"}
    from ao.options import Options
    from raytrace.system.outputs import check_ending, check_outputs
    from scenes.commands.bench import mesh_to_bench, run, table, write_report

    chosen = choices.make_falloff(falloff, None, None, max_distance)
    if report:
        check_ending("--report", report, ".json")
        check_outputs({"--report": report}, [mesh] if mesh else [])
    Options(seed=seed, threads=threads)
    judged = mesh_to_bench(mesh)
    with compiling("hemisphere"):
        rows = run(judged, chosen, seed=seed, threads=threads)
    print(f"{judged.source}: {len(judged.vertices):,} vertices, {len(judged.faces):,} faces")
    print(table(rows))
    if report:
        write_report(report, judged, rows, options, threads)


@app.command()
def demo(
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder for the mesh and the picture.")] = Path("demo"),
    quiet: Quiet = False,
) -> None:
    """Bake a built-in scene and take its picture."""
    from scenes.commands.demo import make, targets

    mesh_target, picture_target = targets(output)
    with progress(quiet, "rays") as (advance,), compiling("hemisphere"):
        baked = make(mesh_target, picture_target, advance)
    if not quiet:
        print(bake_summary(baked, mesh_target))
        print(f"picture: {picture_target}")


@app.callback(invoke_without_command=True)
def start(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Tell the version and end.")] = False,
) -> None:
    """Bake ambient occlusion and obscurance, 1 = open, with Embree."""
    if version:
        from importlib.metadata import version as installed

        print("obscurance", installed("obscurance"))
        raise typer.Exit
    if context.invoked_subcommand is None:
        print(context.get_help())


def main() -> None:
    """Run the command. Exit status: 0 done, 2 the user's input, 1 anything else, 130 interrupted."""
    from raytrace.errors import InputError, ObscuranceError, OutputError

    arguments, commands = sys.argv[1:], get_command(app)
    with readable_output():
        try:
            status = commands.main(arguments, "obscurance", standalone_mode=False)
            sys.stdout.flush()
        except KeyboardInterrupt:
            status = 130
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
        if status == 130:
            print("interrupted; the target was not written", file=sys.stderr)
    sys.exit(status)


def _fail(message: str, status: int) -> int:
    note(message)
    return status


if __name__ == "__main__":
    main()
