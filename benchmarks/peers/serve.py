"""The peer's side of `process.py`: answer JSON requests on standard input until they end.

Needs Python and NumPy alone, for it runs in the peers' interpreters.
"""

import json
import os
import sys
import time

import numpy as np


def serve(about, answer):
    """Say `about`, then `answer(request)` to each request; all are dictionaries.

    Whatever libraries print to standard output goes to standard error, out of the protocol's way.
    """
    out = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)

    def say(message):
        print(json.dumps(message), file=out, flush=True)

    say(about)
    for line in sys.stdin:
        say(answer(json.loads(line)))


def serve_bakes(version, build, trace, load=dict):
    """Serve bakes: requests name a mesh (.npz), `samples`, `seed`, `tau`, `reach`, `options` and a target (.npy) for w.

    Args:
        build(mesh): the scene that `trace` needs, ready to trace.
        trace(scene, mesh, samples=, seed=, tau=, reach=, **options): w (k,) as a NumPy array. `tau` is 0 for the
            binary falloff; `reach` is the length of rays, inf for all there is.
        load(arrays): `mesh`, from float32 `vertices` (n, 3), uint32 `faces` (m, 3), float32 `origins` and `normals`
            (k, 3) of the points to bake, int64 `numbers` (k,), the vertex each of them is, and `of_vertex` (n,), the
            point of each vertex, −1 for none.

    `load` and writing w are not timed; answers hold the seconds of `build` and `trace`.
    """
    known = {}

    def answer(request):
        path = request["mesh"]
        if path not in known:
            known.clear()
            with np.load(path) as arrays:
                known[path] = load(dict(arrays))
        mesh = known[path]
        chosen = {name: request[name] for name in ("samples", "seed", "tau", "reach")}
        start = time.perf_counter()
        scene = build(mesh)
        built = time.perf_counter()
        w = trace(scene, mesh, **chosen, **request["options"])
        traced = time.perf_counter()
        np.save(request["target"], w)
        return {"build": built - start, "trace": traced - built}

    serve({"version": version}, answer)


def tangent_frames(normals):
    """Rows t, b, n of right-handed frames (k, 3, 3) about unit `normals` (k, 3) (Duff et al. 2017), float32."""
    x, y, z = normals.T
    sign = np.where(z >= 0, np.float32(1), np.float32(-1))
    a = -1 / (sign + z)
    t = np.stack([1 + sign * x * x * a, sign * x * y * a, -sign * x], axis=-1)
    b = np.stack([x * y * a, sign + y * y * a, -y], axis=-1)
    return np.stack([t, b, normals], axis=1)
