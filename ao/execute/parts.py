"""A part of a bake: a share of the rows, traced into a journal by a process that knows nothing of the others."""

import hashlib
import json
from collections.abc import Callable, Mapping
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from raytrace.errors import ObscuranceError, OutputError
from raytrace.mesh.placement import Placement
from raytrace.types import Bools, Int64s

from ..points.receivers import Receivers
from .checkpoint import Checkpoint
from .identity import machine
from .journal import Block, record
from .work import Work

ENDING = ".part"
_RUNS, _LEAST = 16, 64  # runs of neighbouring rows to each part, and rows in one at least
DESCRIPTION: Block = hashlib.blake2b(b"description", digest_size=16).digest(), 0, 0
WHOLE: Block = hashlib.blake2b(b"whole", digest_size=16).digest(), 0, 0


class PartTraced(ObscuranceError):
    """All rays of a part are traced: the bake of it ends here, since all that follows needs rows of the other parts.

    An exception, or every step between the rays and the written file would have to know of a bake without values.
    """


def assign_shards(count: int, of: int) -> Int64s:
    """Which of the parts 1 to `of` makes each of `count` rows, (count,): short runs in turn, which take alike."""
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

    The bake raises `PartTraced` when its rays are traced. What an earlier run of the same part has traced is kept.

    Args:
        folder: where the journal is kept. number, of: which part, from 1, of how many.
        description: what is baked, as JSON-ready values, for who merges the parts.
        notify: called with a line for the user.

    Attributes:
        rays: how many this part has traced, by an earlier run too.

    Raises, in the bake:
        InputError: the folder has this part of another bake.
        OutputError: the journal cannot be written, another process is at work on it, or it is some other file.
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
        self._description |= {"mesh digest": digest_of(placement, receivers), "machine": machine()}
        super().begin(placement, receivers, *settings)
        if not self._journal or DESCRIPTION not in self._journal.blocks:
            self._pending.append(record(DESCRIPTION, json.dumps(self._description).encode()))

    def choose(self, work: Work, missing: Bools) -> Bools:
        own = assign_shards(len(work), self.of) == self.number
        self.rays += int(np.count_nonzero(own) * work.rays)
        return missing & own

    def all_traced(self) -> None:
        """Raises: PartTraced."""
        self._pending.append(record(WHOLE, b"whole"))
        self._write()
        raise PartTraced(f"{self.path}: traced")

    def _give_up(self, reason: OutputError) -> None:
        raise OutputError(f"{reason}; the same command continues from what is there")

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        if kind is not None and not issubclass(kind, ObscuranceError):
            self._write()
            if self._journal:
                self.notify(f"{self.path} keeps what is done; the same command continues from it")
        if self._journal:
            self._journal.close()
