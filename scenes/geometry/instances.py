"""Instances of geometry, flattened to one mesh in world space; rotations as matrices (3, 3), float64."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from obscurance.raytrace.errors import InputError, MeshError
from obscurance.raytrace.mesh.mesh import Mesh, PerCorner
from obscurance.raytrace.mesh.opacity import Opacity
from obscurance.raytrace.system.checks import check_memory
from obscurance.raytrace.types import Float64s, Int64s

from .attributes import SourceAttributes, join_attributes, reversed_attributes

if TYPE_CHECKING:
    from obscurance.ao import Profile

MAX_COPIED = 20_000_000
_ROW = 80  # bytes of a placed vertex or triangle, with copies on the way to a mesh


class Instance(NamedTuple):
    """Triangles as a file stores them, and where its scene places them."""

    name: str  # what the file calls the object
    vertices: npt.NDArray[Any]  # (n, 3) numbers, in the object's own frame
    faces: npt.NDArray[Any]  # (m, 3) integers, indices into `vertices`
    normals: npt.NDArray[Any] | None = None  # (n, 3) numbers per vertex in the object's own frame, or None
    matrix: Float64s | None = None  # (4, 4) affine map to the world for column vectors, or None for the identity
    notes: tuple[str, ...] = ()  # warnings about the object
    attributes: SourceAttributes | None = None  # what else the file holds of the object, if that was asked for
    unread: tuple[str, ...] = ()  # what the file holds and nobody reads, in words
    w: npt.NDArray[Any] | None = None  # (n,) obscurance that a bake has left in the file, unchecked, or None
    profile: Profile | None = None  # that a bake has left in the file, or None
    opacity: Opacity | None = None  # alpha of the faces, or None
    up: str | None = None  # the axis that is up, if the file or its format defines it (`Mesh.up`)
    polygons: Int64s | None = None  # (m,) the polygon of each face, as `raytrace.Mesh` has it, or None
    corner_normals: PerCorner | None = None  # as `raytrace.Mesh` has them, of an object alone without a matrix; or None
    to_system: Float64s | None = None  # (4, 4), from the world to coordinates of the file's reference system; or None

    @property
    def volume(self) -> float:
        """The determinant of the matrix, by which volumes grow; below 0 if it mirrors."""
        return 1.0 if self.matrix is None else float(np.linalg.det(self.matrix[:3, :3]))

    @property
    def is_flattened(self) -> bool:
        """Whether there is nothing to see: no faces, or a matrix of no volume."""
        return not len(self.faces) or not self.volume


def with_sides(mesh: Mesh, low: float) -> Mesh:
    """Terrain, a surface z of x and y, as solid: with vertical sides from its borders down to z = `low`, or lower."""
    low = min(low, float(mesh.vertices[:, 2].min()))
    count = len(mesh.vertices)
    edges = np.concatenate([mesh.faces[:, [0, 1]], mesh.faces[:, [1, 2]], mesh.faces[:, [2, 0]]])
    border = edges[~np.isin(edges @ [count, 1], edges[:, ::-1] @ [count, 1])]  # those of one face
    foot = np.unique(border)
    below = mesh.vertices[foot] * [1, 1, 0] + [0, 0, low]
    a, b = border.T
    down_a, down_b = count + np.searchsorted(foot, border).T
    sides = np.concatenate([np.stack([a, down_a, b], axis=1), np.stack([b, down_a, down_b], axis=1)])
    return Mesh(
        np.concatenate([mesh.vertices, below]), np.concatenate([mesh.faces, sides]), source=mesh.source, up=mesh.up
    )


class Submesh(NamedTuple):
    """One placed object of a file: `mesh.vertices[part.vertices]`, `mesh.faces[part.faces]`."""

    name: str
    vertices: slice
    faces: slice


def check_copies(
    elements: int, stored: int, source: object, error: type[InputError] = MeshError, field: str = "objects"
) -> None:
    """Refuse a small file that fills the memory by repeating its `field`. Raises: `error`, MemoryLimitError.

    Args: elements: vertices and triangles, counted wherever they are placed. Each takes a byte or more where it is
        stored. stored: bytes that hold them.
    """
    limit = max(stored, MAX_COPIED)
    if elements > limit:
        raise error(source, field, f"at most {limit:,} vertices and triangles with all copies", f"{elements:,}")
    check_memory(source, _ROW * elements, f"to place {elements:,} vertices and triangles")


def flatten(instances: Sequence[Instance], source: str) -> tuple[Mesh, tuple[Submesh, ...]]:
    """One mesh of all instances, at least one, in their order, in world space.

    A mirroring matrix (negative determinant) reverses the winding of its faces, so that an outside stays an outside.
    Normals go by the inverse transpose; where only some instances have normals, the rest is NaN. Raises: MeshError.
    """
    parts = _parts(instances)
    up = instances[0].up
    if len(instances) == 1 and instances[0].matrix is None:
        only = instances[0]
        facts: dict[str, Any] = {"polygons": only.polygons, "corner_normals": only.corner_normals}
        return Mesh(only.vertices, only.faces, only.normals, source=source, opacity=only.opacity, up=up, **facts), parts
    # Each instance in its place.
    vertices = np.empty((parts[-1].vertices.stop, 3))
    faces = np.empty((parts[-1].faces.stop, 3), np.int64)
    has_normals = any(placed.normals is not None for placed in instances)
    normals = np.full(vertices.shape, np.nan) if has_normals else None
    opacities: list[Opacity | None] = []
    for placed, part in zip(instances, parts, strict=True):
        matrix = np.eye(4) if placed.matrix is None else placed.matrix
        linear = matrix[:3, :3]
        is_mirrored = placed.volume < 0
        vertices[part.vertices] = placed.vertices @ linear.T + matrix[:3, 3]
        # Indices are checked against the object's own vertices: shifted ones could fall into a neighbour's range.
        checked = Mesh(vertices[part.vertices], placed.faces, source=f"{source}: {placed.name}").faces
        faces[part.faces] = (checked[:, ::-1] if is_mirrored else checked) + part.vertices.start
        if normals is not None and placed.normals is not None:
            normals[part.vertices] = placed.normals @ cofactors(linear).T * (-1 if is_mirrored else 1)
        opacities.append(placed.opacity.reversed() if placed.opacity and is_mirrored else placed.opacity)
    opacity = Opacity.joined(opacities, [len(placed.faces) for placed in instances])
    polygons = _polygons(instances, parts)
    return Mesh(vertices, faces, normals, source=source, opacity=opacity, polygons=polygons, up=up), parts


def _parts(instances: Sequence[Instance]) -> tuple[Submesh, ...]:
    """Where each instance's vertices and faces are in a mesh of all instances, one after the other."""
    parts = []
    vertex = 0
    face = 0
    for placed in instances:
        vertices = slice(vertex, vertex + len(placed.vertices))
        faces = slice(face, face + len(placed.faces))
        parts.append(Submesh(placed.name, vertices, faces))
        vertex = vertices.stop
        face = faces.stop
    return tuple(parts)


