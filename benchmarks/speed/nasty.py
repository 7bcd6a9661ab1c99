"""Meshes on which work may grow by the square of their size: `python -m benchmarks.speed.nasty [--sizes N…] [SHAPE…]`.

Each is baked with few rays, so that what is done before them shows. Seconds are of processor time, the growth is the
exponent between a size and the one before: 1 is linear. Contacts are the pairs of a point and a face near it that are
kept.
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Callable
from unittest.mock import patch

import numpy as np

from obscurance import ao
from obscurance.raytrace import Mesh
from obscurance.raytrace.ray_origins import origins
from obscurance.scenes.geometry.polyhedra import icosphere
from obscurance.scenes.validation.table import text_table

SIZES = 1_000, 10_000, 100_000
_SAMPLES = 16
_FAR = 1e6

Part = tuple[np.ndarray, np.ndarray]


def stray(size: int) -> Part:
    """A rough ball, and one triangle a million times as far away as it is large."""
    vertices, faces = icosphere(max(0, round(math.log(size / 20, 4))))
    vertices = vertices * (1 + 0.02 * np.random.default_rng(0).normal(size=(len(vertices), 1)))
    away = np.array([[_FAR, 0, 0], [_FAR, 1, 0], [_FAR, 0, 1.0]])
    return np.concatenate([vertices, away]), np.concatenate([faces, [[len(vertices) + k for k in range(3)]]])


def _separate(corners: np.ndarray) -> Part:
    """Triangles (m, 3, 3) with corners of their own."""
    return corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3)


def pages(size: int) -> Part:
    """Pages of a book, whose spine is their common edge."""
    angle = 2 * math.pi * np.arange(size) / size
    out = np.column_stack([np.cos(angle), np.sin(angle), np.full(size, 0.5)])
    return _separate(np.stack([np.zeros((size, 3)), out, np.tile([0, 0, 1.0], (size, 1))], axis=1))


def soup(size: int) -> Part:
    """Random triangles that cross one another."""
    return _separate(np.random.default_rng(0).uniform(-1, 1, (size, 3, 3)))


def stack(size: int) -> Part:
    """Copies of one triangle, every other one turned over."""
    corners = np.tile(np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0.0]]), (size, 1, 1))
    corners[::2] = corners[::2, ::-1]
    return _separate(corners)


def cone(size: int) -> Part:
    """Slivers around the tip of a cone."""
    angle = 2 * math.pi * np.arange(size) / size
    rim, row = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(size)]), np.arange(size)
    return np.vstack([rim, [[0, 0, 1.0]]]), np.column_stack([row, (row + 1) % size, np.full(size, size)])


def seam(size: int) -> Part:
    """Small triangles that end on the edge of a large one."""
    x = np.linspace(0, 1, size + 1)
    near = np.column_stack([x, np.zeros((size + 1, 2))])
    ends = np.array([[0.5, 1.0, 0.1], [0, 0, 0], [1, 0, 0], [0.5, -1, 0]])
    row, large = np.arange(size), size + 1
    small = np.column_stack([row, row + 1, np.full(size, large)])
    return np.vstack([near, ends]), np.vstack([small, [[large + 2, large + 1, large + 3]]])


def blades(size: int) -> Part:
    """Needles from one point into all directions."""
    rng = np.random.default_rng(0)
    tip = rng.normal(size=(size, 3))
    tip /= np.linalg.norm(tip, axis=1, keepdims=True)
    aside = np.cross(tip, rng.normal(size=(size, 3))) * 0.2 / math.sqrt(size)
    return _separate(np.stack([np.zeros((size, 3)), tip - aside, tip + aside], axis=1))


SHAPES: dict[str, Callable[[int], Part]] = {
    made.__name__: made for made in (stray, pages, soup, stack, cone, seam, blades)
}


def measure(part: Part) -> tuple[float, int]:
    """Processor time of a bake in seconds, and contacts kept in it."""
    kept, find = 0, origins.find_contacts

    def counted(*arguments: object) -> origins.Contacts:
        nonlocal kept
        found = find(*arguments)  # type: ignore[arg-type]
        kept += len(found.point)
        return found

    mesh = Mesh(*part)
    with patch.object(origins, "find_contacts", counted):
        start = time.process_time()
        ao.bake(mesh, samples=_SAMPLES)
        return time.process_time() - start, kept


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("shapes", nargs="*", choices=[[], *SHAPES], metavar="SHAPE", help=", ".join(SHAPES))
    parser.add_argument("--sizes", nargs="+", type=int, default=SIZES, help="faces")
    args = parser.parse_args()
    for small in stray, cone:  # kernels, for boxes of both kinds
        ao.bake(Mesh(*small(4_000)), samples=_SAMPLES)
    rows = []
    for name in args.shapes or SHAPES:
        before: tuple[int, float] | None = None
        for size in args.sizes:
            seconds, contacts = measure(SHAPES[name](size))
            growth = math.log(seconds / before[1]) / math.log(size / before[0]) if before else math.nan
            rows.append([name, f"{size:,}", f"{seconds:.2f}", f"{growth:.2f}", f"{contacts:,}"])
            print(*rows[-1], flush=True)
            before = size, seconds
    head = ["shape", "faces", "seconds", "growth", "contacts"]
    print("\n".join(text_table(head, rows, head[1:])))


if __name__ == "__main__":
    main()
