"""Programs that bake: ours, and the peers found on this machine, all asked in the same way."""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

import ao
from ao.falloff import Mu
from ao.gather.receivers import find_receivers
from benchmarks.peers.process import PeerFailed, Process
from raytrace.mesh.mesh import Mesh
from raytrace.mesh.placement import Placement

from .methods import OURS

PEERS = ("mitsuba", "embreex", "open3d", "blender")
ENVIRONMENTS = Path(__file__).parent.parent.parent / ".peers"

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Task:
    """A mesh to bake, and the same as the arrays that peers get.

    Attributes:
        arrays: a .npz as `benchmarks/peers/serve.py` describes it; lengths in it are mesh lengths times `scale`.
        numbers: int64 (k,), the vertices that a peer's w is of.
    """

    mesh: Mesh
    arrays: Path
    scale: float
    numbers: npt.NDArray[np.int64]

    @classmethod
    def of(cls, mesh: Mesh, target: Path) -> Task:
        """The points, normals and origins of our own baker, coincident vertices once, written to `target`."""
        placement = Placement.of(mesh)
        receivers = find_receivers(mesh, placement)
        points, numbers = receivers.points, receivers.first_vertex
        np.savez(
            target, vertices=placement.vertices, faces=receivers.faces.astype(np.uint32), origins=points.origins,
            normals=points.normals, numbers=numbers, of_vertex=receivers.of_vertex,
        )  # fmt: skip
        return cls(mesh, target, placement.scale, numbers)


@dataclass(frozen=True, eq=False)
class Made:
    """A finished bake: its seconds, scene build included; those of the build; and w (n,), NaN where none was made."""

    seconds: float
    build: float
    w: Floats


class Program(Protocol):
    """Something that bakes."""

    version: str

    def bake(self, task: Task, falloff: ao.Falloff, seed: int, arguments: Mapping[str, Any]) -> Made:
        """One bake of all vertices."""


class Ours:
    """`ao.bake` in this process."""

    def __init__(self) -> None:
        from ao.report import versions

        self.version = f"obscurance {versions()['obscurance']}"

    def bake(self, task: Task, falloff: ao.Falloff, seed: int, arguments: Mapping[str, Any]) -> Made:
        start = time.perf_counter()
        baked = ao.bake(task.mesh, falloff, seed=seed, hidden="ignore", **arguments)
        return Made(time.perf_counter() - start, baked.seconds["build"], baked.w)


class Peer:
    """A peer's script in a process of its own; `folder` takes its answers."""

    def __init__(self, process: Process, folder: Path) -> None:
        self.process, self.target = process, folder / "w.npy"
        self.version: str = process.about["version"]

    def bake(self, task: Task, falloff: ao.Falloff, seed: int, arguments: Mapping[str, Any]) -> Made:
        mu: Mu = falloff.resolve(task.mesh.radius)
        options = dict(arguments)
        samples = int(options.pop("samples"))
        answer = self.process.ask(
            mesh=str(task.arrays), samples=samples, seed=seed, tau=(mu.tau or 0.0) / task.scale,
            reach=mu.max_distance * task.scale, options=options, target=str(self.target),
        )  # fmt: skip
        w = np.full(len(task.mesh.vertices), np.nan)
        w[task.numbers] = np.load(self.target)
        return Made(answer["build"] + answer["trace"], answer["build"], w)


@contextmanager
def open_programs(given: Mapping[str, Path]) -> Iterator[tuple[dict[str, Program], dict[str, str]]]:
    """Ours and every peer that starts, and why the others do not.

    Args:
        given: interpreters of peers by name; of the others, those that `make peers` has made are tried. embreex is
            part of our own environment.
    """
    programs: dict[str, Program] = {OURS: Ours()}
    missing = {}
    with ExitStack() as stack:
        for name in PEERS:
            made = Path(sys.executable) if name == "embreex" else ENVIRONMENTS / name / "bin" / "python"
            python = given.get(name, made)
            if not python.exists():
                missing[name] = f"no interpreter: `make peers`, or --peer {name}=PYTHON"
                continue
            try:
                process = stack.enter_context(Process(python, f"ao_{name}.py"))
            except PeerFailed as reason:
                missing[name] = str(reason)
                continue
            programs[name] = Peer(process, Path(stack.enter_context(tempfile.TemporaryDirectory())))
        yield programs, missing


def peer_option(parser: argparse.ArgumentParser) -> None:
    """Add `--peer NAME=PYTHON`, any number of times: `peer` becomes pairs of a name and an interpreter."""
    parser.add_argument("--peer", action="append", default=[], type=_peer, metavar="NAME=PYTHON", help=" ".join(PEERS))


def _peer(text: str) -> tuple[str, Path]:
    name, _, python = text.partition("=")
    if name not in PEERS or not python:
        raise argparse.ArgumentTypeError(f"expected NAME=PYTHON, NAME one of {' '.join(PEERS)}, got {text!r}")
    return name, Path(python)
