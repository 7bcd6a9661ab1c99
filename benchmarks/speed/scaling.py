"""Scaling: what more cores would make of a bake or a rendering, by what is outside of blocks, long blocks and joins.

    python -m benchmarks.speed.scaling [CASE ...] [--rounds 5] [--cores 2 4 8 16 32]

Every case runs on one thread with `run_blocks` replaced by a recorder, which takes the time of each block that c
threads would have, and with the functions of `STAGES` replaced by ones that say where time goes; it is the thread's
processor time, which other programs disturb little. By a model, c cores take

    time outside blocks + Σ max(longest block, sum of the blocks / c) + joins × cost of a join

A join is a call of `run_blocks` with several blocks; what one costs is measured with c threads and as many blocks that
sleep, so that all threads have to be awake at once, on the cores that there are. Whole times on one and on two threads
stand beside that, measured in turns without the recorder. Medians of the rounds.
"""

from __future__ import annotations

import argparse
import functools
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from importlib import import_module
from statistics import median
from typing import Any

import ao
import raytrace
from benchmarks import RESULTS
from benchmarks.time_against_error.machine import machine
from benchmarks.time_against_error.suite import stone
from raytrace.mesh.mesh import Mesh
from raytrace.system import threads as threads_module
from raytrace.system.atomic import write_json
from scenes.geometry.primitives import plane
from scenes.geometry.temple import temple

TARGET = RESULTS / "scaling.json"
CORES = (2, 4, 8, 16, 32)
STAGES = (
    ("mesh bounds", "raytrace.mesh.placement Placement.of"),
    ("welding, normals", "raytrace.ray_origins.welded weld_points"),
    ("hierarchy", "raytrace.bvh.bvh16 BVH16.of"),
    ("origins", "raytrace.ray_origins.welded WeldedPoints.ray_origins"),
    ("receivers", "ao.points.receivers find_receivers"),
    ("corners of folds", "ao.points.corners find_corner_samples"),
    ("trial of traversals", "ao.prepared packets_below"),
    ("Embree's hierarchy", "raytrace.embree.scene TriangleScene.__init__"),
    ("interior", "ao.estimate.inside inside_solids"),
    ("rays", "ao.execute.tracer Tracer.gather"),
    ("rays", "ao.texture.gathering TexelTracer.gather"),
    ("neighbours", "ao.estimate.one_ring Neighbours.of"),
    ("neighbours", "ao.texture.shown Shown.neighbours"),
    ("denoising", "ao.estimate.shrinkage denoise"),
    ("planning", "ao.estimate.tolerance estimate_to"),
    ("result", "ao.result assemble"),
    ("error between vertices", "ao.interpolation_error measure_interpolation"),
    ("charts", "ao.texture.shown Shown.of"),
    ("coverage", "ao.texture.coverage cover"),
    ("texels", "ao.texture.texels find_texels"),
    ("seams, padding", "ao.texture.result assemble_pages"),
    ("geometry", "raytrace.renderer.render prepare_picture"),
    ("pixels", "raytrace.renderer.render _render_tiles"),
)
REST = "the rest"
_JOINS, _ASLEEP = 200, 1e-3  # to take the time of; seconds


@dataclass
class Stage:
    """Seconds of a stage. Attributes: outside: of blocks. joins: of each, its blocks."""

    outside: float = 0.0
    joins: list[list[float]] = field(default_factory=list)

    def predicted(self, cores: int, join: float) -> float:
        """What it takes on so many cores. Args: join: cost of one, seconds."""
        blocks = sum(max(max(each), sum(each) / cores) for each in self.joins if each)
        return self.outside + blocks + join * sum(len(each) > 1 for each in self.joins)


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
        for start, stop in threads_module.shares(count, block, self.cores if threads > 1 else 1, most):
            work(start, stop)
            if outermost:
                blocks.append(self._lap())
            if progress:
                progress(stop - start)
        if outermost:
            self._blocks = False
            self._stage.joins.append(blocks)


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
    threads_module.thread_count = lambda _: threads  # or there would be no more than there are cores for
    try:
        return median(seconds(threads) for _ in range(_JOINS)) - median(seconds(1) for _ in range(_JOINS))
    finally:
        threads_module.thread_count = cores


def cases() -> dict[str, Callable[[], Callable[[int], object]]]:
    """What there is to run, by name: functions that make one of a number of threads."""
    meshes = {
        "pebble": lambda: stone(3),  # 642 vertices
        "temple": lambda: temple(0.4),  # 6,210
        "stone": lambda: stone(5),  # 10,242
        "large-temple": lambda: temple(0.125),  # 43,982
        "large-stone": lambda: stone(6),  # 40,962
        "huge-stone": lambda: stone(7),  # 163,842
    }
    found: dict[str, Callable[[], Callable[[int], object]]] = {}
    for name, make in meshes.items():
        found[f"{name}-64"] = functools.partial(_vertices, make, samples=64)
        found[f"{name}-.01"] = functools.partial(_vertices, make, tolerance=0.01)
    found["texture-temple"] = functools.partial(_texture, meshes["temple"])
    found["texture-stone"] = functools.partial(_texture, meshes["stone"])
    found["render"] = _rendering
    return found


