"""Reference values of w by brute force: the plain mean of μ over the closest hits of many rays.

It shares the baker's points and normals, which define the quantity, but none of its estimator: nothing is skipped,
stopped early or smoothed. The rays of all falloffs are the same, so one pass serves them all.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from obscurance.ao.mu import Mu
from obscurance.ao.points.points import Points
from obscurance.ao.points.receivers import find_receivers
from obscurance.raytrace.embree import TriangleScene, intersect
from obscurance.raytrace.mesh.mesh import Mesh
from obscurance.raytrace.mesh.placement import Placement
from obscurance.raytrace.sampling import cosine_hemisphere, owen_sobol, seed_key
from obscurance.raytrace.system.threads import run_blocks, thread_count
from obscurance.raytrace.types import Float32s, Float64s, Int64s

RAYS, VERTICES = 16384, 8192
_SETS, _BLOCK_RAYS = 128, 1 << 18
_SEED = 0x5EED_0F_7EA1  # of its own, so that no bake under judgement draws the same rays


@dataclass(frozen=True, eq=False)
class Reference:
    """w at some vertices of a mesh. Attributes: vertices: int64 (k,), which ones. w: float64 (falloffs, k)."""

    vertices: Int64s
    w: Float64s


@dataclass(frozen=True)
class Errors:
    """Errors of w against a reference: root mean square, 99th percentile of |error|, largest, and mean (the bias)."""

    rmse: float
    p99: float
    largest: float
    mean: float

    @classmethod
    def of(cls, w: Float64s, truth: Float64s) -> Errors:
        """The errors of w against the truth, both (k,)."""
        off = w - truth
        size = np.abs(w - truth)
        return cls(*map(float, (np.sqrt(np.mean(off**2)), np.quantile(size, 0.99), size.max(), off.mean())))


def reference(
    mesh: Mesh, mus: Sequence[Mu], rays: int = RAYS, vertices: int = VERTICES, threads: int | None = None
) -> Reference:
    """w by brute force at no more than `vertices` vertices, chosen at random among baked ones.

    Args: rays: of a vertex; a power of two is best. At visibility edges the error falls with rays^(−3/4).
    """
    placement = Placement.of(mesh)
    receivers = find_receivers(mesh, placement)
    chosen = np.sort(np.random.default_rng(_SEED).permutation(len(receivers.points))[:vertices])
    scene = receivers.embree()
    w = trace(scene, placement, receivers.points[chosen], mus, rays, threads)
    corners = receivers.corners.only(chosen)
    if len(corners):
        at_corners = trace(scene, placement, corners.points, mus, rays, threads)
        w[:, corners.point_rows] = corners.mean(at_corners.T).T
    return Reference(receivers.first_vertex[chosen], w)


def trace(
    scene: TriangleScene, placement: Placement, points: Points, mus: Sequence[Mu], rays: int, threads: int | None = None
) -> Float64s:
    """w (falloffs, k) at `points`: plain means over `rays` closest hits, the same directions whatever the origins."""
    chance = np.random.default_rng(_SEED)
    sets = cosine_hemisphere(*owen_sobol(_SETS, rays, seed_key(_SEED))).astype(np.float32)
    drawn = chance.integers(_SETS, size=len(points))
    frames = _turned_frames(points.normals, chance.uniform(0, 2 * np.pi, len(points)))
    w = np.empty((len(mus), len(points)))

    def work(start: int, stop: int) -> None:
        directions = np.matmul(frames[start:stop], sets[drawn[start:stop]]).transpose(0, 2, 1).reshape(-1, 3)
        origins = np.repeat(points.origins[start:stop], rays, axis=0)
        hits = intersect(scene, origins, directions, placement.diagonal, threads=1)
        distance = hits.distance.astype(np.float64) / placement.scale
        for row, mu in enumerate(mus):
            w[row, start:stop] = mu(distance).reshape(-1, rays).mean(axis=1)

    run_blocks(len(points), max(_BLOCK_RAYS // rays, 1), work, thread_count(threads))
    return w


def _turned_frames(normals: Float32s, turns: Float64s) -> Float32s:
    """Rotations (k, 3, 3) that take +z to `normals` (k, 3), turned about them (Duff et al. 2017)."""
    x, y, z = normals.astype(np.float64).T
    sign = np.where(z >= 0, 1.0, -1.0)
    a = -1 / (sign + z)
    t = np.stack([1 + sign * x * x * a, sign * x * y * a, -sign * x], axis=-1)
    b = np.stack([x * y * a, sign + y * y * a, -y], axis=-1)
    c = np.cos(turns)[:, None]
    s = np.sin(turns)[:, None]
    return np.stack([c * t + s * b, c * b - s * t, normals], axis=-1).astype(np.float32)
