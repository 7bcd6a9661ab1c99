"""Bake obscurance: mesh in, w(p) for every vertex out."""

from __future__ import annotations

import time
import warnings
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from raytrace.mesh.mesh import Mesh
from raytrace.mesh.normals import normalize
from raytrace.mesh.placement import Placement
from raytrace.sampling.hash import seed_key
from raytrace.system.memory import check_memory
from raytrace.system.threads import thread_count

from .adaptive.fixed_samples import place_samples, rays_of_corners, sampled, with_corners
from .adaptive.probes import derive
from .adaptive.tolerance import Estimate, ToleranceWarning, estimate_to
from .arguments import check_arguments, falloff_of, mesh_of
from .denoise.one_ring import Neighbours
from .falloff import Falloff, Mu
from .gather.receivers import Flag, Normals, Receivers, find_receivers
from .interior.inside import Fill, Hidden, hidden_points, inside_other_parts
from .memory import vertex_bytes
from .skip.horizon import Horizons
from .trace.checkpoint import Checkpoint
from .trace.tracer import Progress, Tracer

DEFAULT_SAMPLES = 256
_MOST_FOR_TOLERANCE = 1 << 14


@dataclass(frozen=True, eq=False)
class Bake:
    """What a bake makes, one row a vertex in the mesh's own order.

    Attributes:
        w: float64 (n,), obscurance in [0, 1]; 1 is open. Vertices without a usable normal get 1.
        error: float64 (n,), estimated standard error of w.
        bent_normals: float64 (n, 3), unit mean direction of what is open; the normal where nothing is, 0 where none.
        flags: uint8 (n,), `ao.Flag`s.
        rays: number of rays traced, by an interrupted run too.
        rays_skipped: rays not traced, by reason.
        rmse: estimated root mean square of w's sampling error over the vertices asked for.
        skip_seconds: what finding rays to skip took, by reason, on all threads together; where it is nothing to speak
            of it is left out.
        seconds: `build` (Embree scene) and `bake` (everything else that makes w).
        mu: the falloff used, in mesh units.
    """

    w: npt.NDArray[np.float64]
    error: npt.NDArray[np.float64]
    bent_normals: npt.NDArray[np.float64]
    flags: npt.NDArray[np.uint8]
    rays: int
    rays_skipped: dict[str, int]
    skip_seconds: dict[str, float] = field(compare=False)
    rmse: float
    seconds: dict[str, float] = field(compare=False)
    mu: Mu

    def __repr__(self) -> str:
        range_ = f"w from {self.w.min():.3f} to {self.w.max():.3f}"
        return f"<Bake of {len(self.w):,} vertices: {range_}, RMSE {self.rmse:.2g}, {self.rays:,} rays>"

    @property
    def flagged(self) -> dict[str, int]:
        """Number of vertices that carry each `Flag`, by its name in lower case."""
        return {flag.name.lower(): int(np.count_nonzero(self.flags & flag)) for flag in Flag if flag.name}


