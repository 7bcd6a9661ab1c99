"""Peak memory of a 4K picture: 3840×2160, every layer, EXR, by the command in a process of its own.

    python -m benchmarks.memory.picture_4k [SCENE] [--samples 4]

SCENE is a built-in one. The peak is VmHWM of /proc/PID/status, read while the process runs: Linux only.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from benchmarks import RESULTS, ROOT
from obscurance.ao.report import versions
from obscurance.raytrace.system.atomic import write_json
from obscurance.scenes.library import BUILTIN, write_builtin

WIDTH, HEIGHT = 3840, 2160
TARGET = 2 << 30


def peak_of(command: list[str]) -> tuple[int, float]:
    """Peak resident bytes of a command, and its seconds."""
    start = time.perf_counter()
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    status, peak = Path(f"/proc/{process.pid}/status"), 0
    while process.poll() is None:
        lines = [line for line in status.read_text().splitlines() if line.startswith("VmHWM:")]
        if lines:  # a process that has ended, but was not waited for, has none
            peak = int(lines[0].split()[1]) << 10
        time.sleep(0.002)
    if process.returncode:
        raise SystemExit("the command has failed; see its message above")
    return peak, time.perf_counter() - start


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene", nargs="?", default="temple", choices=BUILTIN)
    parser.add_argument("--samples", type=int, default=4)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        scene, output = Path(folder) / "scene.toml", Path(folder) / "picture.exr"
        write_builtin(options.scene, scene)
        size = ["--width", str(WIDTH), "--height", str(HEIGHT), "--samples", str(options.samples)]
        command = [sys.executable, str(ROOT / "cli.py"), "render", str(scene), "-o", str(output), *size]
        peak, seconds = peak_of(command)
        written = output.stat().st_size
    result = {
        "scene": options.scene,
        "picture": {"width": WIDTH, "height": HEIGHT, "samples": options.samples, "layers": "all"},
        "peak_bytes": peak,
        "target_bytes": TARGET,
        "file_bytes": written,
        "seconds": seconds,
        "load": os.getloadavg()[0],
        "cores": os.cpu_count(),
        "versions": versions(),
    }
    target = RESULTS / "memory_4k.json"
    write_json(target, result)
    print(
        f"{options.scene}: peak {peak / 2**30:.2f} GiB (target {TARGET / 2**30:g}), {seconds:.1f} s, {written:,} bytes"
    )


if __name__ == "__main__":
    main()
