"""References, kept in the user's cache folder: they take longer than most bakes."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence

import numpy as np

from ao.falloff import Mu
from raytrace.atomic import atomic_write
from raytrace.jit import user_cache
from scenes.reference import Reference, reference

from .programs import Task


def cached_reference(task: Task, mus: Sequence[Mu], rays: int, vertices: int) -> Reference:
    """`scenes.reference.reference`, from the cache if exactly this one has been made before.

    The key covers the points, normals and ray origins, so a change of what is baked makes another reference.
    """
    folder = user_cache() / "references"
    folder.mkdir(exist_ok=True)
    path = folder / f"{_key(task, mus, rays, vertices)}.npz"
    if path.exists():
        with np.load(path) as arrays:
            return Reference(arrays["vertices"], arrays["w"])
    made = reference(task.mesh, mus, rays, vertices)
    with atomic_write(path) as file:
        np.savez(file, vertices=made.vertices, w=made.w)
    return made


def _key(task: Task, mus: Sequence[Mu], rays: int, vertices: int) -> str:
    digest = hashlib.sha256(f"{mus} {rays} {vertices} {task.scale}".encode())
    with np.load(task.arrays) as arrays:
        for name in sorted(arrays.files):
            digest.update(np.ascontiguousarray(arrays[name]).data)
    return digest.hexdigest()[:24]
