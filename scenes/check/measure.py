"""Independent estimates of w at places of a mesh, and the falloff by which stored values err least there."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from obscurance import ao
from obscurance.ao.options import OCTAVES, VertexOptions
from obscurance.ao.result import SquaredError
from obscurance.raytrace.errors import ConflictError, SceneError
from obscurance.raytrace.types import Float64s, Int64s

from ..bake.vertices import bake_inputs

if TYPE_CHECKING:
    from obscurance.ao.falloff import Falloff

    from ..bake.inputs import BakeInputs
    from ..bake.plan import Plan
    from .stored_values import StoredValues

PLACES = 1024
RAYS = 1024  # of each of two estimates at a place
_SEED = 1 << 62  # of the first, which no bake is likely to have used
_FINER, _STEPS = (4, 16), range(-2, 3)  # parts of an octave, by whose steps the best length is found
_WITHOUT_W = ao.Flag.UNREFERENCED | ao.Flag.DEGENERATE | ao.Flag.HIDDEN
_EVEN = "binary, by solid angle"
_FORMS: dict[str, Callable[..., Falloff]] = {
    "binary": lambda _: ao.Binary(),
    _EVEN: lambda _: ao.Binary(),
    "exponential, half-distance": lambda length: ao.Exponential(half_distance=length),
    "binary, max distance": lambda length: ao.Binary(max_distance=length),
    "linear, max distance": lambda length: ao.Linear(max_distance=length),
}
"""Falloffs that are tried where none is named, all but the first two at lengths an octave apart."""


class Candidate(NamedTuple):
    """A falloff that may be that of stored values."""

    form: str  # one of `_FORMS`, or what the falloff is called
    share: float = 0.0  # its length, of the radius; 0: it has none
    given: Falloff | None = None

    @property
    def words(self) -> str:
        """What it is called."""
        return f"{self.form} {100 * self.share:.3g}%" if self.share else self.form

    @property
    def is_even(self) -> bool:
        """Whether it goes with directions that are even over the solid angle."""
        return self.form == _EVEN

    @property
    def falloff(self) -> Falloff:
        """The falloff itself."""
        return self.given or _FORMS[self.form](f"{100 * self.share}%")


@dataclass(frozen=True)
class Places:
    """Places of a mesh at which stored values are compared.

    Attributes: at: vertices, faces or points, or places on the surface. rows: (k,), which of them, or of the faces.
        weights: (k, 3), barycentric, of places on faces, or None. estimates: (k, 2, c), two independent ones by each of
        c falloffs.
    """

    at: str
    rows: Int64s
    weights: Float64s | None
    estimates: Float64s

    def values(self, stored: StoredValues) -> dict[str, Float64s]:
        """Stored values (k,) at the places, by how they may be meant."""
        if self.weights is None:
            return {meaning: column[self.rows] for meaning, column in stored.rows.items()}
        return {meaning: at(self.rows, self.weights) for meaning, at in stored.lookups.items()}


class Comparison(NamedTuple):
    """Stored values (k,) and two estimates (k, 2) of w at the places.

    Attributes:
        falloff: of the estimates. meaning: of the values, empty if it is known.
        others: the RMS error by each other form of falloff, where it was looked for.
    """

    places: Places
    values: Float64s
    estimates: Float64s
    falloff: Candidate
    meaning: str
    others: dict[str, float]

    @property
    def error(self) -> SquaredError:
        """Of the values."""
        return SquaredError.of(self.values, self.estimates)

    def is_surely_better_than(self, other: Comparison) -> bool:
        """Whether its errors are smaller by more than two standard errors of their difference."""
        less = np.abs(other.signed) - np.abs(self.signed)
        return bool(less.mean() > 2 * less.std() / len(less) ** 0.5)

    @property
    def signed(self) -> Float64s:
        """The values' errors (k,), with the noise of the rays."""
        return np.asarray(self.values - self.estimates.mean(axis=1))


