"""The strip of docs/textures.md: `python -m benchmarks.pictures.high`, part of `make pictures`.

A fine plate of bumps below a fine ball, and their w on a flat plate and a smooth ball: by a cage that reaches from the
plate into the ball, by the same cage with objects matched by name, and by a cage mesh that ends between them.
"""

from __future__ import annotations

import numpy as np

from benchmarks import ROOT
from benchmarks.pictures.half_distances import picture
from obscurance import ao
from obscurance.raytrace import Mesh
from obscurance.raytrace.image.write import write_image
from obscurance.scenes.geometry.polyhedra import icosphere

TARGET = ROOT / "docs" / "textures" / "high.png"
CAGE, GAP, RADIUS = 0.35, 0.15, 0.8


def plate(columns: int, rows: int, bumps: float) -> tuple[np.ndarray, np.ndarray]:
    x, y = (
        axis.ravel() for axis in np.meshgrid(np.linspace(-2, 2, columns), np.linspace(-1.5, 1.5, rows), indexing="ij")
    )
    cell = np.array([i * rows + j for i in range(columns - 1) for j in range(rows - 1)])
    faces = [cell[:, None] + corners for corners in ([0, rows, rows + 1], [0, rows + 1, 1])]
    return np.stack([x, y, bumps * np.sin(12 * x) * np.sin(12 * y)], axis=1), np.concatenate(faces)


def ball(level: int, bumps: float) -> tuple[np.ndarray, np.ndarray]:
    vertices, faces = icosphere(level)
    size = RADIUS * (1 + bumps * np.sin(14 * vertices).prod(axis=1))
    return vertices * size[:, None] + (0, 0, RADIUS + GAP), faces


def both(first: tuple[np.ndarray, np.ndarray], second: tuple[np.ndarray, np.ndarray]) -> tuple[Mesh, np.ndarray]:
    """Two shapes as a mesh, and the number of each of its vertices."""
    count = len(first[0])
    mesh = Mesh(np.append(first[0], second[0], axis=0), np.append(first[1], second[1] + count, axis=0), up="z")
    return mesh, np.repeat([0, 1], [count, len(second[0])])


def main() -> None:
    fine, of_fine = both(plate(320, 240, 0.05), ball(6, 0.08))
    coarse, of_coarse = both(plate(120, 90, 0), ball(5, 0))
    flat, centre = coarse.vertices[of_coarse == 0], np.array([0, 0, RADIUS + GAP])
    room = np.linalg.norm(flat - centre, axis=1) - RADIUS
    above = flat + np.minimum(CAGE, room / 2)[:, None] * [0, 0, 1]
    around = centre + (coarse.vertices[of_coarse == 1] - centre) * (1 + GAP / 2 / RADIUS)
    cage = Mesh(np.append(above, around, axis=0), coarse.faces)
    options = {"samples": 256, "high": fine}
    bakes = [
        ao.bake(coarse, cage=CAGE, **options),
        ao.bake(coarse, cage=CAGE, groups=(of_coarse, of_fine), **options),
        ao.bake(coarse, cage=cage, **options),
    ]
    shown = [picture(fine, ao.bake(fine, samples=256).w, 0.75), *(picture(coarse, each.w, 0.75) for each in bakes)]
    write_image(TARGET, np.concatenate(shown, axis=1))
    print(TARGET)


if __name__ == "__main__":
    main()
