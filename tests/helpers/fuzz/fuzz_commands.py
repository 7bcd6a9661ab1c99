"""Damaged files of every kind through the commands that read them, in this process, as a user types them."""

import json
import os
import re
import tempfile
import time
from functools import cache
from pathlib import Path

import fuzz_mutations
import fuzz_seeds
import numpy as np
from command import obscurance
from mesh_files import obj
from meshes import hills

MESHES = ("glb", "gltf", "obj", "ply_ascii", "ply_mixed", "off", "stl_ascii")
BESIDE = {
    "table": ("table.csv",),
    "beside": ("hills.obj",),
    "profile": ("profile.npz", "profile.ply", "profile.glb"),
    "stored": ("report.json", "batch/manifest.json"),
}
FAMILIES = (*MESHES, "toml", *BESIDE)


class Finding(Exception):
    """An input did what none may do."""


@cache
def sound():
    """Name to content of what stands beside a mesh in a command, most of it made by commands."""
    made = {"hills.obj": obj(*hills(6)), "table.csv": "\n".join(f"{x / 9},{x / 9}" for x in range(10)).encode()}
    with tempfile.TemporaryDirectory() as folder:
        inside = Path(folder)
        (inside / "hills.obj").write_bytes(made["hills.obj"])
        bake = ("bake", inside / "hills.obj", "--samples", 4, "--quiet")
        for name in BESIDE["profile"]:
            obscurance(*bake, "--profile", "-o", inside / name, "--report", inside / "report.json")
        obscurance(*bake, "--output-dir", inside / "batch")
        return made | {name: (inside / name).read_bytes() for name in BESIDE["profile"] + BESIDE["stored"]}


def companions():
    """What the files may refer to: name to content."""
    return fuzz_seeds.companions() | sound()


def unspoiled():
    """Family, name and bytes of each file that is spoilt."""
    yield from (each for each in fuzz_mutations.unspoiled() if each[0] in FAMILIES)
    yield from ((family, name, sound()[name]) for family, names in BESIDE.items() for name in names)


def spoiled(family, rng):
    """The name and bytes of a damaged file of a family, by a `random.Random`."""
    if family not in BESIDE:
        return fuzz_mutations.spoiled(family, rng)
    name = rng.choice(BESIDE[family])
    content = sound()[name]
    if name.endswith(".json") and rng.random() < 0.85:
        tree = fuzz_mutations.mutated(json.loads(content), rng)
        return name, json.dumps(tree).encode("utf-8", "surrogatepass")
    return name, fuzz_mutations.damaged(content, rng)


SMALL = ("--width", "16", "--height", "12", "--samples", "2", "--threads", "2")
BAKES = (
    ("-o", "made.ply"), ("-o", "made.glb"), ("-o", "made.npz"), ("-o", "made.npy"), ("-o", "made.html"), ("--dry-run",),
    ("-o", "made.ply", "--method", "surface"), ("-o", "made.ply", "--tolerance", ".05"),
    ("-o", "made.png", "--uv", "unwrap", "--size", "32"), ("-o", "made.exr", "--size", "32"),
    ("-o", "made.glb", "--occlusion", "texture", "--size", "32"),
    ("-o", "made.npz", "--falloff", "binary", "--normals", "file"),
)  # fmt: skip
RENDERS = ((), (), ("--obscurance", "off"), ("--shading", "gouraud"), ("--alpha", "ignore"), ("--no-own-occlusion",))


def commands(family, path, made, rng):
    """What is done with a file: the arguments of each command, and the file that it is to make or None."""
    mesh, npz, page = path.parent / "hills.obj", made / "made.npz", made / "page.html"
    bake = ("bake", mesh, "--samples", "4", "--quiet", "--threads", "2")
    match family:
        case "table":
            yield [*bake, "--falloff", f"table:{path}", "-o", npz], npz
        case "beside":
            yield (
                ["bake", path, *bake[2:], "--high", path, "--cage", rng.choice(("2%", "5%", "0", "inf")), "-o", npz],
                npz,
            )
            yield ["bake", path, *bake[2:], "--occluder", path, "-o", npz], npz
        case "profile":
            where = ["--mesh", mesh] if path.suffix == ".npz" else []
            changed = made / f"made{path.suffix}"
            yield ["falloff", path, "--half-distance", "30%", "-o", changed], changed
            yield ["view", path, *where, "-o", page], page
        case "stored":
            mesh = path.parent.parent / "hills.obj" if path.parent.name == "batch" else mesh
            yield ["bake", mesh, *bake[2:], "--options", path, "-o", npz], npz
        case _:
            if family != "toml":
                options = [str(made / word) if word.startswith("made.") else word for word in rng.choice(BAKES)]
                target = made / next((os.path.basename(word) for word in options if "made." in word), "none")
                yield ["bake", path, *bake[2:], *options], target
            yield ["info", path, *rng.choice(((), ("--json",)))], None
            yield ["view", path, "-o", page], page
            picture = made / rng.choice(("picture.png", "picture.exr"))
            yield ["render", path, "-o", picture, *SMALL, *rng.choice(RENDERS)], picture


def checked_command(arguments, target, made, run=obscurance):
    """Run a command: its message if it refused the file. Raises: Finding."""
    start = time.process_time()
    if target is not None:
        target.unlink(missing_ok=True)  # of a command before that was a finding
    result = run(*arguments)
    line = f"{arguments[0]}: status {result.returncode}, "
    if result.returncode not in (0, 2) or re.search(r"Traceback|Warning:|^\w*Error:", result.stderr, re.MULTILINE):
        raise Finding(line + result.stderr[-1500:])
    left = sorted(each.name for each in made.iterdir() if each.name.startswith(".") or "partial" in each.name)
    if left:
        raise Finding(f"{line}left {left}")
    if target is not None and (result.returncode == 0) != target.exists() and "--dry-run" not in arguments:
        raise Finding(f"{line}{target.name} is there: {target.exists()}")
    said = len(re.findall(r"^(?:warning|note): ", result.stderr, re.MULTILINE))
    if result.returncode == 2 and (result.stdout or result.stderr.count("\n") != 1 + said):
        raise Finding(f"{line}no one line: {result.stdout[-300:]}{result.stderr[-1000:]}")
    for text in result.stderr.splitlines():
        if not text.isprintable() or len(text) > 1200:
            raise Finding(f"{line}not a line for people: {text[:1500]!r}")
    if target is not None and target.exists() and target.suffix == ".npz":
        w = np.load(target)["w"]
        if not ((w >= 0) & (w <= 1)).all():
            raise Finding(f"{line}w is not in [0, 1]")
    return result.stderr if result.returncode else None, time.process_time() - start
