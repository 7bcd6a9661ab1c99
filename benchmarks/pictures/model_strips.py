"""The sphere strips of docs/models: `python -m benchmarks.pictures.model_strips`, part of `make pictures`.

Each picture is a row of spheres under one directional light and faint ambient light, seen from the front without
perspective, over the model's main parameter. Light arriving is π for physical models, so that ρ = 1 facing it is white.
Warnock's are ever farther from a lamp at the viewer, whose light falls with the distance.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from benchmarks import ROOT
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
    Warnock,
    material_from_dict,
)
from obscurance.raytrace.brdf.presets import eta_from_reflectance
from obscurance.raytrace.brdf.reflect import reflect
from obscurance.raytrace.image.write import write_image
from obscurance.raytrace.mesh.normals import normalize

FOLDER = ROOT / "docs" / "models"
SIZE, SAMPLES = 112, 3
LIGHT = normalize(np.array([-0.5, 0.6, 0.75]))
FRONT = normalize(np.array([0.0, 0.25, 1.0]))
EDGE = normalize(np.array([-1.0, 0.2, -0.15]))
WARD_FORMS = ("bounded", "ward", "duer")
VIEW = np.array([0.0, 0.0, 1.0])
AMBIENT, BACKGROUND = 0.04, 0.02
COPPER = (eta_from_reflectance(0.95), eta_from_reflectance(0.64), eta_from_reflectance(0.54))
BRASS = material_from_dict({"preset": "rolled_brass"})
BRUSHED = {"albedo": 0.0, "k_s": 1.0, "eta": 45.0, "k_a": 0.9, "grain": (0, 1, 0)}


def sphere(material: Material, light: np.ndarray, intensity: float, distance: float | None = None) -> np.ndarray:
    """Linear RGB (SIZE, SIZE, 3) of one sphere. Args: distance: in radii, of its nearest point from a lamp in front."""
    place = (np.arange(SIZE * SAMPLES) + 0.5) / (SIZE * SAMPLES) * 2 - 1
    x, y = np.meshgrid(1.05 * place, -1.05 * place)
    inside = x * x + y * y < 1
    n = np.stack([x, y, np.sqrt(np.maximum(0, 1 - x * x - y * y))], axis=-1)
    row = material.pack().row
    fading = 1.0 if distance is None else 1.0 / (distance + 1.0 - n[..., 2:])
    colour = intensity * fading * reflect(material, n, light, VIEW) + row[:3] + AMBIENT * row[3:6]
    pixels = np.where(inside[..., None], colour, BACKGROUND)
    return pixels.reshape(SIZE, SAMPLES, SIZE, SAMPLES, 3).mean(axis=(1, 3))


DEPTHS = [1.2, 1.8, 2.6, 3.6, 5.0, 7.0]
Strip = tuple[Callable[[float], Material], list[float], np.ndarray, float]
STRIPS: dict[str, Strip] = {
    "lambert": (lambda x: Lambert(albedo=x), [0.05, 0.1, 0.2, 0.4, 0.7, 1.0], LIGHT, np.pi),
    "phong": (lambda x: Phong(k_d=(0.5, 0.1, 0.1), k_s=0.5, exponent=x), [2, 5, 15, 50, 150, 500], LIGHT, 1.0),
    "blinn_phong": (
        lambda x: BlinnPhong(k_d=(0.1, 0.2, 0.5), k_s=0.5, exponent=x), [2, 5, 15, 50, 150, 500], LIGHT, 1.0,
    ),
    "cook_torrance": (
        lambda x: CookTorrance(albedo=0, k_s=1, m=x, eta=COPPER, k_a=(0.95, 0.64, 0.54)),
        [0.1, 0.15, 0.22, 0.33, 0.5, 0.8], LIGHT, 1.0,
    ),
    "cook_torrance_plastic": (
        lambda x: CookTorrance(albedo=(0.1, 0.35, 0.15), k_s=x, m=0.2),
        [0, 0.2, 0.4, 0.6, 0.8, 1.0], LIGHT, np.pi,
    ),
    "elliptical_beckmann": (
        lambda x: EllipticalBeckmann(m_parallel=0.2 / x, m_perpendicular=0.2 * x, **BRUSHED),
        [1, 1.3, 1.7, 2.2, 3, 4], LIGHT, 0.3,
    ),
    "ward": (
        lambda x: Ward(k_d=0.05, k_s=0.6, m_parallel=0.2 / x, m_perpendicular=0.2 * x, grain=(0, 1, 0)),
        [1, 1.3, 1.7, 2.2, 3, 4], LIGHT, 0.5,
    ),
    "ward_forms": (
        lambda x: Ward(
            k_d=0.05, k_s=0.6, m_parallel=0.15, m_perpendicular=0.4, grain=(0, 1, 0), form=WARD_FORMS[int(x)]
        ),
        [0, 1, 2], EDGE, 0.5,
    ),
    "ashikhmin_shirley": (
        lambda x: AshikhminShirley(
            albedo=(0.5, 0.2, 0.1), reflectance=0.05, exponent_parallel=30 * x, exponent_perpendicular=30 / x,
            grain=(0, 1, 0),
        ),
        [1, 2, 4, 8, 16, 30], LIGHT, np.pi,
    ),
    "kajiya": (
        lambda x: Kajiya(height=x, correlation_parallel=2000, correlation_perpendicular=2000, eta=45, k_a=0.9),
        [15, 30, 60, 120, 240, 480], LIGHT, 0.3,
    ),
    "kajiya_grain": (
        lambda x: Kajiya(
            height=90, correlation_parallel=1500 * x, correlation_perpendicular=1500 / x, eta=45, k_a=0.9,
            grain=(0, 1, 0),
        ),
        [1, 1.2, 1.4, 1.7, 2, 2.4], LIGHT, 0.3,
    ),
    "oren_nayar": (lambda x: OrenNayar(albedo=0.8, sigma=x), [0, 0.1, 0.2, 0.35, 0.6, 1.0], FRONT, np.pi),
    "strauss": (
        lambda x: Strauss(colour=(0.8, 0.45, 0.25), smoothness=x, metalness=0.8),
        [0, 0.3, 0.5, 0.7, 0.85, 0.95], LIGHT, 1.0,
    ),
    "strauss_metalness": (
        lambda x: Strauss(colour=(0.8, 0.45, 0.25), smoothness=0.7, metalness=x),
        [0, 0.2, 0.4, 0.6, 0.8, 1.0], LIGHT, 1.0,
    ),
    "poulin_fournier": (
        lambda x: PoulinFournier(k_d=0.2, k_s=0.8, exponent=60, spacing=3, floor=x, grain=(0, 1, 0)),
        [0, 0.3, 0.6, 0.8, 0.95, 1], LIGHT, 1.0,
    ),
    "warnock": (lambda _: Warnock(albedo=0.9), DEPTHS, VIEW, 1.0),
}  # fmt: skip


def plate(grain: Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]) -> np.ndarray:
    """Linear RGB (2 SIZE, 2 SIZE, 3) of a brushed plate under a near lamp, the grain's x and y given by place."""
    side = 2 * SIZE * SAMPLES
    place = (np.arange(side) + 0.5) / side * 2 - 1
    x, y = np.meshgrid(place, -place)
    zero = np.zeros_like(x)
    directions = np.stack([*grain(x, y), zero], axis=-1)
    light = np.stack([-0.3 - x, 0.5 - y, zero + 1.2], axis=-1)
    view = np.stack([-x, -3 - y, zero + 3.5], axis=-1)
    colour = BRASS.pack().row[3:6] * AMBIENT + 0.6 * reflect(BRASS, [0, 0, 1], light, view, directions)
    return colour.reshape(2 * SIZE, SAMPLES, 2 * SIZE, SAMPLES, 3).mean(axis=(1, 3))


GRAINS = [lambda x, y: (1 + 0 * x, 0 * y), lambda x, y: (-y, x), lambda x, y: (x, y)]


def picture(name: str) -> np.ndarray:
    """Linear RGB (SIZE, SIZE · k, 3) of a strip of k spheres."""
    make, values, light, intensity = STRIPS[name]
    far = values if values is DEPTHS else [None] * len(values)
    spheres = [sphere(make(value), light, intensity, each) for value, each in zip(values, far, strict=True)]
    return np.concatenate(spheres, axis=1)


def main() -> None:
    write_image(FOLDER / "grain.png", np.concatenate([plate(grain) for grain in GRAINS], axis=1))
    for name, strip in STRIPS.items():
        write_image(FOLDER / f"{name}.png", picture(name))
        print(FOLDER / f"{name}.png", strip[1])


if __name__ == "__main__":
    main()
