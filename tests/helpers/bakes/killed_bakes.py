"""Bakes killed at random moments and resumed. A script: KILLS SEED METHOD OPTIONS FOLDER; prints what it saw as JSON.

Each bake is forked from this process, which has imported everything but touched neither Embree nor a thread.
"""

import json
import os
import random
import signal
import sys
import time
from functools import partial
from pathlib import Path

import numpy as np
from meshes import hills

import ao
from ao.execute.checkpoint import Checkpoint
from raytrace.mesh.mesh import Mesh
from raytrace.system.atomic import atomic_write

HEADER = 100  # bytes of a journal without rows, at most


def bake_to(target, make, options, **settings):
    """What `obscurance bake` does, with a file that holds every bit of the result."""
    with Checkpoint(f"{target}.partial", notify=lambda _: None, **settings) as checkpoint:
        baked = make(Mesh(*hills(45)), threads=2, checkpoint=checkpoint, **options)
        last = baked.covered if isinstance(baked, ao.BakedTexture) else baked.flags
        with atomic_write(target) as file:
            for rows in (baked.w, baked.error, baked.bent_normals, last, np.array([baked.rays, baked.rmse])):
                file.write(rows.tobytes())


def bake_texture(mesh, **options):
    """The texture of a mesh above the plane of x and y."""
    return ao.bake_texture(mesh, 0.45 * mesh.vertices[:, :2] + 0.5, 80, **options)


def forked(work):
    child = os.fork()
    if child == 0:
        status = 1
        try:
            work()
            status = 0
        finally:
            os._exit(status)
    return child


def size_of(path):
    try:
        return path.stat().st_size
    except FileNotFoundError:
        return 0


def wait_for_rows(journal, child):
    """Wait until there is something to continue, so that some kills leave it however fast the machine is."""
    while size_of(journal) <= HEADER and not os.waitid(os.P_PID, child, os.WEXITED | os.WNOHANG | os.WNOWAIT):
        time.sleep(0.001)


def main(kills, seed, make, options, folder):
    chance = random.Random(seed)
    reference, target = folder / "reference", folder / "target"
    journal = Path(f"{target}.partial")
    for _ in range(2):  # the first may compile
        start = time.monotonic()
        assert os.waitpid(forked(lambda: bake_to(reference, make, options)), 0)[1] == 0
        took = time.monotonic() - start
    wanted = reference.read_bytes()
    seen = {"killed": 0, "finished": 0, "continued": 0, "different": 0, "failed": 0}
    while not seen["failed"] and (seen["killed"] < kills or not target.exists()):
        held = journal.stat().st_size if journal.exists() else 0
        child = forked(lambda: bake_to(target, make, options, resume=True, after=0, every=0))
        if seen["killed"] < kills:
            time.sleep(chance.uniform(0, took))
            if seen["killed"] % 2:
                wait_for_rows(journal, child)
            os.kill(child, signal.SIGKILL)
        status = os.waitpid(child, 0)[1]
        seen["continued"] += held > HEADER
        if os.WIFSIGNALED(status):
            seen["killed"] += 1
        seen["failed"] += os.WIFEXITED(status) and os.WEXITSTATUS(status) != 0
        if target.exists():
            seen["different"] += target.read_bytes() != wanted
            if not os.WIFSIGNALED(status):
                seen["finished"] += 1
                seen["failed"] += journal.exists()
            if seen["killed"] < kills:
                target.unlink()
    print(json.dumps(seen))


if __name__ == "__main__":
    make = bake_texture if sys.argv[3] == "texture" else partial(ao.bake, method=sys.argv[3])
    main(int(sys.argv[1]), int(sys.argv[2]), make, json.loads(sys.argv[4]), Path(sys.argv[5]))
