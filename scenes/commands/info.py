"""`obscurance info`: content, extent and defects of a mesh file."""

from __future__ import annotations

import numpy as np

from ao.gather.receivers import Flag, find_receivers
from raytrace.errors import printable
from raytrace.mesh.normals import face_normals
from raytrace.mesh.placement import Placement
from raytrace.mesh.precision import precision_warnings
from raytrace.types import Float64s

from ..gltf.container import primitives
from ..gltf.occlusion import RAMP, image_name, occlusion_reference
from ..gltf.schema import check_materials
from ..readers.load import MeshFile


def describe(source: MeshFile) -> list[tuple[str, str]]:
    """Rows (name, value) about a file's objects, its extent, its defects and what a bake would do with it."""
    mesh = source.mesh
    placement = Placement.of(mesh)
    receivers = find_receivers(mesh, placement)
    _, area = face_normals(placement.vertices.astype(np.float64), mesh.faces)
    edges = np.sort(mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    uses = np.unique(edges[:, 0] * len(mesh.vertices) + edges[:, 1], return_counts=True)[1]
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    rows = [
        ("file", printable(str(source.path))),
        ("objects", f"{len(source.parts)}: " + ", ".join(printable(part.name) for part in source.parts[:8])),
        ("vertices", f"{len(mesh.vertices):,}"),
        ("faces", f"{len(mesh.faces):,}, {len(mesh.faces) - len(receivers.faces):,} of them degenerate"),
        ("edges", f"{len(uses):,}: {(uses == 1).sum():,} open, {(uses > 2).sum():,} between three faces or more"),
        ("bounds", " – ".join("(" + ", ".join(f"{c:.6g}" for c in corner) + ")" for corner in (low, high))),
        ("radius", f"{mesh.radius:.6g}, of the bounding sphere: 100 % for relative distances"),
        ("area", f"{float(area.sum()) / placement.scale / placement.scale:.6g}"),
        ("normals", "none in the file" if mesh.normals is None else "in the file"),
        ("stored w", _stored(source.w)),
        ("occlusion", _occlusion(source)),
        ("points to bake", f"{len(receivers.points):,}, coincident vertices once"),
    ]
    for flag in Flag:
        count = int(np.count_nonzero(receivers.flags & flag))
        if count:
            rows.append((f"{(flag.name or '').lower()} vertices", f"{count:,}"))
    rows += [("warning", note.removeprefix(f"{source.path}: ")) for note in source.notes]
    rows += [("warning", warning.removeprefix(f"{mesh.source}: ")) for warning in precision_warnings(mesh)]
    return rows


def _occlusion(source: MeshFile) -> str:
    """How many primitives of a glTF file have occlusion textures, and how many of those are ramps of a bake."""
    if source.gltf is None:
        return "no textures in the file"
    header = source.gltf.header
    check_materials(header, source.path)
    pieces = [header["meshes"][each.mesh]["primitives"][each.place] for each in primitives(header)]
    references = [occlusion_reference(header, piece.get("material")) for piece in pieces]
    found = [reference for reference in references if reference]
    ramps = sum(image_name(header, reference) == RAMP for reference in found)
    if not found:
        return "no textures in the file"
    text = f"textures of {len(found):,} of {len(pieces):,} primitives"
    return text + (f", {ramps:,} of them ramps of a bake" if ramps else "")


def _stored(w: Float64s | None) -> str:
    """Range and mean of the w that a bake has left in the file."""
    if w is None:
        return "none in the file"
    finite = w[np.isfinite(w)]
    if not len(finite):
        return "in the file, none of it finite"
    with np.errstate(over="ignore"):
        text = f"{finite.min():.4g} to {finite.max():.4g}, mean {finite.mean():.4g}"
    strange = len(w) - int(((w >= 0) & (w <= 1)).sum())
    return f"{text}; {strange:,} values are not in [0, 1]" if strange else text
