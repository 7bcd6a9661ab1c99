"""Blocks made by the workers of a Dask cluster: a scene is a task that blocks depend on. The only importer of Dask.

Dask starts workers on this machine, knows which are alive, copies the scene to those that need it, makes it again when
all that had it are lost, and gives the blocks of lost workers to others.
"""

import asyncio
import atexit
import hashlib
import logging
import os
import pickle
import re
import signal
import threading
import time
import uuid
from collections import Counter, deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from copy import deepcopy
from itertools import count
from multiprocessing import resource_tracker
from queue import Empty, SimpleQueue
from typing import Any, Self

import numpy as np
from distributed import Future, KilledWorker, Worker, get_worker
from distributed.deploy.spec import close_clusters

from obscurance.raytrace.errors import ClusterError, InputError, MemoryLimitError, OptionError
from obscurance.raytrace.system.threads import thread_count

from ..execute.work import (
    Advance,
    Outputs,
    RowTask,
    Span,
    bit_environment,
    first_difference,
    make_on_threads,
    packed,
    unpack,
)

_FEW_RAYS = 1 << 19  # that are traced here: to send them takes as long
_ATTEMPTS = 3  # of a block, after which it is the block's fault
_AHEAD = 2  # blocks for each thread of the workers: one at work, one on its way
_LOOK = 1.0  # seconds between looks at who is there
_CONNECT, _PATIENCE = 10.0, 10.0  # seconds to reach a scheduler; without a worker until a line says so
_ENDED = "workers have ended with it, for want of memory?"
_START, _END = 120.0, 5.0  # seconds that workers on this machine have to start, and to end
CONFIG = {
    "distributed.scheduler.http.routes": [], "distributed.worker.http.routes": [],  # pages for whoever reaches the port
    "distributed.admin.large-graph-warning-threshold": "1TB",
    "distributed.scheduler.active-memory-manager.start": False,  # it drops copies of the scene between rounds
    "distributed.scheduler.worker-ttl": "30s",  # without a heartbeat
}  # fmt: skip
LOCAL: dict[str, Any] = {
    "n_workers": 0, "threads_per_worker": 1, "memory_limit": 0, "host": "127.0.0.1", "silence_logs": logging.CRITICAL,
    "preload": ["obscurance.ao.cluster.workers"],
    "security": True,  # TLS with credentials of its own: other users of this machine reach its ports
    "scheduler_kwargs": {"dashboard": False, "dashboard_address": "127.0.0.1:0"},
}  # fmt: skip
Answer = tuple[Any, ...]
"""Of a task: "done" and its result; "failed", the worker and a reason; "wrong" and what an `InputError` says."""


def local_workers(address: str) -> int | None:
    """N of `local:N`, 1 of `local`, None of a scheduler's address. Raises: OptionError: it is neither."""
    name, _, number = address.partition(":")
    if name == "local" and ((number.isdecimal() and 1 <= int(number) <= 4096) or ":" not in address):
        return int(number or 1)
    if re.fullmatch(r"(tcp|tls|ws|wss)://.+", address):  # `ucx://` ends in an error of another kind with each version
        return None
    raise OptionError("cluster", "local, local:N or the address of a Dask scheduler, tls://host:port", repr(address))


