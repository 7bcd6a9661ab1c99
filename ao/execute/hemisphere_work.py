"""The rows of `ao.rays.estimator` at points, as work that any process can do."""

import hashlib
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from ..mu import KernelMu
from ..points.points import Points
from ..rays.estimator import COLUMNS
from ..rays.gather_columns import gather_columns, gather_columns_by_packets
from ..rays.gather_packets import gather_hemispheres
from ..rays.gather_streams import gather_streams
from ..rays.layers import Layers
from ..rays.ray_blocks import Rays
from ..rays.ray_packet import RayPacket
from ..rays.ray_scene import RayScene
from ..rays.traverse import TraversalState
from .work import Tables

_BLOCK_RAYS = 1 << 11  # of a block of work


@dataclass(frozen=True, eq=False)
class Hemispheres:
    """Hemispheres to be gathered.

    Attributes:
        points: where. samples: rays of each. key: by which directions are drawn.
        total_points: how many points the whole mesh has, wanted or not.
        mu: the falloff, in render space. t_max: length of rays there.
        packets_below: points with fewer rays are traced by Embree, else by `ao.rays.traverse`.
        leap: how many points share a lattice of directions.
    """

    points: Points
    samples: int
    key: np.uint32
    total_points: int
    mu: KernelMu
    t_max: float
    packets_below: int
    leap: int = 1

    def __len__(self) -> int:
        return len(self.points)

    def __getitem__(self, rows: slice) -> Self:
        return replace(self, points=self.points[rows])

    @property
    def name(self) -> bytes:
        digest = hashlib.blake2b(repr((self.samples, int(self.key), self.leap)).encode(), digest_size=16)
        digest.update(np.ascontiguousarray(self.points.numbers).data)
        return digest.digest()

    @property
    def rays(self) -> float:
        return self.samples

    @property
    def block(self) -> int:
        return max(_BLOCK_RAYS // self.samples, 1)

    def tables(self) -> Tables:
        return (np.empty((len(self), *self.mu.shape, COLUMNS)),)

    def writer(self, scene: RayScene, tables: Tables) -> Callable[[int, int], None]:
        table = scene.table(self.samples, self.total_points, self.key, self.leap)
        points, mu, t_max, (out,) = self.points, self.mu, self.t_max, tables
        columns = mu.columns
        if self.samples < self.packets_below:
            embree = scene.embree()

            def by_packets(first: int, last: int) -> None:
                packet, subset = RayPacket.of(embree, scene.opacity), points[first:last].arrays
                if columns is None:
                    gather_hemispheres(packet, subset, table, mu, t_max, out[first:last])
                elif scene.opacity is None:
                    gather_columns_by_packets(packet, subset, table, columns, t_max, out[first:last])
                else:  # to check the other traversal, without haste
                    for column, each in enumerate(columns.each()):
                        rows = np.empty((last - first, COLUMNS))
                        gather_hemispheres(packet, subset, table, each, min(t_max, each.limit), rows)
                        out[first:last, column] = rows

            return by_packets
        tree, idle = scene.tree, deque[tuple[Rays, TraversalState]]()  # as many at most as threads

        def by_streams(first: int, last: int) -> None:
            subset = points[first:last].arrays
            try:
                rays, state = idle.pop()
            except IndexError:
                rays = Rays.of(table)
                state = TraversalState.of(tree, Layers.of(scene.opacity, rays.t_hit.size, mu))
            if columns is None:
                gather_streams(tree, rays, state, subset, table, mu, t_max, out[first:last])
            else:
                gather_columns(tree, rays, state, subset, table, columns, t_max, out[first:last])
            idle.append((rays, state))

        return by_streams
