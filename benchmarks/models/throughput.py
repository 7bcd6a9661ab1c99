"""Evaluations per second and core of every reflection model: `python -m benchmarks.models.throughput`.

One compiled loop over a million random (n, l, v, grain) above the surface, one packed material, one thread: the
dispatch, the unpacking of the row and the memory traffic are all counted. Median and best of nine runs.
"""

from __future__ import annotations

import platform
import time

import numpy as np

from benchmarks import RESULTS
from obscurance.raytrace import (
    AshikhminShirley,
    BlinnPhong,
    CookTorrance,
    EllipticalBeckmann,
    Kajiya,
    Lambert,
    Material,
    OrenNayar,
    Phong,
    PoulinFournier,
    Strauss,
    Ward,
)
from obscurance.raytrace.brdf.dispatch import reflect_rows
from obscurance.raytrace.kernel.library import built_by
from obscurance.raytrace.system.atomic import write_json

COUNT, RUNS = 1_000_000, 9
RESULT = RESULTS / "model_throughput.json"
MATERIALS: list[Material] = [
    Lambert(albedo=0.5),
    Phong(k_d=0.3, k_s=0.5),
    BlinnPhong(k_d=0.3, k_s=0.5),
    CookTorrance(albedo=0.5, k_s=0.5, m=0.3),
    EllipticalBeckmann(albedo=0.5, k_s=0.5, m_parallel=0.1, m_perpendicular=0.3),
    Ward(k_d=0.4, k_s=0.4, m_parallel=0.1, m_perpendicular=0.3),
    AshikhminShirley(albedo=0.5, reflectance=0.3, exponent_parallel=20, exponent_perpendicular=200),
    Kajiya(height=100, correlation_parallel=4000, correlation_perpendicular=900),
    OrenNayar(albedo=0.5, sigma=0.3),
    Strauss(colour=0.5, smoothness=0.5, metalness=0.5),
    PoulinFournier(k_d=0.4, k_s=0.4, spacing=2.5, floor=0.2),
]


def random_directions(seed: int = 0) -> list[np.ndarray]:
    """n, l, v, grain: (COUNT, 3) unit vectors, l and v above the surface of n."""
    n, l, v, grain = np.random.default_rng(seed).normal(size=(4, COUNT, 3))
    for w in (n, l, v, grain):
        w /= np.linalg.norm(w, axis=1)[:, None]
    for w in (l, v):
        w *= np.sign(np.sum(w * n, axis=1))[:, None]
    return [n, l, v, grain]


def measure(material: Material, directions: list[np.ndarray]) -> dict[str, float]:
    """Million evaluations a second: median and best."""
    kind, row = material.pack()
    out = np.empty((COUNT, 3))
    reflect_rows(kind, row, *directions, out)
    seconds = []
    for _ in range(RUNS):
        start = time.perf_counter()
        reflect_rows(kind, row, *directions, out)
        seconds.append(time.perf_counter() - start)
    return {"median": COUNT / np.median(seconds) / 1e6, "best": COUNT / min(seconds) / 1e6}


def main() -> None:
    directions = random_directions()
    rates = {}
    for material in MATERIALS:
        name = type(material).__name__
        rates[name] = measure(material, directions)
        print(f"{name:20} {rates[name]['median']:6.1f} M/s median  {rates[name]['best']:6.1f} M/s best")
    RESULT.parent.mkdir(exist_ok=True)
    machine = {"cpu": platform.processor() or platform.machine(), "python": platform.python_version()}
    versions = {"kernels": built_by(), "numpy": np.__version__}
    write_json(RESULT, {**machine, **versions, "evaluations": COUNT, "rates": rates})


if __name__ == "__main__":
    main()
