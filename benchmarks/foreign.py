"""Mesh files that others have made, through every command: `python -m benchmarks.foreign FOLDER 200 --seed 1`.

FOLDER holds a folder for each origin, such as packages that were unpacked. Files are drawn from it evenly by origin and
ending. Each is described, baked to a .glb with a report, to a .ply and to textures, unwrapped where it has no
coordinates, rendered and shown. What a command refuses must be one line, by status 2; all else is a fault and listed.
"""

import argparse
import json
import random
import subprocess
import sys
from collections import Counter, defaultdict
from itertools import islice, zip_longest
from pathlib import Path
from tempfile import TemporaryDirectory

ENDINGS = {
    ".obj",
    ".ply",
    ".stl",
    ".off",
    ".gltf",
    ".glb",
    ".vrm",
    ".3mf",
    ".dae",
    ".zae",
    ".vtk",
    ".vtp",
    ".vtu",
    ".msh",
    ".mesh",
    ".inp",
}
FEW = "--samples", "4", "--quiet"
COMMANDS = {
    "info": "info {file} --json",
    "bake": "bake {file} -o w.glb --report r.html",
    "faces": "bake {file} -o f.ply --at faces --preset meshlab",
    "texture": "bake {file} -o t.glb --occlusion texture --size 256",
    "image": "bake {file} -o t<MATERIAL>.png --size 64 --report r.json",
    "render": "render {file} -o p.png --width 48 --height 32",
    "view": "view w.glb -o v.html",
}
"""By what each tries; w.glb is there if the bake succeeded."""
LONGEST = 300  # seconds


def drawn(folder: Path, count: int, seed: int, largest: int) -> list[Path]:
    """So many files of at most `largest` bytes, in turn of each origin and ending."""
    groups = defaultdict(list)
    for path in sorted(folder.rglob("*")):
        if path.suffix.lower() in ENDINGS and path.is_file() and 0 < path.stat().st_size <= largest:
            groups[path.relative_to(folder).parts[0], path.suffix.lower()].append(path)
    rng = random.Random(seed)
    for files in groups.values():
        rng.shuffle(files)
    return list(islice((path for row in zip_longest(*groups.values()) for path in row if path), count))


def tried(path: Path) -> dict[str, str]:
    """What came of each command: "done", "refused", or the fault."""
    found = {}
    with TemporaryDirectory() as folder:
        for name, line in COMMANDS.items():
            if name == "view" and found["bake"] != "done":
                continue
            words = [word.format(file=path) for word in line.split()] + [
                *(FEW if "bake" in line or "render" in line else ())
            ]
            command = [sys.executable, "-m", "obscurance", *words]
            try:
                done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=LONGEST, check=False)
            except subprocess.TimeoutExpired:
                found[name] = f"more than {LONGEST} s"
                continue
            last = [text for text in done.stderr.splitlines() if not text.startswith(("warning: ", "note: "))]
            is_refused = done.returncode == 2 and len(last) == 1
            found[name] = "refused" if is_refused else "done" if done.returncode == 0 else "\n".join(last[-3:])
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("count", type=int)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--largest", type=int, default=12_000_000, help="bytes")
    options = parser.parse_args()
    counts: dict[tuple[str, str], Counter[str]] = defaultdict(Counter)
    for path in drawn(options.folder.resolve(), options.count, options.seed, options.largest):
        origin = path.relative_to(options.folder.resolve()).parts[0]
        found = tried(path)
        counts[origin, path.suffix.lower()].update(["files", *(f"{name} {what}" for name, what in found.items())])
        for name, what in found.items():
            if what not in ("done", "refused"):
                print(f"{path}: {name}: {what}", flush=True)
    for (origin, ending), of in sorted(counts.items()):
        print(json.dumps({"origin": origin, "ending": ending, **of}))
    print(json.dumps(sum(counts.values(), Counter())))


if __name__ == "__main__":
    main()
