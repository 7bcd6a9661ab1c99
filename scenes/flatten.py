"""Placed pieces of geometry become one mesh in world space."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from raytrace.mesh import Mesh


@dataclass(frozen=True)
class Instance:
    """Triangles as a file stores them, and where its scene places them.

    Attributes:
        name: what the file calls the object.
        vertices: (n, 3) numbers, in the object's own frame.
        faces: (m, 3) integers, indices into `vertices`.
        normals: (n, 3) numbers per vertex in the object's own frame, or None.
        matrix: (4, 4) affine map to the world for column vectors, or None for the identity.
    """

    name: str
    vertices: npt.NDArray[Any]
    faces: npt.NDArray[Any]
    normals: npt.NDArray[Any] | None = None
    matrix: npt.NDArray[np.float64] | None = None


@dataclass(frozen=True)
class Part:
    """One placed object of a file: `mesh.vertices[part.vertices]`, `mesh.faces[part.faces]`."""

    name: str
    vertices: slice
    faces: slice


def flatten(instances: Sequence[Instance], source: str) -> tuple[Mesh, tuple[Part, ...]]:
    """One mesh of all instances, in their order, in world space.

    A mirroring matrix (negative determinant) reverses the winding of its faces, so that an outside stays an outside.
    Normals go by the inverse transpose; where only some instances have them, the others' are NaN.

    Raises:
        MeshError: the arrays are not a mesh (`raytrace.Mesh`).
    """
    parts = []
    vertex = face = 0
    for instance in instances:
        vertex_end, face_end = vertex + len(instance.vertices), face + len(instance.faces)
        parts.append(Part(instance.name, slice(vertex, vertex_end), slice(face, face_end)))
        vertex, face = vertex_end, face_end
    if len(instances) == 1 and instances[0].matrix is None:
        only = instances[0]
        return Mesh(only.vertices, only.faces, only.normals, source=source), tuple(parts)
    vertices = np.empty((vertex, 3))
    faces = np.empty((face, 3), dtype=np.int64)
    has_normals = any(instance.normals is not None for instance in instances)
    normals = np.full((vertex, 3), np.nan) if has_normals else None
    for instance, part in zip(instances, parts, strict=True):
        _place(instance, part, vertices, faces, normals, source)
    return Mesh(vertices, faces, normals, source=source), tuple(parts)


def _place(
    instance: Instance,
    part: Part,
    vertices: npt.NDArray[np.float64],
    faces: npt.NDArray[np.int64],
    normals: npt.NDArray[np.float64] | None,
    source: str,
) -> None:
    matrix = np.eye(4) if instance.matrix is None else instance.matrix
    linear = matrix[:3, :3]
    mirrored = np.linalg.det(linear) < 0
    vertices[part.vertices] = instance.vertices @ linear.T + matrix[:3, 3]
    # Indices are checked against the object's own vertices: shifted ones could fall into a neighbour's range.
    own = Mesh(vertices[part.vertices], instance.faces, source=f"{source}: {instance.name}")
    faces[part.faces] = (own.faces[:, ::-1] if mirrored else own.faces) + part.vertices.start
    if normals is not None and instance.normals is not None:
        x, y, z = linear
        # The cofactor matrix is det·inverse transpose, and exists for a flattening matrix too.
        cofactor = np.stack([np.cross(y, z), np.cross(z, x), np.cross(x, y)])
        normals[part.vertices] = instance.normals @ cofactor.T * (-1 if mirrored else 1)
