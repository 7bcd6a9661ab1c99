"""Files that are wrong in what they mean rather than in their bytes, and every command that reads them.

Mesh files and scenes are written from their formats' grammar: right but for a few counts, types, indices, references
and sizes. Each goes through the commands in this process, as a user types them.
"""

import os
import random
import re
import struct
import sys
import time
import zlib
from functools import cache

import fuzz_gltf
import fuzz_meshes
import fuzz_options
import fuzz_seeds
import fuzz_toml
import numpy as np
from command import obscurance
from fuzz_mutations import toml_text

MAKERS = {"gltf": fuzz_gltf.spoiled, "mesh": fuzz_meshes.spoiled, "toml": fuzz_toml.spoiled, **fuzz_options.MAKERS}
FAMILIES = tuple(MAKERS)


class Finding(Exception):
    """An input did what none may do."""


def spoiled(family, rng):
    """The name and bytes of a damaged file of a family, by a `random.Random`."""
    usual = sys.getrecursionlimit()
    sys.setrecursionlimit(100_000)  # copies of deeply nested trees
    try:
        return MAKERS[family](rng)
    finally:
        sys.setrecursionlimit(usual)


@cache
def _big_png():
    """A flat 8192 × 4096 picture in 130 KB: decoded it takes hundreds of megabytes."""
    rows = zlib.compress((b"\0" + b"\x80" * (3 * 8192)) * 4096, 1)
    made = b"\x89PNG\r\n\x1a\n"
    head = struct.pack(">IIBBBBB", 8192, 4096, 8, 2, 0, 0, 0)
    for kind, content in ((b"IHDR", head), (b"IDAT", rows), (b"IEND", b"")):
        made += struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))
    return made


def companions():
    """What the files may refer to: name to content."""
    return fuzz_seeds.companions() | {
        **fuzz_options.sound(),
        "sky.png": fuzz_seeds.image("png", 16, 8),
        "alpha.png": fuzz_seeds.image("png", 40, 30, 4),
        "huge.png": _big_png(),
        "falloff.csv": "\n".join(f"{x},{x / 19}" for x in range(20)).encode(),
        "many.obj": b"".join(b"v %d 0 0\nv %d 1 0\nv %d 0 1\nf -1 -2 -3\n" % (n, n, n) for n in range(3000)),
    }


SMALL = ("--width", "16", "--height", "12", "--samples", "2", "--threads", "2")
BAKES = (
    ("-o", "made.ply"), ("-o", "made.glb"), ("-o", "made.npz"), ("-o", "made.npy"), ("-o", "made.html"), ("--dry-run",),
    ("-o", "made.ply", "--method", "surface"), ("-o", "made.ply", "--tolerance", ".05"),
    ("-o", "made.png", "--uv", "unwrap", "--size", "32"), ("-o", "made.exr", "--size", "32"),
    ("-o", "made.glb", "--occlusion", "texture", "--size", "32"),
    ("-o", "made.npz", "--falloff", "binary", "--normals", "file"),
)  # fmt: skip
RENDERS = ((), (), ("--obscurance", "off"), ("--shading", "gouraud"), ("--alpha", "ignore"), ("--no-own-occlusion",))


SOUND = {
    "table": ["table.csv"],
    "beside": ["hills.obj"],
    "named": ["hills.obj"],
    "part": ["vertex/part-1-of-1.part", "surface/part-1-of-1.part"],
    "profile": ["profile.npz", "profile.ply", "profile.glb"],
    "stored": ["report.json", "batch/manifest-1-of-1.json"],
}


def sound(family, inside, made):
    """Every command on a file as it should be, so that all is compiled: its arguments and target."""
    chance = random.Random(0)
    if family in fuzz_options.MAKERS:
        for name in SOUND[family]:
            for _ in range(8):
                for arguments, target in commands(family, inside / name, made, chance):
                    (inside / name).write_bytes(fuzz_options.sound()[name])
                    yield arguments, target
        return
    content = {
        "gltf": ("m.glb", fuzz_seeds.quad_glb()),
        "mesh": ("m.obj", fuzz_meshes.write_obj(*fuzz_meshes.ball(5), chance)),
        "toml": ("m.toml", toml_text(fuzz_seeds.TOML).encode()),
    }[family]
    path = inside / content[0]
    for _ in range(5):
        for arguments, target in commands(family, path, made, chance):
            path.write_bytes(content[1])
            yield arguments, target


def commands(family, path, made, rng):
    """What is done with a file: the arguments of each command, and the file that it is to make or None."""
    if family in fuzz_options.MAKERS:
        yield from fuzz_options.commands(family, path, made, rng)
        return
    if family != "toml":
        bake = [str(made / word) if word.startswith("made.") else word for word in rng.choice(BAKES)]
        target = made / next((os.path.basename(word) for word in bake if "made." in word), "none")
        yield ["bake", path, "--samples", "4", "--quiet", *bake], target
    yield ["info", path, *rng.choice(((), ("--json",)))], None
    yield ["view", path, "-o", made / "page.html"], made / "page.html"
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
