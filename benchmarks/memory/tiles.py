"""A mesh larger than the memory it is given: `python -m benchmarks.memory.tiles [--faces 20000000] [--tiles 3x3x3]`.

Writes a bumpy sphere of so many triangles as a binary PLY, bakes it in tiles by a process that may have 2 GiB of memory
of its own (RLIMIT_DATA: pages of files are not counted, the system takes them back as it likes), and prints seconds,
how many faces tiles share, and the largest memory of the process. `--group FOLDER` is a control group that it joins,
with a limit that counts these pages, too. `--whole` also bakes it as usual, and compares.
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import RESULTS, ROOT
from benchmarks.meshes import bumpy_sphere
from benchmarks.time_against_error.machine import machine
from raytrace.system.atomic import write_json

RESULT = RESULTS / "tiles.json"
OBSCURANCE = [sys.executable, str(ROOT / "cli.py")]
LIMIT = 2 << 30


def write_sphere(path: Path, faces: int) -> None:
    mesh = bumpy_sphere(faces // 2)
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(mesh.vertices)}\n"
    header += "".join(f"property float {axis}\n" for axis in "xyz")
    header += f"element face {len(mesh.faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    rows = np.empty(len(mesh.faces), [("n", "u1"), ("v", "<i4", 3)])
    rows["n"], rows["v"] = 3, mesh.faces
    with path.open("wb") as file:
        file.write(header.encode() + mesh.vertices.astype("<f4").tobytes())
        rows.tofile(file)


def run(options: list[str], limit: int | None, group: Path | None = None) -> dict[str, Any]:
    """Seconds of a bake, its largest resident memory, and of this what is its own, in MiB."""
    start, own = time.perf_counter(), [0]

    def confine() -> None:
        if limit:
            resource.setrlimit(resource.RLIMIT_DATA, (limit, limit))
        if group:
            (group / "cgroup.procs").write_text(str(os.getpid()))

    running = subprocess.Popen([*OBSCURANCE, "bake", *options], stdout=subprocess.PIPE, text=True, preexec_fn=confine)

    def watch() -> None:
        while running.poll() is None:
            try:
                status = Path(f"/proc/{running.pid}/status").read_text()
            except OSError:
                return
            found = [int(line.split()[1]) >> 10 for line in status.splitlines() if line.startswith("RssAnon")]
            own[0] = max(own[0], *found, 0)
            time.sleep(0.1)

    watcher = threading.Thread(target=watch)
    watcher.start()
    output, _ = running.communicate()
    watcher.join()
    if running.returncode:
        raise SystemExit(f"the bake ended with {running.returncode}")
    largest = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss >> 10
    return {"seconds": time.perf_counter() - start, "resident": largest, "own": own[0], "said": output.splitlines()}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--faces", type=int, default=20_000_000)
    parser.add_argument("--tiles", default="3x3x3")
    parser.add_argument("--samples", default="64")
    parser.add_argument("--max-distance", default="2%")
    parser.add_argument("--whole", action="store_true")
    parser.add_argument("--group", type=Path, help="a control group with a limit of memory, for the tiled bake")
    parser.add_argument("--folder", type=Path, help="for the files on the way")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory(dir=given.folder) as name:
        mesh = Path(name) / "sphere.ply"
        write_sphere(mesh, given.faces)
        print(f"{mesh.stat().st_size >> 20:,} MiB of mesh", flush=True)
        options = [str(mesh), "--samples", given.samples, "--max-distance", given.max_distance, "--falloff", "binary"]
        options += ["--no-denoise", "--interior", "ignore"]
        results = {"tiled": run([*options, "-o", f"{name}/tiled.npy", "--tiles", given.tiles], LIMIT, given.group)}
        if given.whole:
            results["whole"] = run([*options, "-o", f"{name}/whole.npy"], None)
            assert Path(name, "tiled.npy").read_bytes() == Path(name, "whole.npy").read_bytes()
    for way, result in results.items():
        print(f"{way}: {result['seconds']:.0f} s, {result['own']:,} MiB of its own, {result['resident']:,} resident")
        print("\n".join(result["said"]))
    write_json(RESULT, {**machine(), "faces": given.faces, "tiles": given.tiles, "cores": os.cpu_count(), **results})


if __name__ == "__main__":
    main()