def compare_values(plan: Plan, inputs: BakeInputs, stored: StoredValues, seed: int, named: str) -> Comparison:
    """Compare stored values with estimates by the plan's falloff or, if nothing is `named`, by the one that fits best.

    Raises: as `ao.bake`; SceneError: there is no place to compare at.
    """

    def compare(candidates: Sequence[Candidate]) -> list[Comparison]:
        """The comparison by each candidate, for each meaning of the values."""
        compared = []
        for is_even, group in groupby(candidates, lambda candidate: candidate.is_even):
            alike = list(group)
            places = estimate(plan, inputs, stored, [candidate.falloff for candidate in alike], seed, is_even)
            compared += [
                Comparison(places, values, places.estimates[:, :, number], candidate, meaning, {})
                for meaning, values in places.values(stored).items()
                for number, candidate in enumerate(alike)
            ]
        return compared

    def best(comparisons: Iterable[Comparison]) -> Comparison:
        """By the mean absolute error: few values that are far off, inside of parts for instance, tell nothing."""
        return min(comparisons, key=lambda comparison: float(np.abs(comparison.signed).mean()))

    if named:
        return best(compare([Candidate(named, given=plan.falloff)]))
    simplest, even, *with_length = _FORMS
    tried = compare(
        [Candidate(even), Candidate(simplest), *(Candidate(form, share) for form in with_length for share in OCTAVES)]
    )
    by_form = {form: best(one for one in tried if one.falloff.form == form) for form in _FORMS}
    for parts in _FINER:
        lengths = [one.falloff.share * 2.0 ** (step / parts) for one in by_form.values() for step in _STEPS]
        forms = np.repeat(list(by_form), len(_STEPS)).tolist()
        tried = compare([Candidate(form, share) for form, share in zip(forms, lengths, strict=True) if share])
        by_form |= {form: best(one for one in tried if one.falloff.form == form) for form in with_length}
    found = best(by_form.values())
    if not found.is_surely_better_than(by_form[simplest]):
        found = by_form[simplest]
    return found._replace(others={form: one.error.rmse for form, one in by_form.items() if form != found.falloff.form})


def estimate(
    plan: Plan, inputs: BakeInputs, stored: StoredValues, falloffs: Sequence[Falloff], seed: int, is_even: bool = False
) -> Places:
    """Estimates of w, by each falloff, where there are stored values: the same places for the same seed.

    Args: is_even: whether by even directions, whatever the plan's.
    """
    assert isinstance(plan.arguments, VertexOptions)
    arguments = replace(
        plan.arguments, falloff=tuple(falloffs), samples=RAYS, tolerance=None, denoise=False, profile=False,
        both_sides=False, seed=(_SEED + 2 * seed) % 2**63, threads=plan.options.threads,
        weight="uniform" if is_even else plan.arguments.weight,
    )  # fmt: skip
    find = _on_faces if stored.lookups else _at_elements
    found = find(plan, inputs, stored, arguments)
    if not len(found.rows):
        raise SceneError(inputs.source.path, "places", "some outside of solids, with w", "none")
    return found


def _at_elements(plan: Plan, inputs: BakeInputs, stored: StoredValues, arguments: VertexOptions) -> Places:
    """Estimates at some of the vertices, or faces, by two bakes of these alone where that is possible."""
    mesh, chosen = inputs.chosen.mesh, inputs.chosen
    wanted = chosen.receive if arguments.at == "faces" else chosen.only
    candidates = np.arange(stored.rows_count) if wanted is None else np.flatnonzero(wanted)
    random = np.random.default_rng(arguments.seed)
    rows = np.sort(random.choice(candidates, min(PLACES, len(candidates)), replace=False))
    if plan.options.occluded_by == "all" and not inputs.source.cloud and not plan.options.high:  # else all are baked
        mask = np.zeros(len(mesh.vertices), np.bool_)
        mask[mesh.faces[rows] if arguments.at == "faces" else rows] = True
        inputs = inputs._replace(arguments=inputs.arguments | {"only": mask})
    bakes = [
        bake_inputs(plan._replace(arguments=replace(arguments, seed=arguments.seed + turn)), inputs, None, None)
        for turn in range(2)
    ]
    flags = bakes[0].flags
    rows = rows[flags[rows] & _WITHOUT_W == 0]
    return Places(bakes[0].at, rows, None, np.stack([baked.values[rows] for baked in bakes], axis=1))


def _on_faces(plan: Plan, inputs: BakeInputs, stored: StoredValues, arguments: VertexOptions) -> Places:
    """Estimates at points spread over the faces that have values. Raises: ConflictError: of what else they have w."""
    from obscurance.ao.interpolation_error import probe_surface
    from obscurance.ao.prepared import Prepared
    from obscurance.raytrace.mesh.corners import with_hard_edges

    if plan.options.high:
        raise ConflictError("high", "does not go with", "a check of a texture", why="which shows another mesh")
    if plan.options.occluded_by != "all":
        raise ConflictError("occluded_by", "does not go with", "a check of a texture")
    mesh = with_hard_edges(inputs.chosen.mesh)
    if arguments.thickness:
        mesh = mesh.reversed()
    prepared = Prepared.of(mesh, arguments, None, None, inputs.arguments["occluders"])
    among = np.zeros(len(prepared.mesh.faces), np.bool_)
    among[: len(mesh.faces)] = inputs.chosen.receive if stored.faces is None else inputs.chosen.receive & stored.faces
    probes = probe_surface(prepared, prepared.mus, among, RAYS)
    weights = probes.weights[:, ::-1] if arguments.thickness else probes.weights
    return Places("surface", probes.face, weights, probes.estimates)
