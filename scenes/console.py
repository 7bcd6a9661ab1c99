"""What the command says while it works and when it is done."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import ao
    from raytrace.mesh import Mesh


def note(message: str) -> None:
    """One line on standard error."""
    print("obscurance: " + " ".join(message.split()), file=sys.stderr)


def warn(meshes: Iterable[Mesh], others: Iterable[str] = ()) -> list[str]:
    """Tell on standard error what the precision of meshes does to results, and what others there are, once of each."""
    from raytrace.resolution import precision_warnings

    each = {id(mesh): mesh for mesh in meshes}.values()
    warnings = list(dict.fromkeys(warning for mesh in each for warning in precision_warnings(mesh)))
    warnings += list(dict.fromkeys(others))
    for warning in warnings:
        print(f"warning: {warning}", file=sys.stderr)
    return warnings


@contextmanager
def compiling(module: str) -> Iterator[None]:
    """Say why a first run is slow to begin. Args: module: whose kernels it needs."""
    from raytrace.jit import is_warm

    if not is_warm(module):
        print("First run of this version: compiling kernels takes up to half a minute…", file=sys.stderr)
    yield


@contextmanager
def progress(quiet: bool, unit: str) -> Iterator[Callable[[int, int], None] | None]:
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


def bake_summary(baked: ao.Bake, target: Path) -> str:
    """What was baked to where, at which rate and how well."""
    clear = baked.rays_skipped.get("open", 0)
    rays = baked.rays + clear
    text = (
        f"{target}: {len(baked.w):,} vertices, {rays:,} rays{f', {clear:,} of them certainly open,' if clear else ''}"
        f" in {baked.seconds['bake']:.2f} s ({rays / max(baked.seconds['bake'], 1e-9) / 1e6:.1f} Mrays/s),"
        f" estimated RMSE {baked.rmse:.4f}"
    )
    flagged = ", ".join(f"{count} {name}" for name, count in baked.flagged.items() if count)
    return f"{text}\nflagged vertices: {flagged}" if flagged else text


def columns(rows: Sequence[tuple[str, str]]) -> str:
    """Names and values, aligned."""
    width = max(len(name) for name, _ in rows)
    return "\n".join(f"{name:<{width}}  {value}" for name, value in rows)
