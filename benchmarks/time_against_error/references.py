"""References, kept in the user's cache folder: they take longer than most bakes.

Only well-posed vertices count. Where a vertex lies exactly in the plane of a face that it is no corner of, as at
the foot of a wall that stands on a floor of its own, w jumps between one side of that face and the other, and
programs may differ in which side they take: Embree's robust queries, ours among them, count a hit at distance 0, its
faster ones do not. Such vertices are found by moving the ray origins by less than they stand off the surface.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from benchmarks import ROOT
from obscurance.ao.mu import Mu
from obscurance.ao.points.receivers import find_receivers
from obscurance.raytrace.mesh.mesh import Mesh
from obscurance.raytrace.mesh.placement import ULP, Placement
from obscurance.raytrace.system.atomic import atomic_write
from obscurance.scenes.validation.reference import Reference, reference, trace

from .programs import Task

MOVED = 8 * ULP  # half the least height of a ray origin above the faces that meet at its vertex
JUMP, JUMP_RAYS = 0.05, 1024


def cached_reference(task: Task, mus: Sequence[Mu], rays: int, vertices: int) -> Reference:
    """`scenes.validation.reference` at well-posed vertices, from the cache if exactly this one has been made before.

    The key covers the points, normals and ray origins, so a change of what is baked makes another reference.
    """
    folder = ROOT / "build" / "references"
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{_key(task, mus, rays, vertices)}.npz"
    if path.exists():
        with np.load(path) as arrays:
            return Reference(arrays["vertices"], arrays["w"])
    made = reference(task.mesh, mus, rays, vertices)
    kept = well_posed(task.mesh, made.vertices, mus)
    made = Reference(made.vertices[kept], made.w[:, kept])
    with atomic_write(path) as file:
        np.savez(file, vertices=made.vertices, w=made.w)
    return made


def well_posed(
    mesh: Mesh, vertices: npt.NDArray[np.int64], mus: Sequence[Mu], distance: float = MOVED
) -> npt.NDArray[np.bool_]:
    """Whether w at each of `vertices` (k,) stays within `JUMP` as its ray origin moves to four sides by `distance`.

    Vertices without a hemisphere of their own (`ao.points.corners`) are not: other programs cannot be given any.
    """
    placement = Placement.of(mesh)
    receivers = find_receivers(mesh, placement)
    points = receivers.points[receivers.of_vertex[vertices]]
    before = trace(receivers.embree(), placement, points, mus, JUMP_RAYS)
    helper = np.where(np.abs(points.normals[:, :1]) < 0.5, [[1.0, 0, 0]], [[0, 1.0, 0]])
    along = np.cross(points.normals, helper)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    steady = ~np.isin(receivers.of_vertex[vertices], receivers.corners.point_rows)
    for side in (along, -along, np.cross(points.normals, along), -np.cross(points.normals, along)):
        moved = replace(points, origins=(points.origins + distance * side).astype(np.float32))
        steady &= (np.abs(trace(receivers.embree(), placement, moved, mus, JUMP_RAYS) - before) < JUMP).all(axis=0)
    return steady


def _key(task: Task, mus: Sequence[Mu], rays: int, vertices: int) -> str:
    digest = hashlib.sha256(f"{mus} {rays} {vertices} {task.scale} {MOVED} {JUMP}".encode())
    with np.load(task.arrays) as arrays:
        for name in sorted(arrays.files):
            digest.update(np.ascontiguousarray(arrays[name]).data)
    return digest.hexdigest()[:24]
