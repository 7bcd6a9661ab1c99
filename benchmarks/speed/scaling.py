"""Scaling: what more cores would make of a bake or a rendering, by what is outside of blocks, long blocks and joins.

    python -m benchmarks.speed.scaling [CASE ...] [--rounds 5] [--cores 2 4 8 16 32]

Every case runs on one thread with `run_blocks` replaced by a recorder, which takes the time of each block, and with the
functions of `STAGES` replaced by ones that say where time goes; it is the thread's processor time, which other programs
disturb little. Blocks are those for as many threads as there are `--cores` at most. By a model, c cores take

    time outside blocks + Σ max(longest block, sum of the blocks / c) + joins × cost of a join

A join is a call of `run_blocks` with several blocks; what one costs is measured with c threads and as many blocks that
sleep, so that all threads have to be awake at once, on the cores that there are (a lower quartile); one of fewer blocks
wakes no more threads than that. Whole times on one and on two threads stand beside that, measured in turns without the
recorder. Medians of the rounds. Without a CASE all run, and what is found goes to `scaling.json` and to the
documentation.
"""

from __future__ import annotations

import argparse
import functools
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from importlib import import_module
from statistics import median
from typing import Any

from benchmarks import RESULTS, ROOT
from benchmarks.speed.scaling_cases import cases
from benchmarks.speed.scaling_page import table, write_page
from benchmarks.time_against_error.machine import machine
from obscurance.raytrace.system import threads as threads_module
from obscurance.raytrace.system.atomic import write_json

TARGET, PAGE = RESULTS / "scaling.json", ROOT / "build" / "scaling"
CORES = (2, 4, 8, 16, 32)
STAGES = (
    ("mesh bounds", "obscurance.raytrace.mesh.placement Placement.of"),
    ("welding, normals", "obscurance.raytrace.ray_origins.origins weld_points"),
    ("hierarchy", "obscurance.raytrace.bvh.bvh16 BVH16.of"),
    ("origins", "obscurance.raytrace.ray_origins.origins WeldedPoints.ray_origins"),
    ("receivers", "obscurance.ao.points.receivers find_receivers"),
    ("corners of folds", "obscurance.ao.points.corners find_corner_samples"),
    ("Embree's hierarchy", "obscurance.raytrace.embree TriangleScene.__init__"),
    ("interior", "obscurance.ao.estimate.inside inside_solids"),
    ("rays", "obscurance.ao.execute.tracer Tracer.gather"),
    ("rays", "obscurance.ao.execute.sample_means SampleMeans.rows"),
    ("neighbours", "obscurance.ao.estimate.one_ring Neighbours.of"),
    ("neighbours", "obscurance.ao.texture.adjacency texel_neighbours"),
    ("denoising", "obscurance.ao.estimate.shrinkage denoise"),
    ("denoising", "obscurance.ao.estimate.scales denoise_over_scales"),
    ("planning", "obscurance.ao.estimate.tolerance estimate_to"),
    ("result", "obscurance.ao.result assemble"),
    ("error between vertices", "obscurance.ao.interpolation_error measure_interpolation"),
    ("charts", "obscurance.ao.texture.uv_surface UVSurface.of"),
    ("coverage", "obscurance.ao.texture.coverage Page.cover"),
    ("texels", "obscurance.ao.texture.texels TexelSampler.find"),
    ("seams, padding", "obscurance.ao.texture.result PageAssembly.assemble"),
    ("geometry", "obscurance.raytrace.renderer.render prepare_picture"),
    ("pixels", "obscurance.raytrace.renderer.render _render_tiles"),
)
REST = "the rest"
_JOINS, _ASLEEP = 200, 1e-3  # to take the time of; seconds


@dataclass
class Stage:
    """Seconds of a stage. Attributes: outside: of blocks. joins: of each, how many threads it is for, its blocks."""

    outside: float = 0.0
    joins: list[tuple[int, list[float]]] = field(default_factory=list)

    def predicted(self, cores: int, costs: dict[int, float]) -> float:
        """What it takes on so many cores. Args: costs: seconds of a join, by numbers of threads."""
        total = self.outside
        for most, blocks in self.joins:
            threads = min(len(blocks), most, cores)
            total += max(max(blocks), sum(blocks) / threads) if blocks else 0.0
            total += costs[min(c for c in costs if c >= threads)] if threads > 1 else 0.0
        return total


