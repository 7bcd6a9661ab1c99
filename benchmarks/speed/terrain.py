"""Sky-view factors of generated terrain: time a cell, and the peak of memory beside what `--dry-run` says.

    python -m benchmarks.speed.terrain [SIDE ...]     cells each way, by default 500 and 1000

Every bake is the command, in a process of its own: with the default tolerance, and with `--samples 16`.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import rasterio
from rasterio.transform import Affine

from benchmarks import RESULTS, ROOT
from benchmarks.pictures.terrain import CELL, mountains
from obscurance.ao.report import versions
from obscurance.raytrace.system.atomic import write_json

SIDES = 500, 1000
BAKE = "--falloff", "binary", "--max-distance", "20km"
WAYS = {"--tolerance .005": (), "--normals up": ("--normals", "up"), "--samples 16": ("--samples", "16")}


def write(path: Path, side: int) -> None:
    """Mountains (side, side) of cells of 30 m, as a GeoTIFF."""
    place = Affine(CELL, 0, 5e5, 0, -CELL, 5e6)
    form = {"driver": "GTiff", "dtype": "float32", "count": 1, "crs": "EPSG:32632", "width": side, "height": side}
    with rasterio.open(path, "w", transform=place, **form) as file:
        file.write(mountains(size=side).astype(np.float32), 1)


def measured(words: list[str]) -> tuple[str, float, int]:
    """What a command prints, its user and system time in seconds, and the peak of its memory in bytes."""
    command = [sys.executable, str(ROOT / "cli.py"), *words]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as child:
        assert child.stdout
        text = child.stdout.read()
        _, status, usage = os.wait4(child.pid, 0)
        child.returncode = os.waitstatus_to_exitcode(status)
    if child.returncode:
        raise SystemExit(text)
    return text, usage.ru_utime + usage.ru_stime, usage.ru_maxrss << 10


def found(pattern: str, text: str) -> str:
    match = re.search(pattern, text)
    assert match, text
    return match[1]


def main() -> None:
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        source, target = Path(folder) / "dem.tif", Path(folder) / "sky.tif"
        for side in map(int, sys.argv[1:]) if sys.argv[1:] else SIDES:
            write(source, side)
            for way, options in WAYS.items():
                words = ["bake", str(source), "-o", str(target), *BAKE, *options]
                foreseen = found(r"about ([\d.,]+ .iB) in all", measured([*words, "--dry-run"])[0])
                text, seconds, peak = measured(words)
                row = {"side": side, "way": way, "rmse": float(found(r"RMSE ([\d.]+)", text)), "foreseen": foreseen}
                rows.append(row | {"seconds": seconds, "peak": peak})
                print(f"{side}² {way}: {1e6 * seconds / side**2:.0f} µs of CPU a cell, peak {peak >> 20:,} MiB, {row}")
    write_json(RESULTS / "terrain.json", {"rows": rows, "versions": versions()})


if __name__ == "__main__":
    main()
