"""Small nasty meshes against a slow caster in double precision: no vertex is off but where surfaces are in contact.

Slivers, faces that coincide, T-junctions, fans, folded sheets, needles: drawn by seed. The caster of
`tests/helpers/reference.py` shares nothing with the fast one, nor does it know the rules of evidence/reliability.md.
Left out are vertices that these decide: flagged ones, which have a face beside them of which they are no corner or no
common hemisphere, and vertices that are in contact with a face.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
import reference

from obscurance import ao
from obscurance.raytrace import Mesh
from obscurance.scenes.geometry.polyhedra import generic_rotation, join

EXPLAINED = ao.Flag.CONTACT | ao.Flag.FOLDED | ao.Flag.OPPOSED | ao.Flag.DEGENERATE
RAYS, SAMPLES = 1024, 4096
SIGMAS, ROUNDING = 6.0, 2e-3  # the fast baker's own error is a fraction of the caster's
CONTACT = 4e-7  # of the size of a mesh, as evidence/reliability.md says


def fan(rng):
    """Slivers around a tip, over a plate."""
    count = int(rng.integers(5, 24))
    angle = 2 * math.pi * np.arange(count) / count
    rim = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(count)])
    row = np.arange(count)
    tip = [[0, 0, rng.choice([0.02, 0.5, 6.0])]]
    return np.vstack([rim, tip]), np.column_stack([row, (row + 1) % count, np.full(count, count)])


def sheet(rng):
    """A strip that is folded again and again, by sharp angles and blunt ones."""
    count = int(rng.integers(3, 9))
    x = np.cumsum(rng.uniform(0.05, 1, count))
    edge = np.column_stack([x, np.zeros(count), np.where(np.arange(count) % 2, rng.uniform(0.01, 1.5, count), 0.0)])
    row = np.arange(count - 1)
    across = np.array([0, 1.0, 0])
    faces = np.vstack(
        [np.column_stack([row, row + 1, row + count]), np.column_stack([row + 1, row + 1 + count, row + count])]
    )
    return np.vstack([edge, edge + across]), faces


def junctions(rng):
    """Small faces that end on the edge of a large one, and rise from it."""
    count = int(rng.integers(2, 8))
    x = np.sort(np.append(rng.uniform(0, 1, count - 1), [0.0, 1.0]))
    near = np.column_stack([x, np.zeros((count + 1, 2))])
    others = np.array([[0.5, 1.0, rng.choice([0.0, 0.3])], [0, 0, 0], [1, 0, 0], [0.5, -1, rng.choice([0.0, 1.0])]])
    row, tip = np.arange(count), count + 1
    small = np.column_stack([row, row + 1, np.full(count, tip)])
    return np.vstack([near, others]), np.vstack([small, [[tip + 2, tip + 1, tip + 3]]])


def needles(rng):
    """Blades from one point, and one that is nearly flat."""
    count = int(rng.integers(2, 8))
    tip = rng.normal(size=(count, 3))
    aside = np.cross(tip, rng.normal(size=(count, 3))) * rng.choice([1e-3, 0.05])
    corners = np.stack([np.zeros((count, 3)), tip - aside, tip + aside], axis=1)
    return corners.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3)


def stack(rng):
    """Copies of a triangle, in one place or almost, turned over here and there."""
    count = int(rng.integers(2, 5))
    corners = np.tile(rng.uniform(-1, 1, (3, 3)), (count, 1, 1))
    corners[:, :, 2] += np.arange(count)[:, None] * rng.choice([0.0, 1e-5, 0.1])
    turned = rng.random(count) < 0.5
    corners[turned] = corners[turned, ::-1]
    return corners.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3)


def soup(rng):
    """Triangles through one another."""
    count = int(rng.integers(2, 9))
    return rng.uniform(-1, 1, (3 * count, 3)), np.arange(3 * count).reshape(-1, 3)


def block(rng):
    """A box on a plate, which its foot touches."""
    corners = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (0.0, rng.choice([0.01, 1.0]))])
    sides = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [1, 5, 7, 3]]
    faces = np.array([[side[k] for k in triangle] for side in sides for triangle in ((0, 1, 2), (0, 2, 3))])
    plate = np.array([[-2, -2, 0], [2, -2, 0], [2, 2, 0], [-2, 2, 0.0]]), np.array([[0, 1, 2], [0, 2, 3]])
    return join([(corners, faces[:, ::-1]), plate])


SHAPES = fan, sheet, junctions, needles, stack, soup, block


def nasty(seed):
    """A mesh of one or two shapes."""
    rng = np.random.default_rng(seed)
    parts = []
    for _ in range(int(rng.integers(1, 3))):
        vertices, faces = SHAPES[int(rng.integers(len(SHAPES)))](rng)
        parts.append((vertices * rng.choice([0.2, 1.0]) + rng.uniform(-1, 1, 3), faces))
    vertices, faces = join(parts)
    return generic_rotation(seed).apply(vertices), faces


def unexplained(seed):
    """How many standard errors each vertex without an explanation is off, (k,), and whether it was to be compared."""
    vertices, faces = nasty(seed)
    falloff = ao.Exponential(tau=1.0) if seed % 2 else ao.Binary()
    baked = ao.bake(Mesh(vertices, faces), falloff, SAMPLES, denoise=False, interior="ignore")
    truth = reference.estimate(reference.distances(vertices, faces, RAYS, seed), 1.0 if seed % 2 else None)
    p = np.clip(baked.w, 2 / RAYS, 1 - 2 / RAYS)  # few rays that hit say little of their spread
    error = np.hypot(np.maximum(truth.error, 0.5 * np.sqrt(p * (1 - p) / RAYS)), baked.error) + ROUNDING / SIGMAS
    off = np.abs(baked.w - truth.w) / error
    return off[((baked.flags & EXPLAINED) == 0) & ~in_contact(vertices, faces)]


def in_contact(vertices, faces):
    """Which vertices (n,) are as near to a face of which they are no corner as what is in contact."""
    found = np.zeros(len(vertices), bool)
    for face in faces:
        a, b, c = vertices[face]
        normal = np.cross(b - a, c - a)
        away = [np.abs((vertices - a) @ normal) / max(np.linalg.norm(normal), 1e-300)]
        for p, q in ((a, b), (b, c), (c, a)):
            away[0][(vertices - p) @ np.cross(normal, q - p) < 0] = np.inf
            t = np.clip((vertices - p) @ (q - p) / max((q - p) @ (q - p), 1e-300), 0, 1)
            away.append(np.linalg.norm(vertices - p - t[:, None] * (q - p), axis=1))
        near = np.min(away, axis=0) < CONTACT * np.linalg.norm(np.ptp(vertices, axis=0))
        near[face] = False
        found |= near
    return found


def check(seeds):
    compared, failures = 0, []
    for seed in seeds:
        off = unexplained(seed)
        compared += len(off)
        if (off > SIGMAS).any():
            failures.append((seed, float(off.max())))
    assert not failures
    return compared


def test_small_nasty_meshes():
    assert check([*range(30), 52, 97, 115, 239]) > 300  # of the last four some are all but in contact


@pytest.mark.slow
def test_two_thousand_small_nasty_meshes():
    assert check(range(2000)) > 20_000
