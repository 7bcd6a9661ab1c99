"""Faces that nothing outside sees, which a program can drop."""

from functools import partial
from typing import Any, NamedTuple

import numpy as np

from obscurance.raytrace.mesh.mesh import Mesh, mesh_of
from obscurance.raytrace.types import Bools

from .baking import bake
from .execute.tracer import Progress
from .prepared import prepare

_ROUNDS = 16, 128, 1024, 4096  # rays from each side of faces of which none has left so far
_DOUBT = 3.0  # of n rays that none has hit what has a share of 3/n of them is the chance e⁻³, 5 %


def _in_round(progress: Progress, turn: int, done: int, total: int, stage: str) -> None:
    """Report progress of a round."""
    progress(done, total, f"{stage}, round {turn + 1}")


class Unseen(NamedTuple):
    """Faces that are unseen, as `unseen_faces` finds them.

    Attributes:
        faces: bool (m,), faces from which no ray has left the mesh, on either side.
        rays: from each side of each of these.
        share: the most that may yet be open of what such a face looks at, with 95 % confidence.
    """

    faces: Bools
    rays: int
    share: float


def unseen_faces(
    mesh: Mesh | Any, seed: int = 0, threads: int | None = None, progress: Progress | None = None
) -> Unseen:
    """Faces of `mesh` that cannot be seen from outside: no straight line leads from them to infinity.

    Most faces are seen by their first few rays; those that are not get more, 5,264 from each side in all, from points
    spread over the face. Faces without area count as seen.

    Args: progress: called as that of `ao.bake`, in rounds.
    Raises: OptionError, MeshError, MemoryLimitError: as `ao.bake`.
    """
    mesh = mesh_of(mesh, "unseen_faces")
    sides = prepare(mesh), prepare(mesh.reversed())
    unseen = np.ones(len(mesh.faces), np.bool_)
    for turn, samples in enumerate(_ROUNDS):
        corners = np.zeros(len(mesh.vertices), np.bool_)
        corners[mesh.faces[unseen]] = True
        for side in sides:
            baked = bake(
                side, "binary", samples, seed + turn, threads, at="faces", only=corners, denoise=False,
                interior="ignore", progress=progress and partial(_in_round, progress, turn),
            )  # fmt: skip
            unseen &= baked.w == 0
        if not unseen.any():
            break
    rays = sum(_ROUNDS)
    return Unseen(unseen, rays, _DOUBT / rays)