class Recorder:
    """What takes the place of `run_blocks`: all blocks on this thread, one after another, each with its time.

    Attributes: cores: how many threads blocks are for. stages: by name, in the order in which they first came.
    """

    def __init__(self, cores: int) -> None:
        self.cores = cores
        self.stages: dict[str, Stage] = {}
        self._within, self._blocks = [REST], False
        self._last = 0.0

    def _lap(self) -> float:
        now = time.thread_time()
        self._last, since = now, now - self._last
        return since

    def run(self, case: Callable[[int], object]) -> dict[str, Stage]:
        """The stages of a case, which calls this recorder."""
        self._lap()
        case(self.cores)
        self._stage.outside += self._lap()
        return self.stages

    @property
    def _stage(self) -> Stage:
        return self.stages.setdefault(self._within[-1], Stage())

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Book what happens meanwhile under `name`, unless it is part of a block."""
        if self._blocks:
            yield
            return
        self._stage.outside += self._lap()
        self._within.append(name)
        try:
            yield
        finally:
            self._stage.outside += self._lap()
            self._within.pop()

    def run_blocks(
        self,
        count: int,
        block: int,
        work: Callable[[int, int], None],
        threads: int,
        progress: Callable[[int], None] | None = None,
        most: int = 1,
    ) -> None:
        outermost, blocks = not self._blocks, []
        if outermost:
            self._stage.outside += self._lap()
            self._blocks = True
        for start, stop in threads_module.shares(count, block, max(threads, 1), most):
            work(start, stop)
            if outermost:
                blocks.append(self._lap())
            if progress:
                progress(stop - start)
        if outermost:
            self._blocks = False
            self._stage.joins.append((threads, blocks))


def record(case: Callable[[int], object], cores: int) -> dict[str, Stage]:
    """The stages of a case in blocks for so many cores. It has run before, so that all its modules are there."""
    recorder, restored = Recorder(cores), []
    modules = {place: import_module(place.split()[0]) for _, place in STAGES}  # before anything is replaced

    def replace(owner: Any, name: str, value: Any) -> None:
        restored.append((owner, name, vars(owner)[name]))
        setattr(owner, name, value)

    def everywhere(original: Any, value: Any) -> None:
        for module in list(sys.modules.values()):
            for name in [name for name, held in vars(module).items() if held is original]:
                if module is not sys.modules[__name__]:
                    replace(module, name, value)

    everywhere(threads_module.run_blocks, recorder.run_blocks)
    everywhere(threads_module.thread_count, lambda threads: threads or cores)
    for stage, place in STAGES:
        owner: Any = modules[place]
        *classes, name = place.split()[1].split(".")
        for each in classes:
            owner = getattr(owner, each)
        held = vars(owner)[name]
        if isinstance(held, classmethod):
            replace(owner, name, classmethod(_booked(recorder, stage, held.__func__)))
        elif classes:
            replace(owner, name, _booked(recorder, stage, held))
        else:
            everywhere(held, _booked(recorder, stage, held))
    try:
        return recorder.run(case)
    finally:
        for owner, name, value in reversed(restored):
            setattr(owner, name, value)


def _booked(recorder: Recorder, stage: str, function: Callable[..., Any]) -> Callable[..., Any]:
    @functools.wraps(function)
    def booked(*arguments: Any, **options: Any) -> Any:
        with recorder.stage(stage):
            return function(*arguments, **options)

    return booked


def cost_of_join(threads: int) -> float:
    """Seconds that a join of `threads`, each with one block, takes longer than a block on this thread alone."""

    def sleep(first: int, last: int) -> None:
        time.sleep(_ASLEEP)

    def seconds(count: int) -> float:
        start = time.perf_counter()
        threads_module.run_blocks(count, 1, sleep, count)
        return time.perf_counter() - start

    cores = threads_module.thread_count
    threads_module.thread_count = lambda _: threads  # type: ignore[assignment]
    try:
        pairs = [(seconds(threads), seconds(1)) for _ in range(_JOINS)]
    finally:
        threads_module.thread_count = cores
    shared, alone = (sorted(each)[_JOINS // 4] for each in zip(*pairs, strict=True))  # other programs only add
    return max(shared - alone, 0.0)


def measure(case: Callable[[int], object], rounds: int, costs: dict[int, float]) -> dict[str, Any]:
    """Times on one and two threads, and the recorded rounds of median length as rows of a table.

    Args: costs: seconds of a join by numbers of threads, from 1 to those of the model.
    """
    case(2)
    most = max(costs)
    seconds: dict[int, list[float]] = {1: [], 2: []}
    recorded: dict[int, list[dict[str, Stage]]] = {1: [], most: []}
    for _ in range(rounds):
        for threads, times in seconds.items():
            start = time.perf_counter()
            case(threads)
            times.append(time.perf_counter() - start)
        for threads, found in recorded.items():
            found.append(record(case, threads))
    alone, shared = (
        sorted(each, key=lambda stages: _total(stages, 1, costs))[rounds // 2] for each in recorded.values()
    )
    rows: dict[str, dict[str, Any]] = {
        name: {
            "joins": sum(min(threads, len(blocks)) > 1 for threads, blocks in stage.joins),
            "blocks": sum(len(blocks) for _, blocks in stage.joins),
            "longest": max((max(blocks) for _, blocks in stage.joins if blocks), default=0.0),
            "outside": stage.outside,
            "model": {c: (alone if c == 1 else shared)[name].predicted(c, costs) for c in costs},
        }
        for name, stage in shared.items()
    }
    return {
        "seconds": {threads: median(times) for threads, times in seconds.items()},
        "rounds": seconds,
        "model": {c: _total(alone if c == 1 else shared, c, costs) for c in costs},
        "stages": rows,
    }


def _total(stages: dict[str, Stage], cores: int, costs: dict[int, float]) -> float:
    return sum(stage.predicted(cores, costs) for stage in stages.values())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    known = cases()
    parser.add_argument("cases", nargs="*", metavar="CASE", help=f"of {', '.join(known)}; all of them by default")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--cores", type=int, nargs="+", default=CORES)
    chosen = parser.parse_args()
    if unknown := set(chosen.cases) - set(known):
        parser.error(f"no such case: {', '.join(sorted(unknown))}")
    joins = {1: 0.0} | {c: cost_of_join(c) for c in sorted(chosen.cores)}
    print("cost of a join, µs:", ", ".join(f"{c} threads {1e6 * cost:.0f}" for c, cost in joins.items()))
    found = {}
    for name in chosen.cases or known:
        found[name] = measure(known[name](), chosen.rounds, joins)
        print(f"\n{table(name, found[name])}", flush=True)
        if not chosen.cases:
            results = {"machine": machine(), "joins": joins, "cases": found}
            write_json(TARGET, results)
            write_page(results, PAGE)


if __name__ == "__main__":
    main()
