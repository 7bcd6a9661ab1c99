"""What runs on a worker: it says what it is, loads a scene, and traces blocks in it on all of its cores."""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping
from typing import Any

from raytrace.errors import InputError, MemoryLimitError
from raytrace.system.threads import thread_count

from ..execute.identity import first_difference, machine
from ..execute.work import Work, fill
from .rows import pack
from .scene_file import SceneFile, load_scene

_lock = threading.Lock()  # one block at a time, on all cores, however many threads the worker has for tasks
_loaded: dict[str, Any] = {}  # one


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


def trace_block(file: SceneFile, threads: int | None, work: Work) -> tuple[object, ...]:
    """The seconds that the rows of `work` took, and their tables as `pack` has them.

    Or why there are none, in texts: what an `InputError` says that every worker would raise, or one text.
    """
    try:
        with _lock:
            scene, start = _scene(file), time.perf_counter()
            tables = work.tables()
            fill(work, scene, tables, thread_count(threads))
            return time.perf_counter() - start, *pack(tables)
    except Exception as reason:
        if isinstance(reason, InputError) and not isinstance(reason, MemoryLimitError):
            return reason.source, reason.field, reason.expected, str(reason.got)
        return (f"{type(reason).__name__}: {reason}",)


def _scene(file: SceneFile) -> Any:
    if file.digest not in _loaded:
        _loaded.clear()
        _loaded[file.digest] = load_scene(file)
    return _loaded[file.digest]
