"""What runs on a worker: blocks are traced on all of its cores, in a scene that it loads from a file.

Rows travel as bytes of declared lengths: nothing that a worker made is unpickled as rows. The scene, faces of a bake or
a picture, is a file named by its content, and not data that the scheduler holds: what is scattered to workers is lost
with them (distributed #3149, #5704). It is a pickle, with arrays behind it that are neither copied to be written nor to
be read; a worker loads it once its hash is the one that came with the work, from whom could as well send any function
to be called.
"""

import hashlib
import json
import pickle
import struct
import threading
import time
from collections.abc import Mapping, Sequence
from copy import deepcopy
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from raytrace.errors import InputError, MemoryLimitError
from raytrace.system.atomic import atomic_write
from raytrace.system.threads import thread_count

from ..execute.work import Outputs, RowTask, bit_environment, fill, first_difference

_SIZE = struct.Struct("<q")
_lock = threading.Lock()  # one block at a time, on all cores, however many threads the worker has for tasks
_loaded: dict[str, Any] = {}  # one


class SceneFile(NamedTuple):
    """Attributes: path: absolute. digest: hash of what is in it, 64 hex digits."""

    path: str
    digest: str


def write_scene(folder: Path, name: str, scene: object) -> SceneFile:
    """Write a scene into `folder`, if it is not there yet. Raises: OutputError.

    Args: name: of one bake, which removes the file in the end: another of the same mesh may still need its own.
    """
    arrays: list[pickle.PickleBuffer] = []
    head = pickle.dumps(scene, protocol=5, buffer_callback=arrays.append)
    parts = [memoryview(head), *(array.raw() for array in arrays)]
    pieces = [piece for part in parts for piece in (_SIZE.pack(part.nbytes), part)]
    digest = hashlib.blake2b(digest_size=32)
    for piece in pieces:
        digest.update(piece)
    path = folder.absolute() / f".{name}-{digest.hexdigest()[:32]}.scene"
    if not path.exists():
        with atomic_write(path) as file:
            file.writelines(pieces)
    return SceneFile(str(path), digest.hexdigest())


def load_scene(file: SceneFile) -> Any:
    """The scene that was written. Raises: OSError: it cannot be read here. ValueError: it holds something else."""
    parts: list[bytearray] = []
    digest = hashlib.blake2b(digest_size=32)
    with Path(file.path).open("rb") as stored:
        left = stored.seek(0, 2)
        stored.seek(0)
        while left >= _SIZE.size:
            size = stored.read(_SIZE.size)
            digest.update(size)
            left -= _SIZE.size
            part = bytearray(max(min(_SIZE.unpack(size)[0], left), 0))
            left -= stored.readinto(part)
            digest.update(part)
            parts.append(part)
    if digest.hexdigest() != file.digest:
        raise ValueError("other content than its name says")
    return pickle.loads(parts[0], buffers=parts[1:])


def trace_block(expected: Mapping[str, str], file: SceneFile, threads: int | None, work: RowTask) -> tuple[object, ...]:
    """The seconds that the rows of `work` took, and their tables as `pack` has them.

    Or a text, and texts: "refused" and what is wrong with this worker, what was expected of it, and what came; "wrong"
    and what an `InputError` says that every worker would raise; "failed" and a reason.

    Args: expected: `bit_environment()` of who asks. file: the scene to load. threads: None for all cores.
    """
    if difference := first_difference(expected, bit_environment()):
        return "refused", *difference
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
            start = time.perf_counter()
            work = deepcopy(work)  # arrays from the network may be unaligned: kernels would be compiled for them
            tables = fill(work, _loaded[file.digest], thread_count(threads))
            return time.perf_counter() - start, *pack(tables)
        except Exception as reason:
            if isinstance(reason, InputError) and not isinstance(reason, MemoryLimitError):
                return "wrong", reason.source, reason.field, reason.expected, str(reason.got)
            return "failed", f"{type(reason).__name__}: {reason}"


def pack(tables: Outputs) -> tuple[bytes, ...]:
    """The content of each table; objects, which are JSON-ready, as JSON."""
    return tuple(json.dumps(table.tolist()).encode() if table.dtype == object else table.tobytes() for table in tables)


def unpack(work: RowTask, contents: Sequence[object]) -> Outputs:
    """The tables of `work` that `pack` has packed. Raises: ValueError: these are contents of other tables."""
    tables = work.tables()
    for table, content in zip(tables, contents, strict=True):
        if not isinstance(content, bytes):
            raise ValueError(f"expected bytes, got {type(content).__name__}")
        values = np.array(json.loads(content)) if table.dtype == object else np.frombuffer(content, table.dtype)
        table[...] = values.reshape(table.shape)
    return tables
