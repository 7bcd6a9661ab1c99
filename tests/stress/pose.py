"""Poses of a mesh: rotated, scaled, far from the origin, stored in single precision."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from obscurance.ao.falloff import Exponential, Falloff, Tabulated
from obscurance.raytrace.mesh.mesh import Mesh
from obscurance.raytrace.types import Float64s
from obscurance.scenes.geometry.polyhedra import RawMesh, generic_rotation
from obscurance.scenes.validation.configurations import Configuration

_AWAY = np.array([0.6, -0.48, 0.64])
SCALES = tuple(10.0**k for k in range(-9, 10, 3))
OFFSETS = (0.0, 1.0, 1e2, 1e4, 1e6, 1e8)


@dataclass(frozen=True)
class Pose:
    """A similarity.

    Attributes:
        scale: of all lengths.
        offset: distance from the origin, in sizes of the mesh.
        turn: seed of a rotation, or None.
        single: round the coordinates to float32, as PLY and GLB files store them.
    """

    scale: float = 1.0
    offset: float = 0.0
    turn: int | None = None
    single: bool = False

    def __str__(self) -> str:
        parts = [f"scale {self.scale:g}", f"offset {self.offset:g}"]
        if self.turn is not None:
            parts.append(f"turn {self.turn}")
        if self.single:
            parts.append("float32")
        return ", ".join(parts)

    def vertices(self, vertices: Float64s, points: Float64s | None = None) -> Float64s:
        """A mesh's vertices (n, 3), their bounding box moved `offset` sizes off; or other points with it."""
        low, high = vertices.min(axis=0), vertices.max(axis=0)
        points = vertices if points is None else points
        moved = self.directions(points - (low + high) / 2) + self.offset * float((high - low).max()) * _AWAY
        moved = self.scale * moved
        return moved.astype(np.float32).astype(np.float64) if self.single else moved

    def directions(self, directions: Float64s) -> Float64s:
        """Directions (n, 3), turned."""
        return np.array(directions) if self.turn is None else generic_rotation(self.turn).apply(np.array(directions))

    def mesh(self, part: RawMesh, source: str = "mesh") -> Mesh:
        """A part as a mesh."""
        return Mesh(self.vertices(part[0]), part[1], source=source)

    def falloff(self, falloff: Falloff) -> Falloff:
        """The falloff that gives the same w."""
        limit = self.scale * float(falloff.max_distance)
        if isinstance(falloff, Exponential):
            assert falloff.tau is not None
            return Exponential(tau=falloff.tau / self.scale, max_distance=limit)
        assert not isinstance(falloff, Tabulated)
        return replace(falloff, max_distance=limit)

    def configuration(self, line: Configuration) -> Configuration:
        """A closed form's scene, whose w stays what it is."""
        normals = None if line.mesh.normals is None else self.directions(line.mesh.normals)
        mesh = Mesh(self.vertices(line.mesh.vertices), line.mesh.faces, normals, source=line.name)
        return replace(line, mesh=mesh, falloff=self.falloff(line.falloff))


def poses(long: bool) -> list[Pose]:
    """Scales 1e-9 to 1e9 times offsets 0 to 1e8, turned two ways or not: all, or a few that hold the extremes."""
    if long:
        pairs = product(enumerate(SCALES), enumerate(OFFSETS))
        return [Pose(scale, offset, (None, 5, 6)[(i + j) % 3]) for (i, scale), (j, offset) in pairs]
    few = [(1.0, 0.0, 5), (1e-9, 1e6, 6), (1e9, 1e8, None)]
    return [Pose(*values) for values in few]
