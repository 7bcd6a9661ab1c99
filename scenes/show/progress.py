"""The progress of work: labelled bars on a terminal, a line in notebooks, lines every 10 s elsewhere, or JSON."""

import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import Any, Protocol

from obscurance.raytrace.system.interrupts import at_once

_EVERY = 0.1  # seconds between lines of JSON
_EVERY_LINE = 10.0  # and between lines off a terminal
_LATE = 1.0  # until a stage is shown that has counted nothing
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

    Args: units: what each kind of work counts, or a name of work that counts nothing. status: says what else to show.
    """
    if form == "json":
        start = time.perf_counter()
        with _first_if_late([_json_lines(unit, start) for unit in units]) as advances:
            yield advances
        return
    if quiet:
        yield (None,) * len(units)
        return
    shown = _cell() if in_notebook() else _bars() if sys.stderr.isatty() else _lines()
    with shown as show, _first_if_late([_stages(unit, show, status) for unit in units]) as advances:
        yield advances


@contextmanager
def _first_if_late(advances: Sequence[Advance]) -> Iterator[tuple[Advance, ...]]:
    """The same functions, the first of which calls itself once if none has been called after a second: so a stage that
    counts nothing is shown, too."""
    called = threading.Event()

    def heard(advance: Advance) -> Advance:
        def call(done: int, total: int, stage: str = "") -> None:
            called.set()
            advance(done, total, stage)

        return call

    def wait() -> None:
        if not called.wait(_LATE):
            advances[0](0, 1)

    waiting = threading.Thread(target=wait, daemon=True)
    with suppress(RuntimeError):  # the system grants no thread
        waiting.start()
    try:
        yield tuple(map(heard, advances))
    finally:
        called.set()
        if waiting.is_alive():
            waiting.join()


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

    cell: Any = None
    last = 0.0

    def show(label: str, done: int, total: int, text: str) -> None:
        nonlocal cell, last
        now = time.perf_counter()
        if now - last >= _EVERY:
            last = now
            words = f"{label}: {100 * done // max(total, 1)} %", text
            line = {"text/plain": ", ".join(filter(None, words))}
            if cell:
                cell.update(line, raw=True)
            else:
                cell = display(line, raw=True, display_id=True)

    try:
        yield show
    finally:
        if cell:
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
