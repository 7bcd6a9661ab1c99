"""`obscurance check`: w that a file holds, of any program, against independent rays."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from obscurance.ao.result import SquaredError
from obscurance.raytrace.errors import ConflictError, MeshError, OptionError, SceneError, printable
from obscurance.raytrace.mesh.solids import shape_hash
from obscurance.raytrace.system.atomic import write_bytes
from obscurance.raytrace.system.checks import check_ending, check_outputs, check_regular

from ..asset.primitive import StoredBake
from ..bake.console import columns
from ..bake.inputs import BakeInputs, read_inputs
from ..bake.options import ROWS, BakeOptions
from ..bake.plan import Plan, plan_bake
from ..bake.record import Record
from ..bake.run import silence_tolerance_warnings
from ..check.measure import RAYS, Comparison, compare_values
from ..check.stored_values import StoredValues, find_values, is_image
from ..formats.load import load
from ..formats.stored_w import read_beside_w
from ..formats.table import format_of, is_raster

if TYPE_CHECKING:
    from ..asset.asset import Asset

_OF_FALLOFF = "falloff", "tau", "half_distance", "max_distance"
_LEFT_OUT = "mesh", "samples", "tolerance", "denoise", "seed", "profile", "both_sides", "preset"
_OBJECT = 32  # places on an object whose error is shown
_LISTED = 5  # objects and places that are shown
_ELEMENT = {"vertices": "vertex", "faces": "face", "points": "point", "surface": "face"}
_PAGE = 0.01  # tolerance of w on a page


class Checked(NamedTuple):
    """What a check has found, JSON-ready, and whether w is surely beyond what was asked for, or of another mesh."""

    facts: dict[str, Any]
    fails: bool


def check_files(
    files: Sequence[Path], as_json: bool, within: float | None, of: Path | None, output: Path | None, **given: Any
) -> int:
    """Print what is found of each file. Returns: the exit status. Args, Raises: as `check`."""
    if within is not None and not 0 < within <= 1:
        raise OptionError("within", "a number above 0, at most 1", within)
    if output:
        if len(files) > 1:
            raise ConflictError("output", "needs", "one file")
        check_ending("output", output, ".html")
        check_outputs({"--output": output}, [*files, *([of] if of else [])])
    checked = [check(file, of, within, output, **given) for file in files]
    if as_json:
        print(json.dumps([one.facts for one in checked], indent=2, allow_nan=False))
    else:
        print("\n\n".join(columns(in_words(one.facts, within)) for one in checked))
    return int(any(one.fails for one in checked))


def check(file: Path, of: Path | None, within: float | None, output: Path | None, **given: Any) -> Checked:
    """Compare w that a file holds with estimates at places of its mesh, or of the mesh `of`.

    Args: within: what the RMS error may be. output: a page that shows the difference. given: options of `bake` by which
        w was baked, in place of those that the file names.

    Raises: SceneError: there is no w in the file, or of another number of vertices. OptionError, MeshError: as a bake.
    """
    # The files, and how w was baked.
    check_regular(file, "a file of w", SceneError)
    own = None if not format_of(file).read or is_raster(file) or is_image(file) else _mesh(file)
    record = Record.read(file, own)
    source = own if of is None else _mesh(of)
    if source is None:
        raise OptionError("of", f"--of with the mesh that {file.name} belongs to", "none")
    stale = None
    if record and of:
        stale = shape_hash(source.mesh.reversed() if record.options.get("flip") else source.mesh) != record.mesh
    stored = find_values(file, own, source, record is not None)
    if own and stored.lookups:
        source = own  # whose texture coordinates they are looked up by
    if not stored.lookups and len(source.mesh.vertices) != stored.rows_count == len(source.mesh.faces):
        given["at"] = "faces"
    if source is own:
        given["flip"] = False  # as its faces are turned already
    if source.cloud:
        given["points"] = True
    plan = plan_bake(_bake_options(record, source, **given))
    whole = _with_rows(source, stored, plan)
    if whole is None and stale:
        return Checked({"file": str(file), "mesh": str(of), "stale": True}, True)
    if whole is None:
        elements = plan.options.at
        expected = f"a value for each of the {_count(source, elements):,} {elements} of {source.path}"
        raise SceneError(file, "w", expected, f"{stored.rows_count:,}")
    inputs = read_inputs(plan, source=whole)
    if plan.options.method == "surface" and stored.rows:  # which is to be right between vertices
        stored = stored.interpolated(inputs.source.mesh.faces)
    # The comparison.
    with silence_tolerance_warnings():
        is_named = record is not None or any(given[name] is not None for name in _OF_FALLOFF)
        found = compare_values(plan, inputs, stored, given["seed"], _falloff_in_words(plan) if is_named else "")
        facts = _facts(file, own, stored, found, inputs) | {"stale": stale}
        if output:
            write_bytes(output, _page(file, plan, inputs, stored, found))
    return Checked(facts, within is not None and found.error.at_least > within)


def _mesh(file: Path) -> Asset:
    """A mesh file, or a cloud of points. Raises: MeshError: it is neither."""
    try:
        return load(file, names=True)
    except MeshError:
        with suppress(MeshError):
            return load(file, names=True, points=True)
        raise


def _bake_options(record: Record | None, source: Asset, **given: Any) -> BakeOptions:
    """The options of the bake to compare with: given ones in place of those that the file names."""
    values = {} if record is None else record.options
    kept = {
        name: value
        for name, value in values.items()
        if name not in _LEFT_OUT and "vertices" in ROWS[name].bake_kinds.split()
    }
    chosen = {name: value for name, value in given.items() if value is not None and name != "seed"}
    if any(name in chosen for name in _OF_FALLOFF):
        kept = {name: value for name, value in kept.items() if name not in _OF_FALLOFF}
    return BakeOptions(**kept | chosen | {"mesh": [source.path], "output": Path("check.npy"), "quiet": True})


def _count(source: Asset, elements: str) -> int:
    """How many vertices, or faces, there are; of a cloud how many points."""
    return len(source.cloud[0] if source.cloud else getattr(source.mesh, elements))


def _with_rows(source: Asset, stored: StoredValues, plan: Plan) -> Asset | None:
    """The mesh that rows of w belong to: of the vertices of the file, or also of sides of hard edges; None: neither."""
    if stored.lookups or stored.rows_count == _count(source, plan.options.at):
        return source
    split = source.split if plan.options.at == "vertices" and not source.cloud else None
    return source.with_mesh(split) if split and stored.rows_count == len(split.vertices) else None


def _falloff_in_words(plan: Plan) -> str:
    """The falloff of a plan."""
    options = plan.options
    named = {name: getattr(options, name) for name in _OF_FALLOFF[1:]}
    more = [f"{name.replace('_', ' ')} {value}" for name, value in named.items() if value != ROWS[name].default]
    if options.falloff == "exponential" and options.tau is None and options.half_distance is None:
        more.insert(0, "half distance 50%")
    return ", ".join([options.falloff, *more])


def _facts(
    file: Path, own: Asset | None, stored: StoredValues, found: Comparison, inputs: BakeInputs
) -> dict[str, Any]:
    """The facts of a comparison, JSON-ready."""
    error = found.error
    k = len(found.values)
    worst = np.argsort(-np.abs(found.signed))[:_LISTED]
    return {
        "file": str(file),
        "mesh": str(inputs.source.path),
        "held_in": stored.where,
        "meaning": found.meaning or None,
        "falloff": found.falloff.words,
        "fitted": bool(found.others),
        "rmse_by_other_falloffs": found.others,
        "places": k,
        "at": found.places.at,
        "rays": 2 * RAYS,
        "rmse": error.rmse,
        "rmse_standard_error": _of_root(error),
        "rmse_at_least": error.at_least,
        "mean_error": float(found.signed.mean()),
        "mean_error_standard_error": float(found.signed.std()) / k**0.5,
        "rmse_estimate_of_file": _estimate_of_file(file, own, stored, found),
        "objects": dict(sorted(_by_object(found, inputs), key=lambda pair: -pair[1])),
        "worst": [
            {
                _ELEMENT[found.places.at]: int(found.places.rows[row]),
                "at": _position(found, inputs, row),
                "w": float(found.values[row]),
                "by_rays": float(found.estimates[row].mean()),
            }
            for row in worst.tolist()
        ],
    }


def _of_root(error: SquaredError) -> float:
    """The standard error of an RMS error, of the squared error's; where this is as large, the bound that it leaves."""
    upper: float = (max(error.mean, 0.0) + error.deviation) ** 0.5
    return upper - error.rmse


