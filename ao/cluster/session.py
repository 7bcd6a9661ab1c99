"""Rows made by the workers of a Dask cluster, for one command: one work after the other, one scene after the other.

Dask carries calls to workers and says which of these are alive. What it does not do is here: no block goes to a worker
that is unlike this machine, does not see the scene, or has failed; one that stands still loses its blocks; and many
losses of a block end the bake, whatever the scheduler allows (`allowed-failures`).
"""

import time
import weakref
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Self

from raytrace.errors import ClusterError, InputError

from ..execute.work import Finished, Outputs, RowTask, Span, bit_environment, fill, fill_spans
from .dask_cluster import DaskCluster, unguarded
from .worker import SceneFile, trace_block, unpack, write_scene

_LOOK = 0.2  # seconds between looks at who is there
_FAILURES = 3  # of one block, after which it is the block's fault
IN_FLIGHT = 3  # blocks that a worker has at once: one traced, the others on their way
_ENDGAME = 4  # blocks to each worker that what is left is cut into at least
_MOST_BYTES = 10 << 20  # of a block's tables
_KEPT = 0.5  # of what was known of a worker's speed, when a block comes back

Found = tuple[int, int, Outputs]


@dataclass(frozen=True)
class Pace:
    """How large blocks are, and how long workers are waited for."""

    few_rays: float = 1 << 19  # that are traced here: to send them takes as long
    first_rays: float = 1 << 20  # of a block while nothing is known of a worker
    block_seconds: float = 3.0
    least_seconds: float = 0.25  # of a block near the end
    patience: float = 10.0  # seconds without any worker until a message says so
    silence: float = 30.0  # seconds without a heartbeat, after which others get a worker's blocks
    start: float = 120.0  # seconds without any worker on this machine, after which none is waited for
    losses: int = 10  # of workers with the same block, after which it is the block's fault: out of memory, for instance


PACE = Pace()


