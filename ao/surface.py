"""Bake obscurance by least squares: values at the vertices whose interpolation is nearest to w all over the faces."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_array

from raytrace.memory import check_memory
from raytrace.mesh import Mesh
from raytrace.normals import normalize
from raytrace.parallel import thread_count
from raytrace.placement import Placement
from raytrace.sampling import seed_key
from raytrace.weld import CREASE

from .bake import DEFAULT_SAMPLES, MAX_SAMPLES, Bake, _check_whole, describe_work
from .checkpoint import Checkpoint
from .conjugate_gradients import COARSE, solve, solve_within
from .falloff import Exponential, Falloff
from .memory import surface_bytes, vertex_bytes
from .receivers import Flag, Normals, find_receivers
from .surface_fit import Half, cross_validated, normal_matrix, right_side, roughness, ties
from .surface_gather import BELOW, MATRIX, MOMENTS, RIGHT, SQUARES, TRACED
from .surface_patch import Patch, gather, reveal_interiors
from .trace import Progress

Floats = npt.NDArray[np.float64]

_TIE = 1e-7
_RELAXED = 1 / 16


def bake_surface(
    mesh: Mesh | Any,
    falloff: Falloff | None = None,
    samples: int | None = None,
    seed: int = 0,
    threads: int | None = None,
    normals: Normals = "angle",
    progress: Progress | None = None,
    only: npt.NDArray[np.bool_] | None = None,
    checkpoint: Checkpoint | None = None,
) -> Bake:
    """Obscurance w(p) = (1/π) ∫ μ(d) cosθ dω (12.71) over the faces of `mesh`, fitted by one value a vertex.

    Args: as `ao.bake`, but `samples` rays a vertex are spread over its faces, up to 32 from each of many points; with
        `only`, over the faces that those vertices are corners of.

    Returns:
        `error` is the standard error of the fitted values: what separates them from the fit to infinitely many
        samples, not from w at the vertex. `rays_skipped` also counts rays below the face they start on.

    Raises: as `ao.bake`.
    """
    samples = DEFAULT_SAMPLES if samples is None else samples
    _check_whole("samples", samples, 1, MAX_SAMPLES)
    _check_whole("seed", seed, 0, 2**64 - 1)
    workers = thread_count(threads)
    mesh = mesh if isinstance(mesh, Mesh) else Mesh(mesh.vertices, mesh.faces)
    mu = (falloff or Exponential()).resolve(mesh.radius)
    size = len(mesh.vertices), len(mesh.faces)
    at_vertices = {"the vertex method": vertex_bytes(*size, DEFAULT_SAMPLES)}
    check_memory(mesh.source, surface_bytes(*size), describe_work(mesh) + " by the surface method", at_vertices)

    start = time.perf_counter()
    placement = Placement.of(mesh)
    receivers = find_receivers(mesh, placement, normals)
    mine = receivers if only is None else receivers.only(only)
    wanted: npt.NDArray[np.bool_] = np.ones(len(mesh.vertices), np.bool_) if only is None else only

    if checkpoint:
        checkpoint.begin(placement, receivers, "surface", mu, samples, seed, normals)
    patch = Patch.of(placement, receivers, wanted)
    key = seed_key(seed)
    moments, counts = gather(receivers.scene, placement, patch, mu, samples, key, workers, progress, checkpoint)
    reveal_interiors(patch, moments, counts)
    fit = _fit(patch, moments)

    row = receivers.of_vertex
    baked = mine.of_vertex >= 0
    w, error, bent = np.ones(len(row)), np.zeros(len(row)), np.zeros((len(row), 3))
    w[baked], error[baked] = fit.w[row[baked]], fit.error[row[baked]]
    direction = normalize(fit.bent[row[baked]])
    bent[baked] = np.where(direction.any(axis=1, keepdims=True), direction, receivers.points.normals[row[baked]])
    finished = time.perf_counter()
    traced = counts.sum(axis=0)
    return Bake(
        w=w,
        error=error,
        bent_normals=bent,
        flags=receivers.flags,
        rays=int(traced[TRACED]),
        rays_skipped={
            "duplicate": samples * int(np.count_nonzero(baked) - len(mine.points)),
            "no_normal": samples * int(np.count_nonzero(receivers.flags & (Flag.UNREFERENCED | Flag.DEGENERATE))),
            "not_wanted": samples * int(np.count_nonzero(~wanted)),
            "below_face": int(traced[BELOW]),
        },
        rmse=float(np.sqrt(np.sum(error**2) / max(int(np.count_nonzero(wanted)), 1))),
        seconds={"build": receivers.scene.seconds, "bake": finished - start - receivers.scene.seconds},
        mu=mu,
    )


@dataclass(frozen=True, eq=False)
class _Fit:
    """Attributes: w, error: float64 (k,). bent: float64 (k, 3), mean of μ·direction."""

    w: Floats
    error: Floats
    bent: Floats


def _fit(patch: Patch, moments: Floats) -> _Fit:
    """Fit 1 − w, so that where nothing is closed w is exactly 1."""
    seats, points = patch.seats, patch.unknowns
    even, odd = (
        Half(
            normal_matrix(seats, moments[:, half, MATRIX:RIGHT], points),
            right_side(seats, moments[:, half, RIGHT : RIGHT + 3], points),
            float(moments[:, half, SQUARES].sum()),
        )
        for half in (0, 1)
    )
    matrix, right = even.matrix + odd.matrix, even.right + odd.right
    smoothness = roughness(patch.corners, seats, patch.normals, patch.areas, CREASE, points)
    tie = ties(seats, _TIE * matrix.diagonal().sum() * patch.areas / max(patch.areas.sum(), 1e-300), points)
    mean = right.sum() / max(matrix.sum(), 1e-300)
    alpha, (first, second) = cross_validated((even, odd), smoothness, tie, np.full(points, mean))

    whole = (matrix + alpha * smoothness + tie).tocsr()
    closed = solve_within(whole, right, (first + second) / 2)
    relaxed = solve_within((matrix + alpha * _RELAXED * smoothness + tie).tocsr(), right, closed)
    both = moments.sum(axis=1)
    bent = [
        solve(whole, right_side(seats, both[:, column : column + 3], points), np.zeros(points), tolerance=COARSE)
        for column in range(RIGHT + 3, MOMENTS, 3)
    ]
    variance = _local_mean(matrix, (np.clip(first, 0, 1) - np.clip(second, 0, 1)) ** 2 / 4)
    return _Fit(1 - closed, np.sqrt(variance + (closed - relaxed) ** 2), np.stack(bent, axis=1))


def _local_mean(matrix: csr_array, values: Floats) -> Floats:
    """Means of `values` (k,) over each vertex and its neighbours, drawn towards that of all by a tenth."""
    mass = matrix @ np.ones(len(values))
    local = np.where(mass > 0, (matrix @ values) / np.where(mass > 0, mass, 1.0), values)
    return 0.9 * local + 0.1 * float(np.mean(values))
