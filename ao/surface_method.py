"""Bake obscurance by least squares: values at the vertices whose interpolation is nearest to w all over the faces."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import numpy.typing as npt

from raytrace.mesh.mesh import Mesh
from raytrace.mesh.normals import normalize
from raytrace.mesh.placement import Placement
from raytrace.sampling.hash import seed_key
from raytrace.system.memory import check_memory
from raytrace.system.threads import thread_count

from .arguments import check_arguments, falloff_of, mesh_of
from .falloff import Falloff
from .gather.receivers import Flag, Normals, find_receivers
from .least_squares.face_moments import BELOW, TRACED
from .least_squares.fit import fit_values, state
from .least_squares.patch import Patch, gather, reveal_interiors
from .memory import surface_bytes, vertex_bytes
from .trace.checkpoint import Checkpoint
from .trace.tracer import Progress
from .vertex_method import DEFAULT_SAMPLES, Bake, describe_work


def bake_surface(
    mesh: Mesh | Any,
    falloff: Falloff | str | None = None,
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
    check_arguments(samples, seed, threads)
    only = None if only is None else np.asarray(only)
    workers = thread_count(threads)
    mesh = mesh_of(mesh)
    mu = falloff_of(falloff).resolve(mesh.radius)
    size = len(mesh.vertices), len(mesh.faces)
    at_vertices = {"the vertex method": vertex_bytes(*size, DEFAULT_SAMPLES)}
    check_memory(mesh.source, surface_bytes(*size), describe_work(mesh) + " by the surface method", at_vertices)

    start = time.perf_counter()
    placement = Placement.of(mesh)
    receivers = find_receivers(mesh, placement, normals)
    mine = receivers if only is None else receivers.only(only)
    wanted: npt.NDArray[np.bool_] = np.ones(len(mesh.vertices), np.bool_) if only is None else only

    if checkpoint:
        chosen = only if only is None else np.packbits(only).tobytes()
        checkpoint.begin(placement, receivers, "surface", mu, samples, seed, normals, chosen)
    patch = Patch.of(placement, receivers, wanted)
    key = seed_key(seed)
    moments, counts = gather(receivers.scene, placement, patch, mu, samples, key, workers, progress, checkpoint)
    reveal_interiors(patch, moments, counts)
    row, usual, flags = receivers.of_vertex, receivers.points.normals, receivers.flags
    baked, points, built = mine.of_vertex >= 0, len(mine.points), receivers.scene.seconds
    traced = counts.sum(axis=0)
    del receivers, mine  # with Embree's scene, which takes as much memory as the fit
    problem, trial = state(patch, moments, workers)
    del patch, moments, counts
    fit = fit_values(problem, trial, checkpoint.once if checkpoint else lambda _, compute: compute())

    w, error, bent = np.ones(len(row)), np.zeros(len(row)), np.zeros((len(row), 3))
    w[baked], error[baked] = fit.w[row[baked]], fit.error[row[baked]]
    direction = normalize(fit.bent[row[baked]])
    bent[baked] = np.where(direction.any(axis=1, keepdims=True), direction, usual[row[baked]])
    finished = time.perf_counter()
    return Bake(
        w=w,
        error=error,
        bent_normals=bent,
        flags=flags,
        rays=int(traced[TRACED]),
        rays_skipped={
            "duplicate": samples * int(np.count_nonzero(baked) - points),
            "no_normal": samples * int(np.count_nonzero(flags & (Flag.UNREFERENCED | Flag.DEGENERATE))),
            "not_wanted": samples * int(np.count_nonzero(~wanted)),
            "below_face": int(traced[BELOW]),
        },
        skip_seconds={},
        rmse=float(np.sqrt(np.sum(error**2) / max(int(np.count_nonzero(wanted)), 1))),
        seconds={"build": built, "bake": finished - start - built},
        mu=mu,
    )
