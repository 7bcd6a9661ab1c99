"""Estimates of sites of several places: texels and faces by samples on faces, less rays that start below the face.

A site of n rays has n / 32 places, and never fewer than a few: what is missed between places errs no more than what is
missed between rays. The first places are the samples that the site was found with; others are parts of one sequence,
shifted by chance, that is even over the whole site (Cranley & Patterson 1976).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import ClassVar, NamedTuple, Self

import numpy as np

from obscurance.raytrace.kernel.jit import kernel
from obscurance.raytrace.sampling import hash32_array
from obscurance.raytrace.system.parallel import each
from obscurance.raytrace.types import Float32s, Float64Rows, Float64s, Int64s, UInt32s

from ..points.corners import CornerSamples
from ..points.points import Points
from ..points.surface_samples import SurfaceSamples
from ..rays.below_face import leave_out_below
from ..rays.gather import BATCH_VARIANCE, BENT, COLUMNS, W
from ..rays.ray_scene import RayScene
from .tracer import Hemispheres, Tracer
from .work import Outputs

_GATHERED = 1 << 20  # samples
_PLACED = 1 << 14  # groups whose samples are made together
_RAYS = 32  # of a place, where there are many
_FEWEST = 4  # places of a site that has several
_RATE = -1.5  # the variance of the mean over n places, or rays, falls as n^−1.5
Elsewhere = Callable[[Int64s, Int64s, np.uint32], SurfaceSamples]
"""Makes samples of some sites (n,), group by group, by parts (n,) 0, 1, … of the sequence of each, and a key."""


class SampleMeans(NamedTuple):
    """`Means` over samples of sites, which the points of a `Tracer` stand for by their numbers."""

    samples: SurfaceSamples  # of the first sites; others have none but `elsewhere`
    elsewhere: Elsewhere | None = None  # None: each site is the one place that it has
    enough: int = 8  # rays of a sample, so that more samples are worth their time; less where w varies among them

    @property
    def by_blocks(self) -> bool:
        """Blocks of samples have as many sets of directions as they are long."""
        return True

    def rows(self, tracer: Tracer, points: Points, rays: int, key: np.uint32, leap: int, elsewhere: bool) -> Float64s:
        """Rows (k, …, COLUMNS) of sites, by so many `rays` each or a few more; see `Tracer.gather`."""
        sites = points.numbers.astype(np.int64)
        if self.elsewhere is None:
            return self._means(tracer, self.samples, sites, sites, rays, key)
        has_own = sites < len(self.samples)
        counts = np.full(len(sites), _FEWEST)
        counts[has_own] = self.samples.counts[sites[has_own]]
        if elsewhere:
            has_own[:] = False
            counts = np.maximum(counts, _FEWEST)
        parts = np.where(counts == 1, 1, np.maximum(np.rint(rays / (_RAYS * counts)), 1)).astype(np.int64)
        out = np.zeros((len(points), *tracer.mu.shape, COLUMNS))
        for number in np.flatnonzero(np.bincount(parts)).tolist():
            share = -(-rays // number)
            alike = np.flatnonzero(parts == number)
            own = alike[has_own[alike]]
            out[own] = self._means(tracer, self.samples, sites[own], sites[own], share, key)
            # The other parts of each site, added up.
            others = number - has_own[alike]
            of = np.repeat(alike, others)
            part = number - 1 - (np.repeat(np.cumsum(others), others) - 1 - np.arange(len(of)))
            np.add.at(out, of, self._elsewhere(tracer, sites[of], part, share, key))
            out[alike] /= number
            out[alike, ..., BATCH_VARIANCE] *= number**_RATE
        return out

    def _elsewhere(self, tracer: Tracer, sites: Int64s, parts: Int64s, rays: int, key: np.uint32) -> Float64s:
        """Rows (n, …, COLUMNS) of `parts` (n,) of sites (n,), by samples made for them."""
        assert self.elsewhere
        key = np.uint32(~key)  # other directions than those of the sites' own samples
        out = np.empty((len(sites), *tracer.mu.shape, COLUMNS))
        for begin in range(0, len(sites), _PLACED):
            block = slice(begin, begin + _PLACED)
            numbers = hash32_array(hash32_array(sites[block]) ^ parts[block].astype(np.uint32)) >> np.uint32(8)
            samples = self.elsewhere(sites[block], parts[block], key)
            out[block] = self._means(tracer, samples, np.arange(len(samples)), numbers.astype(np.int64), rays, key)
        return out

    def _means(
        self, tracer: Tracer, samples: SurfaceSamples, groups: Int64s, numbers: Int64s, rays: int, key: np.uint32
    ) -> Float64s:
        """Rows of some `groups` (n,) of samples, by so many rays each. Args: numbers: (n,), of random choices."""
        counts = samples.counts[groups]
        fewer = np.clip(rays // self.enough, 1, counts)
        samples_of = np.where(samples.all_count[groups], counts, 2 ** np.floor(np.log2(fewer)).astype(np.int64))
        out = np.empty((len(groups), *tracer.mu.shape, COLUMNS))
        for count in np.flatnonzero(np.bincount(samples_of)).tolist():
            alike = np.flatnonzero(samples_of == count)
            step = max(_GATHERED // count, 1)
            for begin in range(0, len(alike), step):
                block = alike[begin : begin + step]
                source = np.empty(count * len(block), np.int64)
                chosen = np.empty(len(source), np.uint32)
                of_block = groups[block], numbers[block]
                _pick.on(tracer.threads)(*of_block, count, samples.starts, int(key), (source, chosen))
                points = replace(samples.points[source], numbers=chosen)
                normals = samples.geometric_normals.take(source, axis=0)
                hemispheres = tracer.hemispheres(points, -(-rays // count), key, count, len(source))
                (out[block],) = tracer.fill(MeansOfGroups(hemispheres, count, normals))
        return out


class FoldedMeans(NamedTuple):
    """`Means` of vertices some of which are folded: those of these are over samples in their corners."""

    corners: CornerSamples
    numbers: UInt32s  # (j,), of the folded points, ascending
    share: int  # of a vertex's rays, for each of some 18 corner samples: their mean errs as little by fewer each

    @property
    def by_blocks(self) -> bool:
        """Every vertex draws from the sets of all."""
        return False

    def rows(self, tracer: Tracer, points: Points, rays: int, key: np.uint32, leap: int, _: bool) -> Float64s:
        """Rows (k, …, COLUMNS); see `Tracer.gather`. The places of a vertex are all that it stands for."""
        at = np.searchsorted(self.numbers, points.numbers)
        folded = np.append(self.numbers, 0)[at] == points.numbers
        folded &= at < len(self.numbers)
        if not folded.any():
            return tracer.fill(tracer.hemispheres(points, rays, key, leap))[0]
        out = np.empty((len(points), tracer.columns, COLUMNS))
        others = tracer.fill(tracer.hemispheres(points[~folded], rays, key, leap))[0]
        out[~folded] = others.reshape(-1, tracer.columns, COLUMNS)
        # A falloff at a time: means over the samples of each vertex.
        corners = self.corners.only(self.corners.point_rows[at[folded]])
        samples = tracer.fill(tracer.hemispheres(corners.points, -(-rays // self.share), key, 1))[0]
        for column, gathered in enumerate(np.moveaxis(samples.reshape(-1, tracer.columns, COLUMNS), 1, 0)):
            means = np.empty((len(corners), COLUMNS))
            means[:, W] = corners.mean(gathered[:, :1])[:, 0]
            means[:, BATCH_VARIANCE] = corners.variance(gathered[:, BATCH_VARIANCE])
            means[:, BENT:] = corners.mean_direction(gathered[:, BENT:])
            out[folded, column] = means
        return out


@dataclass(eq=False)
class MeansOfGroups:
    """Means over groups of equally many samples, to be traced; rows are as of `Hemispheres`, but float32."""

    hemispheres: Hemispheres  # at the samples, group after group
    samples: int  # of a group
    geometric_normals: Float32s  # (p, 4), of the faces under the samples
    block_rays: ClassVar = 1 << 14

    def __len__(self) -> int:
        return len(self.hemispheres) // self.samples

    def __getitem__(self, rows: slice) -> Self:
        start, stop, _ = rows.indices(len(self))
        part = slice(self.samples * start, self.samples * stop)
        return replace(self, hemispheres=self.hemispheres[part], geometric_normals=self.geometric_normals[part])

    @property
    def name(self) -> bytes:
        return self.hemispheres.name

    @property
    def rays(self) -> float:
        return self.samples * self.hemispheres.rays

    def tables(self) -> Outputs:
        return (np.zeros((len(self), *self.hemispheres.mu.shape, COLUMNS), np.float32),)

    def writer(self, scene: RayScene, tables: Outputs) -> Callable[[int, int], None]:
        table, gather = self.hemispheres.directions(scene), self.hemispheres.gatherer(scene)
        out = tables[0].reshape(-1, *(self.hemispheres.mu.shape or (1,)), COLUMNS)

        def write(start: int, stop: int) -> None:
            part = slice(self.samples * start, self.samples * stop)
            points, normals = self.hemispheres.points[part], self.geometric_normals[part]
            gathered = np.empty((len(points), *out.shape[1:]))
            gather(points, gathered)
            means = np.empty((stop - start, COLUMNS))
            for falloff in range(out.shape[1]):
                column = np.ascontiguousarray(gathered[:, falloff])
                leave_out_below(points.arrays, normals, table, scene.lobe, column)
                _average(column, self.samples, means)
                out[start:stop, falloff] = means

        return write


@each("groups")
def _pick(
    i: int,
    groups: Int64s,
    group_numbers: Int64s,
    samples: int,
    starts: Int64s,
    chance: int,
    picked: tuple[Int64s, UInt32s],
) -> None:
    """Write which samples of a group are taken, one of its runs of so many by `chance`, and their numbers."""
    source, numbers = picked
    begin = starts[groups[i]]
    runs = (starts[groups[i] + 1] - begin) // samples
    begin += samples * (chance % runs)
    for k in range(samples):
        source[samples * i + k] = begin + k
        numbers[samples * i + k] = samples * group_numbers[i] + k


@kernel
def _average(values: Float64Rows, samples: int, out: Float64Rows) -> None:
    """Write means of every `samples` consecutive `values` (k, COLUMNS) to the rows of `out`.

    The variance of one sample is that of its rays, or what samples differ by beyond that, whichever is larger; of the
    mean it is as if of all rays at once: they share a leaped lattice, and places are even over the site.
    """
    for i in range(len(out)):
        for column in range(COLUMNS):
            total = 0.0
            for k in range(samples):
                total += values[samples * i + k, column]
            out[i, column] = total / samples
        between = 0.0
        for k in range(samples):
            between += (values[samples * i + k, W] - out[i, W]) ** 2
        within = out[i, BATCH_VARIANCE]
        out[i, BATCH_VARIANCE] = max(within, between / max(samples - 1, 1) - within) * samples**_RATE
