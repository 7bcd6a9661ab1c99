"""Parts of a bake: shares of the rows, traced into journals by processes independent of each other, and their merge."""

import hashlib
import json
from collections import Counter
from collections.abc import Callable, Collection, Mapping
from contextlib import suppress
from itertools import islice
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple

import numpy as np

from raytrace.errors import InputError, ObscuranceError, OutputError
from raytrace.mesh.placement import Placement
from raytrace.text.strict_json import parse_json
from raytrace.types import Bools, Int64s

from ..points.receivers import Receivers
from .checkpoint import Checkpoint, identity, restore
from .journal import Block, Journal, record
from .work import KeptRowTask, Outputs, RowTask, bit_environment, first_difference

ENDING = ".part"
_RUNS, _LEAST = 16, 64  # runs of neighbouring rows to each part, and rows in one at least
DESCRIPTION: Block = hashlib.blake2b(b"description", digest_size=16).digest(), 0, 0
WHOLE: Block = hashlib.blake2b(b"whole", digest_size=16).digest(), 0, 0


class _AllTraced(Exception):
    """Leaves a bake between its rays and its values, which need rows of the other parts; no further than `trace`."""


def assign_shards(count: int, of: int) -> Int64s:
    """The part, from 1 to `of`, that makes each of `count` rows, (count,): short runs in turn, so that parts take
    alike."""
    run = max(-(-count // (of * _RUNS)), _LEAST)
    return np.arange(count) // run % of + 1


def digest_of(placement: Placement, receivers: Receivers) -> str:
    """Hash of a mesh as rays see it: 16 hex digits."""
    digest = hashlib.blake2b(placement.vertices.data, digest_size=8)
    for array in (receivers.faces, *(receivers.opacity or ())):
        digest.update(np.ascontiguousarray(array).data)
    return digest.hexdigest()


class ShardCheckpoint(Checkpoint):
    """A checkpoint that traces one of several parts of a bake and keeps its journal, for `Merge`.

    `rays` are those of the part, those traced by an earlier run of it among them.

    Args: number, of: which part, from 1, of how many. description: what is baked, JSON-ready, for who merges the parts.

    Raises, in the bake: InputError: the folder has this part of another bake. OutputError: the journal cannot be
        written, another process is at work on it, or it is some other file.
    """

    partial = True
    _expected = "no such file, or this part of this very bake"

    def __init__(
        self, folder: Path, number: int, of: int, description: Mapping[str, Any], notify: Callable[[str], object]
    ) -> None:
        path = folder / f"part-{number:0{len(str(of))}}-of-{of}{ENDING}"
        super().__init__(path, path.exists(), notify)
        self.number, self.of, self.rays = number, of, 0
        self._description = {**description, "part": number, "of": of}

    def begin(self, placement: Placement, receivers: Receivers, *settings: object) -> None:
        """As `Checkpoint.begin`; the part's description is recorded first."""
        self._description |= {"mesh digest": digest_of(placement, receivers), "machine": bit_environment()}
        super().begin(placement, receivers, *settings)
        if not self._journal or DESCRIPTION not in self._journal.blocks:
            self._pending.append(record(DESCRIPTION, json.dumps(self._description).encode()))

    def choose(self, work: RowTask, missing: Bools) -> Bools:
        """The missing rows of this part alone; their rays are counted."""
        is_own = assign_shards(len(work), self.of) == self.number
        self.rays += int(np.count_nonzero(is_own) * work.rays)
        return np.asarray(missing & is_own)

    def all_traced(self) -> None:
        """End the bake within `trace`. Raises: _AllTraced."""
        self._pending.append(record(WHOLE, b"whole"))
        self._write()
        raise _AllTraced

    def trace(self, bake: Callable[[], object]) -> None:
        """Let a bake with this checkpoint trace the rays of the part; it returns when they are in the journal.

        Raises: what `bake` raises.
        """
        with suppress(_AllTraced), self:
            bake()

    def _give_up(self, reason: OutputError) -> None:
        """Fail, for without its journal a part is of no use. Raises: OutputError."""
        raise OutputError(f"{reason}; the same command continues from what is there")

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        if kind is not None and not issubclass(kind, ObscuranceError | _AllTraced):
            self._write()
            if self._journal:
                self.notify(f"{self.path} keeps what is done; the same command continues from it")
        if self._journal:
            self._journal.close()


class PartFile(NamedTuple):
    """A part as it lies on the disk."""

    path: Path
    identity: bytes  # of the bake
    description: dict[str, Any]  # what `ShardCheckpoint` was given, and what it added
    blocks: dict[Block, tuple[int, int]]  # where rows lie in the file

    @property
    def facts(self) -> dict[str, str]:
        """Facts that must be equal in all parts of a bake, by name."""
        flat = {"number of parts": self.description["of"], "mesh": self.description["mesh digest"]}
        flat |= self.description["options"] | self.description["machine"]
        return {name: str(value) for name, value in flat.items()}


def read_parts(folder: Path) -> list[PartFile]:
    """All parts of the one bake whose parts are in `folder`, by number.

    Raises: InputError: there are none, one is missing, not finished, or of another bake.
    """
    try:
        paths = sorted(path for path in folder.iterdir() if path.suffix == ENDING)
    except OSError as reason:
        raise InputError(folder, "folder", "a folder of parts", reason.strerror) from None
    if not paths:
        raise InputError(folder, "parts", f"files that end in {ENDING}, which obscurance bake --part makes", "none")
    parts = [_read(path) for path in paths]
    # Facts and identity must be what most parts have.
    usual = dict(Counter(tuple(part.facts.items()) for part in parts).most_common(1)[0][0])
    for part in parts:
        if difference := first_difference(usual, part.facts):
            name, expected, got = difference
            raise InputError(part.path, name, f"{expected}, as in the other parts", got)
    header = Counter(part.identity for part in parts).most_common(1)[0][0]
    for part in parts:
        if part.identity != header:
            raise InputError(part.path, "header", "what the other parts have", "that of another bake")
    # None may be missing.
    of = parts[0].description["of"]
    numbers = {part.description["part"] for part in parts}
    if lacking := missing_of(of, numbers):
        raise InputError(folder, "parts", f"all of 1 to {of}", f"{len(parts)} of them; missing: {lacking}")
    return parts


def missing_of(of: int, numbers: Collection[int]) -> str:
    """The first twenty of the parts 1 to `of` that are not among `numbers`, in words; "" if none is missing."""
    missing = list(islice((number for number in range(1, of + 1) if number not in numbers), 21))
    return ", ".join(map(str, missing[:20])) + (", …" if len(missing) > 20 else "")


def _read(path: Path) -> PartFile:
    """A part's file, checked to be finished. Raises: InputError."""
    try:
        journal = Journal(path, create=False)
    except OutputError as reason:
        at_work = "at work" in str(reason)
        raise InputError(path, "content", "a finished part", "one at work" if at_work else "another file") from None
    except OSError as reason:
        raise InputError(path, "file", "a readable and writable file", reason.strerror) from None
    try:
        if journal.identity is None or DESCRIPTION not in journal.blocks or WHOLE not in journal.blocks:
            expected = "a finished part; the same command continues it"
            raise InputError(path, "content", expected, "a part that was interrupted")
        return PartFile(path, journal.identity, _parse_description(path, journal.content(DESCRIPTION)), journal.blocks)
    finally:
        journal.close()


def _parse_description(path: Path, content: bytes) -> dict[str, Any]:
    """The description that a part's journal holds. Raises: InputError: it is malformed."""
    try:
        description: dict[str, Any] = parse_json(content)
        number = description["part"]
        of = description["of"]
        options = description["options"]
        facts = description["machine"]
        is_valid = type(number) is type(of) is int and 1 <= number <= of
        is_valid = is_valid and isinstance(options, dict) and isinstance(facts, dict) and "mesh digest" in description
        is_valid = is_valid and isinstance(description["mesh"], str)
    except (ValueError, KeyError, TypeError, RecursionError):
        is_valid = False
    if not is_valid:
        raise InputError(path, "description", "that of a part, with its number, options and machine", "something else")
    return description


class Merge(Checkpoint):
    """The checkpoint of a bake whose rows were all traced in parts. Raises: InputError: they are of another bake."""

    def __init__(self, parts: list[PartFile]) -> None:
        super().__init__(None)
        self.parts = parts

    def begin(self, placement: Placement, receivers: Receivers, *settings: object) -> None:
        """Check that the parts are of this very bake, on a machine like this.

        Raises: InputError: the first difference.
        """
        if identity(placement, receivers, settings) == self.parts[0].identity:
            return
        own_facts: Mapping[str, str] = bit_environment() | {"mesh": digest_of(placement, receivers)}
        facts = self.parts[0].facts
        difference = first_difference({name: facts.get(name, "nothing") for name in own_facts}, own_facts)
        name, expected, got = difference or ("header", "that of this very bake", "that of another")
        raise InputError(self.parts[0].path.parent, name, f"{expected}, as in the parts", f"{got} here")

    def restored(self, work: KeptRowTask, tables: Outputs) -> Bools:
        """Copy the rows of all parts into `tables`. Raises: InputError: some are missing."""
        is_restored, name = np.zeros(len(work), np.bool_), work.name
        for part in self.parts:
            with part.path.open("rb") as file:
                for block, (begin, size) in part.blocks.items():
                    if block[0] == name:
                        file.seek(begin)
                        restore(block, file.read(size), work, tables, is_restored)
        if not is_restored.all():
            part = self.parts[int(assign_shards(len(is_restored), len(self.parts))[np.argmin(is_restored)]) - 1]
            lacking = f"{np.count_nonzero(~is_restored):,} missing or impossible"
            raise InputError(part.path, "rows", f"all of its share of {len(is_restored):,}", lacking)
        return is_restored
