"""The picture of docs/terrain.md: `python -m benchmarks.pictures.terrain`, part of `make pictures`.

Heights, and the sky-view factors of their cells by both definitions.
"""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np

from benchmarks import ROOT
from obscurance import ao
from obscurance.raytrace import Mesh
from obscurance.raytrace.types import Float64s

TARGET = ROOT / "docs" / "terrain.png"
SIZE, CELL = 256, 30.0  # cells each way, and metres


def mountains(seed: int = 3, size: int = SIZE) -> Float64s:
    """Heights (n, n) in metres: noise whose spectrum falls as the frequency^−2.2, folded into ridges."""
    noise = np.fft.rfft2(np.random.default_rng(seed).normal(size=(size, size)))
    frequency = np.hypot(np.fft.fftfreq(size)[:, None], np.fft.rfftfreq(size))
    frequency[0, 0] = np.inf
    heights = np.fft.irfft2(noise * frequency**-2.2, (size, size))
    return 2600 - 900 * np.abs(heights / heights.std())


def surface(heights: Float64s) -> Mesh:
    """The surface through the cells, as a raster is read."""
    row, column = np.indices(heights.shape)
    vertices = np.stack([CELL * column, -CELL * row, heights], axis=-1).reshape(-1, 3)
    number = np.arange(len(vertices)).reshape(heights.shape)
    a, b, c, d = number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]
    faces = np.concatenate([np.stack(corners, axis=-1).reshape(-1, 3) for corners in ((a, b, c), (a, c, d))])
    return Mesh(vertices, faces, up="z")


def main() -> None:
    heights = mountains()
    mesh = surface(heights)
    falloff = ao.Binary(max_distance="10km")
    inclined = ao.bake(mesh, falloff).w.reshape(heights.shape)
    horizontal = ao.bake(mesh, falloff, normals="up").w.reshape(heights.shape)
    figure, (left, middle, right) = plt.subplots(1, 3, figsize=(12, 3.7), layout="constrained")
    figure.colorbar(left.imshow(heights, cmap="terrain"), shrink=0.85, label="height, m")
    middle.imshow(inclined, cmap="gray", vmin=0.2, vmax=1)
    shown = right.imshow(horizontal, cmap="gray", vmin=0.2, vmax=1)
    figure.colorbar(shown, shrink=0.85, label="sky-view factor")
    for axis, title in ((left, "heights"), (middle, "inclined surface"), (right, "horizontal cells")):
        axis.set(title=title, xticks=[], yticks=[])
    figure.savefig(TARGET, dpi=60)
    print(TARGET)


if __name__ == "__main__":
    main()
