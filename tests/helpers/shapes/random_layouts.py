"""Meshes with layouts as other people make them, drawn anew by a seed: a function of a random generator each.

Each gives vertices (n, 3), faces (m, 3), texture coordinates (m, 3, 2) by face and corner, and w where it is the same
everywhere, or None.
"""

import numpy as np


def fold(rng):
    """None for a flat sheet, or how steeply z rises with |y|."""
    return None if rng.random() < 0.5 else rng.uniform(0.3, 3.0)


def bent(points, slope):
    """Points (n, 2) of a sheet, flat or folded to a valley along y = 0, and w of that."""
    height = np.zeros(len(points)) if slope is None else slope * np.abs(points[:, 1])
    return np.column_stack([points, height]), 1.0 if slope is None else None


def placed(uv, rng):
    """Texture coordinates turned, scaled to a part of the page or far less than a texel, and moved to fit into it."""
    turn = rng.uniform(0, 2 * np.pi) if rng.random() < 0.7 else rng.integers(4) * np.pi / 2
    uv = uv @ np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    low, size = uv.min(axis=(0, 1)), np.ptp(uv, axis=(0, 1)).max()
    scale = 0.98 * (1.0 if rng.random() < 0.5 else 10 ** rng.uniform(-4, 0))
    uv = (uv - low) * scale / size
    return uv + rng.uniform(0, 1 - uv.max(axis=(0, 1)))


def dart(rng):
    """Two triangles that share an edge of the surface; both lie on the same side of it on the page, or nearly."""
    points, w = bent(np.array([[0, 0], [1, 0], [0, 1], [0, -1]], float), fold(rng))
    tip, other = rng.uniform(0.2, 1, 2), rng.uniform(0.2, 1, 2) * [1, -1]
    base = np.array([rng.uniform(0.3, 1), 0.0])
    gap = rng.choice([0.0, 1e-5, 0.02]) * np.array([0, 1.0])
    uv = np.array([[[0, 0], base, tip], [base - gap, -gap, other * [1, rng.choice([-1, 1])]]])
    return points, np.array([[0, 1, 2], [1, 0, 3]]), placed(uv, rng), w


def darts(rng):
    """A strip of triangles whose neighbours are folded onto each other on the page: seams whose sides are the same."""
    count = int(rng.integers(2, 12))
    x = np.arange(count + 2) / 2
    points, w = bent(np.column_stack([x, np.arange(count + 2) % 2 - 0.5]), fold(rng))
    faces = np.array([[k, k + 1, k + 2] if k % 2 else [k + 1, k, k + 2] for k in range(count)])
    one = rng.random((3, 2))
    uv = np.array([one[(face - k) % 3] for k, face in enumerate(faces)])
    if rng.random() < 0.5:
        uv += rng.uniform(0, 0.05, (count, 1, 2))
    return points, faces, placed(uv, rng), w


def pole(rng):
    """A latitude–longitude sphere: faces at the poles have corners of their own on the page, or an edge there."""
    columns, rows = int(rng.integers(3, 24)), int(rng.integers(2, 12))
    phi, theta = np.meshgrid(np.arange(columns) * 2 * np.pi / columns, np.arange(rows + 1) * np.pi / rows)
    points = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)
    faces, uv = [], []
    apex = rng.choice([0.0, 0.5, 1.0])
    number = np.arange(columns * (rows + 1)).reshape(rows + 1, columns)
    number[0], number[-1] = 0, number[-1, 0]
    for i in range(rows):
        for j in range(columns):
            a, b, c, d = (i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)
            for corners in ((a, b, c), (a, c, d)):
                vertices = [number[y, x % columns] for y, x in corners]
                if len(set(vertices)) == 3:
                    faces.append(vertices)
                    uv.append([(x + (apex - x + j if y in (0, rows) else 0), rows - y) for y, x in corners])
    return points.reshape(-1, 3), np.array(faces), placed(np.array(uv, float) / [columns, rows], rng), 1.0


def slit(rng):
    """A tube cut open, its layout wrapped around so that the slit meets itself, or stands a hair apart."""
    count = int(rng.integers(3, 40))
    turns = np.arange(count) * 2 * np.pi / count
    points = np.array([[np.cos(t), np.sin(t), z] for t in turns for z in (0, 1)])
    radius, thick = rng.uniform(0.2, 0.8), rng.uniform(0.05, 0.3)
    angles = np.arange(count + 1) * (2 * np.pi - rng.choice([0.0, 1e-6, 1e-2])) / count
    ring = [[(r * np.cos(t), r * np.sin(t)) for r in (radius, radius + thick)] for t in angles]
    faces, uv = [], []
    for k in range(count):
        a, b = 2 * k, 2 * ((k + 1) % count)
        faces += [[a, b, b + 1], [a, b + 1, a + 1]]
        uv += [[ring[k][0], ring[k + 1][0], ring[k + 1][1]], [ring[k][0], ring[k + 1][1], ring[k][1]]]
    return points, np.array(faces), placed(np.array(uv), rng), 1.0


