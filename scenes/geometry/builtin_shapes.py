"""The built-in shapes of scene files, `builtin = "sphere"` for instance, with their parameters.

All stand about the origin, but for the temple, which stands on z = 0. Lengths are scene units; `fineness` is the
longest leg of a mesh triangle, and thus how fine w(p) can be.
"""

import math
from abc import abstractmethod
from typing import Annotated

from pydantic import Field

from raytrace.errors import OptionError
from raytrace.system.memory import NEGLIGIBLE, check_memory
from raytrace.system.parameters import Length, Lengths, Parameters, Whole

from . import primitives
from .menger import menger
from .primitives import TexturedMesh
from .temple import temple

MAX_TRIANGLES = 20_000_000
_SIDES = 16  # triangles around a slim cylinder, the most of any shape
_TRIANGLE = 200  # bytes of one while it is made
_CELLS = 32  # along the longest side, where no fineness is given


class Solid(Parameters):
    """Base: the fineness of the mesh, a 32nd of the longest side unless given."""

    fineness: Length | None = None

    def geometry(self) -> TexturedMesh:
        """The mesh, with texture coordinates where the shape has some.

        Raises: OptionError: more than `MAX_TRIANGLES`. MemoryLimitError: they would not fit into memory.
        """
        count, name = self.triangles(), type(self).__name__.lower()
        if not count <= MAX_TRIANGLES:
            expected = f"a length that makes at most {MAX_TRIANGLES:,} triangles"
            raise OptionError("fineness", expected, f"{self._length():g}", name)
        if _TRIANGLE * count > NEGLIGIBLE:
            check_memory(name, int(_TRIANGLE * count), f"to make about {count:,.0f} triangles")
        return self._make(self._length())

    def triangles(self) -> float:
        """About how many triangles the mesh has; infinity is possible."""
        (longest, area), length = self._extent(), self._length()
        return max(_SIDES * longest / length, 2 * area / length / length)

    def _length(self) -> float:
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
    level: Annotated[Whole, Field(ge=0, le=4)] = 3

    def _extent(self) -> tuple[float, float]:
        return self.size, (2 * (20 / 9) ** self.level + 4 * (8 / 9) ** self.level) * self.size**2

    def _make(self, fineness: float) -> TexturedMesh:
        cuts = max(math.ceil(self.size / 3**self.level / fineness), 1)
        return TexturedMesh(menger(self.level, self.size, cuts))


SOLIDS: dict[str, type[Solid]] = {
    each.__name__.lower(): each for each in (Plane, Box, Sphere, Cylinder, Temple, Sponge)
}
