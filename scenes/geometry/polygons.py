"""Triangulation of polygons.

A polygon that its first corner sees whole, every convex one among them, is cut into a fan about that corner. Others are
seen along their Newell normal: four corners are cut by the other diagonal, more by clipping ears (mapbox_earcut; Held
2001, "FIST: fast industrial-strength triangulation of polygons"). A hole that a pair of coinciding edges ties to the
outline stays open.
"""

from bisect import bisect
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from obscurance.raytrace.errors import MeshError
from obscurance.raytrace.mesh.mesh import LARGEST
from obscurance.raytrace.types import AnyInts, Bools, Float64s, Int64s

MAX_EAR_WORK = 1 << 28  # squared numbers of corners, summed over polygons whose ears are clipped: at most 20 s or so
_EAR_WORK_PER_CORNER = 128  # and so much more for each
_BLOCK = 1 << 17  # corners that are looked at together
_FLAT = 1e-7  # of a polygon's area: how far a triangle of a fan may be turned over
_OVERLAP = 1e-5  # of a polygon's area: how much may be covered twice or not at all


class Triangulation(NamedTuple):
    """Polygons cut into triangles."""

    counts: Int64s  # (p,) triangles of each polygon
    crossing: int  # how many polygons no triangles between their own corners fill, because they cross themselves
    places: Int64s | None  # (m, 3) in the list of corners, by polygon; None if all polygons are triangles

    @property
    def notes(self) -> tuple[str, ...]:
        """Warnings about the polygons."""
        who = f"{self.crossing:,} polygons cross themselves" if self.crossing > 1 else "1 polygon crosses itself"
        what = "no triangles between the corners fill what does; cut it into triangles where it was made"
        short = np.count_nonzero(self.counts == 0)
        few = f"{short:,} faces of fewer than three corners are no triangles"
        return tuple(line for count, line in ((short, few), (self.crossing, f"{who}: {what}")) if count)

    @property
    def polygons(self) -> Int64s | None:
        """The polygon of each triangle, (m,), or None if all polygons are triangles."""
        return None if self.places is None else np.repeat(np.arange(len(self.counts)), self.counts)

    def take(self, values: npt.NDArray[Any]) -> npt.NDArray[Any]:
        """Values (m, 3) of the triangles, from values (c,) of the corners."""
        return values.reshape(-1, 3) if self.places is None else values[self.places]


class _Views(NamedTuple):
    """Polygons as their first corners see them."""

    normals: Float64s  # (p, 3) unit Newell normals, 0 if there is none
    offsets: Float64s  # (k, 3) corners from the first corner of each, the largest coordinate ±1
    areas: Float64s  # (p,) twice the area that the outline goes round, in the same unit
    # (p,) whether the fan about the first corner fills the polygon: a fan covers each point as often as the
    # outline winds around it, so it does unless triangles are turned over
    fills: Bools


def triangulate(
    vertices: npt.NDArray[Any], corners: AnyInts, sizes: AnyInts, source: object = "polygons"
) -> Triangulation:
    """Cut polygons into triangles between their own corners, wound as they are.

    Where an index or a coordinate is invalid, all become fans: `raytrace.Mesh` raises the error.

    Args: corners: vertex indices, polygon after polygon. sizes: (p,); fewer than 3 corners are no triangle.

    Raises: MeshError: concave polygons of so many corners that to cut them could take minutes.
    """
    lengths = sizes.astype(np.int64)
    if lengths.sum() != len(corners):
        raise ValueError(f"{len(corners)} corners for polygons of {lengths.sum()}")
    counts = np.maximum(lengths - 2, 0)
    if (lengths == 3).all():
        return Triangulation(counts, 0, None)
    starts = np.cumsum(lengths) - lengths
    other_diagonal: list[Int64s] = []
    clipped: dict[int, Int64s] = {}
    crossing = 0
    work = 0.0
    for polygons in _blocks(_doubtful(vertices, corners, starts, lengths), lengths):
        own_lengths = lengths[polygons]
        ends = np.cumsum(own_lengths)
        begins = ends - own_lengths
        flat_corners = np.repeat(starts[polygons] - begins, own_lengths) + np.arange(ends[-1])
        points = vertices[corners[flat_corners]].astype(np.float64)
        seen = _view(points, own_lengths)
        # Four corners that no fan about the first fills: one about the second, which is the other diagonal.
        four = np.flatnonzero(~seen.fills & (own_lengths == 4))
        from_second = points[begins[four][:, None] + [1, 2, 3, 0]].reshape(-1, 3)
        fills = _view(from_second, own_lengths[four]).fills if len(four) else np.empty(0, np.bool_)
        other_diagonal.append(polygons[four[fills]])
        crossing += int((~fills).sum())
        # More corners: ears are clipped.
        concave = np.flatnonzero(~seen.fills & (own_lengths > 4))
        work += float((own_lengths[concave].astype(np.float64) ** 2).sum())
        if work > MAX_EAR_WORK + _EAR_WORK_PER_CORNER * len(corners):
            limit = f"concave polygons of at most {int(MAX_EAR_WORK**0.5):,} corners, of fewer if there are many"
            raise MeshError(source, "faces", limit, f"one of {int(own_lengths[concave].max()):,}")
        for row in concave.tolist():
            offsets = seen.offsets[begins[row] : ends[row]]
            clipped[int(polygons[row])], fits = _clip(offsets, seen.normals[row], float(seen.areas[row]))
            crossing += not fits
    counts[list(clipped)] = [len(local) for local in clipped.values()]
    return Triangulation(counts, crossing, _triangles(starts, counts, clipped, other_diagonal))


