"""Places in a texel: parts of a sequence of points, four of each, that is even over it and shifted by chance.

The four points of a part are a rotated grid: no two are in one quarter of the texel's columns, or rows. So four parts
have a point in each of sixteen cells, where an additive recurrence moves them from part to part. Two and two have the
centre for their mean, by which means of linear functions are exact. The shift (Cranley & Patterson 1976) is each
texel's own, so that texels which look alike do not all miss the same.
"""

from typing import NamedTuple, Self

import numpy as np

from obscurance.raytrace.kernel.jit import inline
from obscurance.raytrace.sampling import hash32
from obscurance.raytrace.types import Int64s

SLOTS = 4  # points of a texel
POINTS = SLOTS + 1  # and its centre
_COLUMN = np.array([1, 0])  # of cells, in which points 0 and 2 lie; the others are opposite to them
_ROW = np.array([[0, 2], [3, 1], [2, 0], [1, 3]])  # the same of SLOTS parts, by which each cell has one
_OF_LAYER = np.array([0, 3, 1, 2])
"""Points of a layer that has one of each part, so that these are in all columns and rows."""
_STEP = np.array([1.7548776662466927, 2.5698402909980532]) / SLOTS
"""From part to part; SLOTS of it make one of the R2 sequence (Roberts 2018), by which each cell is even, too."""
_OF_POINTS, OF_AREA, _OF_CELLS, _OF_LAYERS = 0, 2, 4, 5  # numbers that are drawn


class Places(NamedTuple):
    """Where points lie in n texels."""

    parts: Int64s  # (n,), 0, 1, …, or (0,) where all have the first part
    key: int  # of 32 bits

    def of(self, rows: Int64s) -> Self:
        """The places in some texels."""
        return self._replace(parts=self.parts[rows]) if len(self.parts) else self


@inline
def point_in_texel(places, row, texel, k):
    """Where point k of a texel lies in it, from 0 to 1 along each axis; the last one is the centre.

    Args: row: of `Places`. texel: its number on the page.
    """
    if k == SLOTS:
        return 0.5, 0.5
    rows = _rows_of_part(places, row, texel)
    x, y = shift(places, row, texel, _OF_POINTS)
    x = (_COLUMN[k // 2] + x) / SLOTS
    y = (_ROW[rows, k // 2] + y) / SLOTS
    return (1.0 - x, 1.0 - y) if k % 2 else (x, y)


@inline
def points_of_layers(places, row, texel):
    """A number by chance to which that of a layer is added, and what tells which points it has; see `has_sample`."""
    turn = _random(places.key, texel, _OF_LAYERS) % SLOTS + _part(places, row) // SLOTS
    return turn, _rows_of_part(places, row, texel)


@inline
def has_sample(layer, k, of_layers, deepest, few):
    """Whether a layer has a sample at point k of a texel: all layers have equally many, and over the parts each is in
    all columns and rows of cells.

    Args: of_layers: of `points_of_layers`. deepest: how many layers there are. few: so many have one at each point.
    """
    turn, rows = of_layers
    if deepest <= 2:
        return (layer + turn + rows) % 2 == k // 2
    return deepest <= few or ((layer + turn) % SLOTS) ^ _OF_LAYER[rows] == k


@inline
def shift(places, row, texel, first):
    """Two numbers from 0 to 1 by which a texel's points are shifted, or with `OF_AREA` samples spread over area; see
    `point_in_texel`."""
    part = _part(places, row)
    x = _random(places.key, texel, first) * 2.0**-32 + part * _STEP[0]
    y = _random(places.key, texel, first + 1) * 2.0**-32 + part * _STEP[1]
    return x % 1.0, y % 1.0


@inline
def _rows_of_part(places, row, texel):
    """The row of `_ROW` by which the cells of a texel's part have their points."""
    return (_random(places.key, texel, _OF_CELLS) + _part(places, row)) % SLOTS


@inline
def _random(key, texel, number):
    return hash32(np.uint32(hash32(np.uint32(hash32(np.uint32(texel)) ^ np.uint32(key))) + np.uint32(number)))


@inline
def _part(places, row):
    return places.parts[row] if len(places.parts) > 0 else 0
