"""`obscurance bench`: bake time against error on one mesh."""

import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from statistics import median

from obscurance import ao
from obscurance.ao.options import Options
from obscurance.ao.report import versions
from obscurance.raytrace.mesh.mesh import Mesh
from obscurance.raytrace.system.atomic import write_json
from obscurance.raytrace.system.checks import check_ending, check_outputs
from obscurance.raytrace.system.threads import thread_count

from ..formats.load import load
from ..geometry.builtin_shapes import temple
from ..validation.reference import RAYS, Errors, reference
from ..validation.table import text_table

SAMPLES = (16, 64, 256, 1024)
ROUNDS = 3
_VERTICES = 2048
_FINENESS = 0.14


@dataclass(frozen=True)
class Row:
    """Cost and error of one number of rays a vertex."""

    samples: int
    seconds: list[float]  # of each bake, scene build included
    build: float  # median seconds of that part
    rays: int  # traced by one bake
    estimate: float  # the RMSE that the bakes themselves reported, the median one
    errors: Errors


def run_bench(
    mesh: Mesh,
    falloff: ao.Falloff,
    samples: Sequence[int] = SAMPLES,
    rounds: int = ROUNDS,
    seed: int = 0,
    threads: int | None = None,
) -> list[Row]:
    """Bake `mesh` `rounds` times with each of `samples`, in turn, and compare w with a reference of 16384 rays."""
    truth = reference(mesh, [falloff.resolve(mesh.radius)], RAYS, _VERTICES, threads)
    ao.bake(mesh, falloff, samples[0], seed, threads, interior="ignore")
    bakes: dict[int, list[tuple[float, ao.Bake]]] = {count: [] for count in samples}
    for turn in range(rounds):
        for count in samples:
            start = time.perf_counter()
            baked = ao.bake(mesh, falloff, count, seed + turn, threads, interior="ignore")  # as the reference
            bakes[count].append((time.perf_counter() - start, baked))
    measured = []
    for count, timed in bakes.items():
        seconds = [took for took, _ in timed]
        results = [bake for _, bake in timed]
        build = median(bake.seconds["build"] for bake in results)
        estimate = median(bake.rmse for bake in results)
        errors = Errors.of(results[0].w[truth.vertices], truth.w[0])
        measured.append(Row(count, seconds, build, results[0].rays, estimate, errors))
    return measured


def bench_table(measured: Sequence[Row]) -> str:
    """The rows as a text table."""
    head = ("samples", "seconds", "Mrays/s", "RMSE", "p99", "max", "estimated")
    cells = [
        (str(row.samples), f"{median(row.seconds):.3f}", f"{row.rays / median(row.seconds) / 1e6:.1f}",
         f"{row.errors.rmse:.5f}", f"{row.errors.p99:.4f}", f"{row.errors.largest:.4f}", f"{row.estimate:.5f}")
        for row in measured
    ]  # fmt: skip
    return "\n".join(text_table(head, cells, head))


def bench_file(
    path: Path | None,
    falloff: ao.Falloff,
    seed: int,
    threads: int | None,
    report: Path | None,
    options: dict[str, object],
) -> None:
    """Print the table for a mesh file or a coarse temple, and write the report, with the command's `options`."""
    if report:
        check_ending("--report", report, ".json")
        check_outputs({"--report": report}, [path] if path else [])
    Options(seed=seed, threads=threads)
    mesh = temple(_FINENESS) if path is None else load(path).mesh
    measured = run_bench(mesh, falloff, seed=seed, threads=threads)
    print(f"{mesh.source}: {len(mesh.vertices):,} vertices, {len(mesh.faces):,} faces")
    print(bench_table(measured))
    if report:
        facts = {"mesh": mesh.source, "vertices": len(mesh.vertices), "rows": [asdict(row) for row in measured]}
        write_json(report, facts | {"options": options, "threads": thread_count(threads), "versions": versions()})
