"""Commands killed at random moments and run again. A script: KILLS SEED KIND FOLDER; prints what it saw as JSON.

Each command is forked from this process, which has imported everything but touched neither Embree nor a thread. After
a kill, every file in the folder of outputs is whole, but for kept rows, of which the next run makes use, and what that
removes.
"""

import json
import os
import random
import shutil
import signal
import sys
import time
from pathlib import Path

from interrupted_bakes import SMALL_BLOCKS
from mesh_files import ply
from meshes import hills

import obscurance.ao.baking
import obscurance.ao.execute.work
import obscurance.scenes.bake.batch
import obscurance.scenes.bake.run
import obscurance.scenes.bake.texture
import obscurance.scenes.bake.vertices
import obscurance.scenes.commands.bake
import obscurance.scenes.commands.falloff
import obscurance.scenes.commands.render
import obscurance.scenes.show.page.document
import obscurance.scenes.show.report.document
from obscurance import cli
from obscurance.ao.execute.kept import Kept

SCENE = '[render]\nwidth = 300\nheight = 200\n[[objects]]\nmesh = "hills.ply"\n'
BAKE = ("bake", "hills.ply", "--samples", "128", "--quiet")
BATCH = (
    "bake",
    "a.ply",
    "b.ply",
    "c.ply",
    "hills.ply",
    "--samples",
    "128",
    "--quiet",
    "--output-dir",
    "out",
    "--resume",
)
KINDS = {
    "npy": [(*BAKE, "-o", "out/w.npy")],
    "tolerance": [("bake", "hills.ply", "--tolerance", "0.005", "--quiet", "-o", "out/w.npz")],
    "surface": [(*BAKE, "--method", "surface", "-o", "out/w.npz")],
    "faces": [(*BAKE, "--at", "faces", "-o", "out/w.npz")],
    "ply": [(*BAKE, "-o", "out/w.ply")],
    "glb": [(*BAKE, "-o", "out/w.glb")],
    "texture": [(*BAKE, "--size", "64", "-o", "out/w.png")],
    "smooth texture": [("bake", "hills.ply", "--size", "64", "--tolerance", "0.005", "--quiet", "-o", "out/w.exr")],
    "textured": [(*BAKE, "--occlusion", "texture", "--size", "64", "-o", "out/w.glb")],
    "batch": [BATCH],
    "textures": [(*BATCH, "--format", "png", "--size", "64")],
    "npz": [(*BAKE, "-o", "out/w.npz", "--profile")],
    "images": [(*BAKE, "--size", "64", "-o", "out/w.tif", "--bent-normals", "out/b.png", "--error-map", "out/e.exr")],
    "falloff": [
        (*BAKE, "--profile", "-o", "out/w.glb"),
        ("falloff", "out/w.glb", "--half-distance", "10%", "-o", "out/other.glb"),
        ("view", "out/other.glb", "-o", "out/view.html"),
    ],
    "picture": [("render", "scene.toml", "-o", "out/p.exr", "--quiet")],
    "page": [(*BAKE, "-o", "out/w.html")],
    "report": [(*BAKE, "-o", "out/w.npz", "--report", "out/report.html")],
}


def prepare(folder):
    """The inputs, in the working directory."""
    os.chdir(folder)
    for name, steps in (("hills", 40), ("a", 20), ("b", 25), ("c", 30)):
        vertices, faces = hills(steps)
        Path(f"{name}.ply").write_bytes(textured(vertices, faces))
    Path("scene.toml").write_text(SCENE)


def textured(vertices, faces):
    """A PLY file with texture coordinates above the plane of x and y."""
    return ply(vertices, faces, uv=0.45 * vertices[:, :2] + 0.5)


def run(commands):
    """All commands in a process of their own, which is returned running."""
    child = os.fork()
    if child:
        return child
    status = 1
    try:
        Kept.__init__.__defaults__ = (print, 0.0, *Kept.__init__.__defaults__[2:])
        obscurance.ao.execute.work._BLOCK_RAYS = SMALL_BLOCKS[1]
        with open(os.devnull, "w") as nowhere:
            os.dup2(nowhere.fileno(), 1)
        for command in commands:
            sys.argv = ["obscurance", *command]
            try:
                cli.main()
            except SystemExit as end:
                if end.code:
                    raise
        status = 0
    finally:
        os._exit(status)


def outputs():
    """Every file below the folder of outputs: its content, or for files that tell times whether it is whole."""
    found = {}
    for path in sorted(Path("out").rglob("*")):
        if path.is_file():
            content = path.read_bytes()
            if path.suffix == ".json":
                content = sorted(json.loads(content))
            elif path.name == "report.html":
                content = content.rstrip().endswith(b"</html>")
            found[str(path)] = content
    return found


def main(kills, seed, kind, folder):
    chance, commands = random.Random(f"{seed}:{kind}"), KINDS[kind]
    prepare(folder)
    for _ in range(2):  # the first may compile
        shutil.rmtree("out", ignore_errors=True)
        Path("out").mkdir()
        start = time.monotonic()
        assert os.waitpid(run(commands), 0)[1] == 0
        took = time.monotonic() - start
    wanted = outputs()
    assert wanted
    seen = {"killed": 0, "kept": 0, "finished": 0, "faults": []}
    while seen["killed"] < kills:
        shutil.rmtree("out")
        Path("out").mkdir()
        for _ in range(chance.choice((1, 1, 2))):  # killed again on the way on
            child = run(commands)
            time.sleep(took * chance.uniform(0.05, 1))
            os.kill(child, signal.SIGKILL)
            status = os.waitpid(child, 0)[1]
            seen["killed"] += os.WIFSIGNALED(status)
            seen["finished"] += not os.WIFSIGNALED(status)
            seen["kept"] += any(Path("out").rglob("*.partial-*/[0-9a-f]*"))
            for name, content in outputs().items():
                on_the_way = any(part in name for part in (".partial-", "/.obscurance-", ".json"))
                if not on_the_way and content != wanted.get(name):
                    seen["faults"].append(f"half-written {name}: {status}")
        status = os.waitpid(run(commands), 0)[1]
        again = outputs()
        if status or again != wanted:
            differing = [name for name in {*again, *wanted} if again.get(name) != wanted.get(name)]
            seen["faults"].append(f"run again: status {status}, differing or left: {differing}")
    print(json.dumps(seen))


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]), sys.argv[3], Path(sys.argv[4]))
