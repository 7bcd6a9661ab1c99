"""Whether a change of the code leaves alone what commands do: exit status, printed lines and the outputs' bytes.

    python -m benchmarks.same_bytes TREE [OTHER_TREE] [--only TEXT]

Runs the commands of the table in a folder for each source tree, by the Python of the tree's .venv, or if it has none by
this one. With one tree its lines and its outputs' hashes are printed; with two what differs, with exit status 1 if
anything does. Paths and times are left out of lines and reports.
"""

from __future__ import annotations

import argparse
import hashlib
import re
import shlex
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from benchmarks.meshes import bumpy_sphere

COMMANDS = """
bake ball.obj -o ball.npy --tolerance .02
bake ball.obj -o ball.npz --samples 64 --report ball.json
bake ball.obj -o ball.ply --samples 32 --no-denoise --report ball.html --debug-image flags.png
bake ball.obj -o profile.glb --samples 32 --profile
bake ball.obj -o ball.vtp --falloff table:table.csv --samples 32
bake ball.obj -o far.obj --falloff linear --max-distance 25% --samples 32 --seed 3
bake ball.obj -o smooth.npy --falloff smooth --max-distance 40% --samples 32
bake ball.obj -o rounds.npy --falloff binary --tolerance .004
bake ball.obj -o thick.npy --thickness --samples 32
bake ball.obj -o cone.npy --spread 60 --samples 64
bake ball.obj -o fitted.ply --method surface --samples 32
bake ball.obj -o faces.npz --at faces --both-sides --samples 32
bake ball.obj -o standing.ply --ground auto --up z --samples 32 --colors r
bake ball.obj -o in_hills.npy --occluder hills.obj --interior mark --samples 32
bake hills.obj -o hills.glb --tolerance .02 --colors
bake hills.obj -o opaque.npy --alpha ignore --samples 32
bake hills.obj -o own.npy --occluded-by object --samples 32
bake hills.obj -o one.ply --receive low --cast high --normals area --samples 32
bake hills.obj -o back.npy --flip --back-faces ignore --normals up --samples 32
bake hills.obj -o page.png --size 64 --tolerance .02
bake hills.obj -o page.exr --size 48 --samples 16 --half --error-map error.exr
bake hills.obj -o bent.png --size 48 --samples 16 --bent-normals normals.exr --bent-space tangent
bake hills.obj -o eight.png --size 32 --samples 16 --bits 8 --overlap first
bake hills.obj -o shown.glb --occlusion texture --size 32 --samples 16
bake hills.obj -o unwrapped.png --uv unwrap --mesh-output unwrapped.glb --size 64 --samples 16
bake hills.obj -o hills_<MATERIAL>.png --size 32 --samples 16
bake hills.obj -o high.png --high fine.obj --cage 5% --size 32 --samples 16
bake hills.obj -o high.npy --high fine.obj --samples 16
bake hills.obj -o page.html --samples 16
bake hills.obj --dry-run -o none.ply --samples 16
bake ball.obj hills.obj --output-dir batch --format ply --samples 16
bake ball.obj hills.obj --output-dir batch --format ply --samples 16 --resume
bake hills.obj -o by_workers.ply --samples 4096 --cluster local
falloff profile.glb --half-distance 3%,40% -o refaded.ply
view ball.ply -o view.html
view profile.glb ball.ply -o both.html
info hills.obj
info ball.obj --json
prune ball.obj -o pruned.glb
scenes cornell -o cornell.toml
render cornell.toml -o cornell.exr --width 48 --height 48 --samples 16
render cornell.toml -o by_workers.exr --width 48 --height 48 --samples 16 --cluster local
render cornell.toml -o cornell.png --width 48 --height 48 --samples 4 --shading gouraud --no-shadows
scenes still_life -o still_life.toml
render still_life.toml -o still_life.png --width 64 --height 36 --samples 8
render hills.glb -o hills.png --width 48 --height 32 --samples 8
render ball.obj -o baked.png --baked ball.npz --width 48 --height 32 --samples 8
compare cornell.exr cornell.png --difference difference.png
materials gold
validate --samples 64
bake broken.obj -o never.ply
bake missing.obj -o never.ply
bake ball.obj -o never.xyz
bake ball.obj -o never.ply --samples 0
bake ball.obj -o never.png --size 32
bake ball.obj --bogus
render broken.toml -o never.png
"""
_TIMES = re.compile(
    r"[\d.,]+ ?[kM]? ?(s|min|rays/s)\b"  # in lines and in reports to read
    r'|"(load|write|build|bake|seconds|created)": [\d."]+'  # in reports for programs, and in manifests
    r'|<rect width="[\d.]+" height="8"/>'  # bars of seconds
)