def joined_attributes(instances: Sequence[Instance]) -> SourceAttributes | None:
    """The attributes kept beside the mesh that `flatten` makes; None where an object has none."""
    attributes = []
    for placed in instances:
        own_attributes = placed.attributes
        if own_attributes is None:
            return None
        attributes.append(reversed_attributes(own_attributes) if placed.volume < 0 else own_attributes)
    if len(attributes) == 1:
        return attributes[0]
    return join_attributes(attributes, [len(placed.vertices) for placed in instances])


def _polygons(instances: Sequence[Instance], parts: Sequence[Submesh]) -> Int64s | None:
    """The polygon of each face of a mesh of all instances, or None if all are triangles."""
    if all(placed.polygons is None for placed in instances):
        return None
    counted = [np.arange(len(placed.faces)) if placed.polygons is None else placed.polygons for placed in instances]
    return np.concatenate([part.faces.start + polygons for part, polygons in zip(parts, counted, strict=True)])


def cofactors(linear: Float64s) -> Float64s:
    """The cofactor matrices of (…, 3, 3), det · inverse transpose, which exist for flattening ones too."""
    x, y, z = np.moveaxis(linear, -2, 0)
    return np.stack([np.cross(y, z), np.cross(z, x), np.cross(x, y)], axis=-2)


def rotation_of_quaternion(quaternion: npt.ArrayLike) -> Float64s:
    """The rotation of a quaternion (x, y, z, w) of any length. Raises: ValueError: of length zero."""
    components = np.asarray(quaternion, np.float64)
    length = np.linalg.norm(components)
    if not length > 0:
        raise ValueError("a rotation by a quaternion of length zero")
    x, y, z, w = components / length
    return np.array(
        [
            [x * x - y * y - z * z + w * w, 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), -x * x + y * y - z * z + w * w, 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), -x * x - y * y + z * z + w * w],
        ]
    )


def rotation_about(axis: npt.ArrayLike, degrees: float) -> Float64s:
    """The rotation by an angle about an axis of any length but zero, counterclockwise seen from its tip."""
    half = np.radians(degrees) / 2
    unit = np.asarray(axis, np.float64) / np.linalg.norm(axis)
    return rotation_of_quaternion([*(np.sin(half) * unit), np.cos(half)])


def rotation_about_axes(degrees: npt.ArrayLike) -> Float64s:
    """The rotation by three angles about the fixed axes x, y and z, in this order."""
    x, y, z = np.asarray(degrees, np.float64)
    return rotation_about([0, 0, 1], z) @ rotation_about([0, 1, 0], y) @ rotation_about([1, 0, 0], x)
