"""The measuring itself: every method on every mesh, in turn, against a reference."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path
from statistics import median
from typing import Any

from obscurance import ao
from obscurance.scenes.validation.reference import Errors, Reference

from .analysis import TARGETS
from .methods import Method
from .programs import Program, Task
from .references import cached_reference
from .suite import Specimen, falloffs, stone

STEP = 4.0  # a rung takes about this many times as long as the one before
ENOUGH = 2.0  # seconds of one rung after which no further round is begun

Say = Callable[[str], None]


@dataclass(frozen=True)
class Plan:
    """How much to measure: rounds of each rung at most, the reference, and a factor on every method's seconds."""

    rounds: int
    reference_rays: int
    reference_vertices: int
    patience: float


@dataclass
class Climb:
    """A method's way up its ladder on one mesh and falloff.

    Attributes:
        rungs: the rounds of each setting measured so far.
        spent: seconds so far.
    """

    method: Method
    rungs: dict[float, list[dict[str, float]]] = field(default_factory=dict)
    spent: float = 0.0

    def goes_on(self, patience: float) -> bool:
        """Whether the next rung is worth its time: error still above the targets, and time left, or too few rungs."""
        if not self.rungs:
            return True
        last = list(self.rungs.values())[-1]
        if median(each["rmse"] for each in last) <= min(TARGETS):
            return False
        next_one = STEP * median(each["seconds"] for each in last)
        return len(self.rungs) < 2 or self.spent + next_one <= patience * self.method.seconds

    def has_enough(self, setting: float, rounds: int) -> bool:
        """Whether a rung has been measured often enough."""
        done = self.rungs.get(setting, [])
        return len(done) >= rounds or sum(each["seconds"] for each in done) > ENOUGH

    def add(self, setting: float, measured: dict[str, float]) -> None:
        self.rungs.setdefault(setting, []).append(measured)
        self.spent += measured["seconds"]


def measure_mesh(
    specimen: Specimen, programs: Mapping[str, Program], methods: Sequence[Method], plan: Plan, say: Say
) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """All methods on one mesh: what the mesh is, and every rung measured, each figure a list over its rounds."""
    mesh = specimen.make()
    chosen = falloffs(mesh, specimen.dense)
    with tempfile.TemporaryDirectory() as folder:
        task = Task.of(mesh, Path(folder) / "mesh.npz")
        mus = [each.resolve(mesh.radius) for each in chosen.values()]
        truth = cached_reference(task, mus, plan.reference_rays, plan.reference_vertices)
        about = {
            "name": specimen.name,
            "surface": specimen.surface,
            "vertices": len(mesh.vertices),
            "faces": len(mesh.faces),
            "points": len(task.numbers),
        }
        say(f"{specimen.name}: {len(mesh.vertices):,} vertices, {len(mesh.faces):,} faces")
        runs = []
        for row, (name, falloff) in enumerate(chosen.items()):
            fit = [m for m in methods if name.split()[0] in m.falloffs and len(mesh.vertices) <= m.most_vertices]
            judge = Reference(truth.vertices, truth.w[row : row + 1])
            for climb in climb_all(task, falloff, judge, fit, programs, plan, partial(_under, say, name)):
                for setting, rounds in climb.rungs.items():
                    columns = {key: [round(each[key], 6) for each in rounds] for key in rounds[0]}
                    of = {"mesh": specimen.name, "falloff": name, "method": climb.method.name, "setting": setting}
                    runs.append(of | columns)
    return about, runs


def _under(say: Say, name: str, text: str) -> None:
    say(f"  {name}: {text}")


def climb_all(
    task: Task,
    falloff: ao.Falloff,
    truth: Reference,
    methods: Sequence[Method],
    programs: Mapping[str, Program],
    plan: Plan,
    say: Say,
) -> list[Climb]:
    """Measure methods side by side: at each rung all of them in turn, A B C A B C …, another seed each round."""
    climbs = [Climb(method) for method in methods]
    for rung in range(max((len(method.ladder) for method in methods), default=0)):
        going = [climb for climb in climbs if rung < len(climb.method.ladder) and climb.goes_on(plan.patience)]
        for turn in range(plan.rounds):
            for climb in going:
                method = climb.method
                setting = method.ladder[rung]
                if climb.has_enough(setting, plan.rounds):
                    continue
                arguments = {method.setting: setting, **method.options}
                made = programs[method.program].bake(task, falloff, turn, arguments)
                errors = asdict(Errors.of(made.w[truth.vertices], truth.w[0]))
                climb.add(setting, {"seconds": made.seconds, "build": made.build, **errors})
        for climb in going:
            setting = climb.method.ladder[rung]
            rounds = climb.rungs[setting]
            seconds, rmse = (median(each[key] for each in rounds) for key in ("seconds", "rmse"))
            say(f"{climb.method.name} {climb.method.setting} {setting:g}: {seconds:.3f} s, RMSE {rmse:.5f}")
    return climbs


def warm_up(programs: Mapping[str, Program], methods: Sequence[Method], binary: bool) -> None:
    """Have every program compile what it compiles, on a mesh of 42 vertices, so that later calls are not its first.

    Args: binary: whether the binary falloffs are all that is measured.
    """
    mesh = stone(1)
    with tempfile.TemporaryDirectory() as folder:
        task = Task.of(mesh, Path(folder) / "mesh.npz")
        for method in methods:
            for name, falloff in falloffs(mesh, binary).items():
                if name.split()[0] in method.falloffs:
                    for setting in method.ladder:
                        arguments = {method.setting: setting, **method.options}
                        programs[method.program].bake(task, falloff, 0, arguments)
