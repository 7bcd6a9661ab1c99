"""A mesh that stays on the disk, read in runs of rows, and arrays beside it."""

import math
import os
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from raytrace.errors import OutputError
from raytrace.types import AnyFloats, Float64s, Int64s

RUN = 1 << 19  # rows at once
_ZEROS = 1 << 20


class TileSource(Protocol):
    """Triangles over vertices, at least one, in the order and units they came in; a name for messages."""

    @property
    def name(self) -> str: ...

    @property
    def vertex_count(self) -> int: ...

    @property
    def face_count(self) -> int: ...

    def vertices(self, first: int, last: int) -> Float64s:
        """(k, 3)."""

    def faces(self, first: int, last: int) -> Int64s:
        """Faces (k, 3), indices of vertices."""


def runs(count: int) -> Iterator[slice]:
    for first in range(0, count, RUN):
        yield slice(first, min(first + RUN, count))


def bounds(parts: Iterable[AnyFloats]) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]:
    """The bounding box of points (k, 3) in parts; from ∞ to −∞ without any."""
    low, high = np.full(3, np.inf, np.float32), np.full(3, -np.inf, np.float32)
    for part in filter(len, parts):
        low, high = np.minimum(low, part.min(axis=0)), np.maximum(high, part.max(axis=0))
    return low, high


def on_disk(path: Path, kind: npt.DTypeLike, *shape: int) -> npt.NDArray[Any]:
    """Zeros in a new file, whose space is taken now: a full disk would end the process later. Raises: OutputError."""
    size = np.dtype(kind).itemsize * math.prod(shape)
    try:
        with path.open("wb") as file:
            if hasattr(os, "posix_fallocate"):
                os.posix_fallocate(file.fileno(), 0, size)
            else:
                for first in range(0, size, _ZEROS):
                    file.write(bytes(min(_ZEROS, size - first)))
        return np.memmap(path, kind, "r+", shape=shape)
    except OSError as reason:
        text = f"{size:,} bytes beside the output, for tiles: {reason.strerror}"
        raise OutputError(f"{path}: cannot write {text}") from None
