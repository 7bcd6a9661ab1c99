"""Instances of geometry, flattened to one mesh in world space."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from raytrace import InputError, Mesh, MeshError, Opacity
from raytrace.system.checks import check_memory
from raytrace.types import Float64s, Int64s

from .attributes import SourceAttributes

if TYPE_CHECKING:
    from ao import Profile

MAX_COPIED = 20_000_000
_ROW = 80  # bytes of a placed vertex or triangle, with copies on the way to a mesh


@dataclass(frozen=True)
class Instance:
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

    @property
    def is_flattened(self) -> bool:
        """Whether there is nothing to see: no faces, or a matrix of no volume."""
        return not len(self.faces) or (self.matrix is not None and not np.linalg.det(self.matrix[:3, :3]))


@dataclass(frozen=True)
class Submesh:
    """One placed object of a file: `mesh.vertices[part.vertices]`, `mesh.faces[part.faces]`."""

    name: str
    vertices: slice
    faces: slice


def check_copies(
    rows: int, stored: int, source: object, error: type[InputError] = MeshError, field: str = "objects"
) -> None:
    """Refuse a small file that fills the memory by repeating its `field`. Raises: `error`, MemoryLimitError.

    Args: rows: vertices and triangles, counted wherever they are placed. Each takes a byte or more where it is stored.
        stored: bytes that hold them.
    """
    limit = max(stored, MAX_COPIED)
    if rows > limit:
        raise error(source, field, f"at most {limit:,} vertices and triangles with all copies", f"{rows:,}")
    check_memory(source, _ROW * rows, f"to place {rows:,} vertices and triangles")


def flatten(instances: Sequence[Instance], source: str) -> tuple[Mesh, tuple[Submesh, ...]]:
    """One mesh of all instances, in their order, in world space.

    A mirroring matrix (negative determinant) reverses the winding of its faces, so that an outside stays an outside.
    Normals go by the inverse transpose; where only some instances have normals, the rest is NaN. Raises: MeshError.
    """
    parts: list[Submesh] = []
    vertex = face = 0
    for placed in instances:
        first = vertex, face
        vertex = vertex + len(placed.vertices)
        face = face + len(placed.faces)
        parts.append(Submesh(placed.name, slice(first[0], vertex), slice(first[1], face)))
    more: dict[str, Any] = {"source": source, "up": instances[0].up if instances else None}
    if len(instances) == 1 and instances[0].matrix is None:
        only = instances[0]
        more |= {"opacity": only.opacity, "polygons": only.polygons}
        return Mesh(only.vertices, only.faces, only.normals, **more), tuple(parts)
    vertices = np.empty((vertex, 3))
    faces = np.empty((face, 3), np.int64)
    has_normals = any(placed.normals is not None for placed in instances)
    normals = np.full((vertex, 3), np.nan) if has_normals else None
    for placed, part in zip(instances, parts, strict=True):
        matrix = np.eye(4) if placed.matrix is None else placed.matrix
        linear = matrix[:3, :3]
        vertices[part.vertices] = placed.vertices @ linear.T + matrix[:3, 3]
        # Indices are checked against the object's own vertices: shifted ones could fall into a neighbour's range.
        checked = Mesh(vertices[part.vertices], placed.faces, source=f"{source}: {placed.name}")
        faces[part.faces] = (checked.faces[:, ::-1] if _is_mirrored(placed) else checked.faces) + part.vertices.start
        if normals is not None and placed.normals is not None:
            normals[part.vertices] = placed.normals @ cofactors(linear).T * (-1 if _is_mirrored(placed) else 1)
    turned = [each.opacity.reversed() if each.opacity and _is_mirrored(each) else each.opacity for each in instances]
    more["opacity"] = Opacity.joined(turned, [len(placed.faces) for placed in instances])
    if any(placed.polygons is not None for placed in instances):
        own = [np.arange(len(placed.faces)) if placed.polygons is None else placed.polygons for placed in instances]
        more["polygons"] = np.concatenate([part.faces.start + each for part, each in zip(parts, own, strict=True)])
    return Mesh(vertices, faces, normals, **more), tuple(parts)


def cofactors(linear: Float64s) -> Float64s:
    """The cofactor matrices of (…, 3, 3), det · inverse transpose, which exist for flattening ones too."""
    x, y, z = np.moveaxis(linear, -2, 0)
    return np.stack([np.cross(y, z), np.cross(z, x), np.cross(x, y)], axis=-2)


def _is_mirrored(placed: Instance) -> bool:
    return placed.matrix is not None and bool(np.linalg.det(placed.matrix[:3, :3]) < 0)
