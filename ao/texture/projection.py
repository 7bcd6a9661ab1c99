"""From a coarse mesh to a fine one: points of texels, or vertices, move along its smooth normals onto the fine surface.

A ray starts as far outside as the cage reaches and goes in, twice as far; what it meets first is what the texel shows.
A cage that is a mesh says for each point where its ray starts, and so its direction, too.
It goes on through holes that alpha makes.
Points that meet nothing take the closest one; where that is on the ray but for a hundredth of the cage, as on a border
that both meshes have, it counts as met.
"""

from dataclasses import replace
from typing import Any

import numpy as np

from raytrace.bvh.closest import closest_points
from raytrace.embree.rays import intersect
from raytrace.errors import MeshError, OptionError
from raytrace.mesh.mesh import Mesh, mesh_of
from raytrace.mesh.opacity import alphas
from raytrace.mesh.placement import NEAR, Placement
from raytrace.types import Float32s, Float64s, Int64s

from ..estimate.estimate import edges_of, estimate_outside
from ..estimate.inside import inside_solids
from ..estimate.tolerance import Estimate
from ..falloff import Length, is_length, resolve_length
from ..points.corners import CornerSamples
from ..points.receivers import Flag, find_receivers
from ..prepared import Inputs, Prepared
from ..result import PointValues
from .coverage import Coverage
from .gathering import begin_tracing
from .texels import find_texels

Groups = tuple[Int64s, Int64s]

_ROUNDED = 1e-6  # of coordinates, in single precision
_MOST_HOLES = 64  # that a ray goes through
_BESIDE = 0.01  # of the cage: how far from its ray a point that counts as met may be
_OWN_CORNERS = Flag.FOLDED | Flag.OPPOSED | Flag.CONTACT  # how the coarse mesh's faces lie matters to its own w alone


def project(
    coverage: Coverage,
    places: Float64s,
    normals: Float64s,
    prepared: Prepared,
    cage: float | Float64s,
    groups: Groups | None = None,
) -> tuple[Coverage, Int64s]:
    """The points of `coverage` on a fine surface, that of `prepared`, and which of them the cage misses, (j,).

    Args:
        places, normals: (k · slots, 3), the points on the coarse mesh and its unit normals there, in render space.
        cage: how far the fine surface may be, in mesh units, or points (k · slots, 3), which say which way, too.
        groups: of the points (k · slots,) and of the fine mesh's vertices, the first of which says that of a face.

    Raises: MeshError: no point meets anything, or no face has an area. OptionError: no face has a point's group.
    """
    receivers, threads = prepared.receivers, prepared.threads
    if not len(receivers.faces):
        raise MeshError(prepared.mesh.source, "faces", "some that have an area", "none")
    vertices = prepared.placement.vertices.astype(np.float64)
    low, high = (np.stack([ends(vertices, axis=0), ends(places, axis=0)]) for ends in (np.min, np.max))
    if isinstance(cage, float):
        reach = np.full(len(places), cage * prepared.placement.scale)
    else:
        outwards = (cage - prepared.placement.centre) * prepared.placement.scale - places
        reach = np.linalg.norm(outwards, axis=1)
        normals = np.where(reach[:, None] > 0, outwards / np.where(reach > 0, reach, 1)[:, None], normals)
    reach = np.minimum(reach, float(np.linalg.norm(high.max(axis=0) - low.min(axis=0))))
    own, of_vertex = groups or (np.zeros(len(places), np.int64), np.zeros(len(vertices), np.int64))
    of_face = np.asarray(of_vertex)[receivers.faces[:, 0]]
    if groups and len(lacking := np.setdiff1d(own, of_face)):
        raise OptionError("groups", "faces of the fine mesh in each", f"none in {lacking[0]}", prepared.mesh.source)
    match = (own, of_face) if groups else None
    starts = places + reach[:, None] * normals
    face, weights = _first_hits(prepared, starts, -normals, 2 * reach, _rounding(vertices, starts), match)
    missed = np.flatnonzero(face < 0)
    match = own[missed], of_face
    surface = vertices, receivers.faces
    closest = closest_points(receivers.tree, surface, places[missed], float(reach.max()) or 1.0, match, threads)
    face[missed], weights[missed] = closest
    away = np.einsum("kc,kci->ki", closest[1], vertices[receivers.faces[closest[0]]]) - places[missed]
    along = np.einsum("ki,ki->k", away, normals[missed])
    beside = np.linalg.norm(away - along[:, None] * normals[missed], axis=1)
    rounded = _rounding(vertices, places[missed])
    missed = missed[(np.abs(along) > reach[missed] + rounded) | (beside > _BESIDE * reach[missed] + rounded)]
    if len(missed) == len(face):
        expected = "some of it within the cage about the coarse mesh"
        raise MeshError(prepared.mesh.source, "surface", expected, "none")
    shape, count = coverage.face.shape, coverage.face.size
    found = face.astype(np.int32)
    projected = Coverage.of_points(coverage.texels, found[:count].reshape(shape), weights[:count].reshape(*shape, 3))
    return replace(
        projected, overlapping=coverage.overlapping, layers=coverage.layers,
        layer_face=found[count:], layer_barycentric=weights[count:],
    ), missed  # fmt: skip


