"""Simple polyhedra for test scenes: patches, polygons, convex hulls, icospheres, prisms."""

from collections.abc import Iterable

import numpy as np
import numpy.typing as npt
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from obscurance.raytrace.types import Float64s, Int64s

RawMesh = tuple[Float64s, Int64s]


def join(parts: Iterable[RawMesh]) -> RawMesh:
    """Several (vertices (n, 3), faces (m, 3)) as one, vertices in the order of the parts."""
    vertices, faces = zip(*parts, strict=True)
    starts = np.cumsum([0] + [len(points) for points in vertices[:-1]]).tolist()
    return np.concatenate(vertices), np.concatenate(
        [part_faces + start for part_faces, start in zip(faces, starts, strict=True)]
    )


def patches(points: npt.ArrayLike, size: float = 0.1) -> RawMesh:
    """A triangle at +x of each of `points` (k, 3), which becomes vertex 3i, facing +z; they may overlap."""
    points = np.asarray(points, dtype=np.float64)
    reach = size * np.array([[0.0, 0.0, 0.0], [0.8, -0.6, 0.0], [0.6, 0.8, 0.0]])
    return (points[:, None] + reach).reshape(-1, 3), np.arange(3 * len(points)).reshape(-1, 3)


def polygon(corners: npt.ArrayLike) -> RawMesh:
    """A convex polygon (k, 3) as a fan about its first corner."""
    corners = np.asarray(corners, dtype=np.float64)
    second = np.arange(1, len(corners) - 1)
    return corners, np.stack([np.zeros_like(second), second, second + 1], axis=-1)


def hull(points: npt.ArrayLike) -> RawMesh:
    """Convex hull of `points` (k, 3), all of them its corners, wound outward."""
    points = np.asarray(points, dtype=np.float64)
    convex = ConvexHull(points)
    faces = convex.simplices.astype(np.int64)
    corners = points[faces]
    facing = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    inward = np.einsum("ij,ij->i", facing, convex.equations[:, :3]) < 0
    faces[inward] = faces[inward][:, ::-1]
    return points, faces


def icosphere(subdivisions: int) -> RawMesh:
    """Unit sphere of 20·4^subdivisions triangles, from the icosahedron by halving edges; vertices exactly on it."""
    golden = (1 + np.sqrt(5)) / 2
    corners = [(0, a, b) for a in (-1, 1) for b in (-golden, golden)]
    vertices, faces = hull([corner[k:] + corner[:k] for corner in corners for k in range(3)])
    for _ in range(subdivisions):
        edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
        unique, which = np.unique(edges, axis=0, return_inverse=True)
        ab, bc, ca = which.reshape(3, -1) + len(vertices)
        a, b, c = faces.T
        faces = np.concatenate([np.stack(t, axis=-1) for t in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))])
        vertices = np.concatenate([vertices, vertices[unique].mean(axis=1)])
    return vertices / np.linalg.norm(vertices, axis=1, keepdims=True), faces


def prism(sides: int, length: float, rings: int = 2) -> RawMesh:
    """Open prism inscribed in the unit cylinder along y, from −length/2 to length/2, wound outward.

    Vertex i of ring j, at angle 2πi/sides from −z, is number j·sides + i.
    """
    angle = 2 * np.pi * np.arange(sides) / sides
    y = np.linspace(-length / 2, length / 2, rings)
    ring = np.stack([np.sin(angle), np.zeros(sides), -np.cos(angle)], axis=-1)
    vertices = (ring + np.array([0.0, 1.0, 0.0]) * y[:, None, None]).reshape(-1, 3)
    a = np.arange((rings - 1) * sides)
    b = a // sides * sides + (a + 1) % sides
    faces = np.concatenate([np.stack([a, a + sides, b], axis=-1), np.stack([b, a + sides, b + sides], axis=-1)])
    return vertices, faces


def inscribed_radius(part: RawMesh) -> float:
    """Distance of the nearest face plane from the origin: the radius of the largest ball in a convex part about it."""
    a, b, c = part[0][part[1]].transpose(1, 0, 2)
    normal = np.cross(b - a, c - a)
    return float(np.min(np.abs(np.einsum("ij,ij->i", normal, a)) / np.linalg.norm(normal, axis=1)))


def generic_rotation(seed: int) -> Rotation:
    """A rotation no axis of which is a coordinate axis, so that nothing can hide in an alignment."""
    return Rotation.from_quat(np.random.default_rng(seed).normal(size=4))