def _estimate_of_file(file: Path, own: Asset | None, stored: StoredValues, found: Comparison) -> float | None:
    """The RMS of the errors that the file has beside w, at the places; None without any."""
    if found.places.weights is not None:
        return None
    baked = own.baked if own else StoredBake(np.zeros(0), **read_beside_w(file, stored.rows_count))
    errors = baked.error if baked else None
    return None if errors is None else float(np.sqrt(np.mean(np.square(errors[found.places.rows]))))


def _by_object(found: Comparison, inputs: BakeInputs) -> Iterator[tuple[str, float]]:
    """Names of objects with many places, and the RMS error at these."""
    source, places = inputs.source, found.places
    if places.at == "points":
        return
    names = np.full(len(source.mesh.faces), "", object)
    for run in source.runs():
        names[run.faces] = run.object.name
    if places.at == "vertices":
        of_faces = names
        names = np.full(len(source.mesh.vertices), "", object)
        names[source.mesh.faces] = of_faces[:, None]
    of_places = names[places.rows]
    for name in dict.fromkeys(of_places.tolist()):
        is_on = of_places == name
        if np.count_nonzero(is_on) >= _OBJECT:
            yield name, SquaredError.of(found.values[is_on], found.estimates[is_on]).rmse


def _position(found: Comparison, inputs: BakeInputs, place: int) -> list[float]:
    """Where a place lies, in the file's coordinates."""
    mesh, places = inputs.source.mesh, found.places
    row = int(places.rows[place])
    if places.at == "points" and inputs.source.cloud:
        position = inputs.source.cloud[0][row]
    elif places.at == "vertices":
        position = mesh.vertices[row]
    else:
        weights = np.full(3, 1 / 3) if places.weights is None else places.weights[place]
        position = weights @ mesh.vertices[mesh.faces[row]]
    return [float(coordinate) for coordinate in position]


