"""What runs on a worker: blocks are traced on all of its cores; and their rows on the way back.

Rows travel as bytes of declared lengths: nothing that a worker made is unpickled as rows.
"""

import json
import threading
import time
from collections.abc import Mapping, Sequence
from copy import deepcopy
from typing import Any

import numpy as np

from raytrace.errors import InputError, MemoryLimitError
from raytrace.system.threads import thread_count

from ..execute.identity import first_difference, machine
from ..execute.work import Tables, Work, fill
from .scene_file import SceneFile, load_scene

_lock = threading.Lock()  # one block at a time, on all cores, however many threads the worker has for tasks
_loaded: dict[str, Any] = {}  # one
Answer = tuple[object, ...]


def trace_block(expected: Mapping[str, str], file: SceneFile, threads: int | None, work: Work) -> Answer:
    """The seconds that the rows of `work` took, and their tables as `pack` has them.

    Or a text, and texts: "refused" and what is wrong with this worker, what was expected of it, and what came; "wrong"
    and what an `InputError` says that every worker would raise; "failed" and a reason.

    Args: expected: `machine()` of who asks. file: the scene to load. threads: None for all cores.
    """
    if found := first_difference(expected, machine()):
        return "refused", *found
    with _lock:
        try:
            if file.digest not in _loaded:
                _loaded.clear()
                _loaded[file.digest] = load_scene(file)
        except OSError as reason:
            got = str(reason.strerror or reason)
            return "refused", str(reason.filename or file.path), "a folder that all workers share", got
        except Exception as reason:
            return "refused", file.path, "the scene of this very work", f"{type(reason).__name__}: {reason}"
        try:
            start, tables = time.perf_counter(), work.tables()
            work = deepcopy(work)  # arrays from the network may be unaligned: kernels would be compiled for them
            fill(work, _loaded[file.digest], tables, thread_count(threads))
            return time.perf_counter() - start, *pack(tables)
        except Exception as reason:
            if isinstance(reason, InputError) and not isinstance(reason, MemoryLimitError):
                return "wrong", reason.source, reason.field, reason.expected, str(reason.got)
            return "failed", f"{type(reason).__name__}: {reason}"


def pack(tables: Tables) -> tuple[bytes, ...]:
    """The content of each table; objects, which are JSON-ready, as JSON."""
    return tuple(json.dumps(table.tolist()).encode() if table.dtype == object else table.tobytes() for table in tables)


def unpack(work: Work, contents: Sequence[object]) -> Tables:
    """The tables of `work` that `pack` has packed.

    Raises:
        ValueError: these are contents of other tables.
    """
    tables = work.tables()
    for table, content in zip(tables, contents, strict=True):
        if not isinstance(content, bytes):
            raise ValueError(f"expected bytes, got {type(content).__name__}")
        values = np.array(json.loads(content)) if table.dtype == object else np.frombuffer(content, table.dtype)
        table[...] = values.reshape(table.shape)
    return tables
