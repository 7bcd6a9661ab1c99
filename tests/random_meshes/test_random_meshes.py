"""Baking to a tolerance on meshes drawn anew, that nothing was tuned on, against plain bakes of many rays."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
import pytest
from scipy.stats import binom

from obscurance.ao import Bake, Binary, Exponential, Flag, bake
from obscurance.raytrace.mesh.mesh import Mesh

from .meshes import FAMILIES, draw, places

SMALL, LARGE = 17_000, 60_000  # places of vertices; fewer than 16,384 points are never predicted
TOLERANCES = (0.02, 0.01, 0.005)
FALLOFFS = {
    "binary": Binary(),
    "exponential": Exponential(),
    "binary, limited": Binary("20%"),
    "exponential, limited": Exponential(max_distance="20%"),
}
FEW, MANY = 256, 4096  # rays a vertex of the truth
NEAR, FAR = 2.5, 6.0  # times its estimated error: beyond them are few vertices, and next to none
KEPT = 0.95  # of all bakes, at least
FEWEST = 1_500


@pytest.fixture
def seed(pytestconfig: pytest.Config) -> int:
    return pytestconfig.option.mesh_seed


@dataclass(frozen=True, eq=False)
class Truth:
    """Two plain bakes of a mesh with independent rays: w (2, n), and which vertices have one."""

    halves: np.ndarray
    variance: np.ndarray
    some: np.ndarray

    @classmethod
    def of(cls, mesh: Mesh, falloff: str, samples: int, seed: int) -> Truth:
        one, other = (bake(mesh, FALLOFFS[falloff], samples // 2, seed + k, denoise=False) for k in (0, 1))
        variance = np.maximum(one.error**2 + other.error**2, (one.w - other.w) ** 2) / 4
        some = (one.flags & (Flag.UNREFERENCED | Flag.DEGENERATE)) == 0
        return cls(np.stack([one.w, other.w]), variance, some)


@dataclass(frozen=True)
class Outcome:
    """A bake against the truth, in tolerances.

    Attributes:
        true, estimated: root mean square errors of w. largest: of a vertex. beyond: the shares of vertices that are off
            by more than `NEAR` and `FAR` times their estimated error, that of the truth added in squares.
        undefined: whether a number is none.
    """

    true: float
    estimated: float
    largest: float
    beyond: tuple[float, float]
    undefined: bool

    @classmethod
    def of(cls, baked: Bake, truth: Truth, tolerance: float) -> Outcome:
        """The mean of (w − a)(w − b) is the mean square error without bias: the halves a and b have their own rays."""
        some, error = truth.some, baked.error[truth.some]
        squared = np.prod(baked.w - truth.halves, axis=0)[some]
        off = np.abs(baked.w - truth.halves.mean(axis=0))[some]
        expected = np.sqrt(error**2 + truth.variance[some])
        return cls(
            true=float(np.sqrt(max(np.mean(squared), 0.0))) / tolerance,
            estimated=float(np.sqrt(np.mean(error**2))) / tolerance,
            largest=float(off.max()) / tolerance,
            beyond=(float(np.mean(off > NEAR * expected)), float(np.mean(off > FAR * expected))),
            undefined=not all(np.isfinite(each).all() for each in (baked.w, baked.error, baked.bent_normals)),
        )


def faults(outcomes: list[Outcome], few: bool = True) -> str:
    """The limits that a group of bakes breaks: a few bakes of any family, or many of one. All are printed."""
    print(*outcomes, sep="\n")
    true, estimated, largest = np.transpose([(each.true, each.estimated, each.largest) for each in outcomes])
    ratio = np.sqrt((np.sum(true**2) + 1e-12) / (np.sum(estimated**2) + 1e-12))
    worst = np.max(true / np.clip(estimated, 0.25, 1.0))  # few vertices have an error where nearly all is open
    near, far = np.mean([each.beyond for each in outcomes], axis=0)
    missed = np.count_nonzero(true > 1)
    checks = (
        (missed > binom.isf(5e-4 if few else 0.5, len(true), 1 - KEPT), f"tolerance missed in {missed}"),
        (not 1 / 1.4 <= ratio <= 1.4, f"true/estimated error {ratio:.2f}"),
        (few and not worst <= 2, f"an error {worst:.2f} times its estimate or the tolerance"),
        (not largest.max() <= (40 if few else 20), f"a vertex off by {largest.max():.0f} tolerances"),
        (near > (0.07 if few else 0.05), f"{near:.2%} of errors beyond {NEAR} times their estimate"),
        (far > (0.002 if few else 0.001), f"{far:.3%} of errors beyond {FAR} times their estimate"),
        (any(each.undefined for each in outcomes), "NaN"),
    )
    return "; ".join(text for is_off, text in checks if is_off)


def outcome(family: str, seed: int, falloff: str, tolerance: float) -> Outcome:
    mesh = draw(family, seed, SMALL)
    baked = bake(mesh, FALLOFFS[falloff], seed=seed, tolerance=tolerance)
    assert np.count_nonzero(baked.flags & Flag.UNREFERENCED == 0) >= 16384, "too few to predict any"
    return Outcome.of(baked, Truth.of(mesh, falloff, FEW, seed + (1 << 32)), tolerance)


def test_the_tolerance_is_kept_where_many_vertices_are_filled_in() -> None:
    """A warning, which is an error here, would say that it is not."""
    assert outcome("eyes", 9, "exponential", 0.005).estimated <= 1


def test_the_tolerance_is_kept_on_unseen_meshes(seed: int) -> None:
    """Meshes of two of the families, chosen and drawn by a seed that nobody has seen."""
    rng = np.random.default_rng(seed)
    kinds = rng.permutation(list(product(FALLOFFS, TOLERANCES)))[:2]
    chosen = zip(rng.permutation(list(FAMILIES))[:2], kinds, strict=True)
    assert faults([outcome(name, seed, str(kind), float(tolerance)) for name, (kind, tolerance) in chosen]) == "", (
        f"once more: --mesh-seed {seed}"
    )


@pytest.mark.slow
@pytest.mark.parametrize("family", FAMILIES)
def test_the_tolerance_is_kept_by_the_family(family: str, seed: int) -> None:
    """Drawn small and large, with each falloff and tolerance, twice."""
    outcomes = []
    for number, size in enumerate((SMALL, LARGE)):
        mesh = draw(family, seed + number, size)
        for falloff in FALLOFFS:
            truth = Truth.of(mesh, falloff, MANY, seed + (1 << 32))
            for tolerance, again in product(TOLERANCES, range(2)):
                baked = bake(mesh, FALLOFFS[falloff], seed=seed + again, tolerance=tolerance)
                outcomes.append(Outcome.of(baked, truth, tolerance))
    assert faults(outcomes, few=False) == "", f"once more: --mesh-seed {seed}"


@pytest.mark.slow
@pytest.mark.parametrize("family", FAMILIES)
def test_a_family_draws_dense_meshes(family: str, seed: int) -> None:
    mesh = draw(family, seed, FEWEST)
    count = places((mesh.vertices, mesh.faces))
    assert 0.97 * FEWEST <= count <= 8 * FEWEST, f"{family}, seed {seed}: {count}"


@pytest.mark.parametrize(
    ("share", "factor", "fault"),
    [(0, 1, ""), (0, 0.5, "true/estimated"), (0, 2, "true/estimated"), (1e-3, 1, "a vertex off by"), (None, 1, "NaN")],
)
def test_limits_notice_errors_halved_and_doubled_single_vertices_and_nan(share, factor, fault) -> None:
    rng, count = np.random.default_rng(0), 20_000
    exact, some = rng.random(count), np.ones(count, bool)
    error = 0.008 * rng.uniform(0.5, 1.2, count)
    halves = exact + 0.004 * rng.normal(size=(2, count))
    w = exact + error * rng.normal(size=count)
    w[: int((share or 0) * count)] += 0.9
    w[:1] = np.nan if share is None else w[:1]
    baked = Bake.__new__(Bake)
    for name, value in {"w": w, "error": factor * error, "bent_normals": np.ones(3)}.items():
        object.__setattr__(baked, name, value)
    with np.errstate(invalid="ignore"):
        found = faults([Outcome.of(baked, Truth(halves, np.full(count, 8e-6), some), 0.01)] * 2)
    assert fault in found if fault else found == ""