def hills(columns: int) -> str:
    """An .obj of a height field with texture coordinates, of two objects, one of them half transparent."""
    u, v = (axis.ravel() for axis in np.meshgrid(*2 * [np.linspace(0, 1, columns)]))
    places = np.stack([u, v, 0.1 * np.sin(12 * u) * np.cos(9 * v)], axis=1)
    lines = ["mtllib hills.mtl", *("v {:.6f} {:.6f} {:.6f}".format(*place) for place in places)]
    lines += ["vt {:.6f} {:.6f}".format(*place) for place in places[:, :2]]
    corners = (np.arange(columns - 1)[:, None] * columns + np.arange(columns - 1) + 1).ravel()
    for name, half in zip(("low", "high"), np.array_split(corners, 2), strict=True):
        lines += [f"o {name}", f"usemtl {name}"]
        lines += ["f {0}/{0} {1}/{1} {3}/{3} {2}/{2}".format(k, k + 1, k + columns, k + columns + 1) for k in half]
    return "\n".join(lines) + "\n"


def write_inputs(folder: Path) -> None:
    ball = bumpy_sphere(1500)
    lines = ["v {:.9g} {:.9g} {:.9g}".format(*place) for place in ball.vertices]
    lines += ["f {} {} {}".format(*face) for face in ball.faces + 1]
    texts = {"ball.obj": "\n".join(lines) + "\n", "hills.obj": hills(13), "fine.obj": hills(60)}
    texts |= {"hills.mtl": "newmtl low\nd 1\nnewmtl high\nd .5\n", "table.csv": "distance,open\n0,0\n.2,.5\n1,1\n"}
    texts |= {"broken.obj": "v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "broken.toml": "[camera]\nposition = 3\n"}
    for name, text in texts.items():
        (folder / name).write_text(text)


def content(path: Path) -> str:
    """The hash of a file, without times if it is a report."""
    data = path.read_bytes()
    if path.suffix in (".json", ".html"):
        data = _TIMES.sub("TIME", data.decode().replace(str(path.parent), "")).encode()
    return hashlib.sha256(data).hexdigest()[:12]


def contents(folder: Path) -> dict[str, str]:
    return {str(path.relative_to(folder)): content(path) for path in sorted(folder.rglob("*")) if path.is_file()}


def outcome(tree: Path, line: str, folder: Path) -> dict[str, object]:
    """What a command of a source tree does in a folder: its exit status, its lines, hashes of the files it writes."""
    before = contents(folder)
    own = tree / ".venv" / "bin" / "python"
    command = [own if own.exists() else sys.executable, tree / "cli.py", *shlex.split(line)]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    printed = (done.stdout + done.stderr).replace(str(tree), "").replace(str(folder), "")
    lines = {f"line {number}": text for number, text in enumerate(_TIMES.sub("TIME", printed).splitlines(), 1)}
    written = {path: digest for path, digest in contents(folder).items() if before.get(path) != digest}
    return {"exit status": done.returncode, **lines, **written}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("tree", type=Path)
    parser.add_argument("other_tree", type=Path, nargs="?")
    parser.add_argument("--only", default="", metavar="TEXT", help="commands with this in their line alone")
    options = parser.parse_args()
    trees = [tree.resolve() for tree in (options.tree, options.other_tree) if tree]
    any_differs = False
    with tempfile.TemporaryDirectory() as scratch:
        folders = [Path(scratch).resolve() / str(number) for number in range(len(trees))]
        for folder in folders:
            folder.mkdir()
            write_inputs(folder)
        for line in filter(lambda line: options.only in line, COMMANDS.strip().splitlines()):
            did = [outcome(tree, line, folder) for tree, folder in zip(trees, folders, strict=True)]
            names = list(dict.fromkeys(name for each in did for name in each))
            differing = [name for name in names if did[0].get(name) != did[-1].get(name)]
            any_differs |= bool(differing)
            verdict = "differs" if differing else "same   " if options.other_tree else "ran    "
            print(verdict, did[0]["exit status"], line, flush=True)
            for name in differing if options.other_tree else names[1:]:
                print("   ", name, *(each.get(name, "none") for each in did), sep="  ", flush=True)
    sys.exit(any_differs)


if __name__ == "__main__":
    main()
