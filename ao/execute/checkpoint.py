"""Checkpoints of long bakes: traced blocks go to a journal, from which a later run copies them."""

from __future__ import annotations

import hashlib
import os
import time
import warnings
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
import numpy.typing as npt

from raytrace.errors import InputError, OutputError
from raytrace.mesh.placement import Placement
from raytrace.types import Bools, Float64s

from ..points.receivers import Receivers
from ..rays.ray_scene import RayScene
from .identity import machine
from .journal import IDENTITY, Block, Journal, record
from .work import Advance, Span, Tables, Work, fill_spans

AFTER = 60.0  # seconds of work until a journal is begun
EVERY = 5.0  # seconds between writes
_MOST_WAITING = 1 << 26  # bytes that are written at once, due or not


class Checkpoint:
    """The journal of one bake, for `ao.bake` in a `with` block that also writes what was baked.

    Rows depend only on what their call is named by and on the header's hash, so copied ones are the bits that tracing
    would give. The file appears after a minute of work, or when much waits to be written. It is deleted when the block
    ends well, and kept when it does not.

    Args:
        path: the journal, best beside the target; None keeps nothing. resume: continue what it holds.
        notify: called with a line for the user. after, every: seconds until the first write and between writes.

    Attributes:
        partial: whether it fills only some rows, so that later rays must not depend on what earlier ones found.

    Raises, on entry into the bake:
        InputError: `resume`, and the journal is of another mesh, other options, another version or processor.
        OutputError: another process is at work on it, or it is some other file.
    """

    partial = False
    _expected = "the journal of this very bake"

    def __init__(
        self,
        path: str | os.PathLike[str] | None,
        resume: bool = False,
        notify: Callable[[str], object] = warnings.warn,
        after: float = AFTER,
        every: float = EVERY,
    ) -> None:
        self.path, self.resume, self.notify, self.after, self.every = Path(path or ""), resume, notify, after, every
        self._journal: Journal | None = None
        self._identity = b""
        self._left_over = False
        self._given_up = path is None
        self._pending: list[bytes] = []
        self._due = time.monotonic() + after

    def __enter__(self) -> Checkpoint:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        if kind is None:
            self._remove()
            return
        if self._journal or time.monotonic() >= self._due:
            self._write()
        if self._journal:
            self.notify(f"{self.path} keeps the finished part; the same command with --resume continues from it")
            self._journal.close()

    def begin(self, placement: Placement, receivers: Receivers, *settings: object) -> None:
        """Open what there is to continue. Args: everything that decides rows; `settings` by their repr."""
        if self._given_up:
            return
        self._identity = identity(placement, receivers, settings)
        self._due = time.monotonic() + self.after
        try:
            found = Journal(self.path, create=False)
        except FileNotFoundError:
            found = None
        except OSError as reason:
            if isinstance(reason, OutputError) or self.resume:
                raise _refused(self.path, reason) from None
            return
        if found and self.resume and found.identity == self._identity:
            self._journal, self._due = found, time.monotonic() + self.every
            return
        if found:
            found.close()
        if self.resume:
            if found and found.identity:
                raise InputError(self.path, "header", self._expected, "that of another or of a change")
            self.notify(f"{self.path}: nothing to resume; starting from the beginning")
        self._left_over = found is not None
        if found and found.identity == self._identity:
            self.notify(f"{self.path}: left by an interrupted run; --resume would continue it; starting over")

    def fill(self, work: Work, scene: RayScene, tables: Tables, threads: int, advance: Advance) -> None:
        """Make all rows of `work`, or copy those that the journal has.

        Args: tables: of `work.tables`, contiguous, written. advance: called with numbers of finished rows.
        """
        blocks = {} if self._journal is None else self._journal.blocks
        name, restored = work.name, np.zeros(len(work), np.bool_)
        for block in blocks:
            if block[0] == name and self._journal:
                restore(block, self._journal.content(block), tables, restored)
        if restored.any():
            advance(int(np.count_nonzero(restored)))
        if not restored.all():
            self._trace(work, scene, ~restored, tables, threads, advance)

    def _trace(
        self, work: Work, scene: RayScene, missing: Bools, tables: Tables, threads: int, advance: Advance
    ) -> None:
        """Make the `missing` rows, bool (k,), and keep them."""
        name = work.name

        def advanced(rows: int) -> None:
            self.save()
            advance(rows)

        fill_spans(work, scene, spans_of(missing), tables, threads, partial(self.add, name, tables), advanced)

    def add(self, name: bytes, tables: Tables, first: int, last: int) -> None:
        """Take note of traced rows of the work of this name; from any thread."""
        if not self._given_up:
            content = b"".join(table[first:last].tobytes() for table in tables)
            self._pending.append(record((name, first, last), content))

    def status(self) -> str:
        """Text to show beside the progress."""
        return ""

    def all_traced(self) -> None:
        """No more rows will be asked for."""

    def once(self, name: str, compute: Callable[[], Float64s]) -> Float64s:
        """What `compute` returns, (k,), unless the journal has it; from the thread that writes."""
        block = hashlib.blake2b(name.encode(), digest_size=16).digest(), 0, 0
        if self._journal and block in self._journal.blocks:
            return np.frombuffer(self._journal.content(block))
        values = compute()
        if not self._given_up:
            self._pending.append(record(block, values.tobytes()))
            self.save()
        return values

    def save(self) -> None:
        """Write what was added if it is time to, or if much was."""
        if self._given_up:
            return
        if time.monotonic() >= self._due or sum(map(len, self._pending)) >= _MOST_WAITING:
            self._write()
            self._due = time.monotonic() + self.every

    def _write(self) -> None:
        count = len(self._pending)
        if self._given_up or not count:
            return
        try:
            if self._journal is None:
                self._journal = Journal(self.path, create=True)
                self._journal.start(self._identity)
            self._journal.append(b"".join(self._pending[:count]))
            del self._pending[:count]
        except OSError as reason:
            self._give_up(_refused(self.path, reason))

    def _give_up(self, reason: OutputError) -> None:
        """Go on without a journal that cannot be written."""
        self._given_up = True
        self._pending.clear()
        self.notify(f"{reason}; going on without checkpoints")

    def _remove(self) -> None:
        if self._journal is None and self._left_over:
            with suppress(OSError):
                self._journal = Journal(self.path, create=False)
        if self._journal:
            self._journal.remove()


