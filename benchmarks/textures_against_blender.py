"""A texture of ambient occlusion by us and by Blender's Cycles bake: seconds for the same error.

    python -m benchmarks.textures_against_blender MESH [--size 1024] [--rounds 3] [--peer .peers/blender/bin/python]

Binary falloff without a limit, the texture coordinates of the file, errors over the texels that both programs cover.
Ours is the root mean square difference from a bake of ours with `--reference` samples and another seed. Blender's
takes two bakes of different seeds: their root mean square difference over √2. That leaves out whatever both have in
common, in which Blender may differ from the truth, and needs no bake beyond those that are timed; of our denoised ones
it would leave out too much. Time is that of a whole bake, scenes and hierarchies included, without files and, for
Blender, without a margin. Both have baked once before. Seconds at an error are interpolated between sample counts, log
over log.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

from benchmarks.peers.process import Process
from benchmarks.time_against_error.machine import machine
from obscurance import ao
from obscurance.raytrace import Mesh
from obscurance.raytrace.mesh.placement import Placement
from obscurance.raytrace.system.atomic import write_json
from obscurance.raytrace.types import Bools, Float32s, Float64s
from obscurance.scenes.formats.load import load

OURS, THEIRS = (8, 16, 32, 64, 128, 256, 512), (16, 64, 256, 512)
ERRORS = (0.02, 0.01, 0.005, 0.003, 0.0025)
DISTANCE = 1.001  # of the bounding box's diagonal: no ray is longer
RESULTS = Path(__file__).parent / "results" / "textures_against_blender.json"


class Blender:
    """Bakes of one mesh by a Blender in a process of its own."""

    def __init__(self, process: Process, mesh: Mesh, uv: Float64s, size: int, folder: Path) -> None:
        self.process, self.size, self.folder = process, size, folder
        from obscurance.ao.points.receivers import find_receivers

        receivers = find_receivers(mesh, Placement.of(mesh))
        self.reach = DISTANCE * float(np.linalg.norm(np.ptp(mesh.vertices, axis=0)))
        arrays = {
            "vertices": mesh.vertices.astype(np.float32), "faces": mesh.faces.astype(np.uint32),
            "normals": receivers.points.normals, "of_vertex": receivers.of_vertex,
            "uv": uv.reshape(-1, 2).astype(np.float32),
        }  # fmt: skip
        np.savez(folder / "mesh.npz", **arrays)

    def bake(self, samples: int, seed: int) -> tuple[Float32s, float]:
        """w (h, w), 0 where nothing is covered, and seconds."""
        target = self.folder / "w.npy"
        request = {"samples": samples, "seed": seed, "tau": 0.0, "reach": self.reach, "options": {"size": self.size}}
        took = self.process.ask(mesh=str(self.folder / "mesh.npz"), target=str(target), **request)
        made: Float32s = np.load(target)
        return made, took["build"] + took["trace"]


def bake_ours(mesh: Mesh, uv: Float64s, size: int, samples: int, seed: int) -> tuple[Float32s, Bools, float]:
    """w (h, w), what is covered, and seconds."""
    start = time.perf_counter()
    baked = ao.bake_texture(mesh, uv, size, ao.Binary(), samples=samples, seed=seed)
    return baked.w, baked.covered, time.perf_counter() - start


def rmse(one: Float32s, other: Float32s, where: Bools) -> float:
    """The root mean square of a difference, over some texels."""
    return float(np.sqrt(np.mean((one[where].astype(np.float64) - other[where]) ** 2)))


def seconds_at(error: float, curve: list[dict[str, float]]) -> float | None:
    """Seconds at which a program reaches an error; None outside of what was measured."""
    errors, times = (np.log([point[name] for point in curve]) for name in ("rmse", "seconds"))
    order = np.argsort(errors)
    inside = errors[order[0]] <= np.log(error) <= errors[order[-1]]
    return float(np.exp(np.interp(np.log(error), errors[order], times[order]))) if inside else None


def compare(mesh: Mesh, uv: Float64s, size: int, rounds: int, reference: int, blender: Blender) -> dict[str, Any]:
    """Curves of both programs, the difference of what they converge to, and seconds at the same errors."""
    bake_ours(mesh, uv, 64, 16, 0)
    blender.bake(1, 0)
    ours, covered, _ = bake_ours(mesh, uv, size, reference, 99)
    both, curves = covered, {"ours": _Curve("ours"), "blender": _Curve("blender")}
    for samples in THEIRS:
        (one, first), (other, second) = (blender.bake(samples, seed) for seed in range(2))
        both = covered & (one > 0) & (other > 0)
        curves["blender"].add(samples, rmse(one, other, both) / 2**0.5, median([first, second]))
    theirs = ((one.astype(np.float64) + other) / 2).astype(np.float32)
    for samples in OURS:
        found = [bake_ours(mesh, uv, size, samples, seed) for seed in range(rounds)]
        errors = [rmse(w, ours, both) for w, _, _ in found]
        curves["ours"].add(samples, median(errors), median(seconds for _, _, seconds in found))
    rows = []
    for error in ERRORS:
        each = {name: seconds_at(error, curve.points) for name, curve in curves.items()}
        a, b = each["ours"], each["blender"]
        rows.append({"rmse": error, **each, "ratio": b / a if a and b else None})
    apart = {"mean": float(np.mean((theirs - ours)[both])), "rmse": rmse(theirs, ours, both)}
    counts = {"ours": int(covered.sum()), "blender": int((theirs > 0).sum()), "both": int(both.sum())}
    points = {name: curve.points for name, curve in curves.items()}
    return {"covered": counts, "blender_less_ours": apart, "curves": points, "at_equal_error": rows}


class _Curve:
    """Errors and seconds of a program, printed as they are found."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.points: list[dict[str, float]] = []

    def add(self, samples: int, error: float, seconds: float) -> None:
        self.points.append({"samples": samples, "rmse": error, "seconds": seconds})
        print(f"{self.name:8} {samples:5} samples  RMSE {error:.5f}  {seconds:8.2f} s", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("mesh", type=Path)
    parser.add_argument("--peer", type=Path, default=Path(".peers/blender/bin/python"))
    parser.add_argument("--size", type=int, default=1024)
    parser.add_argument("--rounds", type=int, default=3, help="of ours")
    parser.add_argument("--reference", type=int, default=4096, help="samples")
    parser.add_argument("--output", type=Path, default=RESULTS)
    chosen = parser.parse_args()
    source = load(chosen.mesh, "kept.glb")
    uv = source.uv
    if uv is None:
        parser.error(f"{chosen.mesh}: no texture coordinates")
    on = machine()
    with tempfile.TemporaryDirectory() as folder, Process(chosen.peer, "texture_blender.py") as process:
        blender = Blender(process, source.mesh, uv, chosen.size, Path(folder))
        found = compare(source.mesh, uv, chosen.size, chosen.rounds, chosen.reference, blender)
        version = process.about["version"]
    apart = found["blender_less_ours"]
    difference = f"mean {apart['mean']:+.4f}, RMSE {apart['rmse']:.4f}"
    print(f"The mean of Blender's two finest bakes less our reference: {difference}; {found['covered']}")
    for row in found["at_equal_error"]:
        cells = (f"{row[name]:8.2f} s" if row[name] else "        –  " for name in ("ours", "blender"))
        ratio = f"{row['ratio']:6.1f}" if row["ratio"] else "     –"
        print(f"RMSE {row['rmse']:.3f}: ours{next(cells)}  Blender{next(cells)}  ratio {ratio}")
    settings = {"mesh": chosen.mesh.name, "size": chosen.size, "rounds": chosen.rounds, "reference": chosen.reference}
    write_json(chosen.output, {"machine": on, "blender": version, "settings": settings, **found})


if __name__ == "__main__":
    main()
