"""Meshes with defects that must not change w: doubled, degenerate and mixed-up faces, T-junctions."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from meshes import torus

from obscurance.ao import Bake, Exponential, bake
from obscurance.raytrace.mesh.mesh import Mesh
from obscurance.scenes.geometry.polyhedra import RawMesh, join

from .line import Line, undefined
from .pose import Pose

SAMPLES = 512
NOISE = 1.25  # times the estimated error of the difference
_MU = Exponential(tau=2.0)


def defects(long: bool, bake: Callable[..., Bake] = bake) -> Iterator[Line]:
    """A line for each defect: the difference of w it makes, in units of its estimated error, root mean square."""
    turns = range(4, 24) if long else range(4, 7)
    part = torus(40, 20, 0.6)
    turned = {turn: Mesh(Pose(turn=turn).vertices(part[0]), part[1]) for turn in turns}
    plain = {turn: bake(mesh, _MU, SAMPLES) for turn, mesh in turned.items()}
    for name, change in _CHANGES.items():
        squares, missing = [], 0
        for turn in turns:
            order, changed = change((turned[turn].vertices, part[1]), np.random.default_rng(turn))
            other = bake(Mesh(*changed), _MU, SAMPLES, seed=turn)
            squares.append(_difference(plain[turn], other, order))
            missing += undefined(other.w, other.error, other.bent_normals)
        ratio = float(np.sqrt(np.mean(squares)))
        yield Line(name, f"{len(turns)} turns", "rms difference/error", ratio, NOISE, missing)


def _difference(plain: Bake, other: Bake, order: np.ndarray) -> float:
    """Mean square of w's difference over the mean square of its estimated error; vertex i became order[i]."""
    squared = (plain.w - other.w[order]) ** 2
    expected = plain.error**2 + other.error[order] ** 2
    return float(squared.mean() / expected.mean())


Change = Callable[[RawMesh, np.random.Generator], tuple[np.ndarray, RawMesh]]


def _vertices(part: RawMesh, rng: np.random.Generator) -> tuple[np.ndarray, RawMesh]:
    place = rng.permutation(len(part[0]))
    vertices = np.empty_like(part[0])
    vertices[place] = part[0]
    return place, (vertices, place[part[1]])


def _faces(part: RawMesh, rng: np.random.Generator) -> tuple[np.ndarray, RawMesh]:
    return _same(part), (part[0], np.roll(rng.permutation(part[1]), 1, axis=1))


def _doubled(part: RawMesh, rng: np.random.Generator) -> tuple[np.ndarray, RawMesh]:
    return _same(part), (part[0], np.concatenate([part[1], part[1]]))


def _shells(part: RawMesh, rng: np.random.Generator) -> tuple[np.ndarray, RawMesh]:
    """The whole mesh twice at the same place, vertices and all."""
    return _same(part), join([part, part])


def _loose(part: RawMesh, rng: np.random.Generator) -> tuple[np.ndarray, RawMesh]:
    """Every face with corners of its own."""
    first = np.zeros(len(part[0]), np.int64)
    first[part[1].ravel()] = np.arange(3 * len(part[1]))
    return first, (part[0][part[1]].reshape(-1, 3), np.arange(3 * len(part[1])).reshape(-1, 3))


def _no_area(part: RawMesh, rng: np.random.Generator) -> tuple[np.ndarray, RawMesh]:
    """Points and lines for faces, a third as many as there are."""
    some = part[1][rng.random(len(part[1])) < 1 / 3]
    return _same(part), (part[0], np.concatenate([part[1], some[:, [0, 0, 1]], some[:, [2, 2, 2]]]))


def _cut(part: RawMesh, rng: np.random.Generator) -> tuple[np.ndarray, RawMesh]:
    """Faces cut at an edge's middle on one side only: T-junctions."""
    which = rng.choice(len(part[1]), 60, replace=False)
    a, b, c = part[1][which].T
    middle = len(part[0]) + np.arange(len(which))
    vertices = np.concatenate([part[0], (part[0][a] + part[0][b]) / 2])
    rest = np.delete(part[1], which, axis=0)
    cut = np.concatenate([rest, np.stack([a, middle, c], -1), np.stack([middle, b, c], -1)])
    return _same(part), (vertices, cut)


def _same(part: RawMesh) -> np.ndarray:
    return np.arange(len(part[0]))


_CHANGES: dict[str, Change] = {
    "vertices in another order": _vertices,
    "faces in another order": _faces,
    "every face twice": _doubled,
    "the whole mesh twice": _shells,
    "every face with vertices of its own": _loose,
    "faces without area": _no_area,
    "T-junctions": _cut,
}
