"""Unusual topology: faces wound at random, many faces on one edge, sheets welded to their backs, huge floors."""

from __future__ import annotations

from collections.abc import Iterator
from math import pi, sin

import numpy as np
from meshes import grid

from obscurance.ao import Binary, bake
from obscurance.raytrace.mesh.mesh import Mesh
from obscurance.scenes.geometry.polyhedra import RawMesh, hull, icosphere, join, patches

from .line import ERROR, Line, undefined
from .pose import Pose

PAGES = 8
_FAR = 1000.0


def topology(long: bool) -> Iterator[Line]:
    """A line for each mesh: the largest error of the binary w over the poses."""
    poses = [Pose(turn=turn) for turn in range(1, 21 if long else 2)] + [Pose(1e-9, 1e6, 30), Pose(1e9, 1e4, 31)]
    sphere, rng = icosphere(3), np.random.default_rng(0)
    turned = np.where(rng.random(len(sphere[1]))[:, None] < 0.5, sphere[1], sphere[1][:, ::-1])
    flat = grid(4)
    book, readers = _book()
    missed = (2 / pi) * 1.5 / _FAR  # of an infinite page
    box = hull([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (0, 2)])
    feet = np.flatnonzero(box[0][:, 2] == 0)
    for name, part, points, expected, allowed in (
        (f"book of {PAGES} pages on one edge", book, readers, sin(pi / PAGES) ** 2, ERROR + missed),
        ("sheet welded to its own back", (flat[0], np.concatenate([flat[1], flat[1][:, ::-1]])), None, 1.0, 0.0),
        ("box in the middle of a floor 10⁷ times as wide", join([box, grid(1, 2e7)]), feet, _FOOT, ERROR),
    ):  # fmt: skip
        worst, missing = 0.0, 0
        for pose in poses:
            baked = bake(Mesh(pose.vertices(part[0]), part[1]), Binary(), 4096, denoise=False)
            w = baked.w if points is None else baked.w[points]
            worst = float(np.maximum(worst, np.abs(w - expected).max()))
            missing += undefined(baked.w, baked.error, baked.bent_normals)
        yield Line(name, f"{len(poses)} poses", "error of w", worst, allowed, missing)
    yield _mixed(poses, (sphere[0], turned))


_FOOT = 0.5 * (1 - 3**-0.5)


def _book() -> tuple[RawMesh, list[int]]:
    """Pages around one edge, and the vertex of a patch that lies on each, a little off the edge."""
    pages, readers = [], []
    for k in range(PAGES):
        c, s = np.cos(2 * pi * k / PAGES), np.sin(2 * pi * k / PAGES)
        turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])
        corners = np.array([[0, 0, -1], [1, 0, -1], [1, 0, 1], [0, 0, 1.0]]) * _FAR
        patch, face = patches([[0, 0, 0]], 0.3)
        upright = patch[:, [0, 2, 1]] * [1, 1, -1] + [1, 0, 0]
        pages += [(corners @ turn.T, np.array([[0, 2, 1], [0, 3, 2]])), (upright @ turn.T, face)]
        readers.append(7 * k + 4)
    return join(pages), readers


def _mixed(poses: list[Pose], part: RawMesh) -> Line:
    """Faces wound at random without normals have no outside: whatever w is, it is one."""
    outside = missing = 0
    for pose in poses:
        baked = bake(Mesh(pose.vertices(part[0]), part[1]), Binary(), 4096, denoise=False)
        outside += int(np.count_nonzero(~((baked.w >= 0) & (baked.w <= 1))))
        missing += undefined(baked.w, baked.error, baked.bent_normals)
    return Line("sphere with faces wound at random", f"{len(poses)} poses", "w outside [0, 1]", outside, 0, missing)
