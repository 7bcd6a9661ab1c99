"""A unit box seen from inside, open at the top, stored in several ways; and charts of its sides."""

import numpy as np
from uv_meshes import square

from obscurance.raytrace import Mesh

CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
SIDES = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2)]
"""Corners of the walls and last of the floor, anticlockwise as seen from inside."""
OPENING = CORNERS[[1, 5, 7, 3]]
INWARDS = np.array([np.cross(*(CORNERS[list(side)][[1, 3]] - CORNERS[side[0]])) for side in SIDES])
FACES = np.array([each for a, b, c, d in SIDES for each in ((a, b, c), (a, c, d))])
OF = np.repeat(np.arange(len(SIDES)), 6).reshape(-1, 3)


def box(form):
    """The box.

    Args: form: "shared": vertices are; "apart": each face has its own; "corners": normals at corners; "zero", "nan",
        "behind": such a normal at each vertex, or at each corner.
    """
    if form == "shared":
        return Mesh(CORNERS, FACES)
    if form == "apart":
        return Mesh(CORNERS[FACES].reshape(-1, 3), np.arange(FACES.size).reshape(-1, 3))
    if form == "corners":
        return Mesh(CORNERS, FACES, corner_normals=(2.0 * INWARDS, OF))
    if form == "behind":
        return Mesh(CORNERS, FACES, corner_normals=(-INWARDS, OF))
    return Mesh(CORNERS, FACES, np.full(CORNERS.shape, 0.0 if form == "zero" else np.nan))


def charts(cells):
    """Texture coordinates (m, 3, 2): each side a chart of `cells` texels on a page of 4 · `cells`."""
    page = 4 * cells
    starts = [(side % 3 * (cells + 2) / page, side // 3 * (cells + 4) / page) for side in range(len(SIDES))]
    squares = [square(x, y, x + cells / page, y + cells / page) for x, y in starts]
    return np.array([each[list(corners)] for each in squares for corners in ((0, 1, 2), (0, 2, 3))])
