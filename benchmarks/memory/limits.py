"""Memory that bakes estimate and take, and limits: `python -m benchmarks.memory.limits [MILLIONS ...] [--group G]`.

Bumpy spheres of so many million triangles, by default 1 and 2, are baked by the command in a process of its own. Said
is what `bake --dry-run` says, taken the largest resident memory (VmHWM: Linux only). Then each limit, address space
(`ulimit -v`), private memory (`ulimit -d`) and, if its folder is given, a control group, leaves .9, 1, 1.1 and 1.3
times what the bake needs: it is refused with exit status 2, or bakes; the first is refused, the last bakes.
"""

from __future__ import annotations

import argparse
import os
import re
import resource
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

from benchmarks import RESULTS, ROOT
from benchmarks.memory.picture_4k import peak_of
from benchmarks.meshes import bumpy_sphere
from obscurance.ao.report import versions
from obscurance.raytrace.system.atomic import write_json

OBSCURANCE = [sys.executable, str(ROOT / "cli.py")]
WAYS = {
    "--samples 16": ["--samples", "16"],
    "--tolerance .05": ["--tolerance", "0.05"],
    "--method surface": ["--method", "surface", "--samples", "16"],
}
LARGE = 16 << 30
UNITS = {"MiB": 1 << 20, "GiB": 1 << 30}


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


def bytes_of(amount: str, unit: str) -> int:
    return int(float(amount) * UNITS[unit])


def confined(command: list[str], confine: Callable[[], None] | None) -> subprocess.CompletedProcess[str]:
    return subprocess.run(command, capture_output=True, text=True, check=False, preexec_fn=confine)


def limits(group: Path | None) -> dict[str, Callable[[int], Callable[[], None]]]:
    def of_process(kind: int) -> Callable[[int], Callable[[], None]]:
        return lambda size: lambda: resource.setrlimit(kind, (size, size))

    def of_group(size: int) -> Callable[[], None]:
        assert group is not None
        limit = next(path for name in ("memory.max", "memory.limit_in_bytes") if (path := group / name).exists())
        limit.write_text(str(size))
        return lambda: (group / "cgroup.procs").write_text(str(os.getpid())) and None

    found = {"-v": of_process(resource.RLIMIT_AS), "-d": of_process(resource.RLIMIT_DATA)}
    return found | ({"group": of_group} if group else {})


def outcome(result: subprocess.CompletedProcess[str]) -> str:
    lines = [line for line in result.stderr.splitlines() if line.startswith("obscurance:")]
    if result.returncode == 2 and len(lines) == 1 and "memory: expected at most" in lines[0]:
        return "refused"
    return "baked" if result.returncode == 0 else f"ENDED WITH {result.returncode}"


def measure(mesh: Path, way: str, group: Path | None) -> dict[str, object]:
    command = [*OBSCURANCE, "bake", str(mesh), "-o", str(mesh.with_suffix(".npy")), *WAYS[way]]
    shown = re.compile(r"memory +about ([\d.]+) (\w+) in all, ([\d.]+) (\w+) of it.*, ([\d.]+) (\w+) available")

    def said(confine: Callable[[], None] | None) -> tuple[int, int, int]:
        found = shown.search(confined([*command, "--dry-run"], confine).stdout)
        assert found
        words = found.groups()
        whole, needed, free = (bytes_of(*words[at : at + 2]) for at in (0, 2, 4))
        return whole, needed, free

    whole, _, _ = said(None)
    taken, _ = peak_of([*command, "--quiet"])
    row: dict[str, object] = {"mesh": mesh.stem, "way": way, "said": whole, "taken": taken}
    for name, limit in limits(group).items():
        _, needed, free = said(limit(LARGE))
        for share in (0.9, 1.0, 1.1, 1.3):
            size = LARGE - free + int(share * needed)
            row[f"{name} {share}"] = outcome(confined([*command, "--quiet"], limit(size)))
    return row


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("millions", nargs="*", type=float, default=[1, 2])
    parser.add_argument("--group", type=Path, help="a control group that bakes join, one of one's own")
    given = parser.parse_args()
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for millions in given.millions:
            mesh = Path(folder) / f"{millions:g}M.ply"
            write_sphere(mesh, int(millions * 1e6))
            for way in WAYS:
                row = measure(mesh, way, given.group)
                rows.append(row)
                ratio = int(str(row["said"])) / int(str(row["taken"]))
                rest = ", ".join(f"{name}: {text}" for name, text in row.items() if name[0] in "-g")
                sizes = f"{int(str(row['said'])) >> 20:,} MiB, {int(str(row['taken'])) >> 20:,} taken"
                print(f"{row['mesh']} {way}: said {sizes}, {ratio:.2f}; {rest}", flush=True)
    write_json(RESULTS / "memory_limits.json", {"rows": rows, "versions": versions()})


if __name__ == "__main__":
    main()
