"""Error over the surface of the two methods at equal rays: w at the vertices, interpolated, against w traced there.

    python -m benchmarks.accuracy.surface_error MESH... [--samples 64 256] [--points 100000] [--rays 256]

The truth at points spread evenly by area is traced by brute force, by none of the baker's code: 1 = open, about the
normal interpolated between the vertices ("shading", what is below the face left out) and about the face's ("face").
A point is hidden where half of its rays or more meet the backs of faces; errors are given over the points that are not
hidden and over all. Two independent truths f, g of half the rays each make the mean of (w − f)(w − g) free of their
noise. The table has the area-weighted RMS error over what is not hidden, shading normals.
"""

from __future__ import annotations

import argparse
import platform
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from benchmarks import RESULTS
from obscurance import ao
from obscurance.ao.points.receivers import find_receivers
from obscurance.ao.report import versions
from obscurance.raytrace.embree import intersect
from obscurance.raytrace.mesh.mesh import Mesh
from obscurance.raytrace.mesh.normals import face_normals, normalize
from obscurance.raytrace.mesh.placement import Placement
from obscurance.raytrace.ray_origins.origins import ray_offset
from obscurance.raytrace.sampling import cosine_hemisphere, owen_sobol
from obscurance.raytrace.system.atomic import write_json
from obscurance.scenes.formats.load import load

Floats = npt.NDArray[np.float64]
FALLOFFS = {"exponential": ao.Exponential(), "binary": ao.Binary()}
CHUNK = 1 << 21


