"""`obscurance bench`: time against error of the baker itself, on one mesh."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from statistics import median

import ao
from ao.report import versions
from raytrace.mesh.mesh import Mesh
from raytrace.system.atomic import atomic_write
from raytrace.system.threads import thread_count

from ..geometry.temple import temple
from ..readers.load import load
from ..validation.reference import RAYS, Errors, reference

SAMPLES = (16, 64, 256, 1024)
ROUNDS = 3
_VERTICES = 2048
_FINENESS = 0.14


@dataclass(frozen=True)
class Row:
    """What one number of rays a vertex costs and brings.

    Attributes:
        seconds: of each bake, scene build included; build: median seconds of that part.
        rays: traced by one bake. estimate: the RMSE that the bakes themselves reported, the median one.
    """

    samples: int
    seconds: list[float]
    build: float
    rays: int
    estimate: float
    errors: Errors


def mesh_to_bench(path: Path | None) -> Mesh:
    """The mesh of a file, or a coarse temple.

    Raises:
        MeshError: see `scenes.load`.
    """
    return temple(_FINENESS) if path is None else load(path).mesh


def run(
    mesh: Mesh,
    falloff: ao.Falloff,
    samples: Sequence[int] = SAMPLES,
    rounds: int = ROUNDS,
    seed: int = 0,
    threads: int | None = None,
) -> list[Row]:
    """Bake `mesh` `rounds` times with each of `samples`, in turn, and judge w by a reference of 16384 rays."""
    truth = reference(mesh, [falloff.resolve(mesh.radius)], RAYS, _VERTICES, threads)
    ao.bake(mesh, falloff, samples[0], seed, threads, hidden="ignore")
    bakes: dict[int, list[tuple[float, ao.Bake]]] = {count: [] for count in samples}
    for turn in range(rounds):
        for count in samples:
            start = time.perf_counter()
            baked = ao.bake(mesh, falloff, count, seed + turn, threads, hidden="ignore")  # as the reference
            bakes[count].append((time.perf_counter() - start, baked))
    rows = []
    for count, made in bakes.items():
        build = median(baked.seconds["build"] for _, baked in made)
        estimate = median(baked.rmse for _, baked in made)
        errors = Errors.of(made[0][1].w[truth.vertices], truth.w[0])
        rows.append(Row(count, [seconds for seconds, _ in made], build, made[0][1].rays, estimate, errors))
    return rows


def table(rows: Sequence[Row]) -> str:
    """The rows as text."""
    lines = [f"{'samples':>8}{'seconds':>9}{'Mrays/s':>9}{'RMSE':>9}{'p99':>8}{'max':>8}{'estimated':>11}"]
    for row in rows:
        seconds, errors = median(row.seconds), row.errors
        lines.append(
            f"{row.samples:>8}{seconds:>9.3f}{row.rays / seconds / 1e6:>9.1f}{errors.rmse:>9.5f}"
            f"{errors.p99:>8.4f}{errors.largest:>8.4f}{row.estimate:>11.5f}"
        )
    return "\n".join(lines)


def write_report(
    path: str | os.PathLike[str], mesh: Mesh, rows: Sequence[Row], options: dict[str, object], threads: int | None
) -> None:
    """The rows, the options and the machine as JSON, whole or not at all.

    Raises:
        OutputError: it cannot be written.
    """
    content = {
        "mesh": mesh.source,
        "vertices": len(mesh.vertices),
        "rows": [asdict(row) for row in rows],
        "options": options,
        "threads": thread_count(threads),
        "versions": versions(),
    }
    with atomic_write(path) as file:
        file.write((json.dumps(content, indent=2) + "\n").encode())
