"""Kernel throughput against a bare loop of Embree's over the same rays: what the estimator and its walk are worth.

    python -m benchmarks.speed.throughput [MESH] [--samples 256] [--rounds 7]

The bare loop loads precomputed origins and directions into packets of eight and asks the same Embree scene, storing
nothing but a hit count. Both run on all cores, in turn; the JSON holds every round, the table medians and ratios.
"""

from __future__ import annotations

import argparse
import os
import platform
import time
from pathlib import Path
from statistics import median

import numpy as np

from benchmarks import RESULTS
from obscurance.ao import Binary, Exponential
from obscurance.ao.mu import KernelMu
from obscurance.ao.points.receivers import find_receivers
from obscurance.ao.rays.directions import DirectionTable, choose, turned_frame
from obscurance.ao.rays.gather import COLUMNS, gather_hemispheres
from obscurance.ao.rays.ray_blocks import Rays
from obscurance.ao.rays.traverse import TraversalState
from obscurance.ao.report import versions
from obscurance.raytrace.embree import (
    DIR_X,
    DIR_Y,
    DIR_Z,
    GEOM_ID,
    INVALID,
    LANES,
    ORG_X,
    ORG_Y,
    ORG_Z,
    TFAR,
    intersect8,
    new_packet,
    occluded8,
)
from obscurance.raytrace.kernel.jit import kernel
from obscurance.raytrace.mesh.placement import Placement
from obscurance.raytrace.sampling import seed_key
from obscurance.raytrace.system.atomic import write_json
from obscurance.raytrace.system.threads import run_blocks, thread_count
from obscurance.scenes.formats.load import load
from obscurance.scenes.geometry.builtin_shapes import temple

BLOCK = 2048


@kernel
def bare(scene, packet, valid, origins, directions, reach, closest, hits):
    """Trace `directions` (k, 3, samples) from `origins` (k, 3) and count the hits of each point: int64 (k,)."""
    for i in range(len(origins)):
        for lane in range(LANES):
            packet[ORG_X, lane] = origins[i, 0]
            packet[ORG_Y, lane] = origins[i, 1]
            packet[ORG_Z, lane] = origins[i, 2]
        count = 0
        for first in range(0, directions.shape[2], LANES):
            for lane in range(LANES):
                packet[DIR_X, lane] = directions[i, 0, first + lane]
                packet[DIR_Y, lane] = directions[i, 1, first + lane]
                packet[DIR_Z, lane] = directions[i, 2, first + lane]
                packet[TFAR, lane] = reach
            if closest:
                intersect8(scene, packet, valid)
                for lane in range(LANES):
                    count += packet.view(np.uint32)[GEOM_ID, lane] != INVALID
            else:
                occluded8(scene, packet, valid)
                for lane in range(LANES):
                    count += packet[TFAR, lane] < 0.0
        hits[i] = count


@kernel
def world_directions(normals, numbers, table, out):
    """The directions that `ao.rays.gather.gather_hemispheres` would trace, float32 (k, 3, samples)."""
    local = table.directions
    for i in range(len(normals)):
        chosen, turn = choose(numbers[i], table)
        n = normals[i]
        t, b = turned_frame(n, turn)
        for axis in range(3):
            for s in range(local.shape[2]):
                out[i, axis, s] = (
                    local[chosen, 0, s] * t[axis] + local[chosen, 1, s] * b[axis] + local[chosen, 2, s] * n[axis]
                )


def measure(path: Path | None, samples: int, rounds: int) -> dict[str, object]:
    """Time both loops `rounds` times in turn, for the binary and the exponential falloff."""
    mesh = load(path).mesh if path else temple()
    placement = Placement.of(mesh)
    receivers = find_receivers(mesh, placement)
    scene, tree = receivers.embree(), receivers.hierarchy.tree
    count = min(len(receivers.points), 20_000_000 // samples)
    points = receivers.points[np.arange(count)]
    table = DirectionTable.make(samples, count, seed_key(0))
    directions = np.empty((count, 3, samples), np.float32)
    world_directions(points.normals, points.numbers, table, directions)
    threads = thread_count(None)
    out, hits = np.empty((count, 1, COLUMNS)), np.empty(count, np.int64)
    results: dict[str, object] = {}
    for name, falloff in (("binary", Binary()), ("exponential", Exponential())):
        mu = falloff.resolve(mesh.radius).in_render_space(placement.scale)

        def ours(a: int, b: int, mu: KernelMu = mu) -> None:
            room, some = (Rays.of(table), TraversalState.of(tree)), points[a:b].arrays
            gather_hemispheres(tree, *room, some, table, mu, placement.diagonal, out[a:b])

        def theirs(a: int, b: int, closest: bool = mu.tau > 0) -> None:
            bare(
                scene.handle, *new_packet(), points.origins[a:b], directions[a:b],
                np.float32(placement.diagonal), closest, hits[a:b],
            )  # fmt: skip

        for work in (ours, theirs):
            run_blocks(count, BLOCK, work, threads)
        if not mu.tau and not np.allclose(out[:, 0, 0], 1 - hits / samples, atol=2 / samples):
            raise SystemExit("the two loops do not trace the same rays")
        times: dict[str, list[float]] = {"gather": [], "bare": []}
        for _ in range(rounds):
            for key, work in (("gather", ours), ("bare", theirs)):
                start = time.perf_counter()
                run_blocks(count, BLOCK, work, threads)
                times[key].append(time.perf_counter() - start)
        ratios = [b / a for a, b in zip(times["gather"], times["bare"], strict=True)]
        rays = count * samples
        results[name] = {
            "seconds": times,
            "mrays_per_s": {key: rays / median(values) / 1e6 for key, values in times.items()},
            "throughput_ratio": {"median": median(ratios), "min": min(ratios), "max": max(ratios)},
        }
    return {
        "mesh": str(path.name if path else "temple"),
        "points": count,
        "samples": samples,
        "threads": threads,
        "cpu": platform.processor() or platform.machine(),
        "cores": os.cpu_count(),
        "versions": versions(),
        "results": results,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("mesh", nargs="?", type=Path)
    parser.add_argument("--samples", type=int, default=256, help="a multiple of 8")
    parser.add_argument("--rounds", type=int, default=7)
    arguments = parser.parse_args()
    found = measure(arguments.mesh, arguments.samples, arguments.rounds)
    folder = RESULTS
    folder.mkdir(exist_ok=True)
    target = folder / "throughput.json"
    write_json(target, found)
    for name, row in found["results"].items():  # type: ignore[attr-defined]
        speed, ratio = row["mrays_per_s"], row["throughput_ratio"]
        print(
            f"{found['mesh']} {name:<12} gather {speed['gather']:.1f}, bare {speed['bare']:.1f} Mrays/s,"
            f" ratio {ratio['median']:.3f} ({ratio['min']:.3f}–{ratio['max']:.3f})"
        )
    print(target)


if __name__ == "__main__":
    main()
