"""Time saved by skipping rays that provably meet nothing: bakes with and without it, in turns, bit for bit the same.

python -m benchmarks.skipping [MESH ...]     built-in meshes, and files
"""

from __future__ import annotations

import sys
import time
from pathlib import Path
from statistics import median

import numpy as np

import ao
from ao.report import versions
from raytrace.system.atomic import write_json
from scenes.readers.load import load

from .time_against_error.suite import Specimen, builtin, falloffs

TARGET = Path(__file__).parent / "results" / "skipping.json"
SAMPLES = (128, 256, 1024, 4096)
ROUNDS = 3
MOST_RAYS = 4.5e7  # of a bake that is measured


def measure(specimen: Specimen) -> list[dict[str, object]]:
    mesh, rows = specimen.make(), []
    for name, falloff in falloffs(mesh).items():
        for samples in SAMPLES:
            if samples * len(mesh.vertices) > MOST_RAYS:
                continue
            seconds: dict[bool, list[float]] = {False: [], True: []}
            bakes: dict[bool, ao.Bake] = {}
            for seed in range(ROUNDS):
                for skip, taken in seconds.items():
                    start = time.perf_counter()
                    bakes[skip] = ao.bake(mesh, falloff, samples, seed, skip=skip)
                    taken.append(time.perf_counter() - start)
                if not np.array_equal(bakes[False].w, bakes[True].w):
                    raise AssertionError(f"{specimen.name}, {name}, {samples}: skipping changed w")
            row = {
                "mesh": specimen.name,
                "vertices": len(mesh.vertices),
                "falloff": name,
                "samples": samples,
                "all": median(seconds[False]),
                "skipping": median(seconds[True]),
                "open": bakes[True].rays_skipped["open"] / bakes[False].rays,
                "horizons": bakes[True].skip_seconds["open"],
            }
            print(
                f"{specimen.name:16} {row['vertices']:7,} {name:15} {samples:5} {row['all']:8.3f}"
                f" {row['skipping']:8.3f} {median(seconds[False]) / median(seconds[True]):5.2f}×"
                f" {row['open']:5.0%} {row['horizons']:7.3f}",
                flush=True,
            )
            rows.append(row)
    return rows


def main() -> None:
    chosen = [s for s in builtin(quick=False) if not s.dense]
    chosen += [Specimen(Path(path).stem, lambda path=path: load(path).mesh) for path in sys.argv[1:]]
    print("mesh            vertices falloff         rays    all, s  skipping  ratio  open  horizons, s of all threads")
    ao.bake(chosen[0].make(), samples=1024)
    rows = [row for specimen in chosen for row in measure(specimen)]
    write_json(TARGET, {"versions": versions(), "rows": rows})


if __name__ == "__main__":
    main()
