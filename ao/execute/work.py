"""Work that any process can do: rows that depend on nothing but a scene, their own inputs and the kind of machine."""

import hashlib
import platform
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache
from typing import Any, Protocol, Self

import numpy as np
import numpy.typing as npt

from obscurance.raytrace import embree
from obscurance.raytrace.kernel.library import built_by, results_identity
from obscurance.raytrace.kernel.processor import cpu_features, model
from obscurance.raytrace.system.threads import granted, run_blocks

Outputs = tuple[npt.NDArray[Any], ...]
Span = tuple[int, int]
Advance = Callable[[int], None]
Make = Callable[["RowTask", Any, Sequence[Span], Outputs, int, Advance], Iterator[Span]]
"""`make_on_threads`, or what makes the same rows elsewhere."""

_BLOCK_RAYS = 1 << 21  # about a second of one thread
_BLOCK_BYTES = 10 << 20  # of a block, at most
_MOST_BLOCKS = 1 << 10  # of a work; the blocks of a larger one have more rays
_EACH = 4  # shares for each thread; where rows are few, shares are smaller for that, to a quarter
_MOST_RAYS = 1 << 17  # of shares handed over at once: what Ctrl-C waits for


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


def blocks(work: RowTask) -> list[Span]:
    """The blocks in which rows are kept and sent to workers: they depend on the work alone."""
    row_bytes = sum(table.nbytes for table in work[:1].tables())
    wanted = max(int(_BLOCK_RAYS / max(work.rays, 1e-9)), len(work) // _MOST_BLOCKS)
    size = max(min(wanted, _BLOCK_BYTES // max(row_bytes, 1)), 1)
    return [(start, min(start + size, len(work))) for start in range(0, len(work), size)]


def packed(tables: Outputs, span: Span) -> bytes:
    """The rows of a block as bytes, one table after the other."""
    return b"".join(table[slice(*span)].tobytes() for table in tables)


def unpack(content: bytes | memoryview, tables: Outputs, span: Span) -> bool:
    """Copy rows that `packed` has packed into the tables of their work; returns whether there are as many bytes."""
    rows = [table[slice(*span)] for table in tables]
    if len(content) != sum(part.nbytes for part in rows):
        return False
    begin = 0
    for part in rows:
        part[...] = np.frombuffer(content, part.dtype, part.size, begin).reshape(part.shape)
        begin += part.nbytes
    return True


def make_on_threads(
    work: RowTask, scene: Any, spans: Sequence[Span], tables: Outputs, threads: int, advance: Advance = lambda _: None
) -> Iterator[Span]:
    """Make the rows of `spans` on threads; yields each span once its rows stand in the tables.

    A share of a block goes to each thread; where threads are many, neighbouring blocks are made together.
    """
    write = work.writer(scene, tables)
    threads = granted(threads)
    most = max(int(work.block_rays / max(work.rays, 1e-9)), 1)
    left = deque(spans)
    while left:
        together = [left.popleft()]
        while left and len(together) * _EACH < threads and left[0][0] == together[-1][1]:
            together.append(left.popleft())
        first, last = together[0][0], together[-1][1]
        size = max(min(most, (last - first) // (_EACH * threads)), -(-most // 4))
        shares = max(int(_MOST_RAYS / (size * max(work.rays, 1))), 1)

        def make(start: int, stop: int, first: int = first) -> None:
            write(first + start, first + stop)

        run_blocks(last - first, size, make, threads, advance, shares)
        yield from together


class KeptRowTask(RowTask, Protocol):
    """Work whose rows are kept."""

    @property
    def name(self) -> bytes:
        """16 bytes that no other work in the same bake has."""


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
