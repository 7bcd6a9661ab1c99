"""Ambient occlusion at points by embreex's own `run`, directions from NumPy: what needs no compiler.

Each point draws one of 256 scrambled Sobol sets and turns it about its normal. The sets depend on their size alone:
after the first bake of a size they are there.
"""

import os
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from importlib.metadata import version

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from scipy.stats import qmc
from serve import serve_bakes, tangent_frames

SETS = 256
BLOCK = 1 << 17  # rays
FAR = np.float32(1e30)


@cache
def directions(samples):
    """Cosine-weighted directions about +z, float32 (sets, samples, 3)."""
    points = np.stack([qmc.Sobol(2, rng=np.random.default_rng(k)).random(samples) for k in range(SETS)])
    u, turn = points[..., 0], 2 * np.pi * points[..., 1]
    radius = np.sqrt(u)
    return np.stack([radius * np.cos(turn), radius * np.sin(turn), np.sqrt(1 - u)], axis=-1).astype(np.float32)


def build(mesh):
    scene = EmbreeScene()
    TriangleMesh(scene, mesh["vertices"], mesh["faces"].astype(np.int32))
    scene.run(mesh["origins"][:1], mesh["normals"][:1], query="OCCLUDED")  # builds
    return scene


def trace(scene, mesh, samples, seed, tau, reach):
    sets, origins, chance = directions(samples), mesh["origins"], np.random.default_rng(seed)
    chosen = chance.integers(SETS, size=len(origins))
    turns = 2 * np.pi * chance.random(len(origins), np.float32)
    frames = turned(tangent_frames(mesh["normals"]), turns)
    limit = -np.expm1(-tau * reach)
    w = np.empty(len(origins))
    step = max(BLOCK // samples, 1)

    def work(first):
        some = slice(first, first + step)
        rays = np.matmul(sets[chosen[some]], frames[some]).reshape(-1, 3)
        starts = np.repeat(origins[some], samples, axis=0)
        ends = np.full(len(rays), min(reach, FAR), np.float32)
        if tau:
            distance = scene.run(starts, rays, ends, query="DISTANCE")
            mu = np.where(distance < min(reach, FAR), -np.expm1(-tau * distance) / limit, 1.0)
        else:
            mu = scene.run(starts, rays, ends, query="OCCLUDED") < 0
        w[some] = mu.reshape(-1, samples).mean(axis=1)

    with ThreadPoolExecutor(len(os.sched_getaffinity(0))) as pool:
        list(pool.map(work, range(0, len(origins), step)))
    return w


def turned(frames, turns):
    """Frames with rows t, b, n turned about n."""
    c, s = np.cos(turns)[:, None], np.sin(turns)[:, None]
    t, b, n = frames.transpose(1, 0, 2)
    return np.stack([c * t + s * b, c * b - s * t, n], axis=1)


if __name__ == "__main__":
    serve_bakes(f"embreex {version('embreex')}", build, trace)
