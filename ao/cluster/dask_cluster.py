"""A Dask cluster as a source of rows. The only importer of Dask, whose event loop runs on a thread of its own here.

Dask starts workers, knows which are alive, and carries bytes; which worker gets which block is decided here
(`dispatch`), so that a block goes only to workers like this machine, and no block is given up after a few losses.
"""

from __future__ import annotations

import asyncio
import logging
import math
import signal
import threading
import time
import uuid
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import CancelledError
from contextlib import AsyncExitStack, suppress
from functools import partial
from multiprocessing import resource_tracker
from queue import Empty, SimpleQueue
from typing import Any

from raytrace.errors import ClusterError, InputError, OptionError
from raytrace.system.threads import thread_count

from ..execute.work import Span, Tables, Work
from .addresses import CONFIG, LOCAL, local_workers, unguarded
from .dispatch import IN_FLIGHT, Dispatch
from .rows import unpack
from .scene_file import SceneFile
from .worker import greet, trace_block

_CONNECT = 10.0  # seconds to reach a scheduler
_LOOK = 0.2  # seconds between looks at who is there
_PATIENCE = 10.0  # seconds without any worker until a message says so
_HEARTBEATS = 2.0  # seconds between looks at when workers were heard of
_SILENCE = 30.0  # seconds without a heartbeat, after which others get a worker's blocks
_START = 120.0  # seconds without any worker on this machine, after which none is waited for
_END = 10.0  # seconds that they have to end
_FAILURES = 3  # of one block, after which it is the block's fault
_LOSSES = 10  # of workers with the same block, likewise: out of memory, for instance

Found = tuple[int, int, Tables]


