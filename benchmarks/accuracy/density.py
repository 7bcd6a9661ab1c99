"""Bakes to a tolerance against rays: what a mesh's density costs, and whether the error reported is the true one.

    python -m benchmarks.accuracy.density [MESH ...] [--seeds 1 2 3] [--tolerances .01 .004] [--jumps]

Surfaces at two densities, 16 times as many vertices: files by Loop's scheme, and bumpy spheres, height fields and
generated scans by seed. With --jumps instead: posts and walls on a slab, bumps and creases, 160,000 vertices each.
The truth at some vertices is traced with other directions, undenoised; its own noise is taken out of the errors.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from benchmarks.accuracy.dense_meshes import JUMPS, PAIRS, subdivided
from obscurance import ao
from obscurance.raytrace.mesh.mesh import Mesh
from obscurance.scenes.formats.load import load

FALLOFF = ao.Binary()
CHECKED, RAYS = 8192, 2048  # vertices, and rays at each of them


class Truth(NamedTuple):
    """w at some vertices."""

    vertices: npt.NDArray[np.int64]
    w: npt.NDArray[np.float64]
    variance: float

    @classmethod
    def of(cls, mesh: Mesh, seed: int = 1001) -> Truth:
        count = len(mesh.vertices)
        chosen = np.sort(np.random.default_rng(seed).permutation(count)[:CHECKED])
        only = np.isin(np.arange(count), chosen)
        baked = ao.bake(mesh, FALLOFF, samples=RAYS, denoise=False, seed=seed, only=only)
        return cls(chosen, np.asarray(baked.w[chosen], np.float64), float(np.mean(baked.error[chosen] ** 2)))


class Judgement(NamedTuple):
    """How a bake went: rays in all and for each vertex, true RMSE and the one reported, a quantile of |w − truth|."""

    rays: int
    each: float
    rmse: float
    reported: float
    quantile: float

    @classmethod
    def of(cls, mesh: Mesh, truth: Truth, tolerance: float, seed: int) -> Judgement:
        baked = ao.bake(mesh, FALLOFF, tolerance=tolerance, seed=seed)
        off = baked.w[truth.vertices] - truth.w
        rmse = float(np.sqrt(max(np.mean(off**2) - truth.variance, 0.0)))
        quantile = float(np.quantile(np.abs(off), 0.999))
        return cls(baked.rays, baked.rays / len(mesh.vertices), rmse, baked.rmse, quantile)

    def line(self, name: str, tolerance: float) -> str:
        errors = f"{self.rmse:.5f} ({self.rmse / tolerance:4.2f} of it) reported/true {self.reported / self.rmse:4.2f}"
        return (
            f"{name:32s} {tolerance:<6g} {self.rays / 1e6:8.2f} M {self.each:7.1f} {errors} 99.9 % {self.quantile:.3f}"
        )


def pairs(files: list[Path], seeds: list[int]) -> Iterator[tuple[Mesh, Mesh]]:
    for file in files:
        mesh = load(file).mesh
        base = Mesh(mesh.vertices, mesh.faces, source=file.stem)
        yield base, subdivided(base)
    for seed in seeds:
        for pair in PAIRS.values():
            yield pair(seed)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("meshes", nargs="*", type=Path)
    parser.add_argument("--seeds", nargs="*", type=int, default=[1, 2, 3])
    parser.add_argument("--tolerances", nargs="+", type=float, default=[0.01, 0.004])
    parser.add_argument("--jumps", action="store_true", help="surfaces on which w jumps instead")
    options = parser.parse_args()
    if options.jumps:
        for seed in options.seeds:
            for surface in JUMPS.values():
                mesh = surface(seed)
                truth = Truth.of(mesh)
                for tolerance in options.tolerances:
                    print(Judgement.of(mesh, truth, tolerance, seed).line(mesh.source, tolerance), flush=True)
        return
    for base, dense in pairs(options.meshes, options.seeds):
        truths = Truth.of(base), Truth.of(dense)
        for tolerance in options.tolerances:
            few, many = (
                Judgement.of(mesh, truth, tolerance, 5) for mesh, truth in zip((base, dense), truths, strict=True)
            )
            print(few.line(base.source, tolerance))
            print(many.line(dense.source, tolerance), f"{many.rays / few.rays:.2f} × the rays", flush=True)


if __name__ == "__main__":
    main()
