"""Work that any process can do: rows that depend on nothing but a scene, their own inputs and the kind of machine."""

import hashlib
import platform
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import Any, Protocol, Self

import numpy as np
import numpy.typing as npt

from raytrace.embree import library as embree
from raytrace.kernel.library import built_by, cpu_features, results_identity
from raytrace.system.processor import model
from raytrace.system.threads import granted, run_blocks, shares

Outputs = tuple[npt.NDArray[Any], ...]
Span = tuple[int, int]
Advance = Callable[[int], None]
Finished = Callable[[int, int], None]
FillSpans = Callable[["RowTask", Any, Sequence[Span], Outputs, int, Finished], None]  # `fill_spans`, or elsewhere
_EACH = 4  # blocks for each thread; where rows are few, blocks are smaller for that, to a quarter
_MOST_RAYS = 1 << 17  # of blocks made at once: what Ctrl-C waits for


class RowTask(Protocol):
    """Rows to be made by tracing rays in a scene of its sort. Each is the same whichever others are made with it."""

    @property
    def rays(self) -> float:
        """Rays of a row, about."""

    @property
    def block_rays(self) -> int:
        """Rays of the rows that a thread makes at once, at least."""

    def __len__(self) -> int: ...

    def __getitem__(self, rows: slice) -> Self:
        """Some of the rows, to be sent to another process."""

    def tables(self) -> Outputs:
        """Arrays for all rows, to be written."""

    def writer(self, scene: Any, tables: Outputs) -> Callable[[int, int], None]:
        """A function that writes the rows from a start to a stop, to be called from any thread."""


def fill(work: RowTask, scene: Any, threads: int) -> Outputs:
    """Make all rows of the work, on threads; returns its tables."""
    tables = work.tables()
    fill_spans(work, scene, [(0, len(work))], tables, threads, lambda *_: None)
    return tables


def fill_spans(
    work: RowTask, scene: Any, spans: Sequence[Span], tables: Outputs, threads: int, finished: Finished
) -> None:
    """Make the rows of `spans` on threads. Args: finished: called on this thread, with a start and a stop."""
    write = work.writer(scene, tables)
    row_count = sum(stop - start for start, stop in spans)
    threads = granted(threads)
    block = max(int(work.block_rays / max(work.rays, 1e-9)), 1)
    size = max(min(block, row_count // (_EACH * threads)), -(-block // 4))
    most = int(_MOST_RAYS / (size * max(work.rays, 1)))
    blocks = [(start + a, start + b) for start, stop in spans for a, b in shares(stop - start, size, threads, most)]
    finished_spans: deque[Span] = deque()

    def make(number: int, _: int) -> None:
        write(*blocks[number])
        finished_spans.append(blocks[number])

    run_blocks(len(blocks), 1, make, threads, lambda _: finished(*finished_spans.popleft()))


class KeptRowTask(RowTask, Protocol):
    """Work whose rows a journal keeps."""

    @property
    def name(self) -> bytes:
        """16 bytes that no other work in the same bake has."""

    def could_make(self, rows: Outputs) -> bool:
        """Whether the numbers in some rows, of a file that anybody may have written, are in their ranges."""


@cache
def bit_environment() -> dict[str, str]:
    """Facts that must be equal for rows of the same bits, by name.

    The C library counts for its sines, and NumPy and Embree choose instructions by what the processor has.
    """
    features = " ".join(sorted(cpu_features()))
    return {
        "code": results_identity(),
        "Embree": embree.version(),
        "NumPy": np.__version__,
        "kernels": built_by(),
        "C library": " ".join(platform.libc_ver()) or platform.system(),
        "processor": model(),
        "instructions": hashlib.sha256(features.encode()).hexdigest()[:8],
    }


def first_difference(expected: Mapping[str, str], got: Mapping[str, str]) -> tuple[str, str, str] | None:
    """The name and both values of the first entry that differs, or None."""
    for name in (*expected, *(name for name in got if name not in expected)):
        if expected.get(name) != got.get(name):
            return name, expected.get(name, "nothing"), got.get(name, "nothing")
    return None