def _vertices(make: Callable[[], Mesh], **options: Any) -> Callable[[int], object]:
    mesh = make()
    return lambda threads: ao.bake(mesh, threads=threads, **options)


def _texture(make: Callable[[], Mesh]) -> Callable[[int], object]:
    """64 rays a texel of 1024²."""
    from scenes.jobs.textures.unwrap import unwrap

    mesh = make()
    uv = unwrap(mesh, 1024)
    return lambda threads: ao.bake_texture(mesh, uv, 1024, samples=64, threads=threads)


def _rendering() -> Callable[[int], object]:
    """1920×1080 pixels of four samples: a stone on a floor, a sun and three lamps with shadows."""
    meshes = stone(6), plane((-4, -4, -1), (8, 0, 0), (0, 8, 0), 0.1).mesh
    places = ((3.0, -2.0, 3.0), (-3.0, -2.0, 3.0), (0.0, 3.0, 4.0), (0.5, -4.0, 1.0))
    lamps = tuple(raytrace.PointLight(position=place, intensity=10.0) for place in places)
    camera = raytrace.Camera((2.5, -4.0, 2.5), (0.0, 0.0, 0.0), field_of_view=35.0)
    settings = raytrace.Settings(width=1920, height=1080, samples=4)

    def rendered(threads: int) -> object:  # of new shapes, whose geometry has not been kept
        objects = tuple(raytrace.Object(raytrace.Shape(mesh, raytrace.Lambert(albedo=0.6))) for mesh in meshes)
        return raytrace.render(raytrace.Scene(objects, lamps), camera, settings, layers=False, threads=threads)

    return rendered


def measure(
    case: Callable[[int], object], rounds: int, cores: Iterable[int], joins: dict[int, float]
) -> dict[str, Any]:
    """Times on one and two threads, and the recorded rounds of median length as rows of a table."""
    case(2)
    seconds: dict[int, list[float]] = {1: [], 2: []}
    recorded: dict[int, list[tuple[float, int, dict[str, Stage]]]] = {c: [] for c in (1, *cores)}
    for number in range(rounds):
        for threads, times in seconds.items():
            start = time.perf_counter()
            case(threads)
            times.append(time.perf_counter() - start)
        for c, found in recorded.items():
            stages = record(case, c)
            found.append((sum(stage.predicted(c, joins[c]) for stage in stages.values()), number, stages))
    model = {c: sorted(found)[rounds // 2] for c, found in recorded.items()}
    finest = model[max(model)][2]
    rows: dict[str, dict[str, Any]] = {
        name: {
            "joins": sum(len(each) > 1 for each in stage.joins),
            "blocks": sum(map(len, stage.joins)),
            "longest": max((max(each) for each in stage.joins if each), default=0.0),
            "outside": stage.outside,
            "model": {c: stages[name].predicted(c, joins[c]) for c, (_, _, stages) in model.items()},
        }
        for name, stage in finest.items()
    }
    return {
        "seconds": {threads: median(times) for threads, times in seconds.items()},
        "rounds": seconds,
        "model": {c: whole for c, (whole, _, _) in model.items()},
        "stages": rows,
    }


def show(name: str, found: dict[str, Any]) -> None:
    """Print milliseconds of the stages, the longest first, and of all; blocks are those for the most cores."""
    model = found["model"]
    one, two = found["seconds"].values()
    print(f"\n{name}: {1e3 * one:.1f} ms on one thread, {1e3 * two:.1f} on two, {one / two:.2f} ×")
    print(f"{'ms':24}{'joins':>6}{'blocks':>7}{'longest':>8}{'outside':>8}" + "".join(f"{c:>8}" for c in model))
    rows = found["stages"]
    whole = {key: sum(row[key] for row in rows.values()) for key in ("joins", "blocks", "outside")}
    whole |= {"longest": max(row["longest"] for row in rows.values()), "model": model}
    last = max(model)
    for stage, row in [*sorted(rows.items(), key=lambda pair: -pair[1]["model"][last]), ("together", whole)]:
        figures = "".join(f"{1e3 * t:8.2f}" for t in (row["longest"], row["outside"], *row["model"].values()))
        print(f"{stage:24}{row['joins']:6}{row['blocks']:7}{figures}")
    print(f"{'times as fast':53}" + "".join(f"{model[1] / t:8.2f}" for t in model.values()), flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    known = cases()
    parser.add_argument("cases", nargs="*", metavar="CASE", help=f"of {', '.join(known)}; all of them by default")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--cores", type=int, nargs="+", default=CORES)
    chosen = parser.parse_args()
    if unknown := set(chosen.cases) - set(known):
        parser.error(f"no such case: {', '.join(sorted(unknown))}")
    joins = {1: 0.0} | {c: cost_of_join(c) for c in chosen.cores}
    print("cost of a join, µs:", ", ".join(f"{c} threads {1e6 * cost:.0f}" for c, cost in joins.items()))
    found = {}
    for name in chosen.cases or known:
        found[name] = measure(known[name](), chosen.rounds, chosen.cores, joins)
        show(name, found[name])
    if not chosen.cases:
        write_json(TARGET, {"machine": machine(), "joins": joins, "cases": found})


if __name__ == "__main__":
    main()
