"""The `obscurance` command: parsing, calling and printing, nothing else. Heavy imports wait until a command runs."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.exceptions import TyperException

if TYPE_CHECKING:
    import ao
    from raytrace.mesh import Mesh

app = typer.Typer(
    add_completion=False,
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    help="Bake ambient occlusion and obscurance, 1 = open, with Embree.",
)


class Method(StrEnum):
    vertex = "vertex"
    surface = "surface"


class FalloffForm(StrEnum):
    exponential = "exponential"
    binary = "binary"


class Hidden(StrEnum):
    ignore = "ignore"
    mark = "mark"
    fill = "fill"


class Metric(StrEnum):
    flip = "flip"
    rms = "rms"
    max = "max"


class NormalsFrom(StrEnum):
    angle = "angle"
    area = "area"
    equal = "equal"
    file = "file"


Threads = Annotated[int | None, typer.Option(help="Threads; all cores by default. Results don't depend on it.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="No progress bar, no summary.")]


@app.command()
def bake(
    mesh: Annotated[Path, typer.Argument(metavar="INPUT", help="A mesh file: PLY, OBJ, STL, OFF, GLB, glTF, 3MF, …")],
    output: Annotated[Path, typer.Option("--output", "-o", help="Target, by ending: .npy .npz .ply .glb")],
    method: Annotated[
        Method, typer.Option(help="Sample at the vertices, or all over the faces and fit the vertices to it.")
    ] = Method.vertex,
    falloff: Annotated[
        FalloffForm, typer.Option(help="μ: how occlusion fades with distance.")
    ] = FalloffForm.exponential,
    tau: Annotated[float | None, typer.Option(help="Rate τ of the exponential μ, per mesh unit.")] = None,
    half_distance: Annotated[
        str | None, typer.Option(help='Distance that closes half, in mesh units or "50%" of the radius (the default).')
    ] = None,
    max_distance: Annotated[str, typer.Option(help='No occlusion from farther: mesh units, "25%" or inf.')] = "inf",
    samples: Annotated[int | None, typer.Option(help="Rays a vertex, 256; the most with --tolerance.")] = None,
    tolerance: Annotated[float | None, typer.Option(help="RMS error of w to bake to, by as few rays as do.")] = None,
    reconstruct: Annotated[bool, typer.Option(help="Let vertices learn from their neighbours.")] = True,
    seed: Annotated[int, typer.Option(help="Another seed, another set of rays.")] = 0,
    threads: Threads = None,
    normals: Annotated[
        NormalsFrom, typer.Option(help="Vertex normals: face weighting, or the file's.")
    ] = NormalsFrom.angle,
    hidden: Annotated[
        Hidden, typer.Option(help="Vertices inside closed solids: no such thing, flagged, or filled from others.")
    ] = Hidden.ignore,
    report: Annotated[Path | None, typer.Option(help="Also write a JSON report.")] = None,
    debug_image: Annotated[Path | None, typer.Option(help="Also write a picture that marks flagged vertices.")] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Continue an interrupted bake to this target.")] = False,
    colors: Annotated[bool, typer.Option("--colors", help="Give a .glb the vertex colours COLOR_0 = w too.")] = False,
    quiet: Quiet = False,
) -> None:
    """Bake obscurance w(p) at every vertex of a mesh."""
    options = {key: _plain(value) for key, value in locals().items() if key not in ("report", "quiet", "resume")}
    import ao
    from ao.checkpoint import Checkpoint
    from raytrace.atomic import check_writable
    from scenes.write import check_target, write

    chosen = _falloff(falloff, tau, half_distance, max_distance)
    if method is Method.surface:
        _only_at_vertices(
            tolerance=tolerance is not None,
            reconstruct=not reconstruct,
            hidden=hidden is not Hidden.ignore,
            resume=resume,
        )
    check_target(output)
    if report:
        check_writable(report)
    if debug_image:
        from scenes.marked import check_marked_target

        check_marked_target(debug_image)
    from scenes.load import load

    start = time.perf_counter()
    source = load(mesh)
    loaded = time.perf_counter()
    warnings = _warn([source.mesh])
    with Checkpoint(f"{output}.partial", resume, _note) as checkpoint:
        make: Any = ao.bake_surface
        if method is Method.vertex:
            make = partial(
                ao.bake, tolerance=tolerance, reconstruct=reconstruct, hidden=hidden.value, checkpoint=checkpoint
            )
        kernels = "hemisphere" if method is Method.vertex else "surface_gather"
        with _progress(quiet, "rays") as progress, _compiling(kernels):
            baked = make(source.mesh, chosen, samples, seed, threads, normals.value, progress)
        tracing = time.perf_counter()
        write(output, baked, source, colors=colors)
    seconds = {"load": loaded - start, "write": time.perf_counter() - tracing}
    if report:
        from ao.report import write_report
        from raytrace.parallel import thread_count

        options["threads"] = thread_count(threads)
        write_report(report, baked, options, seconds, warnings)
    if debug_image:
        from scenes.marked import write_marked

        write_marked(debug_image, source.mesh, baked)
    if not quiet:
        print(_summary(baked, output))


@app.command()
def info(mesh: Annotated[Path, typer.Argument(metavar="MESH", help="A mesh file.")]) -> None:
    """Tell what a mesh file holds and what a bake would make of it."""
    from scenes.info import describe
    from scenes.load import load

    rows = describe(load(mesh))
    width = max(len(name) for name, _ in rows)
    for name, value in rows:
        print(f"{name:<{width}}  {value}")


@app.command()
def validate(
    samples: Annotated[int, typer.Option(help="Rays a vertex.")] = 4096,
    seed: Annotated[int, typer.Option(help="Another seed, another set of rays.")] = 0,
    threads: Threads = None,
    stress: Annotated[bool, typer.Option("--stress", help="Instead, everything that strains numbers.")] = False,
    long: Annotated[bool, typer.Option("--long", help="With --stress: every pose, for minutes.")] = False,
) -> None:
    """Bake scenes whose answer is known in closed form; exit status 1 if one is off."""
    if stress:
        _stress(samples, seed, threads, long)
        return
    from raytrace.errors import OptionError
    from scenes.validation import run, table

    if long:
        raise OptionError("--long", "--stress with it", "no --stress")
    with _compiling("hemisphere"):
        results = run(samples=samples, seed=seed, threads=threads)
    print(table(results))
    if not all(result.ok for result in results):
        raise typer.Exit(1)


def _stress(samples: int, seed: int, threads: int | None, long: bool) -> None:
    from raytrace.errors import OptionError
    from scenes.stress.line import table
    from scenes.stress.suite import run

    if (samples, seed) != (4096, 0):
        raise OptionError("--samples, --seed", "neither of them with --stress", f"{samples}, {seed}")
    with _compiling("hemisphere"), _progress(False, "groups") as progress:
        lines = run(long, threads, progress)
    print(table(lines))
    if not all(line.ok for line in lines):
        raise typer.Exit(1)


@app.command()
def render(
    scene: Annotated[Path, typer.Argument(metavar="SCENE", help="A .toml scene, a .glb or .gltf, or any mesh.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="Image, by ending: .exr .png .tif .jpg")],
    width: Annotated[int | None, typer.Option(help="Pixels; with --height, in place of the scene's.")] = None,
    height: Annotated[int | None, typer.Option(help="Pixels.")] = None,
    samples: Annotated[int | None, typer.Option(help="Most rays a pixel.")] = None,
    shading: Annotated[str | None, typer.Option(help="constant, gouraud, phong or quadratic.")] = None,
    obscurance: Annotated[str | None, typer.Option(help="How w enters: ambient, book or off.")] = None,
    shadows: Annotated[bool | None, typer.Option("--shadows/--no-shadows", help="Trace shadow rays.")] = None,
    crop: Annotated[str | None, typer.Option(metavar="X,Y,W,H", help="Only these pixels.")] = None,
    seed: Annotated[int | None, typer.Option(help="Another seed, other places in the pixels.")] = None,
    preview: Annotated[bool, typer.Option("--preview", help="A quarter of the size, few rays.")] = False,
    half: Annotated[bool, typer.Option("--half", help="16-bit floats in an .exr.")] = False,
    threads: Threads = None,
    report: Annotated[Path | None, typer.Option(help="Also write a JSON report.")] = None,
    quiet: Quiet = False,
) -> None:
    """Render a scene: local illumination, shadows and obscurance; an .exr holds every layer."""
    from raytrace.atomic import check_writable
    from raytrace.errors import OptionError
    from raytrace.image import check_image_target
    from raytrace.parallel import thread_count

    if (width is None) != (height is None):
        raise OptionError("size", "--width and --height together", "one of them")
    check_image_target(output, half)
    if report:
        check_writable(report)
    given = {"samples": samples, "shading": shading, "obscurance": obscurance, "shadows": shadows, "seed": seed}
    changes: dict[str, Any] = {name: value for name, value in given.items() if value is not None}
    if crop is not None:
        changes["crop"] = _crop(crop)
    from scenes.picture import adjusted, take, write_report
    from scenes.read import read_scene

    size = None if width is None or height is None else (width, height)
    description = adjusted(read_scene(scene, size), changes, preview)
    warnings = _warn(item.shape.mesh for item in description.scene.objects)
    with _compiling("tile"), _progress(quiet, "rays") as baking, _progress(quiet, "tiles") as rendering:
        picture = take(scene, description, output, half, threads, baking, rendering)
    if report:
        write_report(report, scene, description.settings, picture, thread_count(threads), warnings)
    if not quiet:
        rays = sum(picture.frame.rays.values())
        seconds = picture.seconds["render"]
        print(
            f"{output}: {description.settings.width}×{description.settings.height}, {rays / 1e6:.1f} M rays in"
            f" {seconds:.2f} s, {sum(picture.frame.rays_skipped.values()) / 1e6:.1f} M not needed;"
            f" obscurance {description.settings.obscurance} ({picture.seconds['bake']:.2f} s)"
        )


@app.command()
def scenes(
    name: Annotated[str | None, typer.Argument(help="A built-in scene; without one they are listed.")] = None,
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Write it as TOML, to edit.")] = None,
) -> None:
    """List the built-in scenes, or write one."""
    from raytrace.errors import OptionError
    from scenes.builtin import BUILTIN, builtin_toml, write_builtin

    if name is None:
        if output is not None:
            raise OptionError("NAME", "the scene to write", "none")
        width = max(map(len, BUILTIN))
        for each, scene in BUILTIN.items():
            print(f"{each:<{width}}  {scene.summary}")
    elif output is None:
        print(builtin_toml(name), end="")
    else:
        write_builtin(name, output)


@app.command()
def compare(
    a: Annotated[Path, typer.Argument(metavar="A", help="The reference image.")],
    b: Annotated[Path, typer.Argument(metavar="B", help="The image to judge.")],
    threshold: Annotated[float | None, typer.Option(help="Exit status 1 if the metric is above it.")] = None,
    metric: Annotated[Metric, typer.Option(help="What the threshold applies to.")] = Metric.flip,
    difference: Annotated[Path | None, typer.Option(help="Write the FLIP map: .png .tif .jpg")] = None,
) -> None:
    """Tell how far apart two images are."""
    from raytrace.compare import compare as measure
    from raytrace.errors import OptionError

    if threshold is not None and not threshold >= 0:
        raise OptionError("--threshold", "a number in [0, inf)", threshold)
    found = measure(a, b, difference)
    for name in ("mean_error", "rms_error", "max_error", "psnr", "flip"):
        print(f"{name:<10}  {getattr(found, name):.6g}")
    if threshold is not None and not found.within(threshold, metric.value):
        raise typer.Exit(1)


@app.command()
def bench(
    mesh: Annotated[Path | None, typer.Argument(metavar="[MESH]", help="A mesh file; without one, a temple.")] = None,
    falloff: Annotated[
        FalloffForm, typer.Option(help="μ: how occlusion fades with distance.")
    ] = FalloffForm.exponential,
    max_distance: Annotated[str, typer.Option(help='No occlusion from farther: mesh units, "25%" or inf.')] = "inf",
    seed: Annotated[int, typer.Option(help="Of the first round; the next ones follow.")] = 0,
    threads: Threads = None,
    report: Annotated[Path | None, typer.Option(help="Also write every round as JSON.")] = None,
) -> None:
    """Measure bake time against error on this machine."""
    options = {key: _plain(value) for key, value in locals().items() if key != "report"}
    from raytrace.atomic import check_writable
    from scenes.bench import mesh_to_bench, run, table, write_report

    chosen = _falloff(falloff, None, None, max_distance)
    if report:
        check_writable(report)
    judged = mesh_to_bench(mesh)
    with _compiling("hemisphere"):
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
    """Bake a built-in scene and take its picture: temple.ply with w, temple.png to look at."""
    from raytrace.errors import OutputError
    from scenes.demo import TARGETS, make
    from scenes.write import check_target

    try:
        output.mkdir(parents=True, exist_ok=True)
    except OSError as reason:
        raise OutputError(f"{output}: cannot make this folder: {reason.strerror}") from None
    mesh_target, picture_target = (output / name for name in TARGETS)
    check_target(mesh_target)
    with _progress(quiet, "rays") as progress, _compiling("hemisphere"):
        baked = make(mesh_target, picture_target, progress)
    if not quiet:
        print(_summary(baked, mesh_target))
        print(f"picture: {picture_target}")


def _falloff(form: FalloffForm, tau: float | None, half_distance: str | None, max_distance: str) -> ao.Falloff:
    import ao
    from raytrace.errors import OptionError

    if form is FalloffForm.exponential:
        return ao.Exponential(tau, half_distance, max_distance)
    for name, value in (("--tau", tau), ("--half-distance", half_distance)):
        if value is not None:
            raise OptionError(name, "--falloff exponential with it", "--falloff binary")
    return ao.Binary(max_distance)


def _only_at_vertices(**given: bool) -> None:
    """Refuse options of the vertex method that were given to another."""
    from raytrace.errors import OptionError

    for name, is_given in given.items():
        if is_given:
            raise OptionError(f"--{name}", "--method vertex with it", "--method surface")


def _warn(meshes: Iterable[Mesh]) -> list[str]:
    """Tell on standard error what the precision of meshes does to results, once of each."""
    from raytrace.resolution import precision_warnings

    each = {id(mesh): mesh for mesh in meshes}.values()
    warnings = list(dict.fromkeys(warning for mesh in each for warning in precision_warnings(mesh)))
    for warning in warnings:
        print(f"warning: {warning}", file=sys.stderr)
    return warnings


@contextmanager
def _compiling(module: str) -> Iterator[None]:
    """Say why a first run is slow to begin. Args: module: whose kernels it needs."""
    from raytrace.jit import is_warm

    if not is_warm(module):
        print("First run of this version: compiling kernels takes up to half a minute…", file=sys.stderr)
    yield


@contextmanager
def _progress(quiet: bool, unit: str) -> Iterator[Callable[[int, int], None] | None]:
    """A progress bar on a terminal's standard error, once there is progress: a rate and the time left."""
    if quiet or not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    figures = TextColumn("{task.percentage:3.0f} % {task.fields[rate]}")
    bar = Progress(BarColumn(), figures, TimeRemainingColumn(), console=Console(stderr=True), transient=True)
    task = bar.add_task("", rate="")
    start, before = time.perf_counter(), 0

    def advance(done: int, total: int) -> None:
        nonlocal start, before
        if bar.live.is_started:
            rate = (done - before) / max(time.perf_counter() - start, 1e-6)
            text = f"{rate / 1e6:.1f} M {unit}/s" if rate >= 1e5 else f"{rate:.0f} {unit}/s"
            bar.update(task, completed=done, total=total, rate=text)
        else:
            start, before = time.perf_counter(), done
            bar.start()
        if done >= total:
            bar.stop()

    try:
        yield advance
    finally:
        bar.stop()