def in_words(facts: dict[str, Any], within: float | None) -> list[tuple[str, str]]:
    """Rows (name, value) about the facts of a check."""
    stale = {None: "", True: "stale: the mesh is not the one that was baked", False: "the one that was baked"}
    mesh = ", ".join(filter(None, (printable(facts["mesh"]), stale[facts["stale"]])))
    rows = [("file", printable(facts["file"])), ("mesh", mesh)]
    if "rmse" not in facts:  # w is of another number of vertices
        return rows
    meaning = f", {facts['meaning']}" if facts["meaning"] else ""
    how = "as the file or an option says"
    if facts["fitted"]:
        others = ", ".join(f"{name} {error:.4f}" for name, error in facts["rmse_by_other_falloffs"].items())
        how = f"which fits best; by others the RMS error is, at best, {others}"
    rows += [
        ("w", f"in {facts['held_in']}{meaning}"),
        ("falloff", f"{facts['falloff']}, {how}"),
        ("places", f"{facts['places']:,} of the {facts['at']}, by {facts['rays']:,} rays each"),
        ("RMS error", f"{facts['rmse']:.4f} ± {facts['rmse_standard_error']:.4f}"),
        ("mean error", f"{facts['mean_error']:+.4f} ± {facts['mean_error_standard_error']:.4f}"),
    ]
    if facts["rmse_estimate_of_file"] is not None:
        rows.append(("estimated", f"{facts['rmse_estimate_of_file']:.4f}, by the errors in the file"))
    if len(facts["objects"]) > 1:
        listed = [f"{printable(name)} {error:.4f}" for name, error in facts["objects"].items()][:_LISTED]
        rows.append(("objects", f"{', '.join(listed)}: those with the largest errors"))
    worst = facts["worst"][0]
    element, number = next(iter(worst.items()))
    at = ", ".join(f"{coordinate:.6g}" for coordinate in worst["at"])
    rows.append(("worst", f"{element} {number:,} at ({at}): w {worst['w']:.3f}, by rays {worst['by_rays']:.3f}"))
    if within is not None:
        verdict = "yes" if facts["rmse"] <= within else "perhaps: so few places cannot tell"
        if facts["rmse_at_least"] > within:
            verdict = f"no: at least {facts['rmse_at_least']:.4f}, two standard errors less"
        rows.append((f"within {within:g}", verdict))
    return rows


def _page(file: Path, plan: Plan, inputs: BakeInputs, stored: StoredValues, found: Comparison) -> bytes:
    """A page of w in the file and of w baked anew, with a slider between, and of their difference."""
    from obscurance.ao.options import VertexOptions

    from ..bake.vertices import bake_inputs
    from ..show.page.base_colour import base_colour
    from ..show.page.document import html_of_bakes
    from ..show.page.encode import Values

    mesh = inputs.source.mesh
    if found.places.at not in ("vertices", "surface"):
        raise OptionError("output", "a check of w at vertices, or in a texture", f"w of {found.places.at}")
    assert isinstance(plan.arguments, VertexOptions)
    arguments = replace(
        plan.arguments, falloff=found.falloff.falloff, samples=None, tolerance=_PAGE, profile=False,
        weight="uniform" if found.falloff.is_even else plan.arguments.weight,
    )  # fmt: skip
    baked = bake_inputs(plan._replace(arguments=arguments), inputs, None, None)
    if stored.lookups:
        corner = np.zeros(len(mesh.vertices), np.int64)
        corner[mesh.faces.ravel()] = np.arange(mesh.faces.size)
        w = stored.lookups[found.meaning](corner // 3, np.eye(3)[corner % 3])
    else:
        w = stored.rows[found.meaning]
    shown = [Values(w, name=file.name), Values.of(baked, "by independent rays")]
    return html_of_bakes(mesh, shown, f"check of {file.name}", None, base_colour(inputs.source))
