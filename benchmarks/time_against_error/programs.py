"""Programs that bake: ours, and the peers found on this machine, all asked in the same way."""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from benchmarks.peers.process import PeerFailed, Process
from obscurance import ao
from obscurance.ao.mu import Mu
from obscurance.ao.points.receivers import find_receivers
from obscurance.raytrace.mesh.mesh import Mesh
from obscurance.raytrace.mesh.placement import Placement

from .methods import OURS

PEERS = ("mitsuba", "embreex", "open3d", "blender")
ROOT = Path(__file__).parent.parent.parent
ENVIRONMENTS = ROOT / ".peers"

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
        from obscurance.ao.report import versions

        self.version = f"obscurance {versions()['obscurance']}"

    def bake(self, task: Task, falloff: ao.Falloff, seed: int, arguments: Mapping[str, Any]) -> Made:
        start = time.perf_counter()
        baked = ao.bake(task.mesh, falloff, seed=seed, interior="ignore", **arguments)
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


class OurCommand(Ours):
    """`obscurance bake` from a mesh file to a file of w, from the start of its process to its end."""

    def bake(self, task: Task, falloff: ao.Falloff, seed: int, arguments: Mapping[str, Any]) -> Made:
        mu = falloff.resolve(task.mesh.radius)
        mesh, target = task.arrays.with_suffix(".ply"), task.arrays.with_name("ours.npy")
        if not mesh.exists():
            write_ply(task.mesh, mesh)
        options = {"falloff": "exponential" if mu.tau else "binary", "max-distance": mu.max_distance, "seed": seed}
        chosen = [f"--{name}={value}" for name, value in {**options, "interior": "ignore", **arguments}.items()]
        rate = [f"--tau={mu.tau}"] if mu.tau else []
        start = time.perf_counter()
        command = [sys.executable, ROOT / "cli.py", "bake", mesh, "-o", target, "-q", *chosen, *rate]
        subprocess.run(command, check=True, stderr=subprocess.DEVNULL)
        return Made(time.perf_counter() - start, 0.0, np.load(target))


class StartedPeer:
    """A peer's script that is started for each bake, from the start of its process to its end."""

    def __init__(self, python: Path, script: str, folder: Path) -> None:
        self.python, self.script, self.folder = python, script, folder
        with Process(python, script) as process:
            self.version: str = process.about["version"]

    def bake(self, task: Task, falloff: ao.Falloff, seed: int, arguments: Mapping[str, Any]) -> Made:
        start = time.perf_counter()
        with Process(self.python, self.script) as process:
            made = Peer(process, self.folder).bake(task, falloff, seed, arguments)
        return replace(made, seconds=time.perf_counter() - start)


def write_ply(mesh: Mesh, target: Path) -> None:
    """A binary PLY with vertices as doubles, as they are."""
    faces = np.empty(len(mesh.faces), [("count", "u1"), ("corners", "<i4", 3)])
    faces["count"], faces["corners"] = 3, mesh.faces
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(mesh.vertices)}\n"
    head += "".join(f"property double {axis}\n" for axis in "xyz")
    head += f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    target.write_bytes(head.encode() + mesh.vertices.astype("<f8").tobytes() + faces.tobytes())


@contextmanager
def open_programs(
    given: Mapping[str, Path], processes: bool = False
) -> Iterator[tuple[dict[str, Program], dict[str, str]]]:
    """Ours and every peer that starts, and why the others do not.

    Args:
        given: interpreters of peers by name; of the others, those that `make peers` has made are tried. embreex is
            part of our own environment.
        processes: whether each bake is a process of its own.
    """
    programs: dict[str, Program] = {OURS: OurCommand() if processes else Ours()}
    missing = {}
    with ExitStack() as stack:
        for name in PEERS:
            made = Path(sys.executable) if name == "embreex" else ENVIRONMENTS / name / "bin" / "python"
            python = given.get(name, made)
            if not python.exists():
                missing[name] = f"no interpreter: `make peers`, or --peer {name}=PYTHON"
                continue
            script, folder = f"ao_{name}.py", Path(stack.enter_context(tempfile.TemporaryDirectory()))
            try:
                if processes:
                    programs[name] = StartedPeer(python, script, folder)
                else:
                    programs[name] = Peer(stack.enter_context(Process(python, script)), folder)
            except PeerFailed as reason:
                missing[name] = str(reason)
        yield programs, missing


def peer_option(parser: argparse.ArgumentParser) -> None:
    """Add `--peer NAME=PYTHON`, any number of times: `peer` becomes pairs of a name and an interpreter."""
    parser.add_argument("--peer", action="append", default=[], type=_peer, metavar="NAME=PYTHON", help=" ".join(PEERS))


def _peer(text: str) -> tuple[str, Path]:
    name, _, python = text.partition("=")
    if name not in PEERS or not python:
        raise argparse.ArgumentTypeError(f"expected NAME=PYTHON, NAME one of {' '.join(PEERS)}, got {text!r}")
    return name, Path(python)
