"""Merging the parts of a bake: a checkpoint that takes all rows from their journals and makes none."""

import json
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from raytrace.errors import InputError, OutputError
from raytrace.mesh.placement import Placement
from raytrace.types import Bools

from ..points.receivers import Receivers
from .checkpoint import Checkpoint, identity, restore
from .identity import first_difference, machine
from .journal import Block, Journal
from .parts import DESCRIPTION, ENDING, WHOLE, assign_shards, digest_of
from .work import Tables

_MAY_DIFFER = "part", "mesh", "high"  # what parts of one bake may differ in: files have other names elsewhere


class PartFile(NamedTuple):
    """A part as it lies on the disk.

    Attributes:
        path: of its journal. identity: of the bake. description: what `ShardCheckpoint` was given, and what it added.
        blocks: where rows lie in the file.
    """

    path: Path
    identity: bytes
    description: dict[str, Any]
    blocks: dict[Block, tuple[int, int]]

    @property
    def facts(self) -> dict[str, str]:
        """Facts that must be equal in all parts of a bake, by name."""
        flat = {"number of parts": self.description["of"], "mesh": self.description["mesh digest"]}
        flat |= self.description["options"] | self.description["machine"]
        return {name: str(value) for name, value in flat.items()}


def read_parts(folder: Path) -> list[PartFile]:
    """All parts of the one bake whose parts are in `folder`, by number.

    Raises:
        InputError: there are none, one is missing, not finished, or of another bake.
    """
    try:
        paths = sorted(path for path in folder.iterdir() if path.suffix == ENDING)
    except OSError as reason:
        raise InputError(folder, "folder", "a folder of parts", reason.strerror) from None
    if not paths:
        raise InputError(folder, "parts", f"files that end in {ENDING}, which obscurance bake --part makes", "none")
    parts = [_read(path) for path in paths]
    usual = dict(Counter(tuple(part.facts.items()) for part in parts).most_common(1)[0][0])
    for part in parts:
        if found := first_difference(usual, part.facts):
            name, expected, got = found
            raise InputError(part.path, name, f"{expected}, as in the other parts", got)
    identity = Counter(part.identity for part in parts).most_common(1)[0][0]
    for part in parts:
        if part.identity != identity:
            raise InputError(part.path, "header", "what the other parts have", "that of another bake")
    of, numbers = int(usual["number of parts"]), [part.description["part"] for part in parts]
    if missing := sorted(set(range(1, of + 1)) - set(numbers)):
        lacking = ", ".join(map(str, missing[:20])) + (", …" if len(missing) > 20 else "")
        raise InputError(folder, "parts", f"all of 1 to {of}", f"{len(parts)} of them; missing: {lacking}")
    return parts


def _read(path: Path) -> PartFile:
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
        description = json.loads(journal.content(DESCRIPTION))
        return PartFile(path, journal.identity, description, dict(journal.blocks))
    finally:
        journal.close()


class Merge(Checkpoint):
    """The checkpoint of a bake whose rows were all traced in parts.

    Args:
        parts: `read_parts` of them.

    Raises, in the bake:
        InputError: the parts are of another bake.
    """

    def __init__(self, parts: list[PartFile]) -> None:
        super().__init__(None)
        self.parts = parts

    def begin(self, placement: Placement, receivers: Receivers, *settings: object) -> None:
        if identity(placement, receivers, settings) == self.parts[0].identity:
            return
        own: Mapping[str, str] = machine() | {"mesh": digest_of(placement, receivers)}
        facts = self.parts[0].facts
        difference = first_difference({name: facts[name] for name in own}, own)
        name, expected, got = difference or ("header", "that of this very bake", "that of another")
        raise InputError(self.parts[0].path.parent, name, f"{expected}, as in the parts", f"{got} here")

    def restored(self, name: bytes, tables: Tables) -> Bools:
        taken = np.zeros(len(tables[0]), np.bool_)
        for part in self.parts:
            with part.path.open("rb") as file:
                for block, (begin, size) in part.blocks.items():
                    if block[0] == name:
                        file.seek(begin)
                        restore(block, file.read(size), tables, taken)
        if not taken.all():
            part = self.parts[int(assign_shards(len(taken), len(self.parts))[np.argmin(taken)]) - 1]
            lacking = f"{np.count_nonzero(~taken):,} missing"
            raise InputError(part.path, "rows", f"all of its share of {len(taken):,}", lacking)
        return taken
