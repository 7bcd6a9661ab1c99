"""Vertices inside a solid: those that see the backs of faces, where the faces of closed solids look outwards."""

from __future__ import annotations

from typing import Literal

import numpy as np
import numpy.typing as npt

from raytrace.borrow import borrow
from raytrace.embree import (
    DIR_X,
    DIR_Y,
    DIR_Z,
    GEOM_ID,
    INVALID,
    LANES,
    NG_X,
    NG_Y,
    NG_Z,
    TriangleScene,
    intersect8,
    new_packet,
)
from raytrace.jit import kernel
from raytrace.parallel import run_blocks

from .hemisphere import DirectionTable, aim, choose, start_from, turned_frame
from .neighbours import Neighbours
from .receivers import Points
from .subset import coarser, fill, owners

Hidden = Literal["ignore", "mark", "fill"]
RAYS = 32
_MOSTLY = 0.5
_BLOCK = 1 << 12


def hidden_points(
    scene: TriangleScene, points: Points, reach: float, key: np.uint32, threads: int
) -> npt.NDArray[np.bool_]:
    """Whether each point is hidden (k,): more than half of its `RAYS` rays end on the back of a face.

    Args: reach: length of the rays, in placed units.
    """
    table = DirectionTable.make(RAYS, len(points), key)
    backs = np.empty(len(points))

    def work(first: int, last: int) -> None:
        some = points[first:last]
        _look(
            scene.handle, *new_packet(), some.origins, some.normals, some.numbers, table.directions, table.key, reach,
            backs[first:last],
        )  # fmt: skip

    run_blocks(len(points), _BLOCK, work, threads)
    return backs > _MOSTLY


def filled(
    rows: npt.NDArray[np.float64], hidden: npt.NDArray[np.bool_], points: Points, neighbours: Neighbours
) -> npt.NDArray[np.float64]:
    """`rows` (k, c), those of the hidden points told from the nearest that aren't; kept where there are none."""
    owner = owners(neighbours, ~hidden)
    alone = owner < 0
    owner[alone] = np.flatnonzero(alone)
    near, known, cell = coarser(neighbours, owner, points.normals)
    return fill(points, np.arange(len(points)), near, known, cell, np.ascontiguousarray(rows[known]))


@kernel
def _look(scene, packet, valid, origins, normals, numbers, directions, key, reach, backs):
    """The part of each point's rays that end on the back of a face, (n,)."""
    packet, valid, origins, normals = borrow(packet), borrow(valid), borrow(origins), borrow(normals)
    directions, backs = borrow(directions), borrow(backs)
    sets, _, samples = directions.shape
    ids = packet.view(np.uint32)
    for i in range(len(origins)):
        chosen, turn = choose(numbers[i], key, sets)
        n = normals[i]
        t, b = turned_frame(n, turn)
        local = directions[chosen]
        start_from(packet, origins[i])
        count = 0
        for first in range(0, samples, LANES):
            aim(packet, local, first, t, b, n, reach)
            intersect8(scene, packet, valid)
            for lane in range(LANES):
                if ids[GEOM_ID, lane] != INVALID:
                    along = packet[DIR_X, lane] * packet[NG_X, lane] + packet[DIR_Y, lane] * packet[NG_Y, lane]
                    count += along + packet[DIR_Z, lane] * packet[NG_Z, lane] > 0.0
        backs[i] = count / samples
