"""The workers of a Dask cluster, and functions called on one of them. The only importer of Dask.

Dask starts workers, knows which are alive, runs what is submitted to them and carries bytes, on its own thread.
"""

import asyncio
import logging
import os
import re
import signal
import time
import uuid
from collections.abc import Callable
from concurrent.futures import CancelledError, Future, ThreadPoolExecutor
from contextlib import suppress
from multiprocessing import resource_tracker
from typing import Any

from raytrace.errors import ClusterError, OptionError
from raytrace.system.threads import thread_count

_CONNECT = 10.0  # seconds to reach a scheduler
_AGAIN, _GONE = 0.2, 2.0  # seconds until what Dask has cancelled is submitted anew, and until a dead worker is missed
_END = 10.0  # seconds that workers on this machine have to end
CONFIG = {
    "distributed.scheduler.http.routes": [], "distributed.worker.http.routes": [],  # pages for whoever reaches the port
    "distributed.admin.large-graph-warning-threshold": "1GB",
    "distributed.deploy.lost-worker-timeout": "1 hour",  # a worker that starts again may take a while
}  # fmt: skip
LOCAL: dict[str, Any] = {
    "threads_per_worker": 1, "memory_limit": 0, "host": "127.0.0.1", "silence_logs": logging.CRITICAL,
    "preload": ["ao.cluster.worker"],
    "security": True,  # TLS with credentials of its own: other users of this machine reach its ports
    "scheduler_kwargs": {"dashboard": False, "dashboard_address": "127.0.0.1:0"},
}  # fmt: skip


def local_workers(address: str) -> int | None:
    """N of `local:N`, 1 of `local`, None of a scheduler's address. Raises: OptionError: it is neither."""
    name, _, number = address.partition(":")
    if name == "local" and ((number.isdecimal() and 1 <= int(number) <= 4096) or ":" not in address):
        return int(number or 1)
    if re.fullmatch(r"(tcp|tls|ws|wss)://.+", address):  # `ucx://` ends in an error of another kind with each version
        return None
    raise OptionError("cluster", "local, local:N or the address of a Dask scheduler, tls://host:port", repr(address))


def unguarded(address: str) -> str | None:
    """A warning where a scheduler's connections are not authenticated; None by TLS, or for local workers."""
    if local_workers(address) is not None or address.startswith(("tls://", "wss://")):
        return None
    return f"{address}: whoever reaches this scheduler can run code on its workers and here; tls:// keeps others out"