def identity(placement: Placement, receivers: Receivers, settings: tuple[object, ...]) -> bytes:
    """Hash of all that decides a bake's rows, 32 bytes."""
    digest = hashlib.blake2b(repr((machine(), placement.scale, placement.diagonal, settings)).encode())
    arrays: list[npt.NDArray[Any]] = [placement.vertices, receivers.faces]
    for points in (receivers.points, receivers.corners.points):
        arrays += [points.origins, points.normals, points.numbers]
    arrays += receivers.opacity or ()
    for array in arrays:
        digest.update(repr((array.shape, array.dtype)).encode())
        digest.update(np.ascontiguousarray(array).data)
    return digest.digest()[:IDENTITY]


def restore(block: Block, content: bytes, tables: Tables, restored: Bools) -> None:
    """Copy recorded rows into `tables` and mark them in `restored` (k,), if they are rows of these."""
    _, first, last = block
    rows = last - first
    if not 0 <= first < last <= len(restored) or len(content) != sum(table[:1].nbytes for table in tables) * rows:
        return
    begin = 0
    for table in tables:
        block_rows = table[first:last]
        block_rows[:] = np.frombuffer(content, table.dtype, block_rows.size, begin).reshape(block_rows.shape)
        begin += block_rows.nbytes
    restored[first:last] = True


def spans_of(rows: Bools) -> list[Span]:
    """The runs of set values in `rows` (k,)."""
    edges = np.flatnonzero(np.diff(rows, prepend=False, append=False))
    return [(int(first), int(last)) for first, last in edges.reshape(-1, 2)]


def _refused(path: Path, reason: OSError) -> OutputError:
    return reason if isinstance(reason, OutputError) else OutputError(f"{path}: {reason.strerror or reason}")
