"""Surfaces drawn by seed on which the error of a texel or a face is easily told wrong: w jumps within it.

Each family gives a mesh, its texture coordinates (m, 3, 2), NaN of what only occludes, and w of every texel of a square
page where that needs no ray, else None. All are for a binary falloff.
"""

import numpy as np
import trimesh
from meshes import grid
from uv_meshes import rectangle

from obscurance.raytrace import Mesh
from obscurance.scenes.geometry.polyhedra import join

HALVES = np.array([[0, 1, 2], [0, 2, 3]])
UNIT = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float)
FLOOR = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], float)
BOX = np.array([(i, j, k) for i in (-0.5, 0.5) for j in (-0.5, 0.5) for k in (0, 1)])
SIDES = np.array([
    [0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [1, 5, 7], [1, 7, 3],
])  # fmt: skip


def joined(parts):
    """One mesh of (vertices, faces) pairs."""
    return Mesh(*join(parts))


def laid_flat(mesh, faces):
    """Texture coordinates of the first `faces` of a mesh, those of its square from −1 to 1."""
    uv = np.full((len(mesh.faces), 3, 2), np.nan)
    uv[:faces] = (mesh.vertices[mesh.faces[:faces], :2] + 1) / 2
    return uv


def box(size, at):
    return BOX * size + at, SIDES


def some_leaves(seed, height, count=60, side=0.12):
    """Quads that lie at heights from `height` to twice that: the part and what each covers, by places (x, y)."""
    random = np.random.default_rng(seed)
    centre, turn = random.uniform(-0.9, 0.9, (count, 2)), random.uniform(0, np.pi, count)
    along = np.stack([np.cos(turn), np.sin(turn)], -1)
    across = np.stack([-along[:, 1], along[:, 0]], -1)
    corners = [centre + side / 2 * (a * along + b * across) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    z = height * (1 + np.arange(count) / count)
    quads = np.concatenate([np.stack(corners, 1), np.broadcast_to(z[:, None, None], (count, 4, 1))], -1)
    faces = (4 * np.arange(count)[:, None, None] + HALVES).reshape(-1, 3)

    def covered(x, y):
        found = np.zeros(x.shape, np.bool_)
        for (cx, cy), (ux, uy) in zip(centre, along, strict=True):
            within = np.abs((x - cx) * ux + (y - cy) * uy) < side / 2
            found |= within & (np.abs((y - cy) * ux - (x - cx) * uy) < side / 2)
        return found

    return (quads.reshape(-1, 3), faces), covered


def leaves(seed, size, height=1e-5):
    """Leaves on a floor: w is the share of a texel that none covers."""
    lying, covered = some_leaves(seed, height)
    mesh = joined([(FLOOR, HALVES), lying])
    fine = 24
    steps = (np.arange(size * fine) + 0.5) / (size * fine) * 2 - 1
    x, y = np.meshgrid(steps, -steps)
    return mesh, laid_flat(mesh, 2), 1 - covered(x, y).reshape(size, fine, size, fine).mean(axis=(1, 3))


def fins(seed, size):
    """Upright strips, as high as they are apart, several to a texel: w is √2 − 1 in the mean over a gap."""
    start = np.random.default_rng(seed).random()
    gap = 2 / size / 4
    x = (np.arange(-20 * size, 24 * size) + start) * gap
    strips = [(rectangle((at, -20, 0), (0, 40, 0), (0, 0, gap)), HALVES) for at in x - 0.5]
    mesh = joined([(FLOOR, HALVES), *strips])
    return mesh, laid_flat(mesh, 2), np.full((size, size), np.sqrt(2) - 1)


def layers(seed, size, count=90):
    """Squares far apart that share the page, more than a texel has places at first; some of them lie in boxes."""
    dark = np.random.default_rng(seed).permutation(count)[: count // 3]
    apart = 100 * np.eye(3)[0]
    square = np.column_stack([UNIT, np.zeros(4)])
    lids = [box((1.2, 1.2, 0.4), apart * k + [0.5, 0.5, -0.1]) for k in dark]
    mesh = joined([*((square + apart * k, HALVES) for k in range(count)), *lids])
    uv = np.full((len(mesh.faces), 3, 2), np.nan)
    uv[: 2 * count] = np.tile(UNIT[HALVES], (count, 1, 1))
    return mesh, uv, np.full((size, size), 1 - len(dark) / count)


def striped_layers(seed, size, count=2):
    """Squares far apart that share the page, half of each texel dark: by strips along one axis, and along the other."""
    start = np.random.default_rng(seed).random()
    low = (np.arange(-1, size + 1) + start) / size
    squares, lids = [], []
    for layer in range(count):
        at = 100 * layer * np.eye(3)[0]
        squares.append((np.column_stack([UNIT, np.zeros(4)]) + at, HALVES))
        for x in low:
            corners = np.array([(x, -1), (x + 0.5 / size, -1), (x + 0.5 / size, 2), (x, 2)])[:, :: (-1) ** layer]
            lids.append((np.column_stack([corners, np.full(4, 2e-4)]) + at, HALVES))
    mesh = joined(squares + lids)
    uv = np.full((len(mesh.faces), 3, 2), np.nan)
    uv[: 2 * count] = np.tile(UNIT[HALVES], (count, 1, 1))
    return mesh, uv, np.full((size, size), 0.5)


def blocks_under_lids(seed, size, block=0.35, lid=0.7):
    """In each texel a block that holds a corner of it, and a lid over the block and what is next to it, dark."""
    corner = -1 + (np.argwhere(np.ones((size + 2, size + 2))) - 1 + np.random.default_rng(seed).random(2)) * 2 / size
    sides = 2 / size * np.array([block, lid])
    blocks = [box((sides[0], sides[0], 0.01), (*(at + sides[0] / 2), -0.0099)) for at in corner]
    closed = [(v, np.concatenate([f, [[0, 6, 4], [0, 2, 6]]])) for v, f in blocks]  # `box` has no bottom
    lids = [(np.column_stack([at + sides[1] * UNIT, np.full(4, 2e-4)]), HALVES) for at in corner]
    mesh = joined([(FLOOR, HALVES), *closed, *lids])
    dark = (lid**2 - block**2) / (1 - block**2)
    return mesh, laid_flat(mesh, 2), np.full((size, size), 1 - dark)


def chart_over_another(seed, size, part=0.3):
    """A square on all of the page, and in each texel a dark chart of a part of it."""
    random = np.random.default_rng(seed)
    squares, charts, boxes = [(np.column_stack([UNIT * 10 - [500, 0], np.zeros(4)]), HALVES)], [UNIT[HALVES]], []
    for k in range(size**2):
        at = np.array(divmod(k, size))
        squares.append((np.column_stack([UNIT + 10 * at, np.zeros(4)]), HALVES))
        charts.append(((at + random.uniform(0.02, 0.98 - part, 2) + part * UNIT) / size)[HALVES])
        boxes.append(box((1.2, 1.2, 0.4), (*(10 * at + 0.5), -0.1)))
    mesh = joined(squares + boxes)
    uv = np.full((len(mesh.faces), 3, 2), np.nan)
    uv[: 2 * len(charts)] = np.concatenate(charts)
    return mesh, uv, np.full((size, size), 1 / (1 + part**2))


def boxes(seed, size):
    random = np.random.default_rng(seed)
    stand = [box(random.uniform(0.03, 0.3, 3), (*random.uniform(-0.9, 0.9, 2), 0)) for _ in range(40)]
    mesh = joined([(FLOOR, HALVES), *stand])
    return mesh, laid_flat(mesh, 2), None


def grass(seed, size, count=600):
    random = np.random.default_rng(seed)
    root, turn = (
        np.column_stack([random.uniform(-0.95, 0.95, (count, 2)), np.zeros(count)]),
        random.uniform(0, np.pi, count),
    )
    wide = 0.015 * np.stack([np.cos(turn), np.sin(turn), 0 * turn], -1)
    tip = root + np.column_stack([0.05 * random.normal(size=(count, 2)), random.uniform(0.05, 0.2, count)])
    blades = np.stack([root - wide, root + wide, tip], 1).reshape(-1, 3)
    mesh = joined([(FLOOR, HALVES), (blades, np.arange(3 * count).reshape(-1, 3))])
    return mesh, laid_flat(mesh, 2), None


def terrain(seed, size, side=60):
    random = np.random.default_rng(seed)
    waves, phase = 6 * random.normal(size=(8, 2)), random.uniform(0, 6, 8)
    vertices, faces = grid(side - 1, 2.0)
    vertices[:, 2] = 0.4 * np.sin(vertices[:, :2] @ waves.T + phase).mean(axis=1)
    mesh = Mesh(vertices, faces)
    return mesh, laid_flat(mesh, len(faces)), None


def small_charts(seed, size, texels=0.7):
    """The squares of a floor below boxes, each a chart of some texels or less."""
    random = np.random.default_rng(seed)
    vertices, faces = grid(15, 2.0)
    stand = [box(random.uniform(0.02, 0.2, 3), (*random.uniform(-0.9, 0.9, 2), 0)) for _ in range(40)]
    mesh = joined([(vertices, faces), *stand])
    across = int(np.ceil(np.sqrt(len(faces))))
    number = np.arange(len(faces))
    corner = np.stack([number % across, number // across], -1) + random.uniform(0, 0.3, (len(faces), 2))
    uv = np.full((len(mesh.faces), 3, 2), np.nan)
    uv[: len(faces)] = corner[:, None] / across + min(texels / size, 0.65 / across) * UNIT[[0, 1, 2]]
    return mesh, uv, None


def slab_in_solids(seed, size, count=25):
    """The top of a slab, into which boxes reach from above and below, in part into one another."""
    slab = trimesh.creation.box((2, 2, 0.4))
    slab.faces = slab.faces[np.argsort(-slab.triangles_center[:, 2], kind="stable")]
    random = np.random.default_rng(seed)
    parts = [slab.apply_translation((0, 0, -0.2))]
    for _ in range(count):
        solid = trimesh.creation.box(random.uniform(0.1, 0.6, 3))
        solid.apply_transform(trimesh.transformations.random_rotation_matrix(random.random(3)))
        parts.append(solid.apply_translation((*random.uniform(-0.9, 0.9, 2), random.normal(scale=0.1))))
    mesh = joined([(part.vertices, part.faces) for part in parts])
    return mesh, laid_flat(mesh, 2), None
