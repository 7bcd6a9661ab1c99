"""Sheets of a cloud: which of the points near one are of the surface that it is of.

A sheet is where normals are alike, and where no point is far off along the mean of both normals: points of one sheet,
flat or evenly curved, are not.
"""

from typing import NamedTuple

import numpy as np

from obscurance.raytrace.kernel.jit import inline
from obscurance.raytrace.kernel.vector import dot, load, subtract
from obscurance.raytrace.system.parallel import each
from obscurance.raytrace.types import BoolRows, Float64Rows, Float64s, Int32Rows

NEIGHBOURS = 6
"""Nearest points of a sheet, to the last of which a disc reaches."""
NEAR = 32
"""Points among which those of a sheet are sought, at most."""
_OF_SHEET = 6  # nearest points that are of the point's own sheet at least
ALIKE = 0.5  # cosine between normals of one sheet, at least
FLAT = 0.03  # of a disc's radius, how far what is level with it is off at most
_APART = 48.0  # of how far a sheet's own points are off: off by more, and not level, is another sheet


class Cloud(NamedTuple):
    """Points and axes (k, 3), the radii of their discs (k,), those `near` each (k, j), and which are of its sheet."""

    points: Float64Rows
    axes: Float64Rows
    radius: Float64s
    near: Int32Rows
    of_sheet: BoolRows


@each("distances")
def tell_sheets(i: int, cloud: Cloud, distances: Float64Rows) -> None:
    """Fill in `of_sheet`, and the `radius`, which is the distance of the sixth neighbour before: a disc reaches to the
    sixth across edges, too, which does not lie on a sheet above or below.

    Args: distances: (k, 1 + j), of the point itself and of those near it.
    """
    least = np.full(_OF_SHEET, np.inf)  # distances of those with alike normals, sorted
    for j in range(cloud.near.shape[1]):
        facing, above, along = beside(cloud, i, j)
        off = abs(above + along) / 2.0
        if facing > ALIKE and off < least[-1]:
            k = _OF_SHEET - 1
            while k > 0 and least[k - 1] > off:
                least[k] = least[k - 1]
                k -= 1
            least[k] = off
    limit = max(_APART * least[min(_OF_SHEET, cloud.near.shape[1]) - 1], FLAT * cloud.radius[i])
    around = 0
    for j in range(cloud.near.shape[1]):
        facing, above, along = beside(cloud, i, j)
        of_sheet = facing > ALIKE and abs(above + along) / 2.0 <= limit
        cloud.of_sheet[i, j] = of_sheet
        if of_sheet or abs(facing) <= ALIKE:
            around += 1
            if around == NEIGHBOURS:
                cloud.radius[i] = distances[i, 1 + j]


@inline
def beside(cloud, i, j):
    """The cosine between the normals of point i and of the j-th near it, and how far this lies along both."""
    near = cloud.near[i, j]
    axis = load(cloud.axes, i)
    there = load(cloud.axes, near)
    between = subtract(load(cloud.points, near), load(cloud.points, i))
    return dot(there, axis), dot(between, axis), dot(between, there)