@dataclass
class Dispatch:
    """The rows of one work after another, handed out in blocks.

    Not Dask's queue: it would give workers that come later no share of what it has handed out, and all the same blocks.

    Attributes:
        blocks: that came back, of each worker. rows_traced: in them. again: blocks that were handed out once more.
        speed: rays a second of the workers, as far as known.
        spans: rows of the present work that no worker has. left: how many have not come back.
    """

    pace: Pace
    blocks: Counter[str] = field(default_factory=Counter)
    rows_traced: int = 0
    again: int = 0
    speed: dict[str, float] = field(default_factory=dict)
    spans: deque[Span] = field(default_factory=deque)
    left: int = 0
    _rays: float = 1.0
    _most_rows: int = 1

    def begin(self, work: RowTask, spans: Sequence[Span]) -> None:
        """Hand out the rows `spans` of `work` from now on, and none of the last work."""
        self.spans = deque(spans)
        self.left = sum(stop - start for start, stop in spans)
        self._rays = max(work.rays, 1e-9)
        self._most_rows = max(_MOST_BYTES // sum(table.nbytes for table in work[:1].tables()), 1)

    def take(self, worker: str) -> Span:
        """A block for `worker`, of a few seconds, less where little is left."""
        wanted = self.pace.first_rays
        speed = self.speed.get(worker)
        if speed:
            waiting = self._rays * sum(stop - start for start, stop in self.spans)
            seconds = waiting / sum(self.speed.values()) / _ENDGAME
            wanted = speed * min(max(seconds, self.pace.least_seconds), self.pace.block_seconds)
        start, stop = self.spans.popleft()
        end = min(start + min(max(int(wanted / self._rays), 1), self._most_rows), stop)
        if end < stop:
            self.spans.appendleft((end, stop))
        return start, end

    def record_block(self, worker: str, finished: int, seconds: float) -> None:
        """Record a traced block of a worker, and the speed that this shows."""
        self.blocks[worker] += 1
        self.rows_traced += finished
        self.left -= finished
        speed = finished * self._rays / min(max(1e-6, seconds), 1e9)  # whatever number it is
        self.speed[worker] = _KEPT * self.speed.get(worker, speed) + (1 - _KEPT) * speed

    def lost(self, span: Span) -> None:
        """Put a block back, to be handed out once more."""
        self.again += 1
        self.spans.appendleft(span)


class ClusterSession:
    """The workers of a Dask cluster, in a `with` block.

    Args:
        address: `local`, `local:N` or a scheduler's, `tls://host:port`.
        shared: a folder that all workers see under this name, for scenes. name: of their files, the output's.
        notify: called with a line for the user.
        threads: of all workers on this machine together; None: all cores. pace: None: `PACE`.

    Raises: OptionError: when the block is entered: there is no scheduler at the address.
    """

    def __init__(
        self,
        address: str,
        shared: Path,
        name: str,
        notify: Callable[[str], object],
        threads: int | None = None,
        pace: Pace | None = None,
    ) -> None:
        self._pace = pace or PACE
        self.dispatch = Dispatch(self._pace)
        self._cluster = DaskCluster(address, threads)
        self._address = address
        self._shared = shared
        self._name = name
        self._notify = notify
        self._scene: Callable[[], object] = lambda: None  # a weak reference: it may be large
        self._file: SceneFile | None = None
        self._calls: dict[Future[Any], tuple[str, Span]] = {}
        self._heard: dict[str, tuple[object, float]] = {}  # last heartbeats, and when they were learnt of
        self._workers: dict[str, InputError | ClusterError | None] = {}  # why they get no work, if they do not
        self._lost_before: Counter[tuple[int, int]] = Counter()  # how often, by first row and by what ends the bake
        self._begun = self._looked = self._alone_since = time.monotonic()
        self._told_late = not self._cluster.count
        self._told_alone = False

    def __enter__(self) -> Self:
        if not self._cluster.count:
            self._cluster.connect()
            if warning := unguarded(self._address):
                self._notify(warning)
        return self

    def __exit__(self, *_: object) -> None:
        try:
            self._cluster.close()
        finally:
            self._remove()

    def fill_spans(
        self, work: RowTask, scene: Any, spans: Sequence[Span], tables: Outputs, threads: int, finished: Finished
    ) -> None:
        """Make the rows `spans` of `work`, as `ao.execute.work.fill_spans` does, by workers unless it has few rays.

        Raises: as `trace`.
        """
        if sum(stop - start for start, stop in spans) * work.rays < self._pace.few_rays:
            fill_spans(work, scene, spans, tables, threads, finished)
            return
        for start, stop, block_tables in self.trace(work, scene, spans):
            for table, values in zip(tables, block_tables, strict=True):
                table[start:stop] = values
            finished(start, stop)

    def rows(self, work: RowTask, scene: Any, threads: int) -> Iterator[Found]:
        """All rows of `work` in blocks: start, stop, tables. By workers, or if it has few rays by `threads` of this
        process.

        Raises: as `trace`.
        """
        if len(work) * work.rays >= self._pace.few_rays:
            yield from self.trace(work, scene, [(0, len(work))])
        else:
            yield 0, len(work), fill(work, scene, threads)

    def trace(self, work: RowTask, scene: Any, spans: Sequence[Span]) -> Iterator[Found]:
        """The rows `spans` of `work` in a scene, in blocks as they come: start, stop, tables.

        Raises:
            OutputError: the scene's file cannot be written.
            InputError: no worker is like this machine or sees the scene; or the work cannot be done, by a bad texture.
            ClusterError: the scheduler is lost, or blocks fail again and again.
        """
        if self._scene() is not scene:
            self._remove()
            self._file = write_scene(self._shared, self._name, scene)
            self._scene = weakref.ref(scene)
            self._cluster.connect()
            self.dispatch.speed.clear()
        self.dispatch.begin(work, spans)
        self._lost_before.clear()
        self._alone_since, self._told_alone = time.monotonic(), False
        try:
            while self.dispatch.left:
                self._update_workers()
                self._hand_out(work)
                if not self._calls:
                    time.sleep(_LOOK)
                for call in wait(self._calls, _LOOK, FIRST_COMPLETED).done:
                    worker, span = self._calls.pop(call, ("", (0, 0)))
                    if worker and (tables := self._receive(work, worker, span, call)):
                        yield *span, tables
        finally:
            self._forget_blocks()

    def status(self) -> str:
        """How many workers there are, in words."""
        return _plural(list(self._workers.values()).count(None), "worker")

    def summary(self) -> str:
        """What the cluster did, in a line."""
        done = self.dispatch
        again = f", {done.again:,} of them once more, for workers that were lost" if done.again else ""
        blocks = _plural(done.blocks.total(), "block")
        workers = _plural(len(done.blocks), "worker")
        return f"{self._address}: {blocks} traced by {workers}{again}"

    def _update_workers(self) -> None:
        """Update the workers: take on new ones, and drop those that have gone or stand still."""
        now = time.monotonic()
        if now < self._looked + _LOOK:
            return
        # Heartbeats: a worker without one for long is silent.
        self._looked, before = now, self._heard
        self._heard = {}
        for worker, beat in self._cluster.workers().items():
            seen, since = before.get(worker, (None, now))
            self._heard[worker] = beat, since if seen == beat else now
        silent = {worker for worker, (_, since) in self._heard.items() if now > since + self._pace.silence}
        present = self._heard.keys() - silent
        # Blocks of those that have gone or are silent go to others.
        for worker in self._workers.keys() - present:
            if worker in silent:
                self._notify(
                    f"worker {worker} has not been heard of for {self._pace.silence:.0f} s; others get its blocks"
                )
            del self._workers[worker]
            for span in self._forget_blocks(worker):
                most = self._pace.losses
                self._requeue(span, most, f"{most} workers have ended with the same block: too little memory?")
        self._workers |= dict.fromkeys(present - self._workers.keys())
        # Workers of this machine that start late, and what to do without any.
        started, count = len(self._heard), self._cluster.count
        if not self._told_late and count and started and (started >= count or now > self._begun + self._pace.silence):
            self._told_late = True
            if started < count:
                late = f"{started} of {count} workers have started within {self._pace.silence:.0f} s"
                self._notify(f"{self._address}: {late}; going on without the rest")
        if None in self._workers.values():
            self._alone_since, self._told_alone = now, False
        elif now > self._alone_since + self._pace.patience:
            self._warn_without_workers(now - self._alone_since)

    def _warn_without_workers(self, seconds: float) -> None:
        """Warn, once, that there has been no usable worker for so long.

        Raises: InputError, ClusterError: waiting is of no use.
        """
        for reason in filter(None, self._workers.values()):
            raise reason
        local = self._cluster.count
        if local and (seconds > self._pace.start or self._cluster.none_starts()):
            raise ClusterError(f"{self._address}: no worker has started within {seconds:.0f} s")
        if not self._told_alone and seconds > (self._pace.silence if local else self._pace.patience):
            self._notify(f"{self._address}: no workers; waiting for some to join")
            self._told_alone = True

    def _hand_out(self, work: RowTask) -> None:
        """Give blocks to workers that have few of them."""
        busy = Counter(worker for worker, _ in self._calls.values())
        for worker in (worker for worker, reason in self._workers.items() if not reason):
            while busy[worker] < IN_FLIGHT and self.dispatch.spans:
                start, stop = self.dispatch.take(worker)
                call = self._cluster.call(
                    worker, trace_block, bit_environment(), self._file, self._cluster.threads, work[start:stop]
                )
                self._calls[call] = worker, (start, stop)
                busy[worker] += 1

    def _receive(self, work: RowTask, worker: str, span: Span, call: Future[Any]) -> Outputs | None:
        """The rows of a block, from its finished call; None if there are none, and the worker gets no more.

        Raises: InputError: every worker would say so. ClusterError: the block has failed on several.
        """
        nobody, (start, stop) = f"{self._address}: no worker can be used: {worker}", span
        error: InputError | ClusterError
        try:
            kind, *contents = call.result()
            if isinstance(kind, float):
                tables = unpack(work[start:stop], contents)
                self.dispatch.record_block(worker, stop - start, kind)
                return tables
            if kind == "failed":
                error = ClusterError(f"{nobody}: {contents[0]}")
            else:
                error = InputError(*contents) if kind == "wrong" else InputError(nobody, *contents)
        except Exception as fault:  # no answer of `trace_block`
            got = f"{type(fault).__name__}: {fault}"
            kind, error = "refused", InputError(nobody, "code", "obscurance as it is here", got)
        if kind == "wrong":
            raise error
        text, self._workers[worker] = str(error).removeprefix(nobody), error
        self._notify(f"worker {worker} gets no work{text}")
        for lost in self._forget_blocks(worker):
            self.dispatch.lost(lost)
        self._requeue(span, _FAILURES if kind == "failed" else 0, f"a block fails on every worker{text}")
        return None

    def _requeue(self, span: Span, most: int, text: str) -> None:
        """Hand out a block once more. Raises: ClusterError: it has been lost `most` times already, unless that is 0."""
        self.dispatch.lost(span)
        self._lost_before[span[0], most] += 1
        if self._lost_before[span[0], most] == most:
            raise ClusterError(f"{self._address}: {text}")

    def _forget_blocks(self, worker: str | None = None) -> list[Span]:
        """Forget the blocks that a worker has, or that all have; their results are ignored."""
        calls = [call for call, (of, _) in self._calls.items() if worker in (of, None)]
        self.dispatch.speed.pop(worker or "", None)
        for call in calls:
            call.cancel()
        return [self._calls.pop(call)[1] for call in calls]

    def _remove(self) -> None:
        """Delete the file of the scene that workers read."""
        if self._file:
            with suppress(OSError):  # the shared folder has gone
                Path(self._file.path).unlink()
        self._file = None


def _plural(count: int, noun: str) -> str:
    return f"{count:,} {noun}{'' if count == 1 else 's'}"
