"""The built-in shapes of scene files, `builtin = "sphere"` for instance, with their parameters.

All stand about the origin, but for the temple, which stands on z = 0. Lengths are scene units; `fineness` is the
longest leg of a mesh triangle, and thus how fine w(p) can be.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from typing import Annotated

import numpy as np

from obscurance.raytrace.errors import OptionError
from obscurance.raytrace.mesh.mesh import Mesh
from obscurance.raytrace.system.checks import check_memory
from obscurance.raytrace.system.parameters import Length, Lengths, Parameters
from obscurance.raytrace.system.records import Within
from obscurance.raytrace.types import Bools, Int64s

from . import primitives
from .primitives import TexturedMesh, box, merge, tube

COLUMNS = (5, 3)  # along x and along y
SPACING = 1.5
COLUMN_RADIUS, COLUMN_HEIGHT = 0.28, 2.6
MAX_TRIANGLES = 20_000_000
_SIDES = 16  # triangles around a slim cylinder, the most of any shape
_TRIANGLE = 200  # bytes of one while it is made
_CELLS = 32  # along the longest side, where no fineness is given


def menger(level: int, size: float, cuts: int) -> Mesh:
    """The surface of the sponge of edge `size` about the origin, hard edges, exact normals.

    Args: level: as of `Sponge`. cuts: parts that the edge of a smallest cube is cut into.
    """
    solid = _solid(level)
    count = solid.shape[0] * cuts
    vertices = []
    faces = []
    normals = []
    start = 0
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
    beyond = np.pad(solid, ((1, 1), (0, 0), (0, 0)))[1 + side :][: len(solid)]
    cells = np.argwhere(solid & ~beyond)
    origin = (cells + np.array([int(side > 0), 0, 0])) * cuts
    parts = np.stack([np.zeros(cuts * cuts, np.int64), *np.indices((cuts, cuts)).reshape(2, -1)], axis=-1)
    turn = np.array([[0, 0, 0], [0, 1, 0], [0, 1, 1], [0, 0, 1]])[::side]
    return np.reshape(origin[:, None, None] + parts[None, :, None] + turn, (-1, 4, 3))


def temple(fineness: float = 0.07) -> Mesh:
    """Three steps, a ring of columns with bases and capitals, and a roof slab with a pediment block."""
    half = (np.array(COLUMNS) - 1) / 2 * SPACING + 0.55
    floor = 0.45
    top = floor + COLUMN_HEIGHT
    steps = [(0.075 + 0.15 * step, 2 * half + 0.5 * (3 - step), 0.15) for step in range(3)]
    roof = [(top + 0.2, 2 * half, 0.4), (top + 0.475, 2 * half + 0.4, 0.15), (top + 0.7, 2 * half - 0.6, 0.3)]
    blocks = [*steps, *roof, (floor + 0.45, np.array([1.5, 0.9]), 0.9)]
    boxes = [box((0, 0, middle), (*size, height), fineness) for middle, size, height in blocks]
    columns = [part for position in _column_places() for part in _column(*position, floor, fineness)]
    ground = box((0, 0, -0.05), (*(2 * half + 3.0), 0.1), fineness * 2)
    return merge([ground, *boxes[:3], *columns, *boxes[3:]], source="temple").mesh


def _column_places() -> list[tuple[float, float]]:
    """Where columns stand: the border of a grid."""
    x = SPACING * (np.arange(COLUMNS[0]) - (COLUMNS[0] - 1) / 2)
    y = SPACING * (np.arange(COLUMNS[1]) - (COLUMNS[1] - 1) / 2)
    return [(a, b) for a in x for b in y if abs(a) > x[-1] - 1e-9 or abs(b) > y[-1] - 1e-9]


def _column(x: float, y: float, floor: float, fineness: float) -> list[TexturedMesh]:
    """A shaft, its base and its capital."""
    cap = 0.14
    side = 2.6 * COLUMN_RADIUS
    shaft = tube((x, y, floor + cap), COLUMN_RADIUS, COLUMN_HEIGHT - 2 * cap, fineness)
    heights = floor + cap / 2, floor + COLUMN_HEIGHT - cap / 2
    return [shaft, *(box((x, y, height), (side, side, cap), fineness) for height in heights)]


class Solid(Parameters):
    """Base: the fineness of the mesh, a 32nd of the longest side unless given."""

    fineness: Length | None = None

    def geometry(self) -> TexturedMesh:
        """The mesh, with texture coordinates where the shape has some.

        Raises: OptionError: more than `MAX_TRIANGLES`. MemoryLimitError: they would not fit into memory.
        """
        count = self.triangles()
        name = type(self).__name__.lower()
        if not count <= MAX_TRIANGLES:
            expected = f"a length that makes at most {MAX_TRIANGLES:,} triangles"
            raise OptionError("fineness", expected, f"{self._length():g}", name)
        check_memory(name, int(_TRIANGLE * count), f"to make about {count:,.0f} triangles")
        return self._make(self._length())

    def triangles(self) -> float:
        """About how many triangles the mesh has; infinity is possible."""
        longest, area = self._extent()
        length = self._length()
        return max(_SIDES * longest / length, 2 * area / length / length)

    def _length(self) -> float:
        """The longest edge of the mesh."""
        return self._extent()[0] / _CELLS if self.fineness is None else self.fineness

    @abstractmethod
    def _extent(self) -> tuple[float, float]:
        """The longest side, and the area of the whole surface, roughly."""

    @abstractmethod
    def _make(self, fineness: float) -> TexturedMesh:
        """The mesh with edges of at most `fineness`."""


class Plane(Solid):
    """A rectangle in z = 0 facing +z, `size` along x and y; u along x, v along y."""

    size: tuple[Length, Length] = (1.0, 1.0)

    def _extent(self) -> tuple[float, float]:
        return max(self.size), self.size[0] * self.size[1]

    def _make(self, fineness: float) -> TexturedMesh:
        x, y = self.size
        return primitives.plane((-x / 2, -y / 2, 0), (x, 0, 0), (0, y, 0), fineness)


class Box(Solid):
    """A box of `size` along x, y and z (one number: a cube)."""

    size: Lengths = (1.0, 1.0, 1.0)

    def _extent(self) -> tuple[float, float]:
        x, y, z = self.size
        return max(x, y, z), 2 * (x * y + y * z + z * x)

    def _make(self, fineness: float) -> TexturedMesh:
        return primitives.box((0, 0, 0), self.size, fineness)


class Sphere(Solid):
    """A sphere of `radius`, poles on z."""

    radius: Length = 0.5

    def _extent(self) -> tuple[float, float]:
        return 2 * self.radius, 4 * math.pi * self.radius**2 * math.pi / 2

    def _make(self, fineness: float) -> TexturedMesh:
        return primitives.sphere(self.radius, fineness)


class Cylinder(Solid):
    """A closed cylinder of `radius` and `height`, axis z."""

    radius: Length = 0.5
    height: Length = 1.0

    def _extent(self) -> tuple[float, float]:
        return max(2 * self.radius, self.height), 2 * math.pi * self.radius * (self.height + 2 * self.radius)

    def _make(self, fineness: float) -> TexturedMesh:
        return primitives.cylinder(self.radius, self.height, fineness)


class Temple(Solid):
    """A colonnade on steps, about 8 × 5 × 4 units, z up; fineness .07 unless given."""

    fineness: Length = 0.07

    def _extent(self) -> tuple[float, float]:
        return 8.0, 700.0

    def _make(self, fineness: float) -> TexturedMesh:
        return TexturedMesh(temple(fineness))


class Sponge(Solid):
    """A Menger sponge of `size`, each cube without its middle seventh `level` times over, 0 to 4."""

    size: Length = 1.0
    level: Annotated[int, Within(0, 4)] = 3

    def _extent(self) -> tuple[float, float]:
        return self.size, (2 * (20 / 9) ** self.level + 4 * (8 / 9) ** self.level) * self.size**2

    def _make(self, fineness: float) -> TexturedMesh:
        cuts = max(math.ceil(self.size / 3**self.level / fineness), 1)
        return TexturedMesh(menger(self.level, self.size, cuts))


SOLIDS: dict[str, type[Solid]] = {
    solid.__name__.lower(): solid for solid in (Plane, Box, Sphere, Cylinder, Temple, Sponge)
}