def strip_triangles(corners: AnyInts, sizes: AnyInts) -> Int64s:
    """The triangles (m, 3) of strips, every other one turned over, so that all face one way.

    Args: corners: vertex indices, strip after strip; −1 parts strips, too. sizes: of the strips.
    """
    at = np.insert(corners.astype(np.int64), np.cumsum(sizes), -1)
    rows = np.arange(len(at))
    place = rows - np.maximum.accumulate(np.where(at < 0, rows, -1)) - 1
    triangles = np.stack([at[:-2], at[1:-1], at[2:]], axis=1) if len(at) > 2 else np.empty((0, 3), np.int64)
    odd = place[: len(triangles)] % 2 == 1
    triangles[odd] = triangles[odd, ::-1]
    return triangles[(triangles >= 0).all(axis=1)]


def _triangles(starts: Int64s, counts: Int64s, clipped: dict[int, Int64s], other_diagonal: list[Int64s]) -> Int64s:
    """Triangles (m, 3) of places in the list of corners: of most polygons a fan about its first corner.

    Args: starts: (p,), of polygons in the list. counts: (p,), of their triangles. clipped: triangles of the corners of
        polygons whose ears were clipped. other_diagonal: numbers of quadrilaterals that are cut from corner 1 to 3.
    """
    begins = np.cumsum(counts) - counts
    step = np.arange(counts.sum()) - np.repeat(begins, counts)
    first_corners = np.repeat(starts, counts)
    triangles = np.stack([first_corners, first_corners + step + 1, first_corners + step + 2], axis=1)
    for polygon, local in clipped.items():
        triangles[begins[polygon] : begins[polygon] + len(local)] = starts[polygon] + local
    if other_diagonal:
        quadrilaterals = np.concatenate(other_diagonal)
        for row, turned in enumerate(([1, 2, 3], [1, 3, 0])):
            triangles[begins[quadrilaterals] + row] = starts[quadrilaterals][:, None] + turned
    return triangles


def _clip(offsets: Float64s, normal: Float64s, area: float) -> tuple[Int64s, bool]:
    """Triangles (t, 3) of a concave polygon by clipping ears, and whether they fill it.

    Args:
        offsets: (k, 3), the corners from the first one on.
        normal: (3,), unit.
        area: of the polygon.
    """
    import mapbox_earcut

    along = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
    along /= max(float(np.linalg.norm(along)), 1e-300)
    flat = np.ascontiguousarray(offsets @ np.stack([along, np.cross(normal, along)], axis=1))
    ears = mapbox_earcut.triangulate_float64(flat, np.array([len(flat)], np.uint32))
    local = _with_all_corners(ears.reshape(-1, 3).tolist(), len(flat))
    if not len(local):
        fan = np.arange(1, len(flat) - 1)
        return np.stack([0 * fan, fan, fan + 1], axis=1), False
    first_corners = flat[local[:, 0]]
    edges = np.stack([flat[local[:, 1]] - first_corners, flat[local[:, 2]] - first_corners], axis=1)
    covered = float(np.abs(np.linalg.det(edges)).sum())
    return local, abs(covered - area) <= _OVERLAP * covered


