"""Warnings of a mesh: coordinates too coarse for its faces, a few vertices far away, a base that lies on its side.

Coordinates are as its file stores them, or as float32 rays see them. A rounding of δ tilts a face of height h by about
δ/h; where the faces around a vertex are tilted so, no ray from there can be right. Heights below 10⁻⁵ of the
coordinates are reported: a tilt of .01, half a degree.
"""

from typing import NamedTuple

import numpy as np

from ..kernel.jit import inline, kernel
from ..kernel.vector import cross, dot, length, load_triangle, subtract
from ..system.parallel import each
from ..types import Bools, Float64Rows, Float64s, Int32Rows
from .mesh import Mesh
from .normals import face_areas
from .placement import Placement, near_box, sample

TILT = 0.01
_NO_AREA = 1e-15  # times the square of the longest edge: faces without area from the start
_FLAT = 1e-3  # of the mesh's size, that corners of faces at its bottom may be apart in height
_BASE, _NO_BASE = 0.5, 0.05  # of the bounding box's bottom, that faces at it have an area of


class Coarseness(NamedTuple):
    """Vertices of a mesh whose normals rounding makes unreliable."""

    vertices: int  # that have a normal which is uncertain by more than `TILT`
    tilt: float  # median uncertainty of their normals, radians
    spacing: float  # largest distance of neighbouring numbers among the coordinates of their faces, mesh units
    stored: bool  # whether the mesh's own coordinates are that coarse; else only those of render space


def coarseness(mesh: Mesh) -> Coarseness:
    """Look for vertices that rounding leaves without a reliable normal."""
    if not _may_tilt(mesh):
        return Coarseness(0, 0.0, 0.0, False)
    kind = np.float32 if _rounded_to_single(mesh.vertices) else np.float64
    placement = Placement.of(mesh)
    with np.errstate(over="ignore"):  # of vertices that no face uses
        placed = np.ldexp(mesh.vertices - placement.centre, int(np.log2(placement.scale)))
        stored = _spacing(mesh.vertices, kind) * placement.scale
    seen = _spacing(placed, np.float32)
    tilt, weight, spacing = np.zeros((3, len(placed)))
    _tilts(placed, mesh.faces, np.maximum(stored, seen), tilt, weight, spacing)
    tilt = np.divide(tilt, weight, out=np.zeros_like(tilt), where=weight > 0)
    bad = tilt > TILT
    if not bad.any():
        return Coarseness(0, 0.0, 0.0, False)
    coarsest = float(spacing[bad].max() / placement.scale)
    is_stored = bool((stored[bad] >= seen[bad]).mean() > 0.5)
    return Coarseness(int(np.count_nonzero(bad)), float(np.median(tilt[bad])), coarsest, is_stored)


def precision_warnings(mesh: Mesh) -> list[str]:
    """A line if coordinates are too coarse; or none."""
    coarse = coarseness(mesh)
    if not coarse.vertices:
        return []
    what = "its coordinates as stored" if coarse.stored else "float32 coordinates from the centre of the mesh"
    return [
        f"{mesh.source}: normals of {coarse.vertices:,} of {len(mesh.vertices):,} vertices are uncertain by"
        f" {np.degrees(coarse.tilt):.2g}° (median): {what} have steps of {coarse.spacing:.2g},"
        " too coarse for the faces there: move the mesh to the origin before it is stored, or store doubles"
    ]


def outlier_warnings(mesh: Mesh) -> list[str]:
    """A line if few vertices, very far away, make the radius that relative lengths are parts of; or none."""
    low, high = near_box(*mesh.bounds, mesh.used[sample(len(mesh.used))])
    if low is mesh.bounds[0]:
        return []
    size = float(np.linalg.norm(high - low)) / 2
    return [
        f"{mesh.source}: a few vertices far away make its radius {mesh.radius:.3g}, most lie within {size:.2g}:"
        f" give lengths in its own units, such as --half-distance {size / 2:.2g}"
    ]