def bake(
    mesh: Mesh | Any,
    falloff: Falloff | str | None = None,
    samples: int | None = None,
    seed: int = 0,
    threads: int | None = None,
    normals: Normals = "angle",
    progress: Progress | None = None,
    only: npt.NDArray[np.bool_] | None = None,
    tolerance: float | None = None,
    reconstruct: bool = True,
    hidden: Hidden = "auto",
    skip: bool = True,
    checkpoint: Checkpoint | None = None,
) -> Bake:
    """Obscurance w(p) = (1/π) ∫ μ(d) cosθ dω (12.71) at every vertex of `mesh`.

    Args:
        mesh: the surface, a `raytrace.Mesh` or anything with `vertices` and `faces`, a `trimesh.Trimesh` for instance;
            both sides of every face occlude.
        falloff: μ, `Binary(…)` or `Exponential(…)`, or "binary" or "exponential"; by default `Exponential()`.
        samples: rays a vertex, 1 to 2²⁰, by default 256; with a tolerance the most, by default 2¹⁴.
        seed: 0 to 2⁶⁴ − 1. The same seed gives the same bits for any number of threads.
        threads: None for all cores.
        normals: hemisphere axes: incident faces weighted by "angle", "area" or "equal", or "file", the mesh's own.
        progress: called with (rays traced, rays in all) as the work goes on.
        only: bool (n,), the vertices whose w is wanted; the others get 1. None: all. Turns reconstruction off;
            hidden ones are filled from those wanted.
        tolerance: root mean square error of w to bake to, 1e-5 to 1: rays and baked vertices are chosen to meet it, the
            other vertices are predicted from their neighbours. None: every vertex gets `samples` rays.
        reconstruct: whether a vertex's estimate is drawn towards its neighbours' by what they are worth.
        hidden: "auto": vertices inside a closed part of the mesh that is not their own are flagged, and get the values
            of the nearest that are not. "ignore": both sides of faces are surface. "mark": faces bound solids, and
            vertices that mostly see backs, being inside one, are flagged. "fill": besides, they are filled.
        skip: whether rays that certainly meet nothing are left out where telling them costs less than tracing them;
            the bits are the same.
        checkpoint: keeps what is traced, and is asked for what an interrupted run traced; the bits are the same.

    Raises:
        OptionError: an argument is out of range.
        InputError, OutputError: `checkpoint` cannot be used (`Checkpoint`).
        MeshError: `mesh` is none, or `normals="file"` for a mesh without normals.
        MemoryLimitError: the bake would not fit into memory.
        EmbreeError: Embree failed, out of memory for instance.

    Warns:
        ToleranceWarning: the `tolerance` is not met, with too few `samples` allowed for instance.
    """
    most = (DEFAULT_SAMPLES if tolerance is None else _MOST_FOR_TOLERANCE) if samples is None else samples
    check_arguments(most, seed, threads, tolerance, reconstruct, hidden, only)
    only = None if only is None else np.asarray(only)
    workers = thread_count(threads)
    mesh = mesh_of(mesh)
    mu = falloff_of(falloff).resolve(mesh.radius)
    check_memory(mesh.source, vertex_bytes(len(mesh.vertices), len(mesh.faces), most), describe_work(mesh))

    start = time.perf_counter()
    placement = Placement.of(mesh)
    receivers = find_receivers(mesh, placement, normals)
    crowd = len(receivers.points)  # before `only`, so that it changes no direction
    horizons = Horizons(placement, receivers, mu) if skip else None
    if only is not None:
        receivers = receivers.only(only)

    if checkpoint:
        checkpoint.begin(placement, receivers, mu, crowd, most, tolerance, seed, normals, reconstruct)
    tracer = Tracer(receivers.scene, placement, mu, workers, crowd, horizons, progress, checkpoint)
    key = seed_key(seed)
    vertex = receivers.of_vertex
    baked = vertex >= 0
    inside = _inside(receivers, placement, hidden, crowd, workers)
    receivers.flags[baked] |= np.where(inside[vertex[baked]], Flag.HIDDEN, 0).astype(np.uint8)
    if inside.any() and hidden != "mark":
        filling = Fill.of(receivers.points, _neighbours(receivers, workers), inside)
        untraced = ~filling.traced
        traced = receivers.only(baked & ~untraced[vertex])
        estimate = _estimate(tracer, traced, tolerance, most, key, reconstruct and only is None)
        known = np.column_stack([estimate.rows, estimate.variance])
        if tolerance is not None:  # errors at the edge of what is hidden stand for many
            edge = filling.sources
            edge[traced.corners.rows] = False
            again = sampled(tracer, traced.points[edge], None, min(4 * estimate.samples, most), derive(key, 6))
            known[edge] = np.column_stack([again.rows, again.variance])
        rows = filling.extrapolate(known)
        estimate = replace(estimate, rows=rows[:, :4], variance=rows[:, 4])
    else:
        untraced = np.zeros(len(receivers.points), np.bool_)
        estimate = _estimate(tracer, receivers, tolerance, most, key, reconstruct and only is None)
    wanted: npt.NDArray[np.bool_] = np.ones(len(vertex), np.bool_) if only is None else only
    w, error, bent = np.ones(len(vertex)), np.zeros(len(vertex)), np.zeros((len(vertex), 3))
    w[baked] = np.clip(estimate.rows[vertex[baked], 0], 0.0, 1.0)
    error[baked] = np.sqrt(estimate.variance[vertex[baked]])
    bent[baked] = _directions(estimate.rows[:, 1:], receivers.points.normals)[vertex[baked]]
    rmse = float(np.sqrt(np.sum(error**2) / max(int(np.count_nonzero(wanted)), 1)))
    if tolerance is not None and rmse > tolerance:
        reason = f": {most:,} rays a vertex were allowed" if estimate.samples >= most else ""
        text = f"tolerance {tolerance:g} is not met, the estimated RMSE is {rmse:.3g}{reason}"
        warnings.warn(text, ToleranceWarning, stacklevel=2)
    finished = time.perf_counter()
    return Bake(
        w=w,
        error=error,
        bent_normals=bent,
        flags=receivers.flags,
        rays=tracer.rays - tracer.skipped,
        rays_skipped={
            "open": tracer.skipped,
            "duplicate": estimate.samples * int(np.count_nonzero(baked) - len(receivers.points)),
            "no_normal": estimate.samples
            * int(np.count_nonzero(receivers.flags & (Flag.UNREFERENCED | Flag.DEGENERATE))),
            "not_wanted": estimate.samples * int(np.count_nonzero(~wanted)),
            "predicted": (estimate.samples - estimate.screened) * estimate.predicted,
            "hidden": estimate.samples * int(np.count_nonzero(untraced)),
        },
        skip_seconds={"open": sum(horizons.seconds)} if horizons else {},
        rmse=rmse,
        seconds={"build": receivers.scene.seconds, "bake": finished - start - receivers.scene.seconds},
        mu=mu,
    )


