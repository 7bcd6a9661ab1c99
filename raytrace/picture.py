"""A picture of a value per vertex, such as w(p): what a bake looks like before anything is lit."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from .camera import Camera
from .embree import TriangleScene
from .mesh import Mesh
from .placement import Placement
from .query import intersect
from .sampling import mix, owen_sobol

_CHUNK = 1 << 20
_SETS = 256


def picture(
    mesh: Mesh,
    values: npt.NDArray[np.floating],
    camera: Camera,
    width: int,
    height: int,
    samples: int = 16,
    background: float = 0.0,
    threads: int | None = None,
) -> npt.NDArray[np.float32]:
    """`values` (n,) interpolated over the faces of `mesh` as `camera` sees them: float32 (height, width), linear.

    Args:
        samples: rays a pixel, Owen-scrambled Sobol points under a box filter.
        background: value of a ray that hits nothing.
    """
    placement = Placement.of(mesh)
    scene = TriangleScene(placement.vertices, mesh.faces)
    origin = (np.array(camera.position) - mesh.centre) * placement.scale
    u, v = owen_sobol(_SETS, samples, np.uint32(0))
    image = np.empty(width * height, np.float32)
    chunk = max(_CHUNK // samples, 1)
    for first in range(0, len(image), chunk):
        pixel = np.arange(first, min(first + chunk, len(image)))
        row, column = np.divmod(pixel, width)
        chosen = mix(pixel) % _SETS
        x = (2 * (column[:, None] + u[chosen]) - width) / height
        y = 1 - 2 * (row[:, None] + v[chosen]) / height
        hits = intersect(scene, origin, camera.directions(x, y).reshape(-1, 3), threads=threads)
        corners = values[mesh.faces[hits.face]]
        seen = np.where(hits.face < 0, background, np.einsum("ij,ij->i", corners, hits.barycentric))
        image[pixel] = seen.reshape(-1, samples).mean(axis=1)
    return image.reshape(height, width)
