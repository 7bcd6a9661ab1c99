"""The integral over facets that the Oren–Nayar model fits, by quadrature."""

import numpy as np
import numpy.typing as npt

from obscurance.raytrace.types import Float64s


def reference_orders(sigma: float, l: npt.ArrayLike, v: npt.ArrayLike, order: int = 128) -> tuple[float, float]:
    """The integrals that `fitted_orders` fits, for n = (0, 0, 1): slow, and only for measuring the fit.

    A Gaussian distribution of V-groove facets, normalised over projected area as in the paper, each facet Lambertian,
    shadowed and masked by its opposite, and lit once more by it. The second bounce uses Hottel's crossed strings
    between the lit part of one side and the visible part of the other.

    Args: sigma > 0, radians; unit vectors l, v (3,) above the surface; order: quadrature points per half axis.
    Source: Oren & Nayar 1994, sections 4.1–4.3; (12.53–12.60).
    """
    l, v = np.asarray(l, np.float64), np.asarray(v, np.float64)
    end = min(np.pi / 2, 8.0 * sigma)
    nodes, weights = np.polynomial.legendre.leggauss(order)
    theta, d_theta = 0.5 * end * (nodes + 1.0), 0.5 * end * weights
    phi = np.asarray((np.arange(4 * order) + 0.5) * (2.0 * np.pi / (4 * order)), np.float64)
    density = np.exp(-(theta**2) / (2.0 * sigma**2)) * np.sin(theta) * d_theta
    density /= density.sum() * len(phi)

    facet = _directions(theta, phi)
    opposite = _directions(theta, phi + np.pi)
    na = np.cos(theta)[:, None]
    la, va, lo = (np.maximum(0.0, directions @ w) for directions, w in ((facet, l), (facet, v), (opposite, l)))
    lit, seen = _uncovered(na, l[2], la), _uncovered(na, v[2], va)
    projected = va / (na * v[2])
    first = la * projected * np.minimum(lit, seen)  # (12.58) with its GAF

    start_lit, start_seen = 1.0 - _uncovered(na, l[2], lo), 1.0 - seen
    spread = np.cos(2.0 * theta)[:, None]
    strings = _string(1.0, start_seen, spread) + _string(start_lit, 1.0, spread)
    strings = strings - _string(start_lit, start_seen, spread) - _string(1.0, 1.0, spread)
    second = lo * projected * 0.5 * np.maximum(0.0, strings)
    return float(np.sum(density[:, None] * first)), float(np.sum(density[:, None] * second))


def _directions(theta: Float64s, phi: Float64s) -> Float64s:
    """Unit vectors (len(theta), len(phi), 3)."""
    sine = np.sin(theta)[:, None]
    return np.stack(np.broadcast_arrays(sine * np.cos(phi), sine * np.sin(phi), np.cos(theta)[:, None]), axis=-1)


def _uncovered(na: Float64s, nw: float, wa: Float64s) -> Float64s:
    """Part of a facet, from its upper edge down, that direction w reaches past the opposite facet."""
    return np.asarray(np.minimum(1.0, np.divide(2.0 * na * nw, wa, out=np.ones_like(wa), where=wa > 0.0)))


def _string(x: Float64s | float, y: Float64s | float, spread: Float64s) -> Float64s:
    """Distance between the points at x on one side of the groove and at y on the other, measured from its bottom."""
    return np.asarray(np.sqrt(np.maximum(0.0, np.square(x) + np.square(y) + 2.0 * x * y * spread)))
