"""A mesh of any size for the measurements."""

from __future__ import annotations

import numpy as np

from obscurance.raytrace.mesh.mesh import Mesh


def bumpy_sphere(vertices: int) -> Mesh:
    """Rings of about so many vertices, twice as many faces."""
    columns = int(np.sqrt(2 * vertices))
    rows = vertices // columns
    polar, azimuth = np.meshgrid(
        (np.arange(rows) + 0.5) / rows * np.pi, np.arange(columns) / columns * 2 * np.pi, indexing="ij"
    )
    radius = 1 + 0.15 * np.sin(9 * polar) * np.sin(11 * azimuth) + 0.05 * np.sin(41 * polar) * np.cos(37 * azimuth)
    ring = np.sin(polar)
    points = np.stack([ring * np.cos(azimuth), ring * np.sin(azimuth), np.cos(polar)], axis=-1) * radius[..., None]
    at = np.arange(rows - 1)[:, None] * columns + np.arange(columns)
    right = np.arange(rows - 1)[:, None] * columns + (np.arange(columns) + 1) % columns
    lower, upper = (at, at + columns, right), (right, at + columns, right + columns)
    faces = np.concatenate([np.stack(each, axis=-1).reshape(-1, 3) for each in (lower, upper)])
    return Mesh(points.reshape(-1, 3), faces, source="bumpy sphere")
