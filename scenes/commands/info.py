"""`obscurance info`: content, extent and defects of a mesh file."""

from dataclasses import replace
from typing import Any

import numpy as np

from obscurance.ao.points.receivers import Flag, find_receivers
from obscurance.raytrace.errors import InputError, printable
from obscurance.raytrace.mesh.normals import face_areas
from obscurance.raytrace.mesh.placement import Placement
from obscurance.raytrace.mesh.solids import inward_warnings
from obscurance.raytrace.mesh.warnings import outlier_warnings, precision_warnings
from obscurance.raytrace.mesh.weld import coincident
from obscurance.raytrace.types import Float64s

from ..asset.asset import Asset

_NAME, _NAMES = 80, 8  # characters of a name, and names, that are shown


def facts(source: Asset) -> dict[str, Any]:
    """The facts of `describe` as JSON-ready values: lengths in mesh units, None for what is missing."""
    mesh = source.mesh
    placement = Placement.of(mesh)
    unread = []
    try:
        receivers = find_receivers(mesh, placement)
    except InputError as fault:  # an image of alpha
        unread = [f"{fault}; its faces are taken for opaque here".removeprefix(f"{source.path}: ")]
        receivers = find_receivers(replace(mesh, opacity=None), placement)
    area = face_areas(placement.vertices, mesh.faces)
    corners = coincident(placement.vertices, mesh.faces)[mesh.faces]
    edges = np.sort(corners[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    edges = edges[edges[:, 0] < edges[:, 1]]
    uses = np.unique(edges @ [len(mesh.vertices), 1], return_counts=True)[1]
    flagged = {(flag.name or "").lower(): int(np.count_nonzero(receivers.flags & flag)) for flag in Flag}
    profile = source.profile
    stored = "16-bit integers" if source.is_scene else "32-bit floats"
    warnings = [note.removeprefix(f"{source.path}: ") for note in source.notes]
    lines = [*outlier_warnings(mesh), *precision_warnings(mesh), *inward_warnings(mesh, placement.vertices)]
    return {
        "file": str(source.path),
        "objects": list(source.objects),
        "vertices": len(mesh.vertices),
        "faces": len(mesh.faces),
        "degenerate_faces": len(mesh.faces) - len(receivers.faces),
        "edges": len(uses),
        "open_edges": int((uses == 1).sum()),
        "edges_of_three_faces_or_more": int((uses > 2).sum()),
        "bounds": [corner.tolist() for corner in mesh.bounds],
        "up": mesh.up,
        "radius": mesh.radius,
        "area": _finite(float(area.sum()) / placement.scale / placement.scale),
        "normals": mesh.normals is not None or mesh.corner_normals is not None,
        "normals_at_corners": mesh.corner_normals is not None,
        **_surfaces(source),
        "stored_w": _stored(source.w),
        "stored_profile": profile and profile.lengths | {"stored": stored},
        "occlusion_textures": _occlusion(source),
        "alpha": mesh.opacity.counts if mesh.opacity else None,
        "points_to_bake": len(receivers.points),
        "flagged_vertices": {name: count for name, count in flagged.items() if count},
        "warnings": [*unread, *warnings, *(line.removeprefix(f"{mesh.source}: ") for line in lines)],
    }


def describe(source: Asset) -> list[tuple[str, str]]:
    """Rows (name, value) about a file's objects, its extent, its defects and what a bake would do with it."""
    values = facts(source)
    mesh = source.mesh
    open_edges = values["open_edges"]
    nonmanifold = f"{values['edges_of_three_faces_or_more']:,} between three faces or more"
    bounds = " – ".join("(" + ", ".join(f"{c:.6g}" for c in corner) + ")" for corner in values["bounds"])
    profile = source.profile
    stored = values["stored_profile"]
    occlusion = "no textures in the file"
    textures = values["occlusion_textures"]
    if textures and textures["textured"]:
        occlusion = f"textures of {textures['textured']:,} of {textures['primitives']:,} primitives"
        occlusion += f", {textures['ramps']:,} of them ramps of a bake" if textures["ramps"] else ""
    text = profile and f"w at {len(profile.half_distances)} half-distances, {profile.range}, as {stored['stored']}"
    normals = "in the file, several at some vertices" if values["normals_at_corners"] else "in the file"
    named_facts = [
        ("file", printable(values["file"])),
        ("objects", _listed(values["objects"])),
        ("vertices", f"{values['vertices']:,}"),
        ("faces", f"{values['faces']:,}, {values['degenerate_faces']:,} of them degenerate"),
        ("edges", f"{values['edges']:,}: {open_edges:,} open, {nonmanifold}; coincident vertices once"),
        ("bounds", bounds),
        ("up", values["up"] or "not said: y"),
        ("radius", f"{values['radius']:.6g}, of the smallest ball that holds it: 100 % for relative distances"),
        ("area", "too large" if values["area"] is None else f"{values['area']:.6g}"),
        ("normals", normals if values["normals"] else "none in the file"),
        ("texture sets", f"{values['texture_sets'] or 'none'} of texture coordinates"),
        ("materials", _listed(values["materials"])),
        ("textures", _listed(values["textures"])),
        ("stored w", _stored_in_words(values["stored_w"])),
        *([("profile", text)] if text else []),
        ("occlusion", occlusion),
        ("alpha", mesh.opacity.summary.removeprefix("alpha: ") if mesh.opacity else "none: all faces are opaque"),
        ("points to bake", f"{values['points_to_bake']:,}, coincident vertices once"),
    ]
    named_facts += [(f"{name} vertices", f"{count:,}") for name, count in values["flagged_vertices"].items()]
    return named_facts + [("warning", line) for line in values["warnings"]]


def _listed(names: list[str]) -> str:
    """How many names there are, and the first of them."""
    first = ", ".join(printable(name, _NAME) for name in names[:_NAMES])
    return f"{len(names)}: {first}" if names else "none in the file"


def _surfaces(source: Asset) -> dict[str, Any]:
    """How many sets of texture coordinates a file has, and the names of its materials and of their pictures."""
    sets = {name for part in source.parts for name in part.primitive.columns if name.startswith("uv")}
    if source.is_scene:
        from ..formats.gltf.textures import image_names

        textures = image_names(source)
    else:
        textures = list(dict.fromkeys(path.name for material in source.materials for path in material.pictures))
    return {
        "texture_sets": len(sets),
        "materials": [material.name for material in source.materials],
        "textures": textures,
    }


def _occlusion(source: Asset) -> dict[str, int] | None:
    """How many primitives of a glTF file have occlusion textures, and how many of these are the ramp of a bake."""
    if not source.is_scene:
        return None
    used = [source.material(run.material.key) for run in source.runs()]
    textured = [material.occlusion for material in used if material.occlusion]
    return {"primitives": len(used), "textured": len(textured), "ramps": sum(one.is_ramp for one in textured)}


def _stored(w: Float64s | None) -> dict[str, Any] | None:
    """Range and mean of the w that a bake has left in the file; None where no value is finite."""
    if w is None:
        return None
    finite = w[np.isfinite(w)]
    with np.errstate(over="ignore"):
        figures = (finite.min(), finite.max(), finite.mean()) if len(finite) else ()
    numbers = [_finite(value) for value in figures] or [None] * 3
    strange = len(w) - int(((w >= 0) & (w <= 1)).sum())
    return dict(zip(("least", "largest", "mean"), numbers, strict=True)) | {"outside_0_to_1": strange}


def _finite(value: float) -> float | None:
    """The number, or None where it is infinite or NaN, which JSON cannot hold."""
    return float(value) if np.isfinite(value) else None


def _stored_in_words(stored: dict[str, Any] | None) -> str:
    """What `_stored` has found, in a line."""
    if stored is None:
        return "none in the file"
    if stored["least"] is None:
        return "in the file, none of it finite"
    mean = float("inf") if stored["mean"] is None else stored["mean"]
    text = f"{stored['least']:.4g} to {stored['largest']:.4g}, mean {mean:.4g}"
    strange = stored["outside_0_to_1"]
    return f"{text}; {strange:,} values are not in [0, 1]" if strange else text