@contextmanager
def _without_interrupts() -> Iterator[None]:
    """Threads that are started within, and their processes, leave Ctrl-C to this one."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    resource_tracker.ensure_running()  # or it unblocks what is blocked here
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


_loaded: dict[str, Any] = {}  # one scene of this process, which outlives the copies of its bytes that Dask drops
_lock = threading.Lock()


class SharedScene:
    """The bytes of a scene, on their way to workers, and on these the scene.

    Pickled, from the client or from worker to worker, it is the bytes alone, which nobody copies.
    """

    def __init__(self, digest: str, *parts: Any) -> None:
        self._digest, self._parts = digest, parts

    @classmethod
    def of(cls, scene: object) -> Self:
        buffers: list[pickle.PickleBuffer] = []
        content = pickle.dumps(scene, protocol=5, buffer_callback=buffers.append)
        parts = [np.frombuffer(part, np.uint8) for part in (memoryview(content), *(part.raw() for part in buffers))]
        digest = hashlib.blake2b(digest_size=16)
        for part in parts:
            digest.update(part.data)
        return cls(digest.hexdigest(), *parts)

    def __reduce__(self) -> tuple[type[Self], tuple[Any, ...]]:
        return type(self), (self._digest, *self._parts)

    def __sizeof__(self) -> int:
        return sum(part.nbytes for part in self._parts)

    def load(self) -> Any:
        """The scene, built by the first block that needs it."""
        with _lock:
            if self._digest not in _loaded:
                _loaded.clear()
                content, *buffers = self._parts
                _loaded[self._digest] = pickle.loads(content, buffers=[bytearray(part) for part in buffers])
            return _loaded[self._digest]


def copied(shared: SharedScene) -> SharedScene:
    """The bytes of a scene, as a task that Dask runs on a worker, again if all copies are lost."""
    return shared


async def declare_likeness(name: str, expected: Mapping[str, str], dask_worker: Worker) -> tuple[str, str, str] | None:
    """Give a worker that makes the bits expected a resource, for which blocks ask; of others return what differs."""
    difference = first_difference(expected, bit_environment())
    if not difference:
        await dask_worker.set_resources(**{name: 1e9})
    return difference


def attempt(function: Callable[..., Any], shared: SharedScene, item: Any) -> Answer:
    """Call a function on a worker. Its result is of numbers, texts, bytes and lists of these, which need no pickle."""
    try:
        return "done", function(shared, item)
    except Exception as reason:
        if isinstance(reason, InputError) and not isinstance(reason, MemoryLimitError):
            return "wrong", *map(str, (reason.source, reason.field, reason.expected, reason.got))
        return "failed", get_worker().address, f"{type(reason).__name__}: {reason}"


def make_block(shared: SharedScene, work: RowTask) -> bytes:
    """The rows of `work`, made by this thread, as `packed` packs them."""
    work = deepcopy(work)  # arrays from the network may be unaligned: kernels would be compiled for them
    tables, span = work.tables(), (0, len(work))
    for _ in make_on_threads(work, shared.load(), [span], tables, 1):
        pass
    return packed(tables, span)


class Workers:
    """The workers of a Dask cluster, in a `with` block.

    Args:
        address: `local`, `local:N` or a scheduler's, `tls://host:port`.
        notify: called with a line for the user, from any thread.
        threads: of all workers on this machine together; None: all cores.

    Raises: OptionError: when the block is entered: there is no scheduler at the address, or no credentials for it.
    """

    def __init__(self, address: str, notify: Callable[[str], object], threads: int | None = None) -> None:
        self._address, self._notify = address, notify
        self._count, self._threads = local_workers(address), thread_count(threads)
        self._safe_path = os.environ.get("PYTHONSAFEPATH")  # until now
        self._client: Any = None
        self._local: Any = None
        self._scene: tuple[object, Any] = None, None  # the last one, and its future
        facts = hashlib.blake2b(repr(bit_environment()).encode(), digest_size=8)
        self._likeness = f"obscurance-{facts.hexdigest()}"  # the resource that workers like this machine have
        self._unlike: set[str] = set()  # workers that have not it, and are asked what they are
        self._retired: set[str] = set()
        self._workers = self._threads_there = 0
        self.blocks = 0  # made by workers
        self._looked = 0.0
        self._alone_since = time.monotonic()

    def __enter__(self) -> Self:
        try:
            self._open()
        except BaseException as reason:
            self.__exit__(type(reason))
            raise
        if not self._count and not self._address.startswith(("tls://", "wss://")):
            danger = "whoever reaches this scheduler can run code on its workers and here; tls:// keeps others out"
            self._notify(f"{self._address}: {danger}")
        return self

    def _open(self) -> None:
        """Connect to the scheduler, or start one and its workers on this machine, which may be there later."""
        os.environ["PYTHONSAFEPATH"] = "1"  # or what is started, by `python -c`, imports from the current folder first
        import dask
        import distributed

        dask.config.set(CONFIG)
        for name in ("distributed", "distributed.client", "tornado.application"):  # Dask gives them levels of their own
            logging.getLogger(name).setLevel(logging.CRITICAL + 1)
        target: Any = self._address
        if target.startswith("tls://") and not distributed.Security().get_connection_args("client")["ssl_context"]:
            raise OptionError("cluster", "credentials in Dask's configuration, distributed.comm.tls", "none")
        if self._count:
            threads = max(self._threads // self._count, 1)
            with _without_interrupts():
                self._local = target = distributed.LocalCluster(**LOCAL | {"threads_per_worker": threads})
            atexit.unregister(close_clusters)  # which waits for ten seconds where an interrupt comes as it is closed
        try:
            self._client = distributed.Client(target, set_as_default=False, timeout=_CONNECT)
        except (OSError, TimeoutError, ValueError) as reason:
            text = f"nothing that answers ({type(reason).__name__})"
            raise OptionError("cluster", "local, local:N or the address of a Dask scheduler", text) from None
        if self._count:
            self._local.scale(self._count)  # now: cluster and client, as they are made, wait for the last one to start

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if self._client:
            with suppress(Exception):
                self._client.close()
        if self._local:
            self._local.loop.add_callback(_kill, self._local, 0.0 if kind else _END)  # ends with the loop
            with suppress(Exception):
                self._local.close()
        if self._safe_path is None:
            os.environ.pop("PYTHONSAFEPATH", None)

    def make(
        self, work: RowTask, scene: Any, spans: Sequence[Span], tables: Outputs, threads: int, advance: Advance
    ) -> Iterator[Span]:
        """Make the rows of `work`, by workers unless it has few rays, as `make_on_threads` does. Raises: as `made`."""
        if sum(stop - start for start, stop in spans) * work.rays < _FEW_RAYS:
            yield from make_on_threads(work, scene, spans, tables, threads, advance)
            return
        for span, rows in self.made(work, scene, spans):
            for table, values in zip(tables, rows, strict=True):
                table[slice(*span)] = values
            advance(len(rows[0]))
            yield span

    def made(self, work: RowTask, scene: Any, spans: Sequence[Span]) -> Iterator[tuple[Span, Outputs]]:
        """Blocks of rows, and their tables, as they come. Raises: as `map`."""
        for number, content in self.map(make_block, scene, lambda number: work[slice(*spans[number])], len(spans)):
            start, stop = spans[number]
            tables = work[start:stop].tables()
            if not isinstance(content, bytes) or not unpack(content, tables, (0, stop - start)):
                raise ClusterError(f"{self._address}: a worker's answer is no block of rows")
            yield (start, stop), tables

    def map(
        self, function: Callable[..., Any], scene: object, item_of: Callable[[int], Any], items: int
    ) -> Iterator[tuple[int, Any]]:
        """`function(SharedScene, item)` of each item by a worker: numbers and results, as they come.

        Args: item_of: an item, from 0 on, by its number.

        Raises:
            InputError: the function raises it. ClusterError: the scheduler is lost, no worker on this machine starts,
            or an item ends worker after worker.
        """
        waiting, left = deque(range(items)), items
        failures: Counter[int] = Counter()  # of a block
        running: dict[Future, int] = {}
        done: SimpleQueue[tuple[Future, Answer]] = SimpleQueue()
        name, keys = f"block-{uuid.uuid4().hex}", count()

        def fetch(future: Future) -> None:
            """Called by Dask when a task is done."""
            self._client.loop.add_callback(self._fetch, future, done)

        def repeat(number: int, reason: str) -> None:
            """Have a block that has failed made again, but not for ever."""
            failures[number] += 1
            if failures[number] == _ATTEMPTS:
                raise ClusterError(f"{self._address}: a block fails on every worker: {reason}")
            waiting.appendleft(number)

        try:
            while left:
                # Some items for each thread are with the scheduler, the others not made yet.
                window = self._window()
                if not window:  # nobody is there, and Dask does not look again at what it could give to nobody
                    self._client.cancel(list(running))
                    while running:
                        repeat(running.popitem()[1], _ENDED)
                    self._scene = None, None
                while waiting and len(running) < window:
                    number = waiting.popleft()
                    future = self._client.submit(
                        attempt, function, self._shared(scene), item_of(number),
                        key=(name, next(keys)), resources={self._likeness: 1},
                    )  # fmt: skip
                    running[future] = number
                    future.add_done_callback(fetch)
                try:
                    future, (kind, *said) = done.get(timeout=_LOOK)
                except Empty:
                    continue
                if future not in running:  # cancelled
                    continue
                number = running.pop(future)
                future.release()
                if kind == "done":
                    left -= 1
                    self.blocks += 1
                    yield number, said[0]
                elif kind == "failed":
                    repeat(number, said[1])
                    self._retire(*said)
                else:
                    raise InputError(*said) if kind == "wrong" else ClusterError(f"{self._address}: {said[0]}")
        finally:
            with suppress(Exception):
                self._client.cancel(list(running))

    async def _fetch(self, future: Future, done: SimpleQueue[tuple[Future, Answer]]) -> None:
        """Put a finished future and its answer into a queue; whatever a worker sends in its place is not unpickled."""
        try:
            fault = await future.exception()
            if isinstance(fault, KilledWorker):
                answer: Answer = "lost", f"a block fails on every worker: {_ENDED}"
            elif fault:
                raise fault
            else:
                found = await self._client.scheduler.gather(keys=[future.key], deserializers=["msgpack"])
                lost = "failed", "", "its worker has ended"
                answer = tuple(found["data"][future.key]) if found["status"] == "OK" else lost
        except (Exception, asyncio.CancelledError) as reason:  # whatever Dask makes of it
            answer = "lost", " ".join(f"the cluster is lost: {type(reason).__name__}: {reason}".split())
        done.put((future, answer))

    def _retire(self, worker: str, reason: str) -> None:
        """Have a worker that has failed leave the cluster; else it would soon have failed with all blocks."""
        if worker and worker not in self._retired:
            self._retired.add(worker)
            self._notify(f"worker {worker} gets no more work: {reason}")
            self._client.retire_workers([worker])

    def _shared(self, scene: object) -> Any:
        """The future of a scene: made by a worker from its bytes, which the scheduler holds."""
        if self._scene[0] is not scene:
            key = f"scene-{uuid.uuid4().hex}"
            shared = self._client.submit(copied, SharedScene.of(scene), key=key, resources={self._likeness: 1})
            self._scene = scene, shared
        return self._scene[1]

    def status(self) -> str:
        """How many workers there are, in words."""
        return _plural(self._workers, "worker")

    def summary(self) -> str:
        """What the workers did, in a line."""
        return f"{self._address}: {_plural(self.blocks, 'block')} made by workers"

    def _window(self) -> int:
        """How many blocks are to be with the scheduler: some for each thread of workers like this machine.

        Raises: ClusterError: the scheduler is lost; no worker on this machine starts.
        """
        before, now = self._looked, time.monotonic()
        if now < before + _LOOK:
            return _AHEAD * self._threads_there
        self._looked = now
        if self._client.status != "running":
            raise ClusterError(f"{self._address}: the cluster is lost: its scheduler has gone")
        try:  # not by `scheduler_info`, whose workers a callback of Dask's takes away now and then
            there = self._client.sync(self._client.scheduler.identity)["workers"]
        except Exception as reason:  # whatever Dask makes of it
            raise ClusterError(f"{self._address}: the cluster is lost: {type(reason).__name__}") from None
        like = {name: facts["nthreads"] for name, facts in there.items() if self._likeness in facts["resources"]}
        self._workers, self._threads_there = len(like), sum(like.values())
        unlike = there.keys() - like
        for worker in unlike - self._unlike:
            self._client.loop.add_callback(self._ask, worker)
        self._unlike = unlike
        if like:
            self._alone_since = now
        elif before <= self._alone_since + _PATIENCE < now:
            self._notify(f"{self._address}: no workers; waiting for some to join")
        alone = now - self._alone_since
        if self._count and not like and (alone > _START or self._none_starts()):
            raise ClusterError(f"{self._address}: no worker has started within {alone:.0f} s")
        return _AHEAD * self._threads_there

    def _none_starts(self) -> bool:
        """Whether all workers that are started here have failed to."""
        failed = [nanny.status.name in ("failed", "closed") for nanny in list(self._local.workers.values())]
        return bool(failed) and all(failed)

    async def _ask(self, worker: str) -> None:
        """Have a worker take blocks if it is like this machine, or say how it differs. It may never answer."""
        arguments = self._likeness, bit_environment()
        answers = await self._client.run(declare_likeness, *arguments, workers=[worker], on_error="return")
        difference = answers[worker]
        if isinstance(difference, Exception):
            self._notify(f"worker {worker} gets no work: {str(difference) or type(difference).__name__}")
        elif difference:
            name, expected, got = difference
            self._notify(f"worker {worker} gets no work: {name}: expected {expected}, got {got}")


async def _kill(local: Any, patience: float) -> None:
    """End workers on this machine that Dask would wait for: those that are starting, and after some seconds all."""
    end = time.monotonic() + patience
    while True:
        for nanny in list(local._created):
            worker = nanny.process
            if worker and worker.process and (worker.status.name == "starting" or time.monotonic() > end):
                await worker.process.kill()
        await asyncio.sleep(0.1)


def _plural(number: int, noun: str) -> str:
    return f"{number:,} {noun}{'' if number == 1 else 's'}"
