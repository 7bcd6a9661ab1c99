"""Blocks of work for workers: how large they are, who has which, and what comes back from workers that are lost."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field

from ..execute.work import Span, Work

IN_FLIGHT = 3  # blocks that a worker has at once: one traced, the others on their way
_SECONDS, _LEAST_SECONDS = 3.0, 0.25  # of a block
_ENDGAME = 4  # blocks to each worker that what is left is cut into at least
_FIRST_RAYS = 1 << 20  # a thread, while nothing is known of a worker
_MOST_BYTES = 10 << 20  # of a block's tables
_KEPT = 0.5  # of what was known of a worker's speed, when a block comes back


@dataclass
class Dispatch:
    """The rows of one work after another, handed out in blocks.

    Attributes:
        blocks: that came back, of each worker. rows: in them. again: blocks that were handed out once more.
        threads: of each worker that takes blocks. speed: its rays a second, as far as known.
    """

    blocks: dict[str, int] = field(default_factory=dict)
    rows: int = 0
    again: int = 0
    threads: dict[str, int] = field(default_factory=dict)
    speed: dict[str, float] = field(default_factory=dict)
    work: Work | None = None
    _most_rows: int = 1
    _spans: deque[Span] = field(default_factory=deque)

    def begin(self, work: Work, spans: Sequence[Span]) -> None:
        """Hand out the rows `spans` of `work` from now on; all rows of the last work have come back."""
        self.work = work
        self._spans = deque(spans)
        self._most_rows = max(_MOST_BYTES // sum(table.nbytes for table in work[:1].tables()), 1)

    @property
    def waiting(self) -> bool:
        """Whether there are rows that no worker has."""
        return bool(self._spans)

    def take(self, worker: str) -> Span:
        """A block for `worker`, of a few seconds, less where little is left."""
        assert self.work is not None
        rays = max(self.work.rays, 1e-9)
        speed = self.speed.get(worker)
        if speed is None:
            wanted = _FIRST_RAYS * self.threads[worker]
        else:
            left = rays * sum(last - first for first, last in self._spans)
            seconds = left / max(sum(self.speed.values()), speed) / _ENDGAME
            wanted = int(speed * min(max(seconds, _LEAST_SECONDS), _SECONDS))
        first, last = self._spans.popleft()
        end = min(first + min(max(int(wanted / rays), 1), self._most_rows), last)
        if end < last:
            self._spans.appendleft((end, last))
        return first, end

    def came_back(self, worker: str, span: Span, seconds: float) -> None:
        """Take note of a traced block."""
        assert self.work is not None
        rows = span[1] - span[0]
        self.blocks[worker] = self.blocks.get(worker, 0) + 1
        self.rows += rows
        speed = rows * self.work.rays / min(max(1e-6, seconds), 1e9)  # whatever number it is
        self.speed[worker] = _KEPT * self.speed.get(worker, speed) + (1 - _KEPT) * speed

    def lost(self, span: Span) -> None:
        """Hand out a block once more."""
        self.again += 1
        self._spans.appendleft(span)

    def joined(self, worker: str, threads: int) -> None:
        """A worker takes blocks from now on."""
        self.threads[worker] = threads

    def left(self, worker: str) -> None:
        """A worker takes no more blocks."""
        self.threads.pop(worker, None)
        self.speed.pop(worker, None)
