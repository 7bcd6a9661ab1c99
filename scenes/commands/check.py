"""`obscurance check`: w that a file holds, of any program, against independent rays."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from obscurance.ao.result import SquaredError
from obscurance.raytrace.errors import ConflictError, OptionError, SceneError, printable
from obscurance.raytrace.mesh.mesh import shape_hash
from obscurance.raytrace.system.atomic import write_bytes
from obscurance.raytrace.system.checks import check_ending, check_outputs, check_regular

from ..bake.console import columns
from ..bake.inputs import BakeInputs, read_inputs
from ..bake.options import ROWS, BakeOptions
from ..bake.plan import Plan, plan_bake
from ..bake.record import Record
from ..bake.run import silence_tolerance_warnings
from ..check.measure import RAYS, Comparison, compare_values
from ..check.stored_values import StoredValues, find_values, is_image
from ..formats.load import load_faces_or_points
from ..formats.table import format_of, is_raster

if TYPE_CHECKING:
    from ..asset.asset import Asset

_OF_FALLOFF = "falloff", "tau", "half_distance", "max_distance"
_LEFT_OUT = "mesh", "samples", "tolerance", "denoise", "seed", "profile", "both_sides", "preset"
_OBJECT = 32  # places on an object whose error is shown
_LISTED = 5  # objects and places that are shown
_ELEMENT = {"vertices": "vertex", "faces": "face", "points": "point", "surface": "face"}
_PAGE = 0.01  # tolerance of w on a page


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
    checked = [check(file, of, output, **given) for file in files]
    if as_json:
        print(json.dumps(checked, indent=2, allow_nan=False))
    else:
        print("\n\n".join(columns(in_words(facts, within)) for facts in checked))
    beyond = ("rmse" not in facts or (within is not None and facts["rmse_at_least"] > within) for facts in checked)
    return int(any(beyond))


def check(file: Path, of: Path | None, output: Path | None, **given: Any) -> dict[str, Any]:
    """Compare w that a file holds with estimates at places of its mesh, or of the mesh `of`.

    Args: output: a page that shows the difference. given: options of `bake` by which w was baked, in place of those
        that the file names.

    Returns: JSON-ready facts; those of a stale mesh with other vertices have no error.

    Raises: SceneError: there is no w in the file, or of another number of vertices. OptionError, MeshError: as a bake.
    """
    # The files, and how w was baked.
    check_regular(file, "a file of w", SceneError)
    own = None if not format_of(file).read or is_raster(file) or is_image(file) else load_faces_or_points(file)
    record = Record.read(file, own)
    source = own if of is None else load_faces_or_points(of)
    if source is None:
        raise OptionError("of", f"--of with the mesh that {file.name} belongs to", "none")
    mesh = source.mesh
    baked_by = record.options if record else {}
    facts: dict[str, Any] = {"file": str(file), "mesh": str(source.path), "stale": None}
    if record and of:
        facts["stale"] = shape_hash(mesh.reversed() if baked_by.get("flip") else mesh) != record.mesh
    stored = find_values(file, own, source, record is not None)
    if own and stored.lookups:
        source = own  # whose texture coordinates they are looked up by
    given |= {"flip": False} if source is own else {}  # as its faces are turned already
    given |= {"points": True} if source.cloud else {}
    # What rows of w are of: faces, points of a cloud, or vertices, those of the file or also of sides of hard edges.
    count = stored.rows_count
    points = len(source.cloud[0] if source.cloud else mesh.vertices)
    is_of_faces = count == len(mesh.faces) and (count != points or baked_by.get("at") == "faces")
    if not is_of_faces and count not in (None, points):
        split = source.split
        if count == len(split.vertices):
            source = source.with_mesh(split)
        elif facts["stale"]:
            return facts
        else:
            raise SceneError(file, "w", f"a value for each of the {points:,} vertices of {source.path}", f"{count:,}")
    plan = plan_bake(_bake_options(baked_by, source, at="faces" if is_of_faces else "vertices", **given))
    inputs = read_inputs(plan, source=source)
    if plan.options.method == "surface" and stored.rows:  # which is to be right between vertices
        stored = stored.interpolated(inputs.source.mesh.faces)
    # The comparison.
    with silence_tolerance_warnings():
        is_named = record is not None or any(given[name] is not None for name in _OF_FALLOFF)
        found = compare_values(plan, inputs, stored, given["seed"], is_named)
        if output:
            write_bytes(output, _page(file, plan, inputs, stored, found))
    return facts | _facts(stored, found, inputs)


def _bake_options(baked_by: dict[str, Any], source: Asset, **given: Any) -> BakeOptions:
    """The options of the bake to compare with: given ones in place of those that the file names."""
    chosen = {name: value for name, value in given.items() if value is not None and name != "seed"}
    left_out = {*_LEFT_OUT, *(_OF_FALLOFF if any(name in chosen for name in _OF_FALLOFF) else ())}
    kept = {
        name: value
        for name, value in baked_by.items()
        if name not in left_out and "vertices" in ROWS[name].bake_kinds.split()
    }
    return BakeOptions(**kept | chosen | {"mesh": [source.path], "output": Path("check.npy"), "quiet": True})


def _facts(stored: StoredValues, found: Comparison, inputs: BakeInputs) -> dict[str, Any]:
    """The facts of a comparison, JSON-ready."""
    error, places = found.error, found.places
    k = len(found.values)
    worst = np.argsort(-np.abs(found.signed))[:_LISTED]
    return {
        "held_in": stored.where,
        "meaning": found.meaning or None,
        "falloff": found.candidate.words,
        "fitted": bool(found.others),
        "rmse_by_other_falloffs": found.others,
        "places": k,
        "at": places.at,
        "rays": 2 * RAYS,
        "rmse": error.rmse,
        "rmse_standard_error": (max(error.mean, 0.0) + error.deviation) ** 0.5 - error.rmse,
        "rmse_at_least": error.at_least,
        "mean_error": float(found.signed.mean()),
        "mean_error_standard_error": float(found.signed.std()) / k**0.5,
        "objects": dict(sorted(_by_object(found, inputs.source), key=lambda pair: -pair[1])),
        "worst": [
            {
                _ELEMENT[places.at]: int(places.rows[row]),
                "at": places.positions[row].tolist(),
                "w": float(found.values[row]),
                "by_rays": float(found.estimates[row].mean()),
            }
            for row in worst.tolist()
        ],
    }


def _by_object(found: Comparison, source: Asset) -> Iterator[tuple[str, float]]:
    """Names of objects with many places, and the RMS error at these."""
    places = found.places
    if places.at == "points":
        return
    of, names = source.objects_of_faces
    if places.at == "vertices":
        of_faces = of
        of = np.zeros(len(source.mesh.vertices), np.int64)
        of[source.mesh.faces] = of_faces[:, None]
    of_places = np.array(names, object)[of[places.rows]]
    for name in dict.fromkeys(of_places.tolist()):
        is_on = of_places == name
        if np.count_nonzero(is_on) >= _OBJECT:
            yield name, SquaredError.of(found.values[is_on], found.estimates[is_on]).rmse


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
    from ..bake.vertices import bake_inputs
    from ..show.page.base_colour import base_colour
    from ..show.page.document import html_of_bakes
    from ..show.page.encode import Values

    mesh = inputs.source.mesh
    if found.places.at not in ("vertices", "surface"):
        raise OptionError("output", "a check of w at vertices, or in a texture", f"w of {found.places.at}")
    arguments = replace(found.arguments, samples=None, tolerance=_PAGE)
    baked = bake_inputs(plan._replace(arguments=arguments), inputs, None, None)
    if stored.lookups:
        corner = np.zeros(len(mesh.vertices), np.int64)
        corner[mesh.faces.ravel()] = np.arange(mesh.faces.size)
        w = stored.lookups[found.meaning](corner // 3, np.eye(3)[corner % 3])
    else:
        w = stored.rows[found.meaning]
    shown = [Values(w, name=file.name), Values.of(baked, "by independent rays")]
    return html_of_bakes(mesh, shown, f"check of {file.name}", None, base_colour(inputs.source))
