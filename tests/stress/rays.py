"""Self-intersections at vertices of convex meshes; rays that leak out of closed ones, from vertices and from inside."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from obscurance.ao import Binary, bake
from obscurance.raytrace.embree import TriangleScene, intersect
from obscurance.raytrace.mesh.placement import Placement
from obscurance.raytrace.mesh.warnings import coarseness
from obscurance.raytrace.types import Float64s
from obscurance.scenes.geometry.polyhedra import RawMesh

from .line import LEAKS, MILLION, SELF_HITS, Line, undefined
from .pose import Pose, poses
from .solids import FLAT, TORN, closed, convex, inward

_SINGLE = [Pose(scale, offset, 9, True) for scale, offset in ((1.0, 10.0), (1e-6, 100.0), (1e6, 1000.0))]


def self_hits(long: bool) -> Iterator[Line]:
    """Convex meshes, where w is exactly 1: a line for each, over all poses."""
    samples = _samples(long)
    for name, part in convex().items():
        single = [] if name in FLAT else _SINGLE
        yield _share(name, part, 1.0, "self-hits/M", SELF_HITS, poses(long) + single, samples)


def leaks(long: bool) -> Iterator[Line]:
    """Closed meshes seen from inside: a line for each, over all poses, then lines of random rays."""
    for name, part in closed().items():
        yield leak(name, part, poses(long) + ([] if name in TORN else _SINGLE), _samples(long))
    count = 4_000_000 if long else 200_000
    for name in ("icosphere", "torus", "cube with T-junctions", "slab 1000:1000:1"):
        yield _random_rays(name, closed()[name], count)


def _samples(long: bool) -> int:
    """Rays a vertex."""
    return 256 if long else 128


def leak(name: str, part: RawMesh, where: list[Pose], samples: int = 128) -> Line:
    """A closed mesh seen from inside, where the binary w is exactly 0."""
    return _share(f"{name}, inside", inward(part), 0.0, "leaks/M", LEAKS, where, samples)


def _share(
    name: str, part: RawMesh, truth: float, quantity: str, allowed: float, where: list[Pose], samples: int
) -> Line:
    """Rays that make w differ from `truth`, a million, over the poses; stored as float32 where that can hold it."""
    wrong = rays = missing = used = 0
    for pose in where:
        mesh = pose.mesh(part)
        if pose.single and coarseness(mesh).vertices:
            continue
        baked = bake(mesh, Binary(), samples=samples, denoise=False)
        used += 1
        rays += samples * len(baked.w)
        wrong += round(float(np.abs(baked.w - truth).sum()) * samples)
        missing += undefined(baked.w, baked.error, baked.bent_normals)
    return Line(name, f"{used} poses, {rays / MILLION:.0f} M rays", quantity, wrong / rays * MILLION, allowed, missing)


def _random_rays(name: str, part: RawMesh, count: int) -> Line:
    """Random rays from random places inside, two turned poses of them."""
    escaped = 0
    for turn in (1, 2):
        pose = Pose(1.0, 1e3, turn)
        mesh = pose.mesh(part)
        placement = Placement.of(mesh)
        rng = np.random.default_rng(turn)
        origins = pose.directions(_inside(name, rng, count // 2)) * placement.scale
        directions = rng.normal(size=(count // 2, 3))
        scene = TriangleScene(placement.vertices, mesh.faces)
        escaped += count // 2 - int((intersect(scene, origins, directions).face >= 0).sum())
    return Line(
        f"{name}, rays from inside",
        f"2 poses, {count / MILLION:.0f} M rays",
        "leaks/M",
        escaped / count * MILLION,
        LEAKS,
    )


def _inside(name: str, rng: np.random.Generator, count: int) -> Float64s:
    """Places inside a mesh of `closed`, from the centre of its bounding box."""
    if name == "torus":
        angle = rng.uniform(0, 2 * np.pi, count)
        return np.stack([np.cos(angle), np.sin(angle), rng.uniform(-0.3, 0.3, count)], axis=-1)
    reach = {"icosphere": (0.55,) * 3, "slab 1000:1000:1": (0.499, 0.499, 0.000499)}.get(name, (0.499,) * 3)
    return rng.uniform(-1, 1, (count, 3)) * reach
