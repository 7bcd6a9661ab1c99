"""Rays a second of a texture bake beside those of a vertex bake of the same mesh, all work included.

    python -m benchmarks.texture_throughput MESH [MESH ...] [--size 1024] [--samples 256] [--rounds 3]

The texture coordinates are the file's; where it has none, new ones, made before anything is timed. Both bakes run in
turns in one process, on all cores, after one round that is not counted. Seconds of processor time, which other programs
disturb little, and of the clock; the table has medians of the ratios, texture over vertex, the JSON every round.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from statistics import median
from typing import Any

from benchmarks.time_against_error.machine import machine
from obscurance import ao
from obscurance.raytrace.system.atomic import write_json
from obscurance.scenes import unwrap
from obscurance.scenes.formats.load import load

RESULTS = Path(__file__).parent / "results" / "texture_throughput.json"
FALLOFFS: dict[str, ao.Falloff] = {"exponential": ao.Exponential(), "binary": ao.Binary()}


def measure(path: Path, falloff: ao.Falloff, size: int, samples: int, rounds: int) -> dict[str, Any]:
    """Rays a second of both bakes, a list of one number a round for each clock."""
    source = load(path, "kept.glb")
    uv = source.uv
    if uv is None:
        uv = unwrap(source.mesh, size)
    found: dict[str, Any] = {"faces": len(source.mesh.faces), "vertex": [], "texture": []}
    for _ in range(rounds + 1):
        for name in ("vertex", "texture"):
            processor, clock = time.process_time(), time.perf_counter()
            baked: ao.Bake | ao.BakedTexture
            if name == "vertex":
                baked = ao.bake(source.mesh, falloff, samples=samples)
            else:
                baked = ao.bake_texture(source.mesh, uv, size, falloff, samples=samples)
                found["texels"] = int(baked.covered.sum())
            spent = time.process_time() - processor, time.perf_counter() - clock
            found[name].append({"processor": baked.rays / spent[0], "clock": baked.rays / spent[1]})
    return found | {name: found[name][1:] for name in ("vertex", "texture")}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("meshes", type=Path, nargs="+")
    parser.add_argument("--size", type=int, default=1024)
    parser.add_argument("--samples", type=int, default=256)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--output", type=Path, default=RESULTS)
    chosen = parser.parse_args()
    rows = []
    for path in chosen.meshes:
        for name, falloff in FALLOFFS.items():
            found = measure(path, falloff, chosen.size, chosen.samples, chosen.rounds)
            rows.append({"mesh": path.name, "falloff": name, **found})
            cells = []
            for clock in ("processor", "clock"):
                vertex, texture = ([each[clock] for each in found[kind]] for kind in ("vertex", "texture"))
                ratio = median(b / a for a, b in zip(vertex, texture, strict=True))
                cells.append(f"{clock}: {median(vertex) / 1e6:6.2f} and {median(texture) / 1e6:6.2f} M/s, {ratio:.2f}")
            print(f"{path.name:20} {name:12} {found['texels']:8,} texels  {'   '.join(cells)}", flush=True)
    settings = {"size": chosen.size, "samples": chosen.samples, "rounds": chosen.rounds}
    write_json(chosen.output, {"machine": machine(), "settings": settings, "rows": rows})


if __name__ == "__main__":
    main()