class DaskCluster:
    """Workers that are there, and those of this machine if they are asked for, which end with `close`.

    Attributes: count: of workers that are started here, or None. threads: of each; None for all cores of others.
    """

    def __init__(self, address: str, threads: int | None) -> None:
        self.address, self.count = address, local_workers(address)
        self.threads = None if self.count is None else max(thread_count(threads) // self.count, 1)
        self._client: Any = None
        self._local: Any = None
        self._safe_path = os.environ.get("PYTHONSAFEPATH")  # until now
        self._aside = ThreadPoolExecutor(1)  # Ctrl-C, on the main thread, leaves no coroutine that nobody awaits
        self._opened = self._aside.submit(self._open)

    def connect(self) -> None:
        """Wait for the scheduler. Raises: OptionError: there is none at the address, or no credentials for it."""
        try:
            self._opened.result()
        except BaseException:
            self.close()
            raise

    def _open(self) -> None:
        """Connect to the scheduler, or start one and its workers on this machine. Raises: OptionError."""
        os.environ["PYTHONSAFEPATH"] = "1"  # or what is started, by `python -c`, imports from the current folder first
        if hasattr(signal, "pthread_sigmask"):  # workers that Dask's thread starts leave Ctrl-C to who started them
            resource_tracker.ensure_running()  # or it unblocks what is blocked here
            signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        import dask
        import distributed

        for name in ("distributed", "distributed.client", "tornado.application"):  # Dask gives them levels of their own
            logging.getLogger(name).setLevel(logging.CRITICAL + 1)
        dask.config.set(CONFIG)
        target: Any = self.address
        if target.startswith("tls://") and not distributed.Security().get_connection_args("client")["ssl_context"]:
            raise OptionError("cluster", "credentials in Dask's configuration, distributed.comm.tls", "none")
        if self.count:
            self._local = target = distributed.LocalCluster(n_workers=0, **LOCAL)
        try:
            self._client = distributed.Client(target, set_as_default=False, timeout=_CONNECT)
        except (OSError, TimeoutError, ValueError) as reason:
            text = f"nothing that answers ({type(reason).__name__})"
            raise OptionError("cluster", "local, local:N or the address of a Dask scheduler", text) from None
        if self.count:
            self._local.scale(self.count)  # now: cluster and client, as they are made, wait for the last one to start

    def workers(self) -> dict[str, object]:
        """When each worker was last heard of, by its name. Raises: ClusterError: none is left."""
        lost = f"{self.address}: the cluster is lost"
        if self._client.status != "running":
            raise ClusterError(f"{lost}: its scheduler has gone")
        try:  # not by `scheduler_info`, whose workers a callback of Dask's takes away now and then
            facts_of = self._client.sync(self._client.scheduler.identity)["workers"]
            return {name: facts["last_seen"] for name, facts in facts_of.items()}
        except Exception as reason:  # whatever Dask makes of it
            text = " ".join(f"{lost}: {type(reason).__name__}: {reason}".rstrip(": ").split())
            raise ClusterError(text) from None

    def none_starts(self) -> bool:
        """Whether all workers that are started here have failed to."""
        failed = [nanny.status.name in ("failed", "closed") for nanny in list(self._local.workers.values())]
        return bool(failed) and all(failed)

    def call(self, worker: str, function: Callable[..., Any], *arguments: Any) -> Future[Any]:
        """Call `function` on a worker. Returns the future of its result: texts, numbers, bytes, tuples of these, or
        a TypeError.

        The thread beside this one begins the call, so that Ctrl-C cannot come between.
        """
        loop = self._client.loop.asyncio_loop

        def begin() -> Future[Any]:
            """Send the call, on the thread of Dask's event loop."""
            return asyncio.run_coroutine_threadsafe(self._call(worker, function, *arguments), loop)

        return self._aside.submit(begin).result()

    async def _call(self, worker: str, function: Callable[..., Any], *arguments: Any) -> Any:
        """`call`. What Dask cancels, as it loses its scheduler, is no fault of the worker's: `workers` finds out."""
        from distributed.client import ClosedClientError
        from distributed.comm import CommClosedError
        from distributed.scheduler import KilledWorker

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
            except KilledWorker:  # it may be gone, as `workers` finds out; or is started again under the same address
                await asyncio.sleep(_GONE)
                raise
            except (CancelledError, ClosedClientError, CommClosedError):
                pass
            await asyncio.sleep(_AGAIN)

    def close(self) -> None:
        """Let go of the cluster; workers that were started here end, and so does what was set for them."""
        self._aside.shutdown()
        if self._client:
            with suppress(Exception):
                self._client.close()
        if self._local:
            asyncio.run_coroutine_threadsafe(_kill(self._local), self._local.loop.asyncio_loop)  # ends with the loop
            with suppress(Exception):
                self._local.close()
        if self._safe_path is None:
            os.environ.pop("PYTHONSAFEPATH", None)


async def _kill(local: Any) -> None:
    """End workers on this machine that Dask would wait for: those that are starting, and after a while all."""
    end = time.monotonic() + _END
    while True:
        for nanny in list(local._created):
            worker = nanny.process
            if worker and worker.process and (worker.status.name == "starting" or time.monotonic() > end):
                await worker.process.kill()
        await asyncio.sleep(0.1)