def cage_of(cage: Length | Mesh | Any, mesh: Mesh) -> float | Mesh:
    """A cage about the coarse `mesh` in mesh units: a distance, or its own mesh.

    Raises: MeshError: it is none, or has not the vertices and faces of `mesh`; OptionError: it is no length.
    """
    if is_length(cage):
        return resolve_length("cage", cage, mesh.radius or 1.0)
    made = mesh_of(cage, "cage")
    for name in ("vertices", "faces"):
        expected, got = len(getattr(mesh, name)), len(getattr(made, name))
        if expected != got:
            raise MeshError(made.source, name, f"{expected:,}, as {mesh.source} has", f"{got:,}")
    return made


def _first_hits(
    prepared: Prepared, starts: Float64s, directions: Float64s, reach: Float64s, step: Float64s, match: Groups | None
) -> tuple[Int64s, Float32s]:
    """The face (k,) of its group that each ray meets first, −1 for none, and where on it (k, 3); not holes."""
    scene, opacity, threads = prepared.receivers.embree(), prepared.receivers.opacity, prepared.threads
    hits = intersect(scene, starts, directions, reach, threads)
    face, weights, distance = hits.face, hits.barycentric, hits.distance.astype(np.float64)
    rows = np.arange(len(face))
    for _ in range(_MOST_HOLES if opacity or match else 0):
        rows = rows[face[rows] >= 0]
        alpha = np.ones(len(rows))
        if opacity:
            alphas(opacity, face[rows], weights[rows, 1:].astype(np.float64), alpha)
        if match:
            alpha[match[0][rows] != match[1][face[rows]]] = 0
        rows = rows[alpha == 0]
        if not len(rows):
            break
        distance[rows] += step[rows]
        behind = starts[rows] + distance[rows, None] * directions[rows]
        hits = intersect(scene, behind, directions[rows], np.maximum(reach[rows] - distance[rows], 0), threads)
        face[rows], weights[rows] = hits.face, hits.barycentric
        distance[rows] += hits.distance
    if match:
        face[match[0] != match[1][face]] = -1
    return face, weights


def _rounding(vertices: Float64s, places: Float64s) -> Float64s:
    most = max(float(np.abs(vertices).max()), float(np.abs(places).max(initial=0.0)))
    return _ROUNDED * np.minimum(most, np.maximum(NEAR, np.abs(places).max(axis=1)))


def sample_fine_mesh(prepared: Prepared, high: Mesh, coarse: Mesh, inputs: Inputs) -> tuple[Prepared, PointValues]:
    """Estimate w of `high`, the mesh of `prepared`, at the vertices of `coarse`, which become the wanted points.

    Raises: MeshError: nothing is within the cage around `coarse`, or it is one of another mesh; or faces lack areas.
    """
    options, placement, fine, threads = prepared.options, prepared.placement, prepared.receivers, prepared.threads
    shown = find_receivers(coarse, Placement.of(coarse), options.normals)
    count = len(shown.points)
    if not count:
        raise MeshError(coarse.source, "faces", "some that have an area", "none")
    nowhere = np.zeros((count, 1), np.int32), np.zeros((count, 1, 3), np.float32)
    coverage = Coverage.of_points(np.arange(count), *nowhere)
    positions = (coarse.vertices[shown.first_vertex] - placement.centre) * placement.scale
    axes = shown.points.normals.astype(np.float64)
    cage = cage_of(options.cage, coarse)
    reach = cage.vertices[shown.first_vertex] if isinstance(cage, Mesh) else cage
    groups = inputs.groups and (np.asarray(inputs.groups[0])[shown.first_vertex], inputs.groups[1])
    coverage, missed = project(coverage, positions, axes, prepared, reach, groups)
    texels, _ = find_texels(coverage, coverage, prepared, "ignore")
    own = fine.faces[texels.face, 0]
    inside = inside_solids(texels.points, own, placement, fine, options.interior, threads)
    row_of = np.full(count + 1, -1)
    row_of[texels.texels] = np.arange(count)
    flags = shown.flags & ~np.uint8(_OWN_CORNERS)
    for points, flag in ((missed, Flag.MISSED), (texels.texels[inside], Flag.HIDDEN)):
        flags[np.isin(shown.of_vertex, points)] |= np.uint8(flag)
    tracer = begin_tracing(prepared, texels, "high to low", inputs.checkpoint)

    first = texels.first_points
    edges = edges_of(first, row_of[shown.of_vertex[shown.faces]], tracer)
    filled = inside & (options.interior != "mark")
    order = row_of[:-1]

    def estimated() -> tuple[Estimate, int]:
        found, untraced = estimate_outside(tracer, first, CornerSamples.none(), edges, filled, prepared.options)
        return replace(found, rows=found.rows[order], variance=found.variance[order]), untraced

    values = PointValues.of(tracer.each_column(estimated), tracer.rays)
    return replace(prepared, wanted=replace(shown, flags=flags)), values
