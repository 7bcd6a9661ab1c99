"""Ambient occlusion at points by Open3D's RaycastingScene, random directions made by NumPy."""

import numpy as np
import open3d as o3d
from serve import serve_bakes, tangent_frames

BLOCK = 1 << 20  # rays


def build(mesh):
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(mesh["vertices"], mesh["faces"])
    scene.test_occlusions(np.array([[0, 0, 0, 0, 0, 1]], np.float32))  # builds
    return scene


def trace(scene, mesh, samples, seed, tau, reach):
    origins, frames = mesh["origins"], tangent_frames(mesh["normals"])
    chance = np.random.default_rng(seed)
    limit = -np.expm1(-tau * reach)
    w = np.empty(len(origins))
    step = max(BLOCK // samples, 1)
    for first in range(0, len(origins), step):
        some = slice(first, first + step)
        count = len(origins[some])
        u, turn = chance.random((2, count, samples), np.float32)
        turn *= np.float32(2 * np.pi)
        radius = np.sqrt(u)
        local = np.stack([radius * np.cos(turn), radius * np.sin(turn), np.sqrt(1 - u)], axis=-1)
        rays = np.empty((count, samples, 6), np.float32)
        rays[..., :3] = origins[some, None]
        np.matmul(local, frames[some], out=rays[..., 3:])
        if tau:
            distance = scene.cast_rays(rays)["t_hit"].numpy()
            mu = np.where(distance < reach, -np.expm1(-tau * distance) / limit, 1.0)
        else:
            mu = ~scene.test_occlusions(rays, tfar=reach).numpy()
        w[some] = mu.mean(axis=1)
    return w


if __name__ == "__main__":
    serve_bakes(f"open3d {o3d.__version__}", build, trace)
