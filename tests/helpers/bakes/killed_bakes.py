"""Bakes killed at random moments and run again. A script: KILLS SEED METHOD OPTIONS FOLDER; prints what it saw as JSON.

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
from unittest.mock import patch

from interrupted_bakes import MESH, METHODS, SMALL_BLOCKS, bake_texture, bits, folders

from obscurance.ao.execute.kept import Kept
from obscurance.raytrace.system.atomic import atomic_write

METHODS = METHODS | {"texture": bake_texture, "faces": partial(METHODS["vertex"], at="faces")}


def bake_to(target, make, options):
    """What `obscurance bake` does, with a file that holds every bit of the result."""
    with patch(*SMALL_BLOCKS), Kept(target, lambda _: None, after=0) as kept:
        baked = make(MESH, threads=2, checkpoint=kept, **options)
        with atomic_write(target) as file:
            file.writelines(bits(baked))


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


def held(target):
    """How many blocks are kept."""
    return sum(not path.name.startswith(".") for folder in folders(target) for path in folder.iterdir())


def wait_for_rows(target, child):
    """Wait until there is something to continue, so that some kills leave it however fast the machine is."""
    while not held(target) and not os.waitid(os.P_PID, child, os.WEXITED | os.WNOHANG | os.WNOWAIT):
        time.sleep(0.001)


def main(kills, seed, make, options, folder):
    chance = random.Random(seed)
    reference, target = folder / "reference", folder / "target"
    for _ in range(2):  # the first may compile
        start = time.monotonic()
        assert os.waitpid(forked(lambda: bake_to(reference, make, options)), 0)[1] == 0
        took = time.monotonic() - start
    wanted = reference.read_bytes()
    seen = {"killed": 0, "finished": 0, "continued": 0, "different": 0, "failed": 0}
    while not seen["failed"] and (seen["killed"] < kills or not target.exists()):
        seen["continued"] += held(target) > 0
        child = forked(lambda: bake_to(target, make, options))
        if seen["killed"] < kills:
            time.sleep(chance.uniform(0, took))
            if seen["killed"] % 2:
                wait_for_rows(target, child)
            os.kill(child, signal.SIGKILL)
        status = os.waitpid(child, 0)[1]
        if os.WIFSIGNALED(status):
            seen["killed"] += 1
        seen["failed"] += os.WIFEXITED(status) and os.WEXITSTATUS(status) != 0
        if target.exists():
            seen["different"] += target.read_bytes() != wanted
            if not os.WIFSIGNALED(status):
                seen["finished"] += 1
                seen["failed"] += bool(folders(target))
            if seen["killed"] < kills:
                target.unlink()
    print(json.dumps(seen))


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]), METHODS[sys.argv[3]], json.loads(sys.argv[4]), Path(sys.argv[5]))