class Points:
    """Points spread over a mesh by area, and the truth at them.

    Attributes:
        corners: int64 (k, 3), vertices of each point's face. weights: float64 (k, 3), barycentric.
        hidden: bool (k,). truths: {"shading", "face"} → {falloff} → float64 (2, k).
    """

    def __init__(self, mesh: Mesh, count: int, rays: int) -> None:
        placement = Placement.of(mesh)
        receivers = find_receivers(mesh, placement)
        vertices = placement.vertices.astype(np.float64)
        self.scene = receivers.embree()
        self.normals, areas = face_normals(vertices, receivers.faces)
        random = np.random.default_rng(12345)
        ends = np.cumsum(areas)
        face = np.searchsorted(ends, (np.arange(count) + random.random(count)) / count * ends[-1]).clip(
            max=len(ends) - 1
        )
        s, t = np.sqrt(random.random(count)), random.random(count)
        self.weights = np.stack([1 - s, s * (1 - t), s * t], axis=1)
        self.corners = receivers.faces[face]
        front = self.normals[face]
        magnitude = np.abs(vertices[self.corners]).max(axis=(1, 2))
        at = np.einsum("kc,kci->ki", self.weights, vertices[self.corners])
        origins = at + ray_offset(front, magnitude, np.ones(count))[:, None] * front
        axes = receivers.points.normals[receivers.of_vertex[self.corners]].astype(np.float64)
        shading = normalize(np.einsum("kc,kci->ki", self.weights, axes))
        mus = {name: falloff.resolve(mesh.radius) for name, falloff in FALLOFFS.items()}
        self.truths: dict[str, dict[str, Floats]] = {}
        for kind, about in (("shading", shading), ("face", front)):
            self.truths[kind] = {name: np.empty((2, count)) for name in mus}
            backs = np.zeros(count)
            for turn in (0, 1):
                sets = owen_sobol(1024, rays // 2, np.uint32(turn + 1))
                for a in range(0, count, CHUNK // rays):
                    some = slice(a, min(a + CHUNK // rays, count))
                    kept, distance, back = self._trace(origins[some], about[some], front[some], sets, random)
                    weight = kept / kept.sum(axis=1, keepdims=True)
                    backs[some] += (weight * back).sum(axis=1) / 2
                    for name, mu in mus.items():
                        open_ = np.where(np.isinf(distance), 1.0, mu(distance / placement.scale))
                        self.truths[kind][name][turn, some] = (weight * open_).sum(axis=1)
            self.hidden = backs >= 0.5

    def _trace(
        self, origins: Floats, axes: Floats, fronts: Floats, sets: tuple[Floats, Floats], random: np.random.Generator
    ) -> tuple[npt.NDArray[np.bool_], Floats, npt.NDArray[np.bool_]]:
        """Whether each ray leaves above its face, its distance, and whether it meets a back: three times (k, rays)."""
        count, rays = len(origins), sets[0].shape[1]
        chosen = random.integers(0, len(sets[0]), count)
        u, v = sets[0][chosen], (sets[1][chosen] + random.random((count, 1))) % 1
        local = cosine_hemisphere(u, v)
        side = normalize(np.cross(axes, np.where(np.abs(axes[:, :1]) > 0.6, [[0.0, 1, 0]], [[1.0, 0, 0]])))
        frames = np.stack([side, np.cross(axes, side), axes], axis=1)
        directions = np.einsum("kcr,kci->kri", local, frames)
        kept = np.einsum("kri,ki->kr", directions, fronts) > 0
        hits = intersect(self.scene, np.repeat(origins, rays, axis=0), directions.reshape(-1, 3))
        away = np.einsum("ki,ki->k", self.normals[hits.face], directions.reshape(-1, 3)) > 0
        shape = count, rays
        return kept, hits.distance.astype(np.float64).reshape(shape), (away & (hits.face >= 0)).reshape(shape)

    def errors(self, w: Floats, falloff: str) -> dict[str, float]:
        """Area-weighted RMS error of `w` (n,) at the vertices."""
        interpolated = np.einsum("kc,kc->k", self.weights, w[self.corners])
        found = {}
        for kind, truths in self.truths.items():
            squared = (interpolated - truths[falloff][0]) * (interpolated - truths[falloff][1])
            found[kind] = float(np.sqrt(max(squared[~self.hidden].mean(), 0)))
            found[f"{kind}, all points"] = float(np.sqrt(max(squared.mean(), 0)))
        return found


def measure(path: Path, budgets: list[int], count: int, rays: int, seeds: int) -> dict[str, Any]:
    mesh = load(path).mesh
    points = Points(mesh, count, rays)
    most = 8192 if len(mesh.vertices) < 10_000 else 1024
    rows = []
    for name, falloff in FALLOFFS.items():
        for samples in [*budgets, most]:
            row: dict[str, Any] = {"falloff": name, "samples": samples}
            for method in ("vertex", "surface"):
                bakes = [ao.bake(mesh, falloff, samples=samples, seed=seed, method=method) for seed in range(seeds)]
                errors = [points.errors(baked.w, name) for baked in bakes]
                row[method] = {key: float(np.sqrt(np.mean([e[key] ** 2 for e in errors]))) for key in errors[0]}
                row[method]["rays"] = bakes[0].rays
            rows.append(row)
            ratio = row["surface"]["shading"] / row["vertex"]["shading"]
            print(
                f"{path.stem:<15} {name:<12} {samples:>5} rays a vertex  vertex {row['vertex']['shading']:.4f}"
                f"  surface {row['surface']['shading']:.4f}  ratio {ratio:.2f}",
                flush=True,
            )
    return {"mesh": path.name, "vertices": len(mesh.vertices), "hidden": float(points.hidden.mean()), "rows": rows}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("meshes", nargs="+", type=Path, metavar="MESH")
    parser.add_argument("--samples", type=int, nargs="+", default=[64, 256])
    parser.add_argument("--points", type=int, default=100_000)
    parser.add_argument("--rays", type=int, default=256, help="a point's, of both truths together")
    parser.add_argument("--seeds", type=int, default=2)
    given = parser.parse_args()
    found = {
        "points": given.points,
        "rays_a_point": given.rays,
        "seeds": given.seeds,
        "cpu": platform.processor() or platform.machine(),
        "versions": versions(),
        "meshes": [measure(path, given.samples, given.points, given.rays, given.seeds) for path in given.meshes],
    }
    folder = RESULTS
    folder.mkdir(exist_ok=True)
    target = folder / "surface_error.json"
    write_json(target, found)
    print(target)


if __name__ == "__main__":
    main()
