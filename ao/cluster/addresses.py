"""What `--cluster` may say, and the settings of Dask for workers on this machine."""

import logging
from typing import Any

from raytrace.errors import OptionError

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
    """N of `local:N`, 1 of `local`, None of a scheduler's address.

    Raises:
        OptionError: it is neither.
    """
    name, _, number = address.partition(":")
    if name == "local" and ((number.isdecimal() and 1 <= int(number) <= 4096) or ":" not in address):
        return int(number or 1)
    if "://" in address and not address.endswith("://"):
        return None
    raise OptionError("cluster", "local, local:N or the address of a Dask scheduler, tls://host:port", repr(address))


def unguarded(address: str) -> str | None:
    """What there is to say of a scheduler's address, whose connections prove nothing; None of one by TLS."""
    if local_workers(address) is not None or address.startswith(("tls://", "wss://")):
        return None
    return f"{address}: whoever reaches this scheduler can run code on its workers and here; tls:// keeps others out"
