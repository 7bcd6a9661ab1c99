"""What runs on a worker: it says what it is, loads a scene, and traces blocks in it on all of its cores."""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Mapping
from typing import Any

from raytrace.system.threads import thread_count

from ..trace.identity import first_difference, machine
from ..trace.work import Tables, Work, fill
from .scene_file import SceneFile, load_scene

_lock = threading.Lock()  # one block at a time, on all cores, however many threads the worker has for tasks
_loaded: dict[str, Any] = {}  # one


def dask_setup(_worker: object) -> None:
    """Leave an interrupt from the terminal to who started this worker; Dask calls it in workers that preload this."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def greet(expected: Mapping[str, str], file: SceneFile, threads: int | None) -> int | tuple[str, str, str]:
    """How many threads trace here; or why nothing can: what, what was expected of it, and what came.

    Args: expected: `machine()` of who asks. file: the scene to load. threads: None for all cores.
    """
    if found := first_difference(expected, machine()):
        return found
    try:
        with _lock:
            _scene(file)
    except OSError as reason:
        return str(reason.filename or file.path), "a folder that all workers share", str(reason.strerror or reason)
    except Exception as reason:
        return file.path, "the scene of this very work", f"{type(reason).__name__}: {reason}"
    return thread_count(threads)


def trace_block(file: SceneFile, threads: int | None, work: Work) -> tuple[Tables, float]:
    """The rows of `work`, and the seconds that they took."""
    with _lock:
        scene, start = _scene(file), time.perf_counter()
        tables = work.tables()
        fill(work, scene, tables, thread_count(threads))
        return tables, time.perf_counter() - start


def _scene(file: SceneFile) -> Any:
    if file.digest not in _loaded:
        _loaded.clear()
        _loaded[file.digest] = load_scene(file)
    return _loaded[file.digest]
