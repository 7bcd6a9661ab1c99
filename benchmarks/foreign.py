"""Mesh files that others have made, through every command: `python -m benchmarks.foreign FOLDER 200 --seed 1`.

FOLDER holds packages as `pip download --no-deps`, `npm pack` and `apt-get source --download-only` bring them, which are
unpacked there, or a folder for each origin. Files are drawn evenly by origin and ending, of equal ones the first. Each
is described, baked to a .glb with a report, to a .ply and to textures, unwrapped where it has no coordinates, pruned,
rendered and shown. What a command refuses must be one line, by status 2; all else is a fault and listed.
"""

import argparse
import hashlib
import json
import random
import re
import subprocess
import sys
import tarfile
import zipfile
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
    "prune": "prune {file} -o u.glb --quiet",
}
"""By what each tries; w.glb is there if the bake succeeded."""
LONGEST = 300  # seconds


def unpack(folder: Path) -> None:
    """Unpack each package of a folder into one beside it, of its name without the version, unless that is there."""
    for package in sorted(path for path in folder.iterdir() if path.is_file() and path.suffix.lower() not in ENDINGS):
        target = folder / re.split(r"[-_]v?\d", package.name)[0]
        if target.exists():
            continue
        if zipfile.is_zipfile(package):
            with zipfile.ZipFile(package) as archive:
                archive.extractall(target)
        elif tarfile.is_tarfile(package):
            with tarfile.open(package) as files:
                files.extractall(target, filter="data")


def drawn(folder: Path, count: int, seed: int, largest: int) -> list[Path]:
    """So many files of at most `largest` bytes, no two alike, in turn of each origin and ending."""
    groups = defaultdict(list)
    seen = set()
    for path in sorted(folder.rglob("*")):
        if path.suffix.lower() in ENDINGS and path.is_file() and 0 < path.stat().st_size <= largest:
            content = hashlib.sha256(path.read_bytes()).digest()
            if content not in seen:
                seen.add(content)
                groups[path.relative_to(folder).parts[0], path.suffix.lower()].append(path)
    rng = random.Random(seed)
    for files in groups.values():
        rng.shuffle(files)
    return list(islice((path for row in zip_longest(*groups.values()) for path in row if path), count))


def tried(path: Path) -> dict[str, str]:
    """What came of each command: "done", "refused", or the fault; refused ones must leave no file."""
    found = {}
    with TemporaryDirectory() as folder:
        for name, line in COMMANDS.items():
            if name == "view" and found["bake"] != "done":
                continue
            before = {*Path(folder).iterdir()}
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
            is_refused = done.returncode == 2 and len(last) == 1 and {*Path(folder).iterdir()} == before
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
    folder = options.folder.resolve()
    if folder.is_dir():
        unpack(folder)
    files = drawn(folder, options.count, options.seed, options.largest)
    if not files:
        endings = " ".join(sorted(ENDINGS))
        raise SystemExit(f"{folder}: expected packages or folders that hold files in {endings}, got none")
    for path in files:
        origin = path.relative_to(folder).parts[0]
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
