"""The faces that are sampled, and the sampling of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from raytrace.embree import LANES, TriangleScene, new_packet
from raytrace.normals import face_normals
from raytrace.parallel import run_blocks
from raytrace.placement import Placement
from raytrace.sampling import mix

from .bake import Progress
from .falloff import Mu
from .surface_gather import HIDDEN, MOMENTS, SEEN, gather_faces, lattices
from .surface_samples import Samples, along_curve

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]

_MOST_RAYS = 32
_BLOCK_RAYS = 1 << 19


@dataclass(frozen=True, eq=False)
class Patch:
    """Faces in the placed mesh's units, along a space-filling curve.

    Attributes:
        corners: float64 (m, 3, 3). normals: float64 (m, 3), unit. areas: float64 (m,), above 0.
        seats: int64 (m, 3), the row of each corner in `Receivers.points`.
    """

    corners: Floats
    normals: Floats
    areas: Floats
    seats: Ints

    @classmethod
    def of(cls, placement: Placement, faces: Ints, of_vertex: Ints) -> Patch:
        """The patch of `faces` (k, 3), none degenerate, less those with a corner that no point stands for."""
        faces = faces[(of_vertex[faces] >= 0).all(axis=1)]
        vertices = placement.vertices.astype(np.float64)
        faces = faces[along_curve(vertices[faces].mean(axis=1))]
        return cls(vertices[faces], *face_normals(vertices, faces), of_vertex[faces])


def gather(
    scene: TriangleScene,
    placement: Placement,
    patch: Patch,
    axes: npt.NDArray[np.float32],
    mu: Mu,
    samples: int,
    key: np.uint32,
    threads: int,
    progress: Progress | None,
) -> tuple[Floats, Ints]:
    """Moments (m, 2, 19) and counts (m, 3) of the faces of `patch`, see `gather_faces`.

    Args: axes: (n, 3), unit normals that `patch.seats` points to. samples: rays for each of those in use.
    """
    moments, counts = np.zeros((len(patch.seats), 2, MOMENTS)), np.zeros((len(patch.seats), 3), np.int64)
    if not len(patch.seats):
        return moments, counts
    rays = int(np.clip(samples // 2 // LANES * LANES, LANES, _MOST_RAYS))
    count = max(samples * len(np.unique(patch.seats)) // rays, 1)
    spread = Samples.spread(patch.areas, count, float(np.ldexp(mix([key])[0], -32)))
    directions = lattices(rays)
    tau = (mu.tau or 0.0) / placement.scale
    limit = mu.max_distance * placement.scale
    done = 0

    def work(a: int, b: int) -> None:
        gather_faces(
            scene.handle, *new_packet(), patch.corners[a:b], patch.normals[a:b], axes[patch.seats[a:b]],
            spread.starts[a : b + 1], spread.ends[a : b + 1], spread.weights[a:b], spread.shift, directions, key,
            tau, placement.diagonal, limit, moments[a:b], counts[a:b],
        )  # fmt: skip

    def advance(faces: int) -> None:
        nonlocal done
        done += faces
        if progress:
            progress(count * rays * done // len(moments), count * rays)

    run_blocks(len(moments), max(len(moments) * _BLOCK_RAYS // (count * rays), 1), work, threads, advance)
    return moments, counts


def reveal_interiors(moments: Floats, counts: Ints, seats: Ints, points: int) -> Floats:
    """Moments with samples weighted in full where no vertex of the face can see a way out.

    Hidden samples step back behind visible ones at the same vertex. Where there are none, in a room whose walls
    face outwards for instance, they are all that counts.
    """
    seen = np.zeros(points, np.bool_)
    seen[seats[counts[:, SEEN] > 0]] = True
    mixed: npt.NDArray[np.bool_] = seen[seats].any(axis=1)
    return np.where(mixed[:, None, None], moments, moments / HIDDEN)
