"""Bake obscurance: mesh in, w(p) for every vertex out."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from raytrace.embree import TriangleScene, new_packet
from raytrace.errors import OptionError
from raytrace.mesh import Mesh
from raytrace.parallel import run_blocks, thread_count
from raytrace.placement import Placement
from raytrace.sampling import mix, seed_key

from .falloff import Exponential, Falloff, Mu
from .hemisphere import DirectionTable, gather
from .receivers import Flag, Normals, Points, find_receivers

MAX_SAMPLES = 1 << 20
_BLOCK_RAYS = 1 << 19
_CALIBRATION_SHARE = 32
_CALIBRATION_LEAST = 256

Progress = Callable[[int, int], None]


@dataclass(frozen=True, eq=False)
class Bake:
    """What a bake makes, one row a vertex in the mesh's own order.

    Attributes:
        w: float64 (n,), obscurance in [0, 1]; 1 is open. Vertices without a usable normal get 1.
        error: float64 (n,), estimated standard error of w.
        bent_normals: float64 (n, 3), unit mean direction of what is open; the normal where nothing is, 0 where none.
        flags: uint8 (n,), `ao.Flag`s.
        rays: number of rays traced.
        rays_skipped: rays not traced, by reason.
        rmse: estimated root mean square of w's sampling error over the vertices asked for.
        seconds: `build` (Embree scene) and `bake` (everything else that makes w).
        mu: the falloff used, in mesh units.
    """

    w: npt.NDArray[np.float64]
    error: npt.NDArray[np.float64]
    bent_normals: npt.NDArray[np.float64]
    flags: npt.NDArray[np.uint8]
    rays: int
    rays_skipped: dict[str, int]
    rmse: float
    seconds: dict[str, float] = field(compare=False)
    mu: Mu

    @property
    def flagged(self) -> dict[str, int]:
        """Number of vertices that carry each `Flag`, by its name in lower case."""
        return {flag.name.lower(): int(np.count_nonzero(self.flags & flag)) for flag in Flag if flag.name}


def bake(
    mesh: Mesh | Any,
    falloff: Falloff | None = None,
    samples: int = 256,
    seed: int = 0,
    threads: int | None = None,
    normals: Normals = "angle",
    progress: Progress | None = None,
    only: npt.NDArray[np.bool_] | None = None,
) -> Bake:
    """Obscurance w(p) = (1/π) ∫ μ(d) cosθ dω (12.71) at every vertex of `mesh`.

    Args:
        mesh: the surface, a `raytrace.Mesh` or anything with `vertices` and `faces`, a `trimesh.Trimesh` for instance;
            both sides of every face occlude.
        falloff: μ, `Binary` or `Exponential`; by default `Exponential()`.
        samples: rays a vertex, 1 to 2²⁰. Powers of two are sampled best.
        seed: 0 to 2⁶⁴ − 1. The same seed gives the same bits for any number of threads.
        threads: None for all cores.
        normals: hemisphere axes: incident faces weighted by "angle", "area" or "equal", or "file", the mesh's own.
        progress: called with (rays traced, rays in all) as the work goes on.
        only: bool (n,), the vertices whose w is wanted; the others get 1. None: all.

    Raises:
        OptionError: an argument is out of range.
        MeshError: `normals="file"` for a mesh without normals.
        EmbreeError: Embree failed, out of memory for instance.
    """
    _check_whole("samples", samples, 1, MAX_SAMPLES)
    _check_whole("seed", seed, 0, 2**64 - 1)
    workers = thread_count(threads)
    mesh = mesh if isinstance(mesh, Mesh) else Mesh(mesh.vertices, mesh.faces)
    mu = (falloff or Exponential()).resolve(mesh.radius)

    start = time.perf_counter()
    placement = Placement.of(mesh)
    receivers = find_receivers(mesh, placement, normals)
    crowd = len(receivers.points)  # before `only`, so that it changes no direction
    if only is not None:
        receivers = receivers.only(only)
    prepared = time.perf_counter()
    scene = TriangleScene(placement.vertices, receivers.faces)
    built = time.perf_counter()

    points = receivers.points
    calibration = _calibration_subset(len(points))
    rays = samples * (len(points) + len(calibration))
    done = 0

    def advance(gathered: int) -> None:
        nonlocal done
        done += gathered * samples
        if progress:
            progress(done, rays)

    def trace(which: Points, key: np.uint32) -> npt.NDArray[np.float64]:
        table = DirectionTable.make(samples, crowd, key)
        return _gather_all(scene, placement, which, mu, table, workers, advance)

    key = seed_key(seed)
    estimate = trace(points, key)
    again = trace(points[calibration], mix([key ^ np.uint32(0xA5A5A5A5)])[0])
    variance = _variance(estimate, again, calibration, samples)

    vertex = receivers.of_vertex
    baked = vertex >= 0
    wanted: npt.NDArray[np.bool_] = np.ones(len(vertex), np.bool_) if only is None else only
    w, error, bent = np.ones(len(vertex)), np.zeros(len(vertex)), np.zeros((len(vertex), 3))
    w[baked], error[baked] = estimate[vertex[baked], 0], np.sqrt(variance[vertex[baked]])
    bent[baked] = _directions(estimate[:, 2:], points.normals)[vertex[baked]]
    finished = time.perf_counter()
    return Bake(
        w=w,
        error=error,
        bent_normals=bent,
        flags=receivers.flags,
        rays=rays,
        rays_skipped={
            "duplicate": samples * int(np.count_nonzero(baked) - len(points)),
            "no_normal": samples * int(np.count_nonzero(receivers.flags & (Flag.UNREFERENCED | Flag.DEGENERATE))),
            "not_wanted": samples * int(np.count_nonzero(~wanted)),
        },
        rmse=float(np.sqrt(np.sum(error**2) / max(int(np.count_nonzero(wanted)), 1))),
        seconds={"build": built - prepared, "bake": finished - built + prepared - start},
        mu=mu,
    )


def _check_whole(name: str, value: object, low: int, high: int) -> None:
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or not low <= value <= high:
        raise OptionError(name, f"a whole number from {low} to {high}", value)


def _gather_all(
    scene: TriangleScene,
    placement: Placement,
    points: Points,
    mu: Mu,
    table: DirectionTable,
    threads: int,
    advance: Callable[[int], None],
) -> npt.NDArray[np.float64]:
    """`gather` over all points: float64 (k, 5)."""
    samples = table.batches.shape[1]
    out = np.empty((len(points), 5))
    tau = (mu.tau or 0.0) / placement.scale
    limit = mu.max_distance * placement.scale
    reach = min(limit, placement.diagonal)

    def work(first: int, last: int) -> None:
        packet, valid = new_packet()
        some = points[first:last]
        gather(
            scene.handle, packet, valid, some.origins, some.normals, some.numbers,
            table.directions, table.batches, table.mean, table.key, tau, reach, limit, out[first:last],
        )  # fmt: skip

    run_blocks(len(out), max(_BLOCK_RAYS // samples, 1), work, threads, advance)
    return out


def _calibration_subset(count: int) -> npt.NDArray[np.int64]:
    """Evenly spread points to bake a second time with independent scrambles: one in 32, 256 at least."""
    wanted = min(count, max(_CALIBRATION_LEAST, count // _CALIBRATION_SHARE))
    return np.arange(wanted) * count // max(wanted, 1)


def _variance(
    estimate: npt.NDArray[np.float64],
    again: npt.NDArray[np.float64],
    calibration: npt.NDArray[np.int64],
    samples: int,
) -> npt.NDArray[np.float64]:
    """Variance (k,) of each estimate.

    Half the squared difference of two independent scrambles is an unbiased variance. Its mean over the calibration
    points fixes the level; each point's spread between batches, drawn towards the mean by one degree of freedom so
    that lucky agreement never reads as certainty, tells how the level is shared out.
    """
    spread = estimate[:, 1]
    if not len(calibration):
        return spread
    level = float(np.mean((estimate[calibration, 0] - again[:, 0]) ** 2)) / 2
    typical = float(np.mean(spread[calibration]))
    if typical == 0:
        return np.full(len(spread), level)
    freedom = min(8, samples) - 1
    return level / typical * (freedom * spread + typical) / (freedom + 1)


def _directions(means: npt.NDArray[np.float64], normals: npt.NDArray[np.float32]) -> npt.NDArray[np.float64]:
    length = np.linalg.norm(means, axis=1, keepdims=True)
    return np.where(length > 1e-9, means / np.where(length > 1e-9, length, 1.0), normals)
