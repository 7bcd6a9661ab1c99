"""The progress of work: labelled bars on a terminal, a line in notebooks, lines every 10 s elsewhere, or JSON."""

import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any, Protocol

from obscurance.raytrace.system.interrupts import at_once

_EVERY = 0.1  # seconds between lines of JSON
_EVERY_LINE = 10.0  # and between lines off a terminal
_UNCOUNTED = 1.0  # from which on a stage is shown that counts nothing
_RATED = 1000  # a count of fewer has no rate worth telling


class Advance(Protocol):
    """What work calls as it goes on."""

    def __call__(self, done: int, total: int, stage: str = "") -> None:
        """Show that `done` of `total` units are done. Args: stage: of the work; "" if it has no name but its unit's."""


@contextmanager
def progress(
    quiet: bool, *units: str, form: str = "bar", status: Callable[[], str] = str
) -> Iterator[tuple[Advance | None, ...]]:
    """A labelled bar for each stage on a terminal's standard error, one after the other; a line that changes below the
    cell of a notebook; elsewhere a line every 10 s, also within a library's call.

    In the form "json" they are lines, ten a second at most, on standard error whatever that is, quiet or not. A bar is
    full when the next one begins, and the last when the work is done.

    Args: units: what each kind of work counts. status: says what else to show.
    """
    if form == "json":
        start = time.perf_counter()
        yield tuple(_json_lines(unit, start) for unit in units)
        return
    if quiet:
        yield (None,) * len(units)
        return
    shown = _cell() if in_notebook() else _bars() if sys.stderr.isatty() else _lines()
    with shown as show:
        yield tuple(_stages(unit, show, status) for unit in units)


@contextmanager
def stage(name: str, quiet: bool, form: str) -> Iterator[None]:
    """A stage of work that counts nothing, for `progress` to show if it is long."""
    with progress(quiet, name, form=form) as (advance,):
        if advance is None:
            yield
            return
        timer = threading.Timer(_UNCOUNTED, advance, (0, 1))
        with suppress(RuntimeError):  # the system grants no thread
            timer.start()
        try:
            yield
        finally:
            timer.cancel()
            if timer.is_alive():
                timer.join()


Show = Callable[[str, int, int, str], None]  # of a stage: its label, what is done and in all, and what else to say


def _stages(unit: str, show: Show, status: Callable[[], str]) -> Advance:
    """An `Advance` that shows each stage of a work by its label and its rate since it began."""
    began: dict[str, tuple[float, int]] = {}

    def advance(done: int, total: int, stage: str = "") -> None:
        """Show a stage with its rate since it began, once some of it is done."""
        label = stage or unit
        start, before = began.setdefault(label, (time.perf_counter(), done))
        rate = (done - before) / max(time.perf_counter() - start, 1e-6)
        text = f"{rate / 1e6:.1f} M {unit}/s" if rate >= 1e5 else f"{rate:.0f} {unit}/s"
        if total < _RATED or done == before:
            text = ""
        show(label, done, total, ", ".join(filter(None, (text, status()))))

    return advance


@contextmanager
def _lines() -> Iterator[Show]:
    """Lines on standard error, one every 10 s of what was shown last."""
    shown: list[tuple[str, int, int, str]] = []
    over = threading.Event()

    def show(*stage: Any) -> None:
        shown[:] = [stage]

    def tell() -> None:
        while not over.wait(_EVERY_LINE):
            for label, done, total, text in shown:
                words = f"{100 * done // max(total, 1)} %", text
                print(f"obscurance: {label}: {', '.join(filter(None, words))}", file=sys.stderr, flush=True)

    with suppress(RuntimeError):  # the system grants no thread
        threading.Thread(target=tell, daemon=True).start()
    try:
        yield show
    finally:
        over.set()


def in_notebook() -> bool:
    """Whether this process is the kernel of a notebook."""
    shell = sys.modules["IPython"].get_ipython() if "IPython" in sys.modules else None
    return getattr(shell, "kernel", None) is not None


@contextmanager
def _cell() -> Iterator[Show]:
    """A line below the cell of a notebook, which goes when the work is done."""
    from IPython.display import display

    cell = display({"text/plain": ""}, raw=True, display_id=True)
    last = 0.0

    def show(label: str, done: int, total: int, text: str) -> None:
        nonlocal last
        now = time.perf_counter()
        if now - last >= _EVERY:
            last = now
            words = f"{label}: {100 * done // max(total, 1)} %", text
            cell.update({"text/plain": ", ".join(filter(None, words))}, raw=True)

    try:
        yield show
    finally:
        cell.update({"text/plain": ""}, raw=True)


@contextmanager
def _bars() -> Iterator[Show]:
    """Bars on a terminal, of which one is seen at a time."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeRemainingColumn

    label = TextColumn("{task.description}")
    figures = TextColumn("{task.percentage:3.0f} % {task.fields[text]}")
    bars = Progress(label, BarColumn(), figures, TimeRemainingColumn(), console=Console(stderr=True), transient=True)
    tasks: dict[str, TaskID] = {}

    def show(label: str, done: int, total: int, text: str) -> None:
        if label not in tasks:
            fill()
            tasks[label] = bars.add_task(label, text="")
            bars.start()
        bars.update(tasks[label], completed=done, total=total, text=text)

    def fill() -> None:
        """Show all bars as full, then hide them."""
        for task in tasks.values():
            bars.update(task, completed=bars.tasks[task].total)
            bars.refresh()
            bars.update(task, visible=False)

    at_once.append(bars.stop)  # which shows the cursor again
    try:
        yield show
        fill()
    finally:
        bars.stop()
        at_once.remove(bars.stop)


def _json_lines(unit: str, start: float) -> Advance:
    """Progress as objects with event, unit, stage, done, total and seconds since `start`, one a line."""
    import json

    last = 0.0

    def advance(done: int, total: int, stage: str = "") -> None:
        nonlocal last
        now = time.perf_counter()
        if done < total and now - last < _EVERY:
            return
        last = now
        counts = {"unit": unit, "stage": stage or unit, "done": done, "total": total}
        event = {"event": "progress", **counts, "seconds": round(now - start, 3)}
        print(json.dumps(event), file=sys.stderr, flush=True)

    return advance
