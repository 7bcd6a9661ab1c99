"""Convex solids, whose vertices see nothing, and closed ones, which no ray from inside leaves."""

from __future__ import annotations

import numpy as np
from meshes import grid, raw_mesh, torus

from obscurance.raytrace.types import Float64s
from obscurance.scenes.geometry.builtin_shapes import menger
from obscurance.scenes.geometry.polyhedra import RawMesh, hull, icosphere, join, prism
from obscurance.scenes.geometry.primitives import box


def cube(cells: int) -> RawMesh:
    """The unit cube, each side with vertices of its own: hard edges."""
    return raw_mesh(box((0, 0, 0), (1, 1, 1), 1 / cells).mesh)


def ellipsoid(points: int, axes: tuple[float, float, float]) -> RawMesh:
    """Convex hull of random points on an ellipsoid: flat triangles where it is flat."""
    directions = np.random.default_rng(0).normal(size=(points, 3))
    return hull(directions / np.linalg.norm(directions, axis=1, keepdims=True) * axes)


def junctions(cells: int = 12) -> RawMesh:
    """A closed cube whose sides are cut unlike, so that the vertices of one lie on the edges of the next."""
    sides = []
    for side, turn in enumerate(_SIDES):
        vertices, faces = grid(cells if side % 2 else 1 + side)
        sides.append(((vertices + np.array([0, 0, 0.5])) @ turn.T, faces))
    return join(sides)


def stretched(part: RawMesh, axes: tuple[float, float, float]) -> RawMesh:
    """A part scaled along x, y and z."""
    return part[0] * axes, part[1]


def cone(sides: int) -> RawMesh:
    """The wall of a cone about +z: triangles that all meet at the apex, the first vertex."""
    angle = 2 * np.pi * np.arange(sides) / sides
    rim = np.stack([np.cos(angle), np.sin(angle), np.zeros(sides)], axis=-1)
    place = np.arange(sides)
    faces = np.stack([np.zeros(sides, int), place + 1, (place + 1) % sides + 1], axis=-1)
    return np.concatenate([[[0.0, 0.0, 2.0]], rim]), faces


def inward(part: RawMesh) -> RawMesh:
    """A part with its faces turned round."""
    return part[0], part[1][:, ::-1]


def _turn(x: tuple[int, int, int], y: tuple[int, int, int]) -> Float64s:
    return np.stack([x, y, np.cross(x, y)], axis=1).astype(np.float64)


_SIDES = [
    _turn((1, 0, 0), (0, 1, 0)), _turn((0, 1, 0), (0, 0, 1)), _turn((0, 0, 1), (1, 0, 0)),
    _turn((0, 1, 0), (1, 0, 0)), _turn((0, 0, 1), (0, 1, 0)), _turn((1, 0, 0), (0, 0, 1)),
]  # fmt: skip


TORN = {"cube with T-junctions"}  # by the rounding to float32 far from the origin
FLAT = TORN | {"plane", "cube, hard edges", "coarse cube, hard edges"}  # sides that this rounding makes truly bumpy


def convex() -> dict[str, RawMesh]:
    """Convex parts and open planes, by name."""
    return {
        "icosphere": icosphere(5),
        "cube, hard edges": cube(32),
        "coarse cube, hard edges": cube(8),
        "plane": grid(100),
        "cube with T-junctions": junctions(),
        "ellipsoid 1000:1:1": ellipsoid(2000, (1, 1e-3, 1e-3)),
        "ellipsoid 1000:1000:1": ellipsoid(2000, (1, 1, 1e-3)),
        "prism of slivers 10⁴:1": prism(64, 1e3),
        "prism of 3,000 slivers": prism(3000, 2.0),
        "cone of 5,000 slivers": cone(5000),
    }


def closed() -> dict[str, RawMesh]:
    """Closed parts that face outward, by name."""
    return {
        "icosphere": icosphere(4),
        "torus": torus(60, 30),
        "cube, hard edges": cube(20),
        "coarse cube, hard edges": cube(8),
        "cube with T-junctions": junctions(),
        "Menger sponge": raw_mesh(menger(2, 1.0, 1)),
        "slab 1000:1000:1": stretched(cube(8), (1, 1, 1e-3)),
        "ellipsoid 1000:1000:1": ellipsoid(2000, (1, 1, 1e-3)),
    }