def _with_all_corners(triangles: list[list[int]], count: int) -> Int64s:
    """Triangles (t, 3) with the corners that clipping has left out, for they are in line with their neighbours where
    the polygon is seen from: each divides the triangle at the edge that it lies on. None if there is no such edge."""
    used = sorted({corner for triangle in triangles for corner in triangle})
    for corner in sorted(set(range(count)).difference(used)):
        slot = bisect(used, corner)
        ends = {used[slot - 1], used[slot % len(used)]} if used else set()
        divided = next((triangle for triangle in triangles if ends.issubset(triangle)), None)
        if divided is None or len(ends) < 2:
            return np.empty((0, 3), np.int64)
        triangles.remove(divided)
        triangles += [[corner if corner_there == end else corner_there for corner_there in divided] for end in ends]
        used.insert(slot, corner)
    return np.array(triangles, np.int64).reshape(-1, 3)


def _view(points: Float64s, sizes: Int64s) -> _Views:
    """The polygons relative to their first corners, which has no cancellation far from the origin.

    Args:
        points: (c, 3), corners of all polygons in order.
        sizes: (p,), of the polygons.
    """
    begins = np.cumsum(sizes) - sizes
    of = np.repeat(np.arange(len(sizes)), sizes)
    offsets = points - points[begins][of]
    largest = np.maximum.reduceat(np.abs(offsets).max(axis=1), begins)
    offsets /= np.where(largest > 0, largest, 1.0)[of][:, None]
    after = np.roll(offsets, -1, axis=0)  # the next polygon's first, which is 0 too, after the last of each
    cross = np.cross(offsets, after)
    normals = np.add.reduceat(cross, begins)
    size = np.linalg.norm(cross, axis=1)
    areas = np.linalg.norm(normals, axis=1)
    gross = np.add.reduceat(size, begins)
    balanced = (areas <= 1e-12 * gross) & (gross > 0)
    if balanced.any():  # seen along the normal of the largest triangle
        peaks = np.flatnonzero(balanced[of] & (size == np.maximum.reduceat(size, begins)[of]))
        polygons, peak = np.unique(of[peaks], return_index=True)
        normals[polygons] = cross[peaks[peak]]
    length = np.linalg.norm(normals, axis=1)
    normals /= np.where(length > 0, length, 1.0)[:, None]
    normal = normals[of]
    signed = np.einsum("ij,ij->i", cross, normal)
    fills = np.minimum.reduceat(signed, begins) >= -_FLAT * np.add.reduceat(np.abs(signed), begins)
    return _Views(normals, offsets, areas, fills)


def _doubtful(vertices: npt.NDArray[Any], corners: AnyInts, starts: Int64s, sizes: Int64s) -> Int64s:
    """Numbers of the polygons of more than three corners, but for quadrilaterals whose two triangles face one way; none
    where an index or a coordinate is invalid."""
    is_valid = len(corners) and corners.min() >= 0 and corners.max() < len(vertices)
    if not is_valid or not np.abs(vertices).max() <= LARGEST:
        return np.empty(0, np.int64)
    doubtful = sizes > 3
    four = np.flatnonzero(sizes == 4)
    for block in np.split(four, range(_BLOCK, len(four), _BLOCK)):
        origin = vertices[corners[starts[block]]].astype(np.float64).T
        a = vertices[corners[starts[block] + 1]].astype(np.float64).T - origin
        b = vertices[corners[starts[block] + 2]].astype(np.float64).T - origin
        c = vertices[corners[starts[block] + 3]].astype(np.float64).T - origin
        with np.errstate(over="ignore", invalid="ignore"):  # (a × b) · (b × c)
            facing = (a[1] * b[2] - a[2] * b[1]) * (b[1] * c[2] - b[2] * c[1])
            facing += (a[2] * b[0] - a[0] * b[2]) * (b[2] * c[0] - b[0] * c[2])
            facing += (a[0] * b[1] - a[1] * b[0]) * (b[0] * c[1] - b[1] * c[0])
        doubtful[block] = ~(facing > 0)
    return np.flatnonzero(doubtful)


def _blocks(polygons: Int64s, sizes: Int64s) -> Iterator[Int64s]:
    """The polygons in runs of few corners, at least one polygon each."""
    block = np.cumsum(sizes[polygons]) // _BLOCK
    yield from np.split(polygons, np.flatnonzero(np.diff(block)) + 1) if len(polygons) else ()
