"""Damage that meshes suffer in practice: noise, folds, decimation, holes, doubles, seams."""

from __future__ import annotations

from collections.abc import Callable

import fast_simplification
import numpy as np

from obscurance.raytrace.types import Float64s, Int64s
from obscurance.scenes.geometry.polyhedra import RawMesh, join

from .dense import Rng, extent, field, log_uniform, places, used, welded

Damage = Callable[[RawMesh, Rng], RawMesh]


def edge_length(part: RawMesh) -> float:
    """The mean length of an edge."""
    a, b, c = part[0][part[1]].transpose(1, 0, 2)
    return float(np.mean([np.linalg.norm(side, axis=1).mean() for side in (a - b, b - c, c - a)]))


def noisy(part: RawMesh, rng: Rng) -> RawMesh:
    """Every vertex off by 3 to 40 % of an edge."""
    part = welded(part)
    return part[0] + log_uniform(rng, 0.03, 0.4) * edge_length(part) * rng.normal(size=part[0].shape), part[1]


def folded(part: RawMesh, rng: Rng) -> RawMesh:
    """One vertex in 200 to one in 5 moved by an edge or two, so that faces lie over their neighbours."""
    vertices, faces = welded(part)
    which = rng.random(len(vertices)) < log_uniform(rng, 0.005, 0.2)
    shift = rng.uniform(0.5, 2.0) * edge_length((vertices, faces)) * rng.normal(size=vertices.shape)
    normals = vertex_normals((vertices, faces))
    shift -= rng.uniform(0.5, 1.0) * np.einsum("ij,ij->i", shift, normals)[:, None] * normals
    return vertices + np.where(which[:, None], shift, 0.0), faces


def decimated(part: RawMesh, rng: Rng) -> RawMesh:
    """Noise, then half to a sixth of the faces are left by quadric edge collapse, as fast as it goes."""
    part = noisy(part, rng)
    points, faces = fast_simplification.simplify(
        part[0].astype(np.float32),
        part[1].astype(np.int32),
        target_reduction=1 - 1 / DECIMATED,
        agg=float(rng.uniform(3, 10)),
    )
    return used((points.astype(np.float64), faces.astype(np.int64)))


DECIMATED = 3  # by what `decimated` divides the number of vertices


def cut(part: RawMesh, rng: Rng) -> RawMesh:
    """Holes, some of them tiny, and now and then everything on one side of a plane gone."""
    vertices, faces = part
    holes, speckled, side = rng.integers(3, 40), rng.choice([0.0, 0.003]), rng.normal(size=3)
    gone = rng.choice([0.0, rng.uniform(0.1, 0.5)])
    middle, size = vertices[faces].mean(axis=1), extent(part)
    kept = middle @ side >= np.quantile(middle @ side, gone)
    for _ in range(holes):
        radius, about = log_uniform(rng, 0.003, 0.12) * size, middle[int(rng.random() * len(middle))]
        kept &= np.linalg.norm(middle - about, axis=1) > radius
    kept &= rng.random(len(faces)) >= speckled
    return used((vertices, faces[kept])) if kept.any() else part


def doubled(part: RawMesh, rng: Rng) -> RawMesh:
    """Faces twice; or all of it twice, in one place, hardly apart, or as a second skin, perhaps turned inside out."""
    vertices, faces = part
    kind = rng.integers(3)
    if kind == 0:
        again = faces[rng.random(len(faces)) < rng.uniform(0.1, 1.0)]
        return vertices, np.concatenate([faces, again[:, ::-1] if rng.random() < 0.5 else again])
    gap = 0.0 if kind == 1 and rng.random() < 0.5 else log_uniform(rng, 1e-7, 1e-2) * extent(part)
    shift = gap * (vertex_normals(part) if kind == 2 else rng.normal(size=3))
    return join([part, (vertices + shift, faces[:, ::-1] if rng.random() < 0.5 else faces)])


def unwelded(part: RawMesh, rng: Rng) -> RawMesh:
    """Faces with corners of their own, all or some; perhaps a hair apart, perhaps wound at random."""
    vertices, faces = part
    share, apart, wound = rng.choice([0.2, 1.0]), rng.choice([0.0, log_uniform(rng, 1e-6, 3e-2)]), rng.random() < 0.3
    loose = rng.random(len(faces)) < share
    corners = vertices[faces[loose]].reshape(-1, 3)
    corners = corners + apart * edge_length(part) * rng.normal(size=corners.shape)
    own = len(vertices) + np.arange(len(corners)).reshape(-1, 3)
    faces = np.concatenate([faces[~loose], own])
    if wound:
        faces = np.where(rng.random(len(faces))[:, None] < 0.5, faces, faces[:, ::-1])
    return used((np.concatenate([vertices, corners]), faces))


def _area_normal(vertices: Float64s, a: Int64s, b: Int64s, c: Int64s) -> Float64s:
    return np.cross(vertices[b] - vertices[a], vertices[c] - vertices[a])


def vertex_normals(part: RawMesh) -> Float64s:
    """Unit normals (n, 3) of the vertices, zero where there is none."""
    vertices, faces = part
    normals = np.zeros_like(vertices)
    across = _area_normal(vertices, *faces.T)
    for corner in faces.T:
        np.add.at(normals, corner, across)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.divide(normals, length, out=np.zeros_like(normals), where=length > 0)


def uneven(part: RawMesh, rng: Rng) -> RawMesh:
    """Collapsed here and there: some regions keep a tenth of their vertices, drawn together to cells of a grid."""
    vertices, faces = welded(part)
    cell = rng.uniform(2.0, 5.0) * edge_length((vertices, faces))
    coarse = field(rng, 0.5, 2.0)(vertices / extent(part)) > rng.uniform(-0.5, 0.5)
    grid = np.floor(vertices / cell)
    _, group = np.unique(grid, axis=0, return_inverse=True)
    group = np.where(coarse, group.reshape(-1), group.max() + 1 + np.arange(len(vertices)))
    _, group = np.unique(group, return_inverse=True)
    count = np.bincount(group)
    centre = np.stack([np.bincount(group, axis) / count for axis in vertices.T], axis=-1)
    return used((centre, group[faces]))


DAMAGES: dict[str, tuple[Damage, float]] = {  # and how many times as many vertices each begins with
    "noisy": (noisy, 1.0),
    "folded": (folded, 1.0),
    "decimated": (decimated, 1.1 * DECIMATED),
    "clustered": (uneven, 2.0),
    "cut": (cut, 1.8),
    "doubled": (doubled, 1.0),
    "unwelded": (unwelded, 0.5),
}


def damaged(damage: Damage, dense: Callable[[int], RawMesh], size: int, surplus: float, rng: Rng) -> RawMesh:
    """A damaged part that has `size` to 1.6·`size` places of vertices, if any number that it began with gives that.

    Args: dense: a part of any number of places. surplus: times `size`, how many it had better begin with.
    """
    state, best = rng.bit_generator.state, None
    for attempt in range(20):
        rng.bit_generator.state = state
        part = damage(dense(max(int(surplus * size), 100)), rng)
        count = places(part)
        if best is None or (places(best) < size and count > places(best)) or size <= count < places(best):
            best = part
        if size <= count <= 1.6 * size or (attempt >= 4 and places(best) >= size):
            break
        surplus *= 1.5 if attempt >= 4 else 1.25 * size / max(count, size // 8)
    assert best is not None
    return best