def describe_work(mesh: Mesh) -> str:
    """What a bake does, for messages about memory."""
    return f"to bake {len(mesh.vertices):,} vertices and {len(mesh.faces):,} faces"


def _inside(
    receivers: Receivers, placement: Placement, hidden: Hidden, crowd: int, threads: int
) -> npt.NDArray[np.bool_]:
    """Which points (k,) are inside a solid, as `hidden` has it."""
    count, faces, reach = len(receivers.points), len(receivers.faces), placement.diagonal
    if hidden == "ignore":
        return np.zeros(count, np.bool_)
    if hidden == "auto":
        return inside_other_parts(receivers, placement.vertices, reach, crowd, threads)
    any_back, nobody = np.zeros(faces, np.int64), np.full(count, -1)
    return hidden_points(receivers.scene, receivers.points, reach, crowd, threads, any_back, nobody)


def _neighbours(receivers: Receivers, threads: int) -> Neighbours:
    return Neighbours.of(receivers.of_vertex[receivers.faces], receivers.points.normals, threads)


def _estimate(
    tracer: Tracer, receivers: Receivers, tolerance: float | None, most: int, key: np.uint32, drawn: bool
) -> Estimate:
    """Estimates at all points: with `most` rays each, or as many as a tolerance needs; `drawn` to neighbours or not."""
    ordinary, rows = receivers.ordinary()
    corners, places = receivers.corners, receivers.corners.places
    if tolerance is None or not len(receivers.points):
        samples = place_samples(most, False)
        tracer.later = rays_of_corners(corners, samples)
        joined = _neighbours(ordinary, tracer.threads) if drawn else None
        estimate = sampled(tracer, ordinary.points, joined, most, key)
    elif len(rows):
        estimate = estimate_to(tracer, ordinary.points, _neighbours(ordinary, tracer.threads), tolerance, most, key)
        samples = place_samples(estimate.samples, True)
    else:  # none to plan rays by but places, of which the mean of some 18 is asked for
        alone = Neighbours.of(np.zeros((0, 3), np.int64), places.normals, tracer.threads)
        found = estimate_to(tracer, places, alone, min(2 * tolerance, 1.0), most, key)
        nothing = Estimate(np.zeros((0, 4)), np.zeros(0), found.samples, 0)
        return with_corners(nothing, rows, found, corners)
    if not len(corners):
        return estimate
    tracer.later = 0
    return with_corners(estimate, rows, sampled(tracer, places, None, samples, key), corners)


def _directions(means: npt.NDArray[np.float64], normals: npt.NDArray[np.float32]) -> npt.NDArray[np.float64]:
    told = np.einsum("ij,ij->i", means, means) > 1e-18
    return np.where(told[:, None], normalize(means), normals)
