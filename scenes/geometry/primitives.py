"""Finely meshed planes, boxes, spheres and cylinders, of which the built-in scenes are made.

Each has exact normals, hard edges where its sides meet, and texture coordinates from 0 to 1 over every side.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from obscurance.raytrace.mesh.mesh import Mesh
from obscurance.raytrace.mesh.normals import normalize
from obscurance.raytrace.types import Float64s, Int64s


class Origin(NamedTuple):
    """The vertex of its file, of `total`, that each vertex of a mesh comes from: `of`, int64 (n,).

    `total` is 0 for a further object of the same file.
    """

    of: Int64s
    total: int


@dataclass(frozen=True, eq=False)
class TexturedMesh:
    """A mesh and its texture coordinates uv, float64 (n, 2), v upwards, or None."""

    mesh: Mesh
    uv: Float64s | None = None
    origin: Origin | None = None  # where the vertices come from, if they are not its file's one by one
    colours: Float64s | None = None  # linear RGB (n, 3) of the vertices, or None


def merge(pieces: Sequence[TexturedMesh], source: str) -> TexturedMesh:
    """All `pieces`, made by this module, as one; vertices and faces in order."""
    meshes = [piece.mesh for piece in pieces]
    starts = np.cumsum([0] + [len(mesh.vertices) for mesh in meshes[:-1]])
    faces = np.concatenate([mesh.faces + start for mesh, start in zip(meshes, starts, strict=True)])
    normals = np.concatenate([mesh.normals for mesh in meshes if mesh.normals is not None])
    mesh = Mesh(np.concatenate([mesh.vertices for mesh in meshes]), faces, normals, source=source, up="z")
    return TexturedMesh(mesh, np.concatenate([piece.uv for piece in pieces if piece.uv is not None]))


def plane(corner: npt.ArrayLike, along: npt.ArrayLike, across: npt.ArrayLike, fineness: float) -> TexturedMesh:
    """A parallelogram with normal along × across, cut into triangles with legs of at most `fineness`."""
    start = np.asarray(corner, np.float64)
    s_side = np.asarray(along, np.float64)
    t_side = np.asarray(across, np.float64)
    normal = normalize(np.cross(s_side, t_side))

    def surface(s: Float64s, t: Float64s) -> tuple[Float64s, Float64s]:
        return start + s * s_side + t * t_side, np.broadcast_to(normal, (*np.broadcast(s, t).shape[:-1], 3))

    cells = [max(int(np.ceil(np.linalg.norm(side) / fineness)), 1) for side in (s_side, t_side)]
    return _patch(surface, cells[0], cells[1], "plane")


def box(centre: npt.ArrayLike, size: npt.ArrayLike, fineness: float) -> TexturedMesh:
    """An axis-aligned box of `size` (3,) about `centre` (3,), outward normals, triangles with legs up to `fineness`."""
    sides = []
    extent = np.asarray(size, np.float64)
    for axis in range(3):
        along, across = np.diag(extent)[[axis - 2, axis - 1]]
        low = np.asarray(centre, np.float64) - extent / 2
        high = low + np.diag(extent)[axis]
        sides += [plane(high, along, across, fineness), plane(low, across, along, fineness)]
    return merge(sides, source="box")


def sphere(radius: float, fineness: float) -> TexturedMesh:
    """A sphere about the origin, poles on z; u runs around from +x, v from pole to pole upwards."""

    def surface(s: Float64s, t: Float64s) -> tuple[Float64s, Float64s]:
        """Points and normals at longitude 2πs and latitude π(t − ½)."""
        across = np.sin(np.pi * np.minimum(t, 1 - t))
        normal = np.concatenate(np.broadcast_arrays(*_ring(s, across), -np.cos(np.pi * t)), axis=-1)
        return radius * normal, normal

    rings = max(int(np.ceil(np.pi * radius / fineness)), 4)
    return _patch(surface, 2 * rings, rings, "sphere")


def tube(base: npt.ArrayLike, radius: float, height: float, fineness: float) -> TexturedMesh:
    """The side of a cylinder that stands on `base` along z, outward normals, no caps."""

    def surface(s: Float64s, t: Float64s) -> tuple[Float64s, Float64s]:
        x, y, z = np.broadcast_arrays(*_ring(s, np.ones_like(t)), height * t)
        sideways = np.concatenate([x, y, np.zeros_like(z)], axis=-1)
        return np.asarray(base, np.float64) + radius * sideways + z * [0.0, 0.0, 1.0], sideways

    return _patch(surface, _around(radius, fineness), max(int(np.ceil(height / fineness)), 1), "tube")


def cylinder(radius: float, height: float, fineness: float) -> TexturedMesh:
    """A closed cylinder about the origin along z, outward normals, triangles with legs of at most `fineness`."""

    def cap(side: float) -> Callable[[Float64s, Float64s], tuple[Float64s, Float64s]]:
        """The disc at the upper end, side 1, or the lower, −1, as `_patch` takes surfaces."""

        def surface(s: Float64s, t: Float64s) -> tuple[Float64s, Float64s]:
            x, y = np.broadcast_arrays(*_ring(side * s, radius * (1 - t)))
            z = np.full_like(x, side * height / 2)
            return np.concatenate([x, y, z], axis=-1), np.broadcast_to([0.0, 0.0, side], (*x.shape[:-1], 3))

        return surface

    around = _around(radius, fineness)
    rings = max(int(np.ceil(radius / fineness)), 1)
    caps = [_patch(cap(side), around, rings, "cap") for side in (1.0, -1.0)]
    return merge([tube((0, 0, -height / 2), radius, height, fineness), *caps], source="cylinder")


def _around(radius: float, fineness: float) -> int:
    return max(int(np.ceil(2 * np.pi * radius / fineness)), 8)


def _ring(turn: Float64s, radius: Float64s) -> tuple[Float64s, Float64s]:
    """x and y of a circle; whole turns meet exactly."""
    angle = 2 * np.pi * np.mod(turn, 1.0)
    return radius * np.cos(angle), radius * np.sin(angle)


def _patch(
    surface: Callable[[Float64s, Float64s], tuple[Float64s, Float64s]], rows: int, columns: int, name: str
) -> TexturedMesh:
    """A surface given by points and unit normals (…, 3) of s and t (…, 1) in [0, 1], facing ∂s × ∂t."""
    s, t = np.meshgrid(np.linspace(0, 1, rows + 1), np.linspace(0, 1, columns + 1), indexing="ij")
    stacked_points, stacked_normals = surface(s[..., None], t[..., None])
    points = stacked_points.reshape(-1, 3)
    normals = stacked_normals.reshape(-1, 3)
    index = np.arange((rows + 1) * (columns + 1)).reshape(rows + 1, columns + 1)
    corners = np.stack([index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]], axis=-1)
    faces = corners[..., [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3)
    places = points[faces]
    distinct = (places != np.roll(places, 1, axis=1)).any(axis=2).all(axis=1)
    return TexturedMesh(
        Mesh(points, faces[distinct], normals, source=name, up="z"), np.stack([s.ravel(), t.ravel()], axis=-1)
    )
