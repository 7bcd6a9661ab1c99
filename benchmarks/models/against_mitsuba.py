"""Lambert and the microfacet models against Mitsuba 3: `python -m benchmarks.models.against_mitsuba`.

Needs `pip install mitsuba` (3.9 tried). What is compared, over random pairs of directions above the surface:

- `diffuse` with Lambert: f n·l itself;
- `roughconductor` (Beckmann, η = 1.5, k = 0) with Cook–Torrance and elliptical Beckmann, k_s = 1: the conventions for
  D, F and 1/4 agree, but Mitsuba's G is Smith's and ours that of V-grooves, so each side's G is divided out;
- Mitsuba's dielectric Fresnel reflectance with ours.

Exit status 1 where they are further apart than single precision explains.
"""

from __future__ import annotations

import sys

import mitsuba as mi
import numpy as np

from obscurance.raytrace import CookTorrance, EllipticalBeckmann, Lambert, Material
from obscurance.raytrace.brdf.microfacet import fresnel
from obscurance.raytrace.brdf.reflect import reflect

N = np.array([0.0, 0.0, 1.0])
COUNT, TOLERANCE = 2000, 2e-5


def hemisphere(seed: int) -> np.ndarray:
    w = np.random.default_rng(seed).normal(size=(COUNT, 3))
    w[:, 2] = np.abs(w[:, 2]) + 1e-3
    return w / np.linalg.norm(w, axis=1)[:, None]


def mitsuba_values(bsdf: mi.BSDF, l: np.ndarray, v: np.ndarray) -> np.ndarray:
    """f n·l by Mitsuba, light and viewer in the local frame, u along x."""
    context, values = mi.BSDFContext(), []
    interaction = mi.SurfaceInteraction3f()
    for light, viewer in zip(l, v, strict=True):
        interaction.wi = mi.Vector3f(*viewer)
        values.append(np.array(bsdf.eval(context, interaction, mi.Vector3f(*light))))
    return np.array(values)[:, 0]


def smith(alpha: tuple[float, float], l: np.ndarray, v: np.ndarray, h: np.ndarray) -> np.ndarray:
    """Mitsuba's own G."""
    distribution = mi.MicrofacetDistribution(mi.MicrofacetType.Beckmann, *alpha)
    return np.array(
        [distribution.G(mi.Vector3f(*a), mi.Vector3f(*b), mi.Vector3f(*c)) for a, b, c in zip(v, l, h, strict=True)]
    )


def v_grooves(l: np.ndarray, v: np.ndarray, h: np.ndarray) -> np.ndarray:
    """Our G, as printed."""
    vh = np.sum(v * h, axis=1)
    return np.minimum(1, np.minimum(2 * h[:, 2] * v[:, 2] / vh, 2 * h[:, 2] * l[:, 2] / vh))


def report(name: str, ours: np.ndarray, theirs: np.ndarray) -> bool:
    """Relative differences where the value is above 1e-6 of the largest."""
    used = theirs > 1e-6 * theirs.max()
    apart = np.abs(ours - theirs)[used] / theirs[used]
    print(f"{name:44} {used.sum():5} pairs: median {np.median(apart):.1e}, largest {apart.max():.1e}")
    return bool(apart.max() < TOLERANCE)


def lobe(material: Material, alpha: tuple[float, float], l: np.ndarray, v: np.ndarray) -> bool:
    description = {
        "type": "roughconductor", "distribution": "beckmann", "alpha_u": alpha[0], "alpha_v": alpha[1],
        "eta": {"type": "rgb", "value": 1.5}, "k": {"type": "rgb", "value": 0.0},
        "specular_reflectance": {"type": "rgb", "value": 1.0},
    }  # fmt: skip
    h = (l + v) / np.linalg.norm(l + v, axis=1)[:, None]
    theirs = mitsuba_values(mi.load_dict(description), l, v) / smith(alpha, l, v, h)
    ours = reflect(material, N, l, v)[:, 0] / v_grooves(l, v, h)
    return report(f"D F/(4 n·v), {type(material).__name__} {alpha}", ours, theirs)


def main() -> int:
    mi.set_variant("scalar_rgb")
    l, v = hemisphere(0), hemisphere(1)
    grey = mi.load_dict({"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.6}})
    good = [report("diffuse, Lambert", reflect(Lambert(albedo=0.6), N, l, v)[:, 0], mitsuba_values(grey, l, v))]
    for m in (0.1, 0.3, 0.6):
        good.append(lobe(CookTorrance(albedo=0, m=m, eta=1.5), (m, m), l, v))
    for a, b in ((0.1, 0.4), (0.6, 0.2)):
        material = EllipticalBeckmann(albedo=0, m_parallel=a, m_perpendicular=b, eta=1.5, grain=(1, 0, 0))
        good.append(lobe(material, (a, b), l, v))
    cosines = np.linspace(0.001, 1, 500)
    theirs = np.array([mi.fresnel(float(c), 1.5)[0] for c in cosines])
    good.append(report("Fresnel, η = 1.5", np.array([fresnel(1.5, c) for c in cosines]), theirs))
    return 0 if all(good) else 1


if __name__ == "__main__":
    sys.exit(main())
