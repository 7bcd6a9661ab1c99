"""Independent estimates of w at places of a mesh, and the falloff by which stored values err least there."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from obscurance import ao
from obscurance.ao.falloff import DEFAULT_HALF_DISTANCE
from obscurance.ao.options import OCTAVES, VertexOptions, Weight
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
_SIMPLEST, _EVEN = "binary", "binary, by solid angle"
_FORMS: dict[str, Callable[[str], Falloff]] = {
    "exponential, half-distance": lambda length: ao.Exponential(half_distance=length),
    "binary, max distance": ao.Binary,
    "linear, max distance": ao.Linear,
}
"""Falloffs of a length that are tried where none is named, at first an octave apart."""


class Candidate(NamedTuple):
    """A falloff that may be that of stored values."""

    form: str  # one of `_FORMS`, or what the falloff is called
    share: float = 0.0  # its length, of the radius; 0: it has none
    given: Falloff | None = None

    @property
    def words(self) -> str:
        """The falloff as the command names it."""
        return f"{self.form} {100 * self.share:.3g}%" if self.share else self.form

    @property
    def falloff(self) -> Falloff:
        """The falloff itself."""
        return self.given or _FORMS[self.form](f"{100 * self.share}%")


class Places(NamedTuple):
    """Places of a mesh at which stored values are compared.

    Attributes: at: vertices, faces or points, or places on the surface. rows: (k,), which of them, or of the faces.
        weights: (k, 3), barycentric, of places on faces, or None. positions: (k, 3). estimates: (k, 2, c), two
        independent ones by each of c falloffs.
    """

    at: str
    rows: Int64s
    weights: Float64s | None
    positions: Float64s
    estimates: Float64s


class Comparison(NamedTuple):
    """Stored values (k,) and two estimates (k, 2) of w at the places.

    Attributes:
        arguments: of the estimates. meaning: of the values, empty if it is known.
        others: the RMS error by each other form of falloff, where it was looked for.
    """

    places: Places
    values: Float64s
    estimates: Float64s
    candidate: Candidate
    arguments: VertexOptions
    meaning: str
    others: dict[str, float]

    @property
    def error(self) -> SquaredError:
        """The error of the values."""
        return SquaredError.of(self.values, self.estimates)

    def is_surely_better_than(self, other: Comparison) -> bool:
        """Whether its errors are smaller by more than two standard errors of their difference."""
        less = np.abs(other.signed) - np.abs(self.signed)
        return bool(less.mean() > 2 * less.std() / len(less) ** 0.5)

    @property
    def signed(self) -> Float64s:
        """The values' errors (k,), with the noise of the rays."""
        return np.asarray(self.values - self.estimates.mean(axis=1))


def compare_values(plan: Plan, inputs: BakeInputs, stored: StoredValues, seed: int, is_named: bool) -> Comparison:
    """Compare stored values with estimates by the plan's falloff or, if that is not named, by the one that fits best.

    The places are the same for the same seed. Raises: as `ao.bake`; SceneError: there is no place to compare at.
    """
    assert isinstance(plan.arguments, VertexOptions)
    arguments = replace(
        plan.arguments, samples=RAYS, tolerance=None, denoise=False, profile=False, both_sides=False,
        seed=(_SEED + 2 * seed) % 2**63, threads=plan.options.threads,
    )  # fmt: skip

    def compare(candidates: Sequence[Candidate], weight: Weight = arguments.weight) -> list[Comparison]:
        """The comparison by each candidate, for each meaning of the values."""
        by_all = replace(arguments, falloff=tuple(one.falloff for one in candidates), weight=weight)
        places = (_on_faces if stored.lookups else _at_elements)(plan, inputs, stored, by_all)
        if not len(places.rows):
            raise SceneError(inputs.source.path, "places", "some outside of solids, with w", "none")
        return [
            Comparison(places, values, places.estimates[:, :, number], candidate,
                       replace(by_all, falloff=candidate.falloff), meaning, {})
            for meaning, values in stored.at(places.rows, places.weights).items()
            for number, candidate in enumerate(candidates)
        ]  # fmt: skip

    def best(comparisons: Iterable[Comparison]) -> Comparison:
        """By the mean absolute error: few values that are far off, inside of parts for instance, tell nothing."""
        return min(comparisons, key=lambda comparison: float(np.abs(comparison.signed).mean()))

    if is_named:
        return best(compare([Candidate(_in_words(plan), given=plan.falloff)]))
    by_form = {_EVEN: best(compare([Candidate(_EVEN, given=ao.Binary())], "uniform"))}
    octaves = [Candidate(form, share) for form in _FORMS for share in OCTAVES]
    tried = compare([Candidate(_SIMPLEST, given=ao.Binary()), *octaves])
    by_form |= {form: best(one for one in tried if one.candidate.form == form) for form in (_SIMPLEST, *_FORMS)}
    for parts in _FINER:
        lengths = {form: by_form[form].candidate.share for form in _FORMS}
        tried = compare([Candidate(form, lengths[form] * 2.0 ** (step / parts)) for form in _FORMS for step in _STEPS])
        by_form |= {form: best(one for one in tried if one.candidate.form == form) for form in _FORMS}
    found = best(by_form.values())
    if not found.is_surely_better_than(by_form[_SIMPLEST]):
        found = by_form[_SIMPLEST]
    others = {form: one.error.rmse for form, one in by_form.items() if form != found.candidate.form}
    return found._replace(others=others)


def _in_words(plan: Plan) -> str:
    """The falloff of a plan."""
    name = plan.options.falloff
    changed = plan.changed()
    if name == "exponential" and "tau" not in changed:
        changed.setdefault("half_distance", DEFAULT_HALF_DISTANCE)
    lengths = [
        f"{key.replace('_', ' ')} {changed[key]}" for key in ("tau", "half_distance", "max_distance") if key in changed
    ]
    return ", ".join([name, *lengths])


def _at_elements(plan: Plan, inputs: BakeInputs, stored: StoredValues, arguments: VertexOptions) -> Places:
    """Estimates at some of the vertices, or faces, by two bakes of these alone where that is possible."""
    mesh, chosen, source = inputs.chosen.mesh, inputs.chosen, inputs.source
    wanted = chosen.receive if arguments.at == "faces" else chosen.only
    assert stored.rows_count is not None
    candidates = np.arange(stored.rows_count) if wanted is None else np.flatnonzero(wanted)
    random = np.random.default_rng(arguments.seed)
    rows = np.sort(random.choice(candidates, min(PLACES, len(candidates)), replace=False))
    if plan.options.occluded_by == "all" and not source.cloud and not plan.options.high:  # else all are baked
        mask = np.zeros(len(mesh.vertices), np.bool_)
        mask[mesh.faces[rows] if arguments.at == "faces" else rows] = True
        inputs = inputs._replace(arguments=inputs.arguments | {"only": mask})
    bakes = [
        bake_inputs(plan._replace(arguments=replace(arguments, seed=arguments.seed + turn)), inputs, None, None)
        for turn in range(2)
    ]
    at = bakes[0].at
    rows = rows[bakes[0].flags[rows] & _WITHOUT_W == 0]
    points = source.cloud[0] if source.cloud else mesh.vertices
    positions = mesh.vertices[mesh.faces[rows]].mean(axis=1) if at == "faces" else points[rows]
    return Places(at, rows, None, positions, np.stack([baked.values[rows] for baked in bakes], axis=1))


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
    positions = np.einsum("kc,kcd->kd", weights, inputs.source.mesh.vertices[inputs.source.mesh.faces[probes.face]])
    return Places("surface", probes.face, weights, positions, probes.estimates)
