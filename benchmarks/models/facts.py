"""The measured figures in docs/models: `python -m benchmarks.models.facts`.

Energy by quadrature, reciprocity over random pairs, and the Oren–Nayar fit against the integral it approximates.
"""

from __future__ import annotations

import numpy as np

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
from obscurance.raytrace.brdf.models.oren_nayar import fitted_orders
from obscurance.raytrace.brdf.reflect import NORMAL, albedo, asymmetry, directional_albedo, towards

from .oren_nayar_integral import reference_orders

DEGREES = [0, 20, 40, 60, 75, 80, 85, 87, 89, 89.9]
SLOPES = [0.05, 0.1, 0.2, 0.3, 0.45, 0.6, 0.8, 1.0]
MIRROR = {"albedo": 0.0, "k_s": 1.0, "eta": 1e6}


def largest(make: dict[str, Material], slopes: dict[str, float | None]) -> None:
    """The largest directional albedo of a family, and where it is."""
    found = [
        (directional_albedo(material, np.radians(a), slopes[name])[0], name, a)
        for name, material in make.items()
        for a in DEGREES
    ]
    value, name, at = max(found)
    print(f"  {value:.4f} for {name} at {at}°")


def energy() -> None:
    print("largest directional albedo")
    for title, build in (
        ("Cook–Torrance, Beckmann, F = 1", lambda m: CookTorrance(m=m, **MIRROR)),
        ("Cook–Torrance, Beckmann, F = 1, book form", lambda m: CookTorrance(m=m, form="book", **MIRROR)),
        ("Cook–Torrance, Gaussian, F = 1", lambda m: CookTorrance(m=m, distribution="gaussian", **MIRROR)),
        (
            "elliptical Beckmann, m_∥ = m_⊥/4, F = 1",
            lambda m: EllipticalBeckmann(m_parallel=m / 4, m_perpendicular=m, grain=(1, 0, 0), **MIRROR),
        ),
        *(
            (
                f"Ward, {form}, m_∥ = m_⊥/4",
                lambda m, form=form: Ward(
                    k_d=0, k_s=1, m_parallel=m / 4, m_perpendicular=m, grain=(1, 0, 0), form=form
                ),
            )
            for form in ("bounded", "ward", "duer")
        ),
    ):
        print(title, end=":")
        largest({f"m = {m}": build(m) for m in SLOPES}, {f"m = {m}": m for m in SLOPES})
    exponents = [(a, b) for a in (1, 10, 100, 1000) for b in (1, 10, 100, 1000) if a <= b]
    lobes = [
        (albedo(coated, np.radians(angle), 160)[0], f"n = {a}, {b}, R_s = {r}", angle)
        for a, b in exponents
        for r in (0, 0.04, 0.5, 1)
        for coated in [
            AshikhminShirley(albedo=1, reflectance=r, exponent_parallel=a, exponent_perpendicular=b, grain=(1, 0, 0))
        ]
        for angle in DEGREES
    ]
    print("Ashikhmin–Shirley, ρ = 1:\n  {:.4f} for {} at {}°".format(*max(lobes)))
    fits = {f"σ = {s}": OrenNayar(albedo=1.0, sigma=s) for s in (0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.4, 0.6, 1.0, 1.5)}
    print("Oren–Nayar fit, ρ = 1", end=":")
    largest(fits, dict.fromkeys(fits))
    for sigma in (0.1, 0.3, 0.6):
        value = directional_albedo(OrenNayar(albedo=1.0, sigma=sigma), np.radians(89))[0]
        print(f"  σ = {sigma}, 89°: {value:.4f}")
    for title, paint in (
        ("Phong, k_d = .3, k_s = .6, m = 3", Phong(k_d=0.3, k_s=0.6, exponent=3)),
        ("Blinn–Phong, k_d = .3, k_s = .6, m = 3", BlinnPhong(k_d=0.3, k_s=0.6, exponent=3)),
        ("Strauss, c = 1, s = .5, m = .5", Strauss(colour=1.0, smoothness=0.5, metalness=0.5)),
    ):
        values = [f"{directional_albedo(paint, np.radians(a))[0]:.2f}" for a in (0, 60, 85, 89)]
        print(f"{title}: reflected/incident at 0, 60, 85, 89°: {', '.join(values)}")


def reciprocity() -> None:
    print("\nasymmetry of f(l, v), largest of 20 000 pairs")
    for material in (
        Lambert(albedo=0.8),
        CookTorrance(albedo=0.5, k_s=0.6, m=0.2),
        EllipticalBeckmann(albedo=0.5, k_s=0.6, m_parallel=0.1, m_perpendicular=0.6),
        Ward(k_d=0.2, k_s=0.6, m_parallel=0.1, m_perpendicular=0.6),
        AshikhminShirley(albedo=0.5, reflectance=0.3, exponent_parallel=9, exponent_perpendicular=300),
        Kajiya(height=90, correlation_parallel=4000, correlation_perpendicular=900),
        OrenNayar(albedo=0.9, sigma=0.5),
        Phong(k_d=0.3, k_s=0.6),
        Phong(k_d=0.3, k_s=0.6, weight="cosine"),
        BlinnPhong(k_d=0.3, k_s=0.6),
        Strauss(colour=0.5, smoothness=0.5),
        PoulinFournier(k_d=0.5, k_s=0.0),
        PoulinFournier(k_d=0.3, k_s=0.6),
    ):
        print(f"  {material.to_dict()}: {asymmetry(material):.1e}")


def oren_nayar_fit(limit: float) -> None:
    print(f"\nOren–Nayar fit minus integral, as parts of ρ/π, ρ = .9, angles to {limit:g}°")
    angles = np.radians([a for a in (2, 15, 30, 45, 60, 75, 85) if a <= limit])
    for sigma in (0.1, 0.2, 0.35, 0.5, 0.7, 1.0):
        errors = []
        for theta_i in angles:
            for theta_r in angles:
                for phi in np.linspace(0, np.pi, 7):
                    l, v = towards(theta_i), towards(theta_r, phi)
                    exact = reference_orders(sigma, l, v, 64)
                    fit = fitted_orders(sigma, tuple(NORMAL), tuple(l), tuple(v))
                    errors.append(((fit[0] - exact[0]) / l[2], (fit[1] - exact[1]) / l[2]))
        first, second = np.array(errors).T
        total = first + 0.9 * second
        cells = [f"{np.sqrt(np.mean(e**2)):.3f} RMS, {np.abs(e).max():.3f} largest" for e in (first, second, total)]
        print(f"  σ = {sigma}: first order {cells[0]}; second {cells[1]}; together {cells[2]}")


if __name__ == "__main__":
    energy()
    reciprocity()
    oren_nayar_fit(75)
    oren_nayar_fit(85)
