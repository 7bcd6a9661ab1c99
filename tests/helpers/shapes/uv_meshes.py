"""Meshes with texture coordinates, for tests of textures."""

import numpy as np
import trimesh

from obscurance.raytrace import Mesh

FLOOR_AND_WALL = """v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nv -1 1 1\nv 1 1 1
vt .05 .05\nvt .95 .05\nvt .95 .45\nvt .05 .45\nvt .05 .55\nvt .95 .55\nvt .95 .95\nvt .05 .95
f 1/1 2/2 3/3 4/4\nf 4/5 3/6 6/7 5/8\n"""
"""An OBJ file of a floor and a wall, a chart of the page each."""


def rectangle(corner, u, v):
    """Four corners, in front of which u × v points."""
    corner, u, v = (np.array(each, float) for each in (corner, u, v))
    return np.array([corner, corner + u, corner + u + v, corner + v])


def square(x0, y0, x1, y1):
    """Texture coordinates of the corners of a `rectangle`."""
    return np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1)], float)


def quads(*pieces):
    """A mesh of rectangles, and the texture coordinates of its vertices. Args: pieces: (rectangle, square) each."""
    vertices, uv = (np.concatenate(column) for column in zip(*pieces, strict=True))
    faces = np.concatenate([np.array([[0, 1, 2], [0, 2, 3]]) + 4 * k for k in range(len(pieces))])
    return Mesh(vertices, faces), uv


def inward_cube(cells):
    """A closed unit cube seen from inside, each side a chart of whole texels on a page of 4 · `cells` texels.

    Returns: the mesh, its texture coordinates, and (column, row) of the texel at which each side's chart begins.
    """
    pieces, begins = [], []
    for side in range(6):
        axis, far = divmod(side, 2)
        n, u, v = np.eye(3)[axis] * (0.5 if far else -0.5), np.eye(3)[(axis + 1) % 3], np.eye(3)[(axis + 2) % 3]
        corner = n - u / 2 - v / 2
        x, y = 1 / 64 + side % 3 / 3.5, 1 / 64 + side // 3 / 2.5
        x, y = round(x * 4 * cells) / (4 * cells), round(y * 4 * cells) / (4 * cells)
        pieces.append((rectangle(corner, *((v, u) if far else (u, v))), square(x, y, x + 1 / 4, y + 1 / 4)))
        begins.append((round(x * 4 * cells), round((1 - y) * 4 * cells) - cells))
    mesh, uv = quads(*pieces)
    return mesh, uv, begins


def icosphere(subdivisions=2, radius=1.0, centre=(0, 0, 0)):
    """A sphere with every face a chart of its own, and texture coordinates (m, 3, 2)."""
    made = trimesh.creation.icosphere(subdivisions=subdivisions, radius=radius)
    return Mesh(made.vertices + np.array(centre), made.faces), grid_charts(len(made.faces))


def grid_charts(count):
    """Texture coordinates (count, 3, 2): one face in each cell of a square grid, with room around it."""
    side = int(np.ceil(np.sqrt(count)))
    cell = np.stack([np.arange(count) % side, np.arange(count) // side], axis=1)
    return (cell[:, None] + np.array([[0.1, 0.1], [0.9, 0.15], [0.3, 0.9]])) / side


def floor_and_wall(height=-0.01):
    """A floor at a height that is larger than 4 × 4 beside the plane x = 0, and a wall on it at x = −½."""
    return quads(
        (rectangle((-0.5, -60, height), (60, 0, 0), (0, 120, 0)), square(0, 0, 1, 1)),
        (rectangle((-0.5, 60, height), (0, -120, 0), (0, 0, 60)), square(0, 0, 1, 1)),
    )[0]
