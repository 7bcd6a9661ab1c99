"""A plan is run: its files are read, rays are traced, and outputs written, here or in a batch."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Literal, NamedTuple
from warnings import catch_warnings, simplefilter

from obscurance import ao
from obscurance.raytrace.errors import ClusterError, ObscuranceError, OptionError, printable
from obscurance.raytrace.system.atomic import is_standard_output

from .console import note
from .inputs import BakeInputs, read_inputs
from .options import OptionValues
from .plan import OpenCheckpoint, Plan
from .report import OutputSummary, WorkSize

if TYPE_CHECKING:
    from obscurance.ao.cluster.workers import Workers
    from obscurance.ao.execute.kept import Kept


@contextmanager
def silence_tolerance_warnings() -> Iterator[None]:
    """Silence Python's warnings about tolerances that are not met: commands print their own."""
    with catch_warnings():
        simplefilter("ignore", ao.ToleranceWarning)
        yield


def workers_of(options: OptionValues) -> AbstractContextManager[Workers | None]:
    """The workers that `--cluster` asks for, if it does. Raises: OptionError: there can be none."""
    if not options.cluster:
        return nullcontext()
    if find_spec("distributed") is None or find_spec("cryptography") is None:
        raise OptionError("cluster", "Dask and cryptography: pip install dask distributed cryptography", "not both")
    from obscurance.ao.cluster.workers import Workers

    return Workers(options.cluster, note, options.threads)


def kept_by(workers: Workers | None, output: Path | None) -> Kept:
    """Keeps rows beside the output, if that is a file; workers trace them, if there are any."""
    from obscurance.ao.execute.kept import Kept

    target = None if output is None or is_standard_output(output) else output
    return Kept(target, note, make=workers.make, status=workers.status) if workers else Kept(target, note)


_kept_beside = partial(kept_by, None)


def run(
    plan: Plan, content: bytes | None = None, open_checkpoint: OpenCheckpoint = _kept_beside
) -> Iterator[OutputSummary]:
    """Bake and write, one output after the other. Raises: as `read_inputs`, `ao.bake` and writers.

    Args: content: of the input, if it is no file's.
    """
    inputs = read_inputs(plan, content)
    if plan.kind == "vertices":
        from . import vertices

        return vertices.run(plan, inputs, open_checkpoint)
    from . import texture

    return texture.run(plan, inputs, open_checkpoint)


def work_size(plan: Plan, inputs: BakeInputs) -> WorkSize:
    """The size of the bake. Raises: InputError: as `run`, before anything is traced."""
    if plan.kind == "vertices":
        from . import vertices

        return vertices.work_size(plan, inputs)
    from . import texture

    return texture.work_size(plan, inputs)


class Outcome(NamedTuple):
    """Attributes: as of `scenes.bake.manifest.Entry`."""

    status: Literal["done", "failed"]
    seconds: float
    message: str
    warnings: list[str]


def run_in_batch(plan: Plan, threads: int, open_checkpoint: OpenCheckpoint = _kept_beside) -> Outcome:
    """Bake and write, or continue what was begun; errors become messages, but for a cluster's, which ends all bakes."""
    plan = plan.with_options(quiet=True, progress="bar", threads=threads)
    start = time.perf_counter()
    try:
        summaries = list(run(plan, open_checkpoint=open_checkpoint))
    except ClusterError:
        raise
    except Exception as fault:
        expected = isinstance(fault, ObscuranceError | OSError | MemoryError)
        message = str(fault) if expected and str(fault) else f"{type(fault).__name__}: {fault}"
        message = printable(message if str(plan.mesh) in message else f"{plan.mesh}: {message}")
        return Outcome("failed", round(time.perf_counter() - start, 3), message, [])
    message = "\n".join(summary.text for summary in summaries)
    warnings = [line for summary in summaries for line in summary.warnings]
    return Outcome("done", round(time.perf_counter() - start, 3), message, warnings)
