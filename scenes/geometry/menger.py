"""The Menger sponge: creases at every scale.

Source: Karl Menger, Allgemeine Räume und Cartesische Räume, 1926.
"""

import numpy as np

from raytrace.mesh.mesh import Mesh
from raytrace.types import Bools, Int64s


def menger(level: int, size: float, cuts: int) -> Mesh:
    """The surface of the sponge about the origin, hard edges, exact normals.

    Args:
        level: times that every cube loses its middle seventh, 0 (a cube) to 4.
        size: edge of the whole.
        cuts: parts that the edge of a smallest cube is cut into.
    """
    solid = _solid(level)
    count = solid.shape[0] * cuts
    vertices, faces, normals, start = [], [], [], 0
    for axis in range(3):
        for side in (1, -1):
            corners = _squares(np.moveaxis(solid, axis, 0), side, cuts)
            key, index = np.unique(corners @ [(count + 1) ** 2, count + 1, 1], return_inverse=True)
            lattice = np.stack([key // (count + 1) ** 2, key // (count + 1) % (count + 1), key % (count + 1)], axis=-1)
            vertices.append(np.roll(lattice, axis, axis=1) * (size / count) - size / 2)
            square = index.reshape(-1, 4)
            faces.append(square[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3) + start)
            normals.append(np.tile(side * np.eye(3)[axis], (len(key), 1)))
            start += len(key)
    return Mesh(np.concatenate(vertices), np.concatenate(faces), np.concatenate(normals), source="sponge", up="z")


def _solid(level: int) -> Bools:
    """The filled cells of the 3^level lattice."""
    middle = np.indices((3, 3, 3)) == 1
    solid = np.ones((1, 1, 1), bool)
    for _ in range(level):
        solid = np.kron(solid, middle.sum(axis=0) < 2).astype(bool)
    return solid


def _squares(solid: Bools, side: int, cuts: int) -> Int64s:
    """Lattice corners (k, 4, 3), counter-clockwise from outside, of the open faces of `solid` along ±its first axis."""
    beyond = np.zeros_like(solid)
    if side > 0:
        beyond[:-1] = solid[1:]
    else:
        beyond[1:] = solid[:-1]
    cells = np.argwhere(solid & ~beyond)
    first = (cells + np.array([int(side > 0), 0, 0])) * cuts
    parts = np.stack([np.zeros(cuts * cuts, np.int64), *np.indices((cuts, cuts)).reshape(2, -1)], axis=-1)
    turn = np.array([[0, 0, 0], [0, 1, 0], [0, 1, 1], [0, 0, 1]])[::side]
    return (first[:, None, None] + parts[None, :, None] + turn).reshape(-1, 4, 3)