def fan(rng):
    """Triangles about a point, each a chart; they lie side by side, over one another or at random."""
    count = int(rng.integers(3, 30))
    turns = np.arange(count) * 2 * np.pi / count
    points = np.column_stack([np.append(0, np.cos(turns)), np.append(0, np.sin(turns)), np.append(0, 0 * turns)])
    points[0, 2] = rng.choice([0.0, -rng.uniform(0, 2)])
    faces = np.array([[0, 1 + k, 1 + (k + 1) % count] for k in range(count)])
    leaf = np.array([[0, 0], [1, -0.3], [1, 0.3]]) * rng.uniform(0.1, 1, (1, 2))
    shift = np.arange(count)[:, None] * [0, 0.7]
    if rng.random() < 0.5:
        shift = rng.random((count, 2)) * rng.choice([0.0, 1.0, 5.0])
    return points, faces, placed(leaf + shift[:, None], rng), 1.0 if points[0, 2] == 0 else None


def mirrored(rng):
    """Two halves that show the same part of the page, exactly or nearly."""
    points, w = bent(np.array([[x, y] for y in (-1, 0, 1) for x in (0, 1, 2)], float), fold(rng))
    quads = [[0, 1, 4, 3], [1, 2, 5, 4], [3, 4, 7, 6], [4, 5, 8, 7]]
    faces = np.array([corners for a, b, c, d in quads for corners in ((a, b, c), (a, c, d))])
    uv = np.abs(points[:, :2] - [rng.choice([0, 1]), 0])[faces]
    return points, faces, placed(uv + rng.choice([0.0, 1e-3]) * rng.random((len(faces), 1, 2)), rng), w


def islands(rng):
    """A bumpy grid of quads, each a chart of its own: side by side with shared edges, or small squares far apart."""
    side = int(rng.integers(2, 14))
    y, x = np.mgrid[: side + 1, : side + 1]
    flat = rng.random() < 0.5
    height = np.zeros(x.shape) if flat else rng.uniform(0, 0.6, x.shape)
    points = np.stack([x, y, height], axis=-1).reshape(-1, 3).astype(float)
    number = np.arange((side + 1) ** 2).reshape(side + 1, -1)
    cells = rng.permutation(side * side)
    fill = rng.choice([1.0, 0.9, 0.25, 0.02])
    faces, uv = [], []
    for k in range(side * side):
        i, j = divmod(k, side)
        corner = np.array(divmod(cells[k], side), float)
        quad = [number[i, j], number[i, j + 1], number[i + 1, j + 1], number[i + 1, j]]
        square = np.roll(corner + fill * np.array([[0, 0], [1, 0], [1, 1], [0, 1]]), rng.integers(4), axis=0)
        for a, b, c in ((0, 1, 2), (0, 2, 3)):
            faces.append([quad[a], quad[b], quad[c]])
            uv.append(square[[a, b, c]])
    return points, np.array(faces), placed(np.array(uv), rng), 1.0 if flat else None


def crumbs(rng):
    """A ball or a sheet of many faces of which each lies anywhere on the page, some of no area, some upside down."""
    side = int(rng.integers(3, 20))
    y, x = np.mgrid[: side + 1, : side + 1] / side
    slope = fold(rng)
    points, w = bent(np.stack([x, y - 0.5], axis=-1).reshape(-1, 2), slope)
    number = np.arange((side + 1) ** 2).reshape(side + 1, -1)
    a, b, c, d = number[:-1, :-1].ravel(), number[:-1, 1:].ravel(), number[1:, 1:].ravel(), number[1:, :-1].ravel()
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    uv = rng.random((len(faces), 1, 2)) + 10 ** rng.uniform(-3, 0) * rng.normal(size=(len(faces), 3, 2))
    flat = rng.random(len(faces)) < 0.1
    flat[0] = False
    uv[flat, 2] = uv[flat, 0]
    return points, faces, placed(uv, rng), w


def any_options(rng, mesh):
    """Options of `ao.bake_texture` that go together, each at times."""

    def at_times(share, name, *values):
        return {name: values[rng.integers(len(values))]} if rng.random() < share else {}

    options = at_times(0.6, "tolerance", 0.02, 0.05, 0.1) or {"samples": int(rng.choice([1, 2, 3, 8, 33]))}
    options |= at_times(0.3, "overlap", "first") | at_times(0.2, "bent_space", "tangent", "tangent-directx")
    options |= at_times(0.1, "thickness", True) or at_times(0.2, "interior", "ignore", "fill")
    options |= at_times(0.2, "cage", "1%", "5%", "30%") | at_times(0.15, "normals", "area", "equal")
    options |= at_times(0.15, "spread", 1, 20, 90) | at_times(0.15, "back_faces", "ignore")
    options |= at_times(0.15, "close_seams", False) | at_times(0.15, "profile", True)
    if "cage" in options:
        options["high"] = mesh
    if "samples" in options:
        options |= at_times(0.15, "denoise", False)
    return options


KINDS = (dart, darts, pole, slit, fan, mirrored, islands, crumbs)
