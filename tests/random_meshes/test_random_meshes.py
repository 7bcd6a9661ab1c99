"""Baking to a tolerance on meshes drawn anew, and proof that the verdict notices bakes that break it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.spatial import cKDTree

from obscurance import ao
from obscurance.ao import Bake, Falloff
from obscurance.raytrace import Mesh

from .comparison import Truth, compare_with_truth, find_truth
from .dense import places
from .families import FAMILIES
from .suite import Case, Outcome, draw, falloffs, long_cases, run_cases, short_cases
from .verdict import FEW, LIMITS, Limits, verdict

SPARSE, FEWEST = 5_000, 1_500


@pytest.fixture
def seed(pytestconfig: pytest.Config) -> int:
    return pytestconfig.option.mesh_seed


def broken_limits(outcomes: Sequence[Outcome], limits: Limits, seed: int) -> str:
    """The limits that are broken, and how to see it again; empty if none is. All bakes are printed."""
    print(*outcomes, sep="\n")
    print(result := verdict(f"seed {seed}", outcomes, limits))
    return "" if result.ok else f"{'; '.join(result.faults)}; once more: --mesh-seed {seed}"


def test_the_tolerance_is_kept_where_many_vertices_are_filled_in() -> None:
    """A warning, which is an error here, would say that it is not."""
    case = Case("eyes", seed=9, size=17000, falloff=1, tolerance=0.005, again=0)
    (outcome,) = run_cases([case], samples=256)
    assert outcome.figures.estimated <= case.tolerance


def test_the_tolerance_is_kept_on_unseen_meshes(seed: int) -> None:
    """Meshes of two of the families, chosen and drawn by a seed that nobody has seen."""
    outcomes = list(run_cases(short_cases(seed, count=2), samples=256))
    assert broken_limits(outcomes, FEW, seed) == ""
    assert min(outcome.figures.vertices for outcome in outcomes) >= 16384, f"seed {seed}: too few to predict any"


@pytest.mark.slow
@pytest.mark.parametrize("family", FAMILIES)
def test_the_tolerance_is_kept_by_the_family(family: str, seed: int) -> None:
    assert broken_limits(list(run_cases(long_cases(family, seed))), LIMITS, seed) == ""


Change = Callable[[Mesh, Bake], Bake]


def sufficient(mesh: Mesh, falloff: Falloff, *, seed: int, tolerance: float) -> Bake:
    """Plain rays at every vertex, as many as the error estimated by a first bake asks for: it keeps the tolerance."""
    first = ao.bake(mesh, falloff, 128, seed + 1)
    samples = int(np.clip(128 * (first.rmse / (0.85 * tolerance)) ** (4 / 3), 8, 4096))
    return ao.bake(mesh, falloff, samples, seed)


def unchecked(mesh: Mesh, baked: Bake) -> Bake:
    """Every 24th vertex is kept, the others take what the nearest of these has, and nobody looks whether it fits."""
    kept = np.arange(0, len(baked.w), 24)
    near = kept[cKDTree(mesh.vertices[kept]).query(mesh.vertices)[1]]
    return replace(baked, w=baked.w[near], error=baked.error[near])


def scaled_error(factor: float) -> Change:
    return lambda mesh, baked: replace(baked, error=factor * baked.error)


def spoilt(mesh: Mesh, baked: Bake) -> Bake:
    """One vertex in a thousand is .9 off."""
    w = np.array(baked.w)
    some = np.arange(500, len(w), 1000)
    w[some] = np.abs(0.9 - w[some])
    return replace(baked, w=w)


def undefined(mesh: Mesh, baked: Bake) -> Bake:
    w = np.array(baked.w)
    w[7] = np.nan
    return replace(baked, w=w)


CASES = (
    Case("posts", 1, SPARSE, 0, 0.01),
    Case("character", 1, SPARSE, 0, 0.01),
    Case("thin sheets", 1, SPARSE, 3, 0.02),
)


@cache
def case_baked(case: Case) -> tuple[Mesh, Truth, Bake]:
    """A mesh, its truth, and a bake that keeps the tolerance."""
    mesh = draw(case.family, case.seed, case.size)
    falloff = list(falloffs(mesh).values())[case.falloff]
    return mesh, find_truth(mesh, falloff, 512, 99), sufficient(mesh, falloff, seed=0, tolerance=case.tolerance)


def faults(change: Change) -> str:
    outcomes = []
    for case in CASES:
        mesh, truth, baked = case_baked(case)
        outcomes.append(Outcome(case, "", compare_with_truth(change(mesh, baked), truth)))
    return "; ".join(verdict("all", outcomes, FEW).faults)


@pytest.mark.slow
def test_a_bake_that_keeps_the_tolerance_passes() -> None:
    assert faults(lambda mesh, baked: baked) == ""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "fault"),
    [
        (unchecked, "a vertex off by"),
        (unchecked, "beyond 6 times"),
        (scaled_error(0.5), "true/estimated"),
        (scaled_error(2.0), "true/estimated"),
        (spoilt, "a vertex off by"),
        (undefined, "NaN"),
    ],
    ids=["unchecked predictions", "and their errors", "errors halved", "errors doubled", "single vertices", "NaN"],
)
def test_a_bake_that_breaks_it_fails(change: Change, fault: str) -> None:
    assert fault in faults(change)


@pytest.mark.slow
@pytest.mark.parametrize("family", FAMILIES)
def test_a_family_draws_dense_meshes(family: str, seed: int) -> None:
    mesh = draw(family, seed, FEWEST)
    count = places((mesh.vertices, mesh.faces))
    assert 0.97 * FEWEST <= count <= 8 * FEWEST, f"{family}, seed {seed}: {count}"
