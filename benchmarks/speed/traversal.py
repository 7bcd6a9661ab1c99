"""Gathering with one walk for all rays of a point beside Embree's packets: the same rays, in turns.

python -m benchmarks.speed.traversal [MESH ...]     built-in meshes, and files
"""

from __future__ import annotations

import sys
import time
from pathlib import Path
from statistics import geometric_mean, median
from typing import Any

import numpy as np

from benchmarks import RESULTS
from benchmarks.time_against_error.suite import Specimen, builtin, falloffs
from obscurance.ao.points.receivers import find_receivers
from obscurance.ao.rays.directions import DirectionTable
from obscurance.ao.rays.gather import COLUMNS, W, gather_hemispheres, gather_streams
from obscurance.ao.rays.ray_blocks import Rays
from obscurance.ao.rays.ray_packet import RayPacket
from obscurance.ao.rays.traverse import TraversalState
from obscurance.ao.report import versions
from obscurance.raytrace.mesh.placement import Placement
from obscurance.raytrace.sampling.sequences import seed_key
from obscurance.raytrace.system.atomic import write_json
from obscurance.scenes.formats.load import load

TARGET = RESULTS / "traversal.json"
SAMPLES = (8, 16, 32, 64, 256, 1024)
ROUNDS = 5
POINTS = 4000  # neighbours along the curve, from the middle of it


def measure(specimen: Specimen) -> list[dict[str, Any]]:
    """One row a falloff and number of rays, times in microseconds a point on one thread."""
    mesh = specimen.make()
    placement = Placement.of(mesh)
    receivers = find_receivers(mesh, placement)
    first = max(len(receivers.points) - POINTS, 0) // 2
    points = receivers.points[first : first + POINTS]
    tree, scene = receivers.tree, receivers.embree()
    rows = []
    for name, falloff in falloffs(mesh).items():
        mu = falloff.resolve(mesh.radius).in_render_space(placement.scale)
        reach = min(mu.limit, placement.diagonal)
        for samples in SAMPLES:
            table = DirectionTable.make(samples, len(receivers.points), seed_key(0))
            seconds: dict[str, list[float]] = {"embree": [], "stream": []}
            by_packets, by_streams = np.empty((2, len(points), 1, COLUMNS))
            for _ in range(ROUNDS + 1):
                start = time.perf_counter()
                gather_hemispheres(RayPacket.of(scene), points.arrays, table, mu, reach, by_packets)
                middle = time.perf_counter()
                gather_streams(
                    tree, Rays.of(table), TraversalState.of(tree), points.arrays, table, mu, reach, by_streams
                )
                seconds["embree"].append(middle - start)
                seconds["stream"].append(time.perf_counter() - middle)
            took = {way: 1e6 * median(times[1:]) / len(points) for way, times in seconds.items()}
            differ = float(np.mean(np.abs(by_streams[..., W] - by_packets[..., W])))
            row = {"mesh": specimen.name, "vertices": len(mesh.vertices), "falloff": name, "samples": samples}
            rows.append(row | took | {"ratio": took["embree"] / took["stream"], "differ": differ})
            print(
                f"{specimen.name:16} {len(mesh.vertices):7,} {name:20} {samples:5} {took['embree']:8.2f}"
                f" {took['stream']:8.2f} {rows[-1]['ratio']:6.2f}× {differ:9.1e}",
                flush=True,
            )
    return rows


def main() -> None:
    chosen = [s for s in builtin(quick=False) if not s.dense]
    chosen += [Specimen(Path(path).stem, lambda path=path: load(path).mesh) for path in sys.argv[1:]]
    print("mesh            vertices falloff              rays  embree, µs  stream, µs  ratio  mean |Δw|")
    rows = [row for specimen in chosen for row in measure(specimen)]
    for name in dict.fromkeys(row["falloff"] for row in rows):
        means = {
            samples: geometric_mean(r["ratio"] for r in rows if (r["falloff"], r["samples"]) == (name, samples))
            for samples in SAMPLES
        }
        print(f"{name:20}", "  ".join(f"{samples}: {mean:.2f}×" for samples, mean in means.items()))
    write_json(TARGET, {"versions": versions(), "rows": rows})


if __name__ == "__main__":
    main()
