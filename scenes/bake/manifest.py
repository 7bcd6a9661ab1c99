"""The manifest of a batch as JSON, with the outcome of each input; manifests of shards merged into one."""

import hashlib
import heapq
import re
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from threading import Lock
from typing import Annotated, Any, Literal

from raytrace.errors import InputError
from raytrace.system.atomic import write_json
from raytrace.system.checks import check_regular
from raytrace.system.records import Fault, Within, read
from raytrace.text.strict_json import parse_json

MANIFEST = "manifest.json"
VERSION = 1
EVERY = 2.0  # seconds between writes while work goes on
Status = Literal["done", "failed", "waiting"]
_NAME = re.compile(r"manifest-\d+-of-(\d+)\.json")


@dataclass
class Entry:
    """The outcome of an input, with the names of files."""

    input: str
    output: str
    status: Status = "waiting"  # also of what an interrupt left out
    seconds: float = 0.0  # of reading, baking and writing
    message: str = ""  # the summary or the fault
    warnings: list[str] = field(default_factory=list)
    sha256: str = ""  # of the bytes of the input and of the files that it names
    output_sha256: str = ""

    def done(self) -> None:
        """Record the hash of an output that is written as a whole."""
        self.status = "done"
        self.output_sha256 = digest([Path(self.output)])


def digest(files: Iterable[Path]) -> str:
    """SHA-256 of the bytes of files in hex digits, nothing where one cannot be read: its bake will say why."""
    hashed = hashlib.sha256()
    try:
        for path in files:
            check_regular(path, "a file")
            with path.open("rb") as file:
                hashlib.file_digest(file, lambda: hashed)
    except (OSError, ValueError):
        return ""
    return hashed.hexdigest()


class Manifest:
    """The entries of a batch, written every few seconds; from any thread. Args: about: options and versions."""

    def __init__(self, path: Path, entries: list[Entry], about: dict[str, Any]) -> None:
        self.path, self.entries, self._about = path, entries, about
        self._lock = Lock()
        self._due = time.monotonic() + EVERY

    def count(self, status: Status) -> int:
        return sum(entry.status == status for entry in self.entries)

    def save(self) -> None:
        """Write the manifest, if the last time is some seconds ago."""
        with self._lock:
            if time.monotonic() >= self._due:
                self.write()
                self._due = time.monotonic() + EVERY

    def write(self) -> None:
        """Write the manifest now. Raises: OutputError."""
        counts = {status: self.count(status) for status in ("done", "failed", "waiting")}
        entries = [asdict(entry) for entry in self.entries]
        write_json(self.path, {"manifest_version": VERSION, **counts, **self._about, "inputs": entries})

    def resume(self, notify: Callable[[str], object]) -> None:
        """Take over the entries of the file on disk that are done, of the same bytes with the same options and
        versions.

        Outputs that are gone or have other bytes than were written, and inputs that have changed, are not done.

        Args: notify: called with a line for the user.
        """
        try:
            stored = parse_json(self.path.read_bytes())
            version = stored["manifest_version"]
            facts = {name: stored[name] for name in self._about}
            entries = read(list[Entry], stored["inputs"])
            done = {entry.input: entry for entry in entries if entry.status == "done"}
        except FileNotFoundError:
            notify(f"{self.path}: nothing to resume; starting from the beginning")
            return
        except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError, Fault):
            version = None
            facts = {}
            done = {}
        if version != VERSION:
            got = "something else" if version is None else f"one of version {version}"
            raise InputError(self.path, "manifest_version", f"a manifest of version {VERSION}", got)
        if facts != self._about:
            notify(f"{self.path}: of other options or another version; starting from the beginning")
            return
        for number, entry in enumerate(self.entries):
            earlier = done.get(entry.input)
            if not earlier or not earlier.output_sha256:
                continue
            is_same = (earlier.output, earlier.sha256) == (entry.output, entry.sha256)
            if is_same and digest([Path(entry.output)]) == earlier.output_sha256:
                self.entries[number] = earlier


def part_manifest(number: int, of: int) -> str:
    """The name of the manifest of part `number`, from 1, of so many."""
    return f"manifest-{number:0{len(str(of))}}-of-{of}.json"


def assign_shards(sizes: Sequence[int], of: int) -> list[int]:
    """The shard, 1 to `of`, of each mesh: the largest first, each to the shard with the least work so far."""
    shards = [0] * len(sizes)
    loads = [(0, part) for part in range(1, of + 1)]
    for mesh in sorted(range(len(sizes)), key=lambda mesh: -sizes[mesh]):
        load, shards[mesh] = heapq.heappop(loads)
        heapq.heappush(loads, (load + sizes[mesh] + 1, shards[mesh]))
    return shards


def is_batch_of_parts(folder: Path) -> bool:
    """Whether a folder holds the manifest of a part of a batch."""
    return folder.is_dir() and any(_NAME.fullmatch(path.name) for path in folder.iterdir())


def merge_batch(folder: Path) -> Manifest:
    """Merge the manifests of all shards. Raises: InputError: one is missing, not finished, or of another batch."""
    from ao.execute.parts import missing_of
    from ao.execute.work import first_difference

    paths = sorted(path for path in folder.iterdir() if _NAME.fullmatch(path.name))
    parts = [_read(path) for path in paths]
    first_part = parts[0]
    facts = [
        {**part.options, "versions": part.versions, "of": part.part.of, "inputs": part.part.inputs} for part in parts
    ]
    # All parts are of one batch, none is missing, and all are finished.
    for path, part_facts in zip(paths, facts, strict=True):
        if difference := first_difference(facts[0], part_facts):
            name, expected, got = difference
            raise InputError(path, name, f"{expected}, as in the first part", got)
    of, numbers = first_part.part.of, {part.part.number for part in parts}
    if lacking := missing_of(of, numbers):
        raise InputError(folder, "parts", f"all of 1 to {of}", f"{len(parts)} of them; missing: {lacking}")
    entries = {entry.input: entry for part in parts for entry in part.inputs}
    for path, part in zip(paths, parts, strict=True):
        if waiting := part.waiting:
            expected = "a finished part; the same command continues it"
            raise InputError(path, "waiting", expected, f"{waiting:,} meshes that wait")
    for name in first_part.part.inputs:
        if name not in entries:  # the parts saw files of other sizes
            raise InputError(folder, "inputs", f"{name} in one of the parts", "none that has it")
    # The manifest of the whole batch.
    about = {"options": first_part.options, "versions": first_part.versions}
    manifest = Manifest(folder / MANIFEST, [entries[name] for name in first_part.part.inputs], about)
    manifest.write()
    return manifest


@dataclass
class _Part:
    number: int
    of: int
    inputs: list[str]  # of all parts

    def __post_init__(self) -> None:
        if not 1 <= self.number <= self.of:
            raise ValueError


@dataclass
class _Stored:
    """The manifest of a part."""

    manifest_version: Annotated[int, Within(1, 1)]  # VERSION
    options: dict[str, Any]
    versions: dict[str, Any]
    waiting: int
    part: _Part
    inputs: list[Entry]


def _read(path: Path) -> _Stored:
    """The manifest of a part. Raises: InputError: it cannot be read, or is of another version."""
    try:
        check_regular(path, "the manifest of a part")
        return read(_Stored, parse_json(path.read_bytes()))
    except (OSError, ValueError, RecursionError, Fault):
        expected = f"the manifest of a part, of version {VERSION}"
        raise InputError(path, "manifest_version", expected, "something else") from None
