"""Errors of a bake to a tolerance, and of its own error estimates, against plain bakes of many rays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from obscurance.ao import Bake, Falloff, Flag, bake
from obscurance.raytrace.mesh.mesh import Mesh
from obscurance.raytrace.types import Bools, Float64s

NEAR, FAR = 2.5, 6.0  # times its estimated error: beyond them are few vertices, and next to none


@dataclass(frozen=True)
class Figures:
    """How a bake compares with the truth.

    Attributes:
        true: root mean square error of w. estimated: the bake's own estimate of it.
        largest: |error| of the vertex that is farthest off.
        vertices: number of vertices with a w. beyond: how many are off by more than `NEAR` and than `FAR` times
            their estimated error, that of the truth added in squares.
        rays: traced, a vertex.
        undefined: NaN and infinite numbers in w, errors and bent normals.
    """

    true: float
    estimated: float
    largest: float
    vertices: int
    beyond: tuple[int, int]
    rays: float
    undefined: int

    @property
    def ratio(self) -> float:
        """True over estimated error; 1 where both are 0."""
        if self.true == self.estimated:
            return 1.0
        return self.true / self.estimated if self.estimated > 0 else float("inf")


@dataclass(frozen=True, eq=False)
class Truth:
    """Two plain bakes of a mesh with independent rays.

    Attributes:
        halves: float64 (2, n), w of each. w: (n,), their mean.
        variance: (n,), squared error to expect of that: the bakes' own estimate, or their difference where it is more.
        some: bool (n,), the vertices that have a w.
    """

    halves: Float64s
    w: Float64s
    variance: Float64s
    some: Bools


def find_truth(mesh: Mesh, falloff: Falloff, samples: int, seed: int) -> Truth:
    """w by `samples` rays a vertex in all, from 2 on; its seeds are `seed` and the one after."""
    bakes = [bake(mesh, falloff, samples // 2, seed + k, denoise=False) for k in (0, 1)]
    halves = np.stack([baked.w for baked in bakes])
    variance = np.maximum(bakes[0].error ** 2 + bakes[1].error ** 2, (halves[0] - halves[1]) ** 2) / 4
    some = (bakes[0].flags & (Flag.UNREFERENCED | Flag.DEGENERATE)) == 0
    return Truth(halves, halves.mean(axis=0), variance, some)


def compare_with_truth(baked: Bake, truth: Truth) -> Figures:
    """Compare a bake with the truth, which it has no rays in common with.

    With the two halves a and b of the truth the mean of (w − a)(w − b) is the mean square error without bias.
    """
    some, error = truth.some, baked.error[truth.some]
    squared = np.prod(baked.w - truth.halves, axis=0)[some]
    off = np.abs(baked.w - truth.w)[some]
    expected = np.sqrt(error**2 + truth.variance[some])
    arrays = baked.w, baked.error, baked.bent_normals
    count = max(len(off), 1)
    return Figures(
        true=float(np.sqrt(np.maximum(np.sum(squared) / count, 0.0))),
        estimated=float(np.sqrt(np.sum(error**2) / count)),
        largest=float(off.max(initial=0.0)),
        vertices=len(off),
        beyond=(int((off > NEAR * expected).sum()), int((off > FAR * expected).sum())),
        rays=baked.rays / count,
        undefined=sum(int(np.count_nonzero(~np.isfinite(array))) for array in arrays),
    )
