"""Scenes of flat patches: parallelograms in cells, with a front, each of a named object."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation


@dataclass(frozen=True, eq=False)
class Patch:
    """A parallelogram `corner` + s `u` + t `v`, s and t from 0 to 1, whose front is that of u × v.

    Attributes: cells: how many along u and v the file has. name: of its object.
    """

    corner: np.ndarray
    u: np.ndarray
    v: np.ndarray
    cells: tuple[int, int] = (2, 2)
    name: str = "floor"

    @property
    def normal(self):
        across = np.cross(self.u, self.v)
        return across / np.linalg.norm(across)

    def at(self, s, t):
        """Points (…, 3) at coordinates (…,)."""
        return self.corner + np.multiply.outer(s, self.u) + np.multiply.outer(t, self.v)

    def moved(self, matrix, shift=0.0):
        return Patch(matrix @ self.corner + shift, matrix @ self.u, matrix @ self.v, self.cells, self.name)

    def turned_over(self):
        return Patch(self.corner, self.v, self.u, self.cells[::-1], self.name)


def patch(corner, u, v, cells=(2, 2), name="floor"):
    return Patch(*(np.array(part, float) for part in (corner, u, v)), cells, name)


def box(low, high, cells=1, name="box", inwards=False, without=()):
    """The sides of a box, by numbers 2·axis + 1 if it is the upper one, but for those in `without`."""
    low, high = np.array(low, float), np.array(high, float)
    sides = []
    for axis in range(3):
        i, j = (axis + 1) % 3, (axis + 2) % 3
        u, v = np.zeros((2, 3))
        u[i], v[j] = high[i] - low[i], high[j] - low[j]
        for upper in (0, 1):
            if 2 * axis + upper not in without:
                corner = low.copy()
                corner[axis] = (low, high)[upper][axis]
                side = Patch(corner, u, v, (cells, cells), name)
                sides.append(side if bool(upper) != inwards else side.turned_over())
    return sides


TOP = 5


def floor(rng, side=1.0):
    cells = int(rng.integers(2, 6))
    return patch((-side, -side, 0), (2 * side, 0, 0), (0, 2 * side, 0), (cells, cells))


def open_box(rng):
    """A box without a lid, seen from the inside, some of it as a sheet and some with walls of a thickness."""
    height = rng.uniform(0.3, 1.5)
    inside = box((-0.5, -0.5, 0), (0.5, 0.5, height), int(rng.integers(2, 5)), "inside", True, (TOP,))
    if rng.random() < 0.5:
        return inside
    outside = box((-0.6, -0.6, -0.1), (0.6, 0.6, height), 1, "outside", False, (TOP,))
    rims = [patch((-0.6, -0.6, height), (1.2, 0, 0), (0, 0.1, 0), (1, 1), "rim")]
    rims.append(patch((-0.6, 0.5, height), (1.2, 0, 0), (0, 0.1, 0), (1, 1), "rim"))
    rims.append(patch((-0.6, -0.5, height), (0.1, 0, 0), (0, 1, 0), (1, 1), "rim"))
    rims.append(patch((0.5, -0.5, height), (0.1, 0, 0), (0, 1, 0), (1, 1), "rim"))
    return [*inside, *outside, *rims]


def boxes(rng):
    """Boxes that float over a floor, or stand on it without a bottom."""
    parts = [floor(rng)]
    for number in range(int(rng.integers(1, 4))):
        size = rng.uniform(0.1, 0.5, 3)
        low = np.append(rng.uniform(-0.9, 0.5, 2), rng.choice([0.0, rng.uniform(0.02, 0.4)]))
        without = (TOP - 1,) if low[2] == 0 else ()
        parts += box(low, low + size, 1, f"box{number}", without=without)
    return parts


def sheets(rng):
    """Sheets that lie over a floor, near or far, either way up."""
    parts = [floor(rng)]
    for number in range(int(rng.integers(1, 4))):
        gap = 10 ** rng.uniform(-3, -0.2)
        x, y = rng.uniform(-0.8, 0.3, 2)
        sheet = patch(
            (x, y, gap), (rng.uniform(0.2, 0.9), 0, 0), (0, rng.uniform(0.2, 0.9), 0), (2, 1), f"sheet{number}"
        )
        parts.append(sheet.turned_over() if rng.random() < 0.5 else sheet)
    return parts


def fins(rng):
    """Walls that stand on a floor, and lean."""
    parts = [floor(rng)]
    for number in range(int(rng.integers(1, 7))):
        angle, lean = rng.uniform(0, 2 * np.pi), rng.uniform(-0.5, 0.5)
        along = rng.uniform(0.1, 0.6) * np.array([np.cos(angle), np.sin(angle), 0])
        up = rng.uniform(0.1, 0.8) * np.array([-lean * np.sin(angle), lean * np.cos(angle), 1])
        parts.append(patch([*rng.uniform(-0.7, 0.4, 2), 0], along, up, (2, 2), f"fin{number}"))
    return parts


def stairs(rng):
    """Steps, a tread and a riser each."""
    count = int(rng.integers(2, 5))
    deep, high = rng.uniform(0.1, 0.5, 2)
    parts = []
    for step in range(count):
        parts.append(patch((step * deep, 0, step * high), (deep, 0, 0), (0, 1, 0), (2, 2), "stairs"))
        parts.append(patch((step * deep + deep, 1, step * high), (0, -1, 0), (0, 0, high), (2, 1), "stairs"))
    return parts


def loose(rng):
    """Parallelograms anywhere."""
    parts = []
    for number in range(int(rng.integers(2, 9))):
        u, v = rng.normal(size=(2, 3)) * 0.3
        parts.append(patch(rng.uniform(-0.5, 0.5, 3), u, v, (2, 2), f"loose{number}"))
    return parts


FAMILIES = (open_box, boxes, sheets, fins, stairs, loose)


def posed(parts, rng):
    """The scene turned, scaled and moved, and the numbers of its pose."""
    size = 10 ** rng.choice([0.0, 0.0, rng.uniform(-3, 3)])
    turn = np.eye(3) if rng.random() < 0.3 else Rotation.random(random_state=int(rng.integers(1 << 31))).as_matrix()
    shift = size * rng.choice([0.0, 0.0, 1e3]) * rng.normal(size=3)
    return [part.moved(size * turn, shift) for part in parts]
