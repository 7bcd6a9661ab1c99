"""One bake of a batch: what became of it, whoever did it."""

from __future__ import annotations

import time
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from raytrace.errors import ClusterError, ObscuranceError, printable

from ..commands.bake import MeshBake
from .manifest import Status

if TYPE_CHECKING:
    import ao


@dataclass(frozen=True)
class Outcome:
    """Attributes: as of `scenes.batch.manifest.Entry`."""

    status: Status
    seconds: float
    message: str
    warnings: list[str] = field(default_factory=list)


def bake_one(bake: MeshBake, falloff: ao.Falloff, threads: int, resume: bool) -> Outcome:
    """Bake and write; faults become messages, but for that of a cluster, which is lost for the others, too.

    Args: resume: continue what an interrupted run has traced, if there is any.
    """
    begun = resume and bake.journal(bake.output).exists()
    bake = replace(bake, quiet=True, progress="bar", threads=threads, resume=begun)
    start = time.perf_counter()
    try:
        written = list(bake.bake(falloff))
    except ClusterError:
        raise
    except Exception as fault:
        expected = isinstance(fault, ObscuranceError | OSError | MemoryError)
        message = str(fault) if expected and str(fault) else f"{type(fault).__name__}: {fault}"
        message = printable(message if str(bake.mesh) in message else f"{bake.mesh}: {message}")
        return Outcome("failed", _since(start), message)
    message = "\n".join(each.summary for each in written)
    return Outcome("done", _since(start), message, [line for each in written for line in each.warnings])


def _since(start: float) -> float:
    return round(time.perf_counter() - start, 3)
