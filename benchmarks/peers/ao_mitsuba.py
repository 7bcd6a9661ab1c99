"""Ambient occlusion at points by Mitsuba 3, LLVM backend: one fused kernel makes directions, traces and averages."""

import glob
import os

import drjit as dr
import mitsuba as mi
import numpy as np
from serve import serve_bakes

for library in glob.glob("/usr/lib/*/libLLVM.so.19.1"):  # Debian's libllvm19
    os.environ.setdefault("DRJIT_LIBLLVM_PATH", library)
mi.set_variant("llvm_ad_rgb")

WAVEFRONT = 1 << 26  # rays


def build(mesh):
    triangles = mi.Mesh("mesh", len(mesh["vertices"]), len(mesh["faces"]))
    arrays = mi.traverse(triangles)
    arrays["vertex_positions"] = mesh["vertices"].ravel()
    arrays["faces"] = mesh["faces"].ravel()
    arrays.update()
    scene = mi.load_dict({"type": "scene", "mesh": triangles})
    dr.sync_thread()
    return scene


def trace(scene, mesh, samples, seed, tau, reach, sampler):
    origins, normals = mesh["origins"], mesh["normals"]
    step = max(WAVEFRONT // samples, 1)
    generator = mi.load_dict({"type": sampler, "sample_count": samples})
    if generator.sample_count() != samples:
        raise ValueError(f"{sampler} takes {generator.sample_count()} samples, not {samples}")
    w = []
    for number, first in enumerate(range(0, len(origins), step)):
        some = slice(first, first + step)
        w.append(wavefront(scene, origins[some], normals[some], generator, (seed << 16) + number, tau, reach))
    return np.concatenate(w)


def wavefront(scene, origins, normals, generator, seed, tau, reach):
    count, samples = len(origins), generator.sample_count()
    generator.set_samples_per_wavefront(samples)
    generator.seed(seed, count * samples)
    point = dr.arange(mi.UInt32, count * samples) // samples
    local = mi.warp.square_to_cosine_hemisphere(generator.next_2d())
    frame = mi.Frame3f(dr.gather(mi.Normal3f, mi.Normal3f(normals.T), point))
    ray = mi.Ray3f(dr.gather(mi.Point3f, mi.Point3f(origins.T), point), frame.to_world(local))
    if np.isfinite(reach):
        ray.maxt = dr.opaque(mi.Float, reach)
    if tau:
        hit = scene.ray_intersect_preliminary(ray)
        rate, limit = (dr.opaque(mi.Float, value) for value in (tau, -np.expm1(-tau * reach)))
        mu = dr.select(hit.is_valid(), (1 - dr.exp(-rate * hit.t)) / limit, 1.0)
    else:
        mu = dr.select(scene.ray_test(ray), 0.0, 1.0)
    total = dr.zeros(mi.Float, count)
    dr.scatter_reduce(dr.ReduceOp.Add, total, mu, point)
    return np.array(total / samples)


if __name__ == "__main__":
    serve_bakes(f"mitsuba {mi.__version__}", build, trace)
