"""Cases of bakes to a tolerance on random meshes, and their runs."""

from __future__ import annotations

import zlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from obscurance.ao import Binary, Exponential, Falloff, bake
from obscurance.raytrace.mesh.mesh import Mesh

from .comparison import Figures, compare_with_truth, find_truth
from .families import FAMILIES, LARGE, SMALL

TOLERANCES = (0.02, 0.01, 0.005)
TRUTH = 4096
_LIMIT = 0.1  # of the bounding box's diagonal
_APART = 1 << 32  # between the seeds of the bakes and those of the truths
_DRAWS, _SEEDS = 2, 2  # of a family, and bakes of each, in the long form


@dataclass(frozen=True)
class Case:
    """One bake.

    Attributes:
        family, seed: the mesh: `draw(family, seed, size)`. size: places of vertices asked for.
        falloff: number of the falloff, 0 to 3, in `falloffs`. tolerance: asked for. again: number of the bake.
    """

    family: str
    seed: int
    size: int
    falloff: int
    tolerance: float
    again: int = 0


@dataclass(frozen=True)
class Outcome:
    """The result of a case. Attributes: kind: the falloff in words. figures: see `Figures`."""

    case: Case
    kind: str
    figures: Figures


def falloffs(mesh: Mesh) -> dict[str, Falloff]:
    """Binary and exponential with its default rate, without a limit and up to a tenth of the diagonal, by name."""
    low, high = mesh.bounds
    limit = _LIMIT * float(np.linalg.norm(high - low))
    return {
        "binary": Binary(),
        "exponential": Exponential(),
        "binary, 10%": Binary(limit),
        "exponential, 10%": Exponential(max_distance=limit),
    }


def draw(family: str, seed: int, size: int) -> Mesh:
    """The mesh that `family` makes of `seed`, whatever other families are drawn."""
    return FAMILIES[family](np.random.default_rng([seed, zlib.crc32(family.encode())]), size)


def short_cases(seed: int, count: int) -> list[Case]:
    """A small mesh of each of `count` of the families, each with another falloff and tolerance."""
    rng = np.random.default_rng(seed)
    chosen = rng.permutation(list(FAMILIES))[:count].tolist()
    kinds = rng.permutation(4 * len(TOLERANCES))
    mixed = [kinds[k % len(kinds)] for k in range(len(chosen))]
    return [Case(name, seed, SMALL, int(k) % 4, TOLERANCES[k // 4]) for name, k in zip(chosen, mixed, strict=True)]


def long_cases(name: str, seed: int) -> list[Case]:
    """Meshes of one family, drawn small and large, with each falloff and tolerance, several bakes of each."""
    return [
        Case(name, seed + number, size, falloff, tolerance, again)
        for number, size in zip(range(_DRAWS), (SMALL, LARGE), strict=True)
        for falloff in range(4)
        for tolerance in TOLERANCES
        for again in range(_SEEDS)
    ]


def run_cases(cases: Iterable[Case], samples: int = TRUTH) -> Iterator[Outcome]:
    """Bake every case and compare it with the truth. The truth is kept from one case to the next where they share it.

    Args:
        samples: rays a vertex of the truth, at least 2.
    """
    drawn: tuple[object, ...] = ()
    known: tuple[object, ...] = ()
    for case in cases:
        if drawn != (case.family, case.seed, case.size):
            drawn = case.family, case.seed, case.size
            mesh = draw(case.family, case.seed, case.size)
        kind, falloff = list(falloffs(mesh).items())[case.falloff]
        if known != (*drawn, kind):
            known = (*drawn, kind)
            truth = find_truth(mesh, falloff, samples, case.seed % _APART + _APART)
        seed = (case.seed + case.again) % _APART
        baked = bake(mesh, falloff, seed=seed, tolerance=case.tolerance)
        yield Outcome(case, kind, compare_with_truth(baked, truth))