def _may_tilt(mesh: Mesh) -> bool:
    """Whether a face would be tilted by more than `TILT` if all coordinates were as coarse as the largest float32."""
    spacing = float(_spacing(2 * np.array(mesh.bounds), np.float32).max())  # twice: from the centre of the mesh
    is_tilted = np.zeros(1, np.bool_)
    _find_tilted(mesh.vertices, mesh.faces, spacing, is_tilted)
    return bool(is_tilted[0])


@each("faces")
def _find_tilted(f: int, vertices: Float64Rows, faces: Int32Rows, spacing: float, is_tilted: Bools) -> None:
    """Set is_tilted[0] if a face may be tilted by more than `TILT`, its corners being off by half of `spacing`."""
    a, b, c = load_triangle(vertices, faces, f)
    double, longest = _doubled_area_and_longest_edge(a, b, c)
    if double > _NO_AREA * longest * longest and 0.5 * spacing * longest > TILT * double:
        is_tilted[0] = True


@inline
def _doubled_area_and_longest_edge(a, b, c):
    """Twice the area, and the longest edge, of a triangle."""
    ab = subtract(b, a)
    bc = subtract(c, b)
    ca = subtract(a, c)
    return length(cross(ab, bc)), np.sqrt(max(dot(ab, ab), dot(bc, bc), dot(ca, ca)))


def _rounded_to_single(vertices: Float64s) -> bool:
    """Whether coordinates were rounded to float32: all are float32 numbers, and last bits are used.

    About half of them are set by rounding; coordinates on a coarser grid, such as whole numbers, are exact.
    """
    with np.errstate(over="ignore"):
        single = vertices.astype(np.float32)
    return bool((single == vertices).all()) and float(np.mean(single.view(np.uint32) & 1)) > 1 / 16


def _spacing(vertices: Float64s, kind: type[np.floating]) -> Float64s:
    """Distance (n,) of neighbouring numbers of a kind at each vertex's largest coordinate."""
    with np.errstate(over="ignore"):
        largest = np.abs(vertices).max(axis=1).astype(kind)
    return np.asarray(np.spacing(np.minimum(largest, np.finfo(kind).max / 2)), np.float64)


@kernel
def _tilts(
    vertices: Float64Rows, faces: Int32Rows, spacing: Float64s, tilt: Float64s, weight: Float64s, widest: Float64s
) -> None:
    """Sum δ/h of each vertex's faces, weighted by their angles there, and the largest spacing among their corners."""
    for f in range(len(faces)):
        a, b, c = load_triangle(vertices, faces, f)
        double, longest = _doubled_area_and_longest_edge(a, b, c)
        if double <= _NO_AREA * longest * longest:
            continue
        coarse = max(spacing[faces[f, 0]], spacing[faces[f, 1]], spacing[faces[f, 2]])
        tilted = min(0.5 * coarse * longest / double, 1.0)
        for corner in range(3):
            v = faces[f, corner]
            angle = np.arctan2(double, dot(subtract(b, a), subtract(c, a)))
            weight[v] += angle
            tilt[v] += angle * tilted
            widest[v] = max(widest[v], coarse)
            a, b, c = b, c, a


def lying_notes(mesh: Mesh, up: str | None = None) -> list[str]:
    """A line if y is up for want of a better axis, and the mesh has a flat base across z and none across y.

    Args: up: the axis that was asked for.
    """
    if up or mesh.up or not mesh.bounds[1][2] > mesh.bounds[0][2]:
        return []
    if _base(mesh, 2) < _BASE or _base(mesh, 1) > _NO_BASE:
        return []
    return [f"{mesh.source}: y is taken for up, but the mesh seems to lie on its side: --up z"]


def _base(mesh: Mesh, axis: int) -> float:
    """The area of faces at the bottom along an axis, as a share of the bounding box's bottom."""
    low, high = mesh.bounds
    size = high - low
    heights = mesh.vertices[mesh.faces][:, :, axis] - low[axis]
    at_bottom = (heights <= _FLAT * size.max()).all(axis=1)
    bottom = float(np.prod(np.delete(size, axis)))
    areas = face_areas(mesh.vertices, mesh.faces[at_bottom])
    return float(areas.sum()) / bottom if bottom > 0 else 0.0
