"""The `obscurance` command: parsing, calling and printing, nothing else. Heavy imports wait until a command runs."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.exceptions import TyperException

if TYPE_CHECKING:
    import ao

app = typer.Typer(
    add_completion=False,
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    help="Bake ambient occlusion and obscurance, 1 = open, with Embree.",
)


class Method(StrEnum):
    vertex = "vertex"


class FalloffForm(StrEnum):
    exponential = "exponential"
    binary = "binary"


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
    method: Annotated[Method, typer.Option(help="Sample at the vertices.")] = Method.vertex,
    falloff: Annotated[
        FalloffForm, typer.Option(help="μ: how occlusion fades with distance.")
    ] = FalloffForm.exponential,
    tau: Annotated[float | None, typer.Option(help="Rate τ of the exponential μ, per mesh unit.")] = None,
    half_distance: Annotated[
        str | None, typer.Option(help='Distance that closes half, in mesh units or "50%" of the radius (the default).')
    ] = None,
    max_distance: Annotated[str, typer.Option(help='No occlusion from farther: mesh units, "25%" or inf.')] = "inf",
    samples: Annotated[int, typer.Option(help="Rays a vertex; powers of two are best.")] = 256,
    seed: Annotated[int, typer.Option(help="Another seed, another set of rays.")] = 0,
    threads: Threads = None,
    normals: Annotated[
        NormalsFrom, typer.Option(help="Vertex normals: face weighting, or the file's.")
    ] = NormalsFrom.angle,
    report: Annotated[Path | None, typer.Option(help="Also write a JSON report.")] = None,
    colors: Annotated[bool, typer.Option("--colors", help="Give a .glb the vertex colours COLOR_0 = w too.")] = False,
    quiet: Quiet = False,
) -> None:
    """Bake obscurance w(p) at every vertex of a mesh."""
    options = {key: _plain(value) for key, value in locals().items() if key not in ("report", "quiet")}
    from raytrace.atomic import check_writable
    from scenes.write import check_target, write

    chosen = _falloff(falloff, tau, half_distance, max_distance)
    check_target(output)
    if report:
        check_writable(report)
    from scenes.load import load

    start = time.perf_counter()
    source = load(mesh)
    loaded = time.perf_counter()
    baked = _bake(source.mesh, chosen, samples, seed, threads, normals.value, quiet)
    tracing = time.perf_counter()
    write(output, baked, source, colors=colors)
    seconds = {"load": loaded - start, "write": time.perf_counter() - tracing}
    if report:
        from ao.report import write_report
        from raytrace.parallel import thread_count

        options["threads"] = thread_count(threads)
        write_report(report, baked, options, seconds)
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
) -> None:
    """Bake scenes whose answer is known in closed form; exit status 1 if one is off."""
    from scenes.validation import run, table

    with _compiling():
        results = run(samples=samples, seed=seed, threads=threads)
    print(table(results))
    if not all(result.ok for result in results):
        raise typer.Exit(1)


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
    with _progress(quiet) as progress, _compiling():
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


def _bake(
    mesh: Any, falloff: ao.Falloff, samples: int, seed: int, threads: int | None, normals: Any, quiet: bool
) -> Any:
    import ao

    with _progress(quiet) as progress, _compiling():
        return ao.bake(mesh, falloff, samples, seed, threads, normals, progress)


@contextmanager
def _compiling() -> Iterator[None]:
    """Say why a first run is slow to begin."""
    from raytrace.jit import is_warm

    if not is_warm():
        print("First run of this version: compiling kernels, some ten seconds…", file=sys.stderr)
    yield


@contextmanager
def _progress(quiet: bool) -> Iterator[Callable[[int, int], None] | None]:
    """A progress bar on a terminal's standard error: rays per second and time left."""
    if quiet or not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (
        BarColumn(),
        TextColumn("{task.percentage:3.0f} %"),
        TextColumn("{task.fields[rate]}"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("bake", rate="")
        start = time.perf_counter()

        def advance(done: int, total: int) -> None:
            rate = done / max(time.perf_counter() - start, 1e-6)
            bar.update(task, completed=done, total=total, rate=f"{rate / 1e6:.1f} Mrays/s")

        yield advance


def _summary(baked: ao.Bake, target: Path) -> str:
    rate = baked.rays / max(baked.seconds["bake"], 1e-9) / 1e6
    text = (
        f"{target}: {len(baked.w):,} vertices, {baked.rays / 1e6:.1f} M rays in {baked.seconds['bake']:.2f} s"
        f" ({rate:.1f} Mrays/s), estimated RMSE {baked.rmse:.4f}"
    )
    flagged = ", ".join(f"{count} {name}" for name, count in baked.flagged.items() if count)
    return f"{text}\nflagged vertices: {flagged}" if flagged else text


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
        print("interrupted; nothing was written", file=sys.stderr)
    sys.exit(status)


def _fail(message: str, status: int) -> int:
    print("obscurance: " + " ".join(message.split()), file=sys.stderr)
    return status


if __name__ == "__main__":
    main()