class DaskCluster:
    """Workers that trace blocks.

    Args:
        address: `local`, `local:N` for N workers on this machine, or a scheduler's, `tls://host:port`.
        threads: of a worker on this machine; None: they share all cores.
        notify: called, on the caller's thread, with a line for the user.

    Attributes:
        dispatch: what is handed out, and what came back.

    Raises, from `connect`:
        OptionError: there is no scheduler at that address.
    """

    def __init__(self, address: str, threads: int | None, notify: Callable[[str], object]) -> None:
        self.address, self.notify = address, notify
        self.dispatch = Dispatch()
        self.workers = local_workers(address)
        self._threads = None if self.workers is None else max(thread_count(threads) // self.workers, 1)
        self._messages: SimpleQueue[Found | str | BaseException] = SimpleQueue()
        self._connected = threading.Event()
        self._loop: asyncio.AbstractEventLoop | None = None
        self._stop, self._scene_known = asyncio.Event(), asyncio.Event()
        self._more = asyncio.Condition()
        self._served: dict[str, asyncio.Task[None]] = {}
        self._refused: dict[str, InputError | ClusterError] = {}
        self._heard: dict[str, tuple[float, float]] = {}  # last heartbeats: the scheduler's time, ours when it came
        self._failures: dict[Span, int] = {}
        self._losses: dict[int, int] = {}
        self._asked, self._late = 0.0, math.inf
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._client: Any = None
        self._thread.start()

    def connect(self) -> None:
        """Wait until the scheduler is reached."""
        while not self._connected.wait(0.1) and self._thread.is_alive():
            pass
        if not self._connected.is_set():
            self._next()  # the reason

    def use(self, scene: SceneFile, machine: Mapping[str, str]) -> None:
        """Let workers trace in a scene from now on, those that are as `machine` says."""
        self.connect()
        self._scene, self._machine = scene, machine
        self.dispatch.speed.clear()
        self._soon(self._scene_known.set)

    def trace(self, work: Work, spans: Sequence[Span]) -> Iterator[Found]:
        """The rows `spans` of `work`, in blocks as they come: first row, last row, tables.

        Raises:
            InputError: no worker is like this machine or sees the scene; or the work itself cannot be done, a texture
                not be read for instance.
            ClusterError: the scheduler is lost, or blocks fail again and again.
        """
        left = sum(last - first for first, last in spans)
        self._soon(partial(self._begin, work, spans))
        while left:
            first, last, tables = self._next()
            left -= last - first
            yield first, last, tables

    def status(self) -> str:
        """How many workers there are, in words."""
        count = len(self.dispatch.threads)
        return f"{count} worker{'' if count == 1 else 's'}"

    def close(self) -> None:
        """Let go of the cluster; workers that were started here end."""
        if self._loop:
            with suppress(RuntimeError):  # it has ended
                self._loop.call_soon_threadsafe(self._stop.set)
        self._thread.join(20)

    def _soon(self, call: Callable[[], object]) -> None:
        assert self._loop is not None
        with suppress(RuntimeError):  # it has ended; the reason is among the messages
            self._loop.call_soon_threadsafe(call)

    def _next(self) -> Found:
        """The next block that comes back; lines for the user on the way."""
        alone_since = time.monotonic()
        reported = False
        while True:
            try:
                message = self._messages.get(timeout=0.1)
            except Empty:
                if len(self._served) > len(self._refused):  # some work, or are being asked what they are
                    alone_since, reported = time.monotonic(), False
                elif time.monotonic() > alone_since + _PATIENCE and self._messages.empty():
                    reported = self._alone(time.monotonic() - alone_since, reported)
                continue
            if isinstance(message, BaseException):
                raise message
            if isinstance(message, str):
                self.notify(message)
            else:
                return message

    def _alone(self, seconds: float, reported: bool) -> bool:
        """Say, once, that no worker can be used for so many seconds. Returns: whether that has been said.

        Raises: InputError, ClusterError: waiting is of no use.
        """
        for reason in list(self._refused.values()):
            raise reason
        if self.workers:
            failed = [nanny.status.name in ("failed", "closed") for nanny in list(self._local.workers.values())]
            if seconds > _START or (failed and all(failed)):
                raise ClusterError(f"{self.address}: no worker has started within {seconds:.0f} s")
        if not reported and seconds > (_SILENCE if self.workers else _PATIENCE):
            self.notify(f"{self.address}: no workers; waiting for some to join")
            reported = True
        return reported

    def _run(self) -> None:
        if hasattr(signal, "pthread_sigmask"):  # workers that this thread starts leave Ctrl-C to who started them
            resource_tracker.ensure_running()  # or it unblocks what is blocked here
            signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            asyncio.run(self._serve_all())
        except OptionError as reason:
            self._messages.put(reason)
        except (Exception, asyncio.CancelledError) as reason:  # the latter of Dask, whose connection has ended
            lost = f"{self.address}: the cluster is lost: {type(reason).__name__}: {reason}".rstrip(": ")
            self._messages.put(ClusterError(" ".join(lost.split())))

    async def _serve_all(self) -> None:
        """Connect, and serve each worker that is there or comes, until it goes."""
        import dask
        import distributed

        for name in ("distributed", "distributed.client", "tornado.application"):  # Dask gives them levels of their own
            logging.getLogger(name).setLevel(logging.CRITICAL + 1)
        dask.config.set(CONFIG)
        self._loop = asyncio.get_running_loop()
        async with AsyncExitStack() as stack:
            target: Any = self.address
            if target.startswith("tls://") and not distributed.Security().get_connection_args("client")["ssl_context"]:
                raise OptionError("cluster", "credentials in Dask's configuration, distributed.comm.tls", "none")
            if self.workers is not None:
                local = distributed.LocalCluster(n_workers=0, asynchronous=True, **LOCAL)
                target = self._local = await stack.enter_async_context(local)
                stack.callback(lambda: asyncio.create_task(_kill(local)))  # which ends with the event loop
            client = distributed.Client(target, asynchronous=True, set_as_default=False, timeout=_CONNECT)
            try:
                self._client = await stack.enter_async_context(client)
            except (OSError, TimeoutError, ValueError) as reason:
                text = f"nothing that answers ({type(reason).__name__})"
                raise OptionError("cluster", "local, local:N or the address of a Dask scheduler", text) from None
            if self.workers:
                local.scale(self.workers)  # now: both of them, as they are entered, wait for the last worker to start
                self._late = time.monotonic() + _SILENCE
            if warning := unguarded(self.address):
                self._messages.put(warning)
            self._connected.set()
            try:
                while not self._stop.is_set():
                    await self._look()
                    with suppress(TimeoutError):
                        await asyncio.wait_for(self._stop.wait(), _LOOK)
            finally:
                for task in self._served.values():
                    task.cancel()
                await asyncio.gather(*self._served.values(), return_exceptions=True)

    async def _look(self) -> None:
        """Serve workers that have come, and let go of those that have gone."""
        if self._client.status != "running":
            raise ClusterError("its scheduler has gone")
        started = (await self._client.scheduler.ncores()).keys()
        if self.workers and len(started) >= self.workers:
            self._late = math.inf
        elif started and time.monotonic() > self._late:
            self._late = math.inf
            late = f"{len(started)} of {self.workers} workers have started within {_SILENCE:.0f} s"
            self._messages.put(f"{self.address}: {late}; going on without the rest")
        present = started - await self._silent()
        for worker in present - self._served.keys():
            self._served[worker] = asyncio.create_task(self._serve(worker))
        for worker in self._served.keys() - present:
            self._refused.pop(worker, None)
            self._served.pop(worker).cancel()

    async def _silent(self) -> set[str]:
        """Workers that have sent no heartbeat for long, as stopped processes do; the user gets a line."""
        now = time.monotonic()
        if now >= self._asked + _HEARTBEATS:
            self._asked = now
            workers = (await self._client.scheduler.identity())["workers"]
            before, self._heard = self._heard, {}
            for worker, about in workers.items():
                seen, since = before.get(worker, (None, now))
                self._heard[worker] = about["last_seen"], since if seen == about["last_seen"] else now
        silent = {worker for worker, (_, since) in self._heard.items() if now > since + _SILENCE}
        for worker in silent & self._served.keys():
            self._messages.put(f"worker {worker} has not been heard of for {_SILENCE:.0f} s; others get its blocks")
        return silent

    async def _serve(self, worker: str) -> None:
        await self._scene_known.wait()
        answer: Any = None
        scene = None
        while not isinstance(answer, int) and scene is not self._scene:  # which may have been another's meanwhile
            scene = self._scene
            try:
                answer = await self._call(worker, greet, self._machine, scene, self._threads)
                what, expected, got = ("", "", "") if isinstance(answer, int) else answer
            except Exception as failure:
                answer = None
                what, expected, got = "code", "obscurance as it is here", f"{type(failure).__name__}: {failure}"
        if not isinstance(answer, int):
            reason = InputError(f"{self.address}: no worker can be used: {worker}", what, expected, got)
            self._refuse(worker, f"{what}: expected {expected}, got {got}", reason)
            return
        self.dispatch.joined(worker, answer)
        try:
            async with asyncio.TaskGroup() as feeding:
                for _ in range(IN_FLIGHT):
                    feeding.create_task(self._feed(worker))
        except* _Failed as failures:
            text = str(failures.exceptions[0])
            self._refuse(worker, text, ClusterError(f"{self.address}: no worker can be used: {worker}: {text}"))
        finally:
            self.dispatch.left(worker)

    def _refuse(self, worker: str, text: str, reason: InputError | ClusterError) -> None:
        """Args: text: for the user at once. reason: for the case that there are no others."""
        self._messages.put(f"worker {worker} gets no work: {' '.join(text.split())}")
        self._refused[worker] = reason

    async def _feed(self, worker: str) -> None:
        """Keep one block after another in flight to a worker."""
        from distributed.scheduler import KilledWorker

        dispatch = self.dispatch
        while True:
            async with self._more:
                await self._more.wait_for(lambda: dispatch.waiting)
            if not dispatch.waiting:
                continue
            assert dispatch.work is not None
            first, last = span = dispatch.take(worker)
            try:
                some = dispatch.work[first:last]
                seconds, *contents = await self._call(worker, trace_block, self._scene, self._threads, some)
                if not isinstance(seconds, float):
                    raise InputError(seconds, *contents) if contents else _Failed(seconds)
                tables = unpack(some, contents)
            except BaseException as reason:
                dispatch.lost(span)
                if isinstance(reason, asyncio.CancelledError | KilledWorker):
                    self._ended(span)
                async with self._more:
                    self._more.notify_all()
                if isinstance(reason, asyncio.CancelledError):
                    raise
                if isinstance(reason, InputError):
                    self._messages.put(reason)
                    return
                if not isinstance(reason, KilledWorker):
                    self._failed(span, reason)
                continue
            dispatch.came_back(worker, span, seconds)
            self._messages.put((first, last, tables))

    def _ended(self, span: Span) -> None:
        """A worker has ended with a block; the bake does, too, if many have with the same."""
        self._losses[span[0]] = self._losses.get(span[0], 0) + 1
        if self._losses[span[0]] >= _LOSSES:
            reason = f"{_LOSSES} workers have ended with the same block: too little memory, for instance"
            self._messages.put(ClusterError(f"{self.address}: {reason}"))

    def _failed(self, span: Span, reason: BaseException) -> None:
        """Raises: _Failed: always; the bake, too, if other workers have failed at the same block."""
        text = str(reason) if isinstance(reason, _Failed) else f"{type(reason).__name__}: {reason}"
        self._failures[span] = self._failures.get(span, 0) + 1
        if self._failures[span] >= _FAILURES:
            self._messages.put(ClusterError(f"{self.address}: a block fails on every worker: {text}"))
        raise _Failed(text)

    async def _call(self, worker: str, function: Callable[..., Any], *arguments: Any) -> Any:
        """What `function` returns on a worker: texts, numbers, bytes and tuples of such, or TypeError is raised.

        What Dask cancels, because it has lost its scheduler, is no fault of the worker's: `_look` will find out.
        """
        from distributed.client import ClosedClientError
        from distributed.comm import CommClosedError

        while True:
            key = f"{function.__name__}-{uuid.uuid4().hex}"
            try:
                future = self._client.submit(function, *arguments, key=key, workers=[worker], pure=False)
                try:
                    if reason := await future.exception():
                        raise reason
                    found = await self._client.scheduler.gather(keys=[key], deserializers=["msgpack"])
                    if found["status"] == "OK":
                        return found["data"][key]
                finally:
                    future.release()
            except (CancelledError, ClosedClientError, CommClosedError):
                pass
            await asyncio.sleep(_LOOK)

    def _begin(self, work: Work, spans: Sequence[Span]) -> None:
        async def wake() -> None:
            async with self._more:
                self._more.notify_all()

        self._failures.clear()
        self._losses.clear()
        self.dispatch.begin(work, spans)
        self._waking = asyncio.ensure_future(wake())


async def _kill(local: Any) -> None:
    """End workers on this machine that Dask would wait for: those that are starting, and after a while all."""
    end = time.monotonic() + _END
    while True:
        for nanny in list(local._created):
            worker = nanny.process
            if worker and worker.process and (worker.status.name == "starting" or time.monotonic() > end):
                await worker.process.kill()
        await asyncio.sleep(0.1)


class _Failed(Exception):
    """A worker cannot trace."""
