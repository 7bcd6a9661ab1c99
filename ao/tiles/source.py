"""A mesh that stays on the disk, read in runs of rows."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Protocol

from raytrace.types import Float64s, Int64s

RUN = 1 << 19  # rows at once


class TileSource(Protocol):
    """Triangles over vertices, in the order and units they came in.

    Attributes:
        name: for messages. vertex_count, face_count: at least 1.
    """

    @property
    def name(self) -> str: ...

    @property
    def vertex_count(self) -> int: ...

    @property
    def face_count(self) -> int: ...

    def vertices(self, first: int, last: int) -> Float64s:
        """Vertices (k, 3) from a first one to a last one."""

    def faces(self, first: int, last: int) -> Int64s:
        """Faces (k, 3), indices of vertices."""


def runs(count: int) -> Iterator[slice]:
    """Runs of `count` rows."""
    for first in range(0, count, RUN):
        yield slice(first, min(first + RUN, count))
