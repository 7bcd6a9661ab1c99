"""What the faces of a mesh bound: solids, cavities, and solids whose faces look inwards by mistake."""

import numpy as np

from ..kernel.jit import kernel
from ..kernel.vector import cross, dot, length, load_triangle, subtract
from ..sampling import hash64
from ..system.parallel import each
from ..types import (
    Bools,
    Float32Rows,
    Float32s,
    Float64s,
    Int32Rows,
    Int32s,
    Int64Rows,
    Int64s,
    UInt64s,
)
from .mesh import Mesh
from .normals import face_areas
from .placement import Placement
from .weld import coincident, connected_components

_MOST_WORK = 1 << 27  # solid angles of faces; where it would take more, what a box encloses counts as enclosed


def closed_parts(vertices: Float32s, faces: Int32s, alone: bool = True) -> tuple[Int64s, Float64s]:
    """The connected part (n,) of each vertex, and six times the signed volume (p,) of each part, 0 of open ones.

    Vertices at the same place are one. At every edge of a closed part as many faces run one way as the other. The
    volume is negative where faces look inwards.
    """
    representative = coincident(vertices, faces)
    count = int(representative.max()) + 1
    corners = faces if count == len(vertices) else representative[faces]
    part = connected_components(corners, count)
    of_face = part[corners[:, 0]]
    if not alone and (of_face == of_face[:1]).all():
        return part[representative], np.zeros(int(part.max()) + 1)
    volume = _volumes(vertices, faces, part[representative])
    sums = np.zeros(len(volume), np.uint64)
    _sum_edges(corners, part, sums)
    return part[representative], np.where(sums == 0, volume, 0.0)


def inward_looking(vertices: Float32s, faces: Int32s) -> tuple[int, int, float]:
    """How many closed parts look inwards that are no cavities, how many closed parts there are, and the share of the
    mesh's area that those which look inwards have.

    A cavity is enclosed by a part that looks outwards. Parts are sought only if the faces of some component enclose a
    negative volume, so that this costs next to nothing where none looks inwards.
    """
    component = connected_components(faces, len(vertices))
    volume = _volumes(vertices, faces, component)
    if not (volume < 0).any():
        return 0, 0, 0.0
    part, volume = closed_parts(vertices, faces)
    of_face = part[faces[:, 0]]
    inward = (volume < 0) & ~_are_enclosed(vertices, faces, of_face, volume)
    areas = face_areas(vertices, faces)
    share = areas[inward[of_face]].sum() / max(areas.sum(), 1e-300)
    return int(np.count_nonzero(inward)), int(np.count_nonzero(volume)), float(share)


def inward_warnings(mesh: Mesh, vertices: Float32s | None = None) -> list[str]:
    """A line if closed parts of a mesh look inwards; or none. Args: vertices: of the mesh in render space."""
    inward, closed, share = inward_looking(Placement.of(mesh).vertices if vertices is None else vertices, mesh.faces)
    if not share:
        return []
    subject = "its faces look" if closed == 1 else f"{inward:,} of {closed:,} closed parts look"
    remedy = "--flip turns all faces over" if share > 0.5 else "turn only these over, where the mesh was made"
    return [f"{mesh.source}: {subject} inwards, so the inside is baked: {remedy}"]


def _are_enclosed(vertices: Float32s, faces: Int32s, of_face: Int64s, volume: Float64s) -> Bools:
    """Which parts (p,) of negative volume lie within parts that look outwards. Args: of_face: (m,), parts."""
    enclosed = np.zeros(len(volume), np.bool_)
    outward, inward = np.flatnonzero(volume > 0), np.flatnonzero(volume < 0)
    if not len(outward):
        return enclosed
    # The faces of each part, and the box about it.
    counts = np.bincount(of_face, minlength=len(volume))
    starts = np.concatenate([[0], np.cumsum(counts)])
    order = np.argsort(of_face, kind="stable")
    there = np.flatnonzero(counts)
    low, high = np.full((2, len(volume), 3), np.nan)
    low[there] = np.minimum.reduceat(vertices[faces[order]].min(axis=1), starts[there])
    high[there] = np.maximum.reduceat(vertices[faces[order]].max(axis=1), starts[there])
    # Parts whose boxes hold that of another: how often their faces wind about a corner of it.
    for part in inward.tolist():
        around = outward[(low[outward] <= low[part]).all(axis=1) & (high[outward] >= high[part]).all(axis=1)]
        if not len(around):
            continue
        if int(counts[around].sum()) * len(inward) > _MOST_WORK:
            enclosed[part] = True
            continue
        within = faces[np.concatenate([order[starts[outer] : starts[outer + 1]] for outer in around])]
        corner = vertices[faces[order[starts[part]], 0]].astype(np.float64)
        enclosed[part] = _winding(vertices, within, corner) > 0.5
    return enclosed


@kernel
def _winding(vertices: Float32Rows, faces: Int32Rows, point: Float64s) -> float:
    """How often faces wind about a point: the sum of their solid angles over 4π (van Oosterom and Strackee 1983)."""
    total = 0.0
    at = (point[0], point[1], point[2])
    for f in range(len(faces)):
        a, b, c = load_triangle(vertices, faces, f)
        a = subtract(a, at)
        b = subtract(b, at)
        c = subtract(c, at)
        la = length(a)
        lb = length(b)
        lc = length(c)
        along = la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb
        total += 2.0 * np.arctan2(dot(a, cross(b, c)), along)
    return total / (4.0 * np.pi)


def _volumes(vertices: Float32s, faces: Int32s, part: Int64s) -> Float64s:
    """Six times the volume (p,) that the faces of each part bound. Args: part: (n,), of each vertex."""
    of_face = np.empty(len(faces))
    _add_volumes(vertices, faces, of_face)
    if not part.any():
        return np.full(1, of_face.sum())
    return np.bincount(part[faces[:, 0]], of_face, int(part.max()) + 1).astype(np.float64, copy=False)


@each("faces")
def _add_volumes(f: int, vertices: Float32Rows, faces: Int32Rows, volume: Float64s) -> None:
    """Write six times the signed volume of the tetrahedron that each face spans with the origin."""
    a, b, c = load_triangle(vertices, faces, f)
    volume[f] = dot(a, cross(b, c))


@kernel
def _sum_edges(corners: Int32Rows | Int64Rows, part: Int64s, sums: UInt64s) -> None:
    """Add up hashes of the edges of each part (p,), negative ones of those that run downwards: 0 where as many run one
    way as the other. Args: corners: (m, 3), of faces. part: (n,), of each vertex. sums: zeros."""
    for f in range(len(corners)):
        for k in range(3):
            a = corners[f, k]
            b = corners[f, (k + 1) % 3]
            hashed = hash64(np.uint64(min(a, b)) << np.uint64(32) | np.uint64(max(a, b)))
            if a < b:
                sums[part[a]] += hashed
            elif a > b:
                sums[part[a]] -= hashed
