"""Blocks of work for workers: how large they are, what is left, and what has come back.

Not Dask's queue: it would give workers that come later no share of what it has handed out, and all the same blocks.
"""

from collections import Counter, deque
from collections.abc import Sequence
from dataclasses import dataclass, field

from ..execute.work import Span, Work

IN_FLIGHT = 3  # blocks that a worker has at once: one traced, the others on their way
_SECONDS, _LEAST_SECONDS = 3.0, 0.25  # of a block
_ENDGAME = 4  # blocks to each worker that what is left is cut into at least
_FIRST_RAYS = 1 << 20  # while nothing is known of a worker
_MOST_BYTES = 10 << 20  # of a block's tables
_KEPT = 0.5  # of what was known of a worker's speed, when a block comes back


@dataclass
class Dispatch:
    """The rows of one work after another, handed out in blocks.

    Attributes:
        blocks: that came back, of each worker. rows: in them. again: blocks that were handed out once more.
        speed: rays a second of the workers, as far as known.
        spans: rows of the present work that no worker has. left: how many have not come back.
    """

    blocks: Counter[str] = field(default_factory=Counter)
    rows: int = 0
    again: int = 0
    speed: dict[str, float] = field(default_factory=dict)
    spans: deque[Span] = field(default_factory=deque)
    left: int = 0
    _rays: float = 1.0
    _most_rows: int = 1

    def begin(self, work: Work, spans: Sequence[Span]) -> None:
        """Hand out the rows `spans` of `work` from now on, and none of the last work."""
        self.spans, self.left = deque(spans), sum(last - first for first, last in spans)
        self._rays = max(work.rays, 1e-9)
        self._most_rows = max(_MOST_BYTES // sum(table.nbytes for table in work[:1].tables()), 1)

    def take(self, worker: str) -> Span:
        """A block for `worker`, of a few seconds, less where little is left."""
        wanted, speed = float(_FIRST_RAYS), self.speed.get(worker)
        if speed:
            waiting = self._rays * sum(last - first for first, last in self.spans)
            seconds = waiting / sum(self.speed.values()) / _ENDGAME
            wanted = speed * min(max(seconds, _LEAST_SECONDS), _SECONDS)
        first, last = self.spans.popleft()
        end = min(first + min(max(int(wanted / self._rays), 1), self._most_rows), last)
        if end < last:
            self.spans.appendleft((end, last))
        return first, end

    def came_back(self, worker: str, rows: int, seconds: float) -> None:
        """Take note of a traced block."""
        self.blocks[worker] += 1
        self.rows += rows
        self.left -= rows
        speed = rows * self._rays / min(max(1e-6, seconds), 1e9)  # whatever number it is
        self.speed[worker] = _KEPT * self.speed.get(worker, speed) + (1 - _KEPT) * speed

    def lost(self, span: Span) -> None:
        """Hand out a block once more."""
        self.again += 1
        self.spans.appendleft(span)
