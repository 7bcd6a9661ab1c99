"""Small non-convex meshes that several test modules bake."""

from __future__ import annotations

import numpy as np

from obscurance.raytrace.mesh.mesh import Mesh
from obscurance.scenes.geometry.polyhedra import RawMesh, generic_rotation, hull, join


def raw_mesh(mesh: Mesh) -> RawMesh:
    """The vertices, to be changed at will, and the faces of a mesh."""
    return np.array(mesh.vertices), mesh.faces


def grid(cells: int, size: float = 1.0) -> RawMesh:
    """A square in z = 0 about the origin, facing +z; rows of vertices along y, one after the other along x."""
    steps = np.linspace(-size / 2, size / 2, cells + 1)
    x, y = (axis.ravel() for axis in np.meshgrid(steps, steps, indexing="ij"))
    first = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).ravel()
    right, across = first + cells + 1, first + cells + 2
    faces = np.concatenate([np.stack([first, right, across], -1), np.stack([first, across, first + 1], -1)])
    return np.stack([x, y, 0 * x], axis=-1), faces


def soup_over_floor(seed: int, triangles: int = 14) -> RawMesh:
    """Random triangles above a floor, none touching another's vertices."""
    rng = np.random.default_rng(seed)
    corners = rng.uniform(-1, 1, (triangles, 1, 3)) + rng.normal(scale=0.35, size=(triangles, 3, 3)) + [0, 0, 2]
    return join([grid(3, 4.0), (corners.reshape(-1, 3), np.arange(3 * triangles).reshape(-1, 3))])


def torus(major: int = 9, minor: int = 6, tube: float = 0.45) -> RawMesh:
    """A coarse torus of radius 1, smooth enough that no vertex normal lies behind a face."""
    u, v = np.meshgrid(np.arange(major), np.arange(minor), indexing="ij")
    a, b = 2 * np.pi * u.ravel() / major, 2 * np.pi * v.ravel() / minor
    ring = 1 + tube * np.cos(b)
    vertices = np.stack([ring * np.cos(a), ring * np.sin(a), tube * np.sin(b)], axis=-1)

    def index(i: np.ndarray, j: np.ndarray) -> np.ndarray:
        return (i % major * minor + j % minor).ravel()

    p, q, r, s = index(u, v), index(u + 1, v), index(u + 1, v + 1), index(u, v + 1)
    return vertices, np.concatenate([np.stack([p, q, r], axis=-1), np.stack([p, r, s], axis=-1)])


def two_boxes() -> RawMesh:
    """Two boxes a little apart, the second turned."""
    cube, faces = hull([(x, y, z) for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)])
    c, s = np.cos(0.4), np.sin(0.4)
    turned = cube @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]) * [0.8, 1.4, 0.7] + [1.6, -0.2, 0.1]
    return join([(cube, faces), (turned, faces)])


def hills(side: int = 8) -> RawMesh:
    """A height field with ridges and hollows."""
    vertices, faces = grid(side - 1, 2.0)
    x, y, _ = vertices.T
    z = 0.35 * np.sin(5 * x + 1) * np.cos(4 * y) + 0.2 * np.sin(9 * x * y)
    return np.stack([x, y, z], axis=-1), faces


def turned(part: RawMesh) -> RawMesh:
    """`part` off every coordinate axis: a normal at ±0 has either of two frames, by its sign."""
    return generic_rotation(6).apply(part[0]), part[1]


MESHES = {
    "soup": turned(soup_over_floor(1)),
    "other soup": turned(soup_over_floor(2)),
    "torus": turned(torus()),
    "boxes": turned(two_boxes()),
    "hills": turned(hills()),
}


def crumpled(part: RawMesh, share: float, seed: int) -> RawMesh:
    """`part` with noise of `share` of its mean edge in each coordinate, so that it folds over itself."""
    vertices, faces = part
    edges = vertices[faces] - vertices[np.roll(faces, 1, axis=1)]
    size = share * float(np.linalg.norm(edges, axis=2).mean())
    return vertices + np.random.default_rng(seed).normal(scale=size, size=vertices.shape), faces


def newell_normal(corners: np.ndarray) -> np.ndarray:
    """Unit normal (3,) of a polygon (k, 3), k ≥ 3, convex or not, not quite planar too (Martin Newell's sums)."""
    corners = np.asarray(corners, np.float64)
    following = np.roll(corners, -1, axis=0)
    sums = np.sum(np.roll(corners - following, -1, axis=1) * np.roll(corners + following, -2, axis=1), axis=0)
    return sums / np.linalg.norm(sums)