def _summary(baked: ao.Bake, target: Path) -> str:
    rate = baked.rays / max(baked.seconds["bake"], 1e-9) / 1e6
    text = (
        f"{target}: {len(baked.w):,} vertices, {baked.rays:,} rays in {baked.seconds['bake']:.2f} s"
        f" ({rate:.1f} Mrays/s), estimated RMSE {baked.rmse:.4f}"
    )
    flagged = ", ".join(f"{count} {name}" for name, count in baked.flagged.items() if count)
    return f"{text}\nflagged vertices: {flagged}" if flagged else text


def _crop(text: str) -> tuple[int, int, int, int]:
    from raytrace.errors import OptionError

    try:
        x, y, width, height = (int(part) for part in text.split(","))
    except ValueError:
        raise OptionError("--crop", "four whole numbers X,Y,W,H", repr(text)) from None
    return x, y, width, height


def _plain(value: object) -> object:
    return str(value) if isinstance(value, Path | StrEnum) else value


def main() -> None:
    """Run the command. Exit status: 0 done, 2 the user's input, 1 anything else, 130 interrupted."""
    from raytrace.errors import InputError, ObscuranceError, OutputError

    try:
        status = app(standalone_mode=False)
    except KeyboardInterrupt:
        status = 130
    except TyperException as mistake:
        status = _fail(mistake.format_message(), 2)
    except (InputError, OutputError) as mistake:
        status = _fail(str(mistake), 2)
    except ObscuranceError as failure:
        status = _fail(str(failure), 1)
    except MemoryError:
        status = _fail("out of memory", 1)
    if status == 130:
        print("interrupted; the target was not written", file=sys.stderr)
    sys.exit(status)


def _fail(message: str, status: int) -> int:
    _note(message)
    return status


def _note(message: str) -> None:
    print("obscurance: " + " ".join(message.split()), file=sys.stderr)


if __name__ == "__main__":
    main()
