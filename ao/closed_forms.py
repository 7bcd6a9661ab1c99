"""Closed forms of w(p) = (1/π) ∫ μ(d) cosθ dω (12.71), the ground truths of validation.

Every function returns w as a float, 1 = open. `tau` is the rate τ > 0, in 1/length, of μ(x) = 1 − e^(−τx) (12.74), or
None for the binary μ (0 on a hit). Lengths share one unit. p lies on a plane, normal up, unless said otherwise.
Scenes of planes, where a limit D is offered, take it as `max_distance`: μ(x) = (1 − e^(−τx))/(1 − e^(−τD)) below D
and 1 beyond; with it `tau` may also be the name of a polynomial of `ao.falloff`, such as "linear", μ = x/D. Where no
antiderivative exists, one adaptive quadrature is left, good to 1e-10.

All follow from one transform of a scene, L(τ, D) = (1/π) ∫_{d<D} e^(−τd) cosθ dω, as w = 1 − L(0, D) when binary and
w = 1 − [L(τ, D) − e^(−τD) L(0, D)]/(1 − e^(−τD)) when exponential; and from its moments
M_n(D) = (1/π) ∫_{d<D} dⁿ cosθ dω when μ is a polynomial Σ c_n (x/D)ⁿ: w = 1 − L(0, D) + Σ c_n M_n(D)/Dⁿ. Arguments
outside their range raise ValueError. Of any scene of triangles the binary w is 1 − F, by form factors of polygons.
"""

from collections.abc import Callable, Sequence
from itertools import pairwise
from math import acos, asin, atan, atan2, cos, exp, expm1, hypot, inf, isinf, log, pi, radians, sin, sqrt, tan

import numpy as np
import numpy.typing as npt
from scipy.integrate import quad
from scipy.special import expn

from obscurance.raytrace.types import Float64s

from .falloff import POLYNOMIALS

Rate = float | str | None  # τ, a name in `POLYNOMIALS`, or None: binary
# With cosθ = 1/cosh u the integrand of Ki is analytic for |Im u| < π/2, so the trapezoidal rule errs by e^(−π²/step) ≈
# 1e-17 (Trefethen & Weideman 2014, "The exponentially convergent trapezoidal rule", theorem 5.1).
_STEP = 0.25
_U = np.arange(0.0, 40.0, _STEP)
_COSH = np.cosh(_U)
_WEIGHTS = np.where(_U == 0.0, _STEP / 2, _STEP)


def bickley(n: int, x: float) -> float:
    """Bickley–Naylor function Ki_n(x) = ∫₀^{π/2} e^(−x/cosθ) cos^{n−1}θ dθ (DLMF 10.43.11) of n ≥ 1, x ≥ 0."""
    depth = np.minimum(x * _COSH, 700.0)  # e^(−700) is nil, and no underflow; the error is below 1e-13
    return float(np.exp(-depth) @ (_WEIGHTS / _COSH**n))


def shell(tau: float, near: float, far: float, power: int = 0) -> float:
    """Attenuated depth integral ∫_near^far e^(−τt) tⁿ near² t⁻³ dt of a plane seen at distances near to far.

    It is the inner integral of (1/π)∫ e^(−τd) cosθ dω both for a plane facing the normal at distance `near`
    (t = near/cosθ, cosθ sinθ dθ = near² t⁻³ dt) and, at one azimuth, for a plane containing it (t = near/sinθ).

    Args:
        tau: τ ≥ 0; 0 leaves ½(1 − near²/far²). far: where the plane, or the search, ends; ≥ near > 0, ∞ allowed.
        power: n ≥ 0; above 0 with τ = 0 and a finite `far` only. For 0: E3(τ near) − (near/far)² E3(τ far).
    """
    if power == 2:
        return near**2 * log(far / near)
    if power:
        return near**2 * (far ** (power - 2) - near ** (power - 2)) / (power - 2)
    beyond = 0.0 if isinf(far) else (near / far) ** 2 * expn(3, tau * far)
    return float(expn(3, tau * near) - beyond)


def _require(condition: bool, message: str) -> None:
    if not condition:
        raise ValueError(message)


def _obscurance(transform: Callable[..., float], tau: Rate, max_distance: float = inf) -> float:
    """w. Args: transform: (τ, D) → L, and (0, D, n) → M_n if there are polynomials."""
    if isinstance(tau, str):
        _require(0 < max_distance < inf, f"max_distance: expected > 0 and finite, got {max_distance}")
        terms = [c * transform(0.0, max_distance, n) / max_distance**n for n, c in POLYNOMIALS[tau].items()]
        return 1.0 - transform(0.0, max_distance) + sum(terms)
    _require(tau is None or 0 < tau < inf, f"tau: expected a finite rate > 0 or None, got {tau}")
    _require(max_distance > 0, f"max_distance: expected > 0, got {max_distance}")
    if tau is None:
        return 1.0 - transform(0.0, max_distance)
    if isinf(max_distance):
        return 1.0 - transform(tau, inf)
    nearer = transform(tau, max_distance) - exp(-tau * max_distance) * transform(0.0, max_distance)
    return 1.0 + nearer / expm1(-tau * max_distance)


def _integral(integrand: Callable[[float], float], low: float, high: float, breaks: Sequence[float] = ()) -> float:
    """∫ integrand from `low` to `high` by adaptive quadrature, piece by piece between `breaks`, where it has kinks."""
    edges = [low, *sorted(b for b in breaks if low < b < high), high]
    return sum(float(quad(integrand, a, b, epsabs=1e-11, epsrel=1e-11, limit=200)[0]) for a, b in pairwise(edges))


def _upright(
    distance: Callable[[float], float],
    height: float,
    tau: float,
    limit: float,
    azimuths: tuple[float, float],
    breaks: Sequence[float] = (),
    power: int = 0,
) -> float:
    """L of walls perpendicular to the floor: (1/π) ∫ shell(τ, ρ(φ), √(ρ² + h²)) dφ, ρ the distance at azimuth φ.

    Args: power: n of M_n.
    """

    def integrand(azimuth: float) -> float:
        near = distance(azimuth)
        far = min(limit, hypot(near, height))
        return shell(tau, near, far, power) if near < far else 0.0

    return _integral(integrand, *azimuths, breaks) / pi


def _extruded(distance: Callable[[float], float], tau: float, angles: tuple[float, float]) -> float:
    """L of what is infinite along y: (2/π) ∫ sinφ Ki3(τρ(φ)) dφ, ρ the distance at angle φ from +x in the xz plane."""
    return 2 / pi * _integral(lambda angle: sin(angle) * bickley(3, tau * distance(angle)), *angles)


def tilted_normal(tilt: float) -> float:
    """Normal tilted by `tilt` (0…π, radians) over an infinite plane through p: ½(1 + cosδ) for every μ.

    What lies below the plane is hit at distance 0, where μ = 0, so binary and exponential agree.
    """
    _require(0 <= tilt <= pi, f"tilt: expected 0 to π, got {tilt}")
    return (1 + cos(tilt)) / 2


def inverted_pyramid(sides: int, slope: float) -> float:
    """Tip of an inverted regular pyramid of n sides that rise by t: (n/π) cosβ arctan(cosβ tan(π/n)), tanβ = t.

    For every μ: what is below the rim is hit at distance 0. By Lambert's formula; as n → ∞ a cone's cos²β.
    """
    _require(sides > 2 and slope > 0, f"sides, slope: expected > 2, > 0, got {sides}, {slope}")
    cosine = 1 / hypot(1, slope)
    return sides / pi * cosine * atan(cosine * tan(pi / sides))


def dome(radius: float, tau: Rate = None, max_distance: float = inf) -> float:
    """Dome of the given radius R centred at p: 0 binary, 1 − e^(−τR) exponential, R/D linear, without variance."""
    return _obscurance(lambda t, limit, n=0: exp(-t * radius) * radius**n if radius < limit else 0.0, tau, max_distance)


def ceiling(height: float, tau: Rate = None, max_distance: float = inf) -> float:
    """Infinite ceiling at height h: (h/D)² binary, 1 − 2E3(τh) exponential and unlimited, 1 − (1 − h/D)² linear."""
    return disk(height, inf, tau, max_distance)


def disk(height: float, radius: float, tau: Rate = None, max_distance: float = inf, spread: float = 180.0) -> float:
    """Disk of radius R at height h, centred over p and parallel to the plane.

    Binary h²/(h² + R²); exponential 1 − 2[E3(τh) − c² E3(τ√(h² + R²))], c² = h²/(h² + R²). D cuts the disk to the
    radius √(D² − h²). Linear, to the distance F = min(D, √(h² + R²)): h²/F² + (2h/D)(1 − h/F). A cone of half the
    `spread` s, in degrees, has of it the disk within h tan s/2, and sin² s/2 of the hemisphere.
    """
    _require(height > 0 and radius > 0, f"height, radius: expected > 0, got {height}, {radius}")
    half = radians(spread / 2)
    radius = min(radius, height * tan(half)) if spread < 180 else radius

    def transform(t: float, limit: float, n: int = 0) -> float:
        seen = 2 * shell(t, height, min(limit, hypot(height, radius)), n) if height < limit else 0.0
        return seen / sin(half) ** 2

    return _obscurance(transform, tau, max_distance)


def wall(distance: float, height: float = inf, tau: Rate = None, max_distance: float = inf) -> float:
    """Wall of the given height h (∞ allowed) and infinite length, standing at distance d from p.

    Binary ½(1 + d/√(d² + h²)), so ½ for h = ∞; exponential for h = ∞: 1 − (2/π)[Ki1(τd) − Ki3(τd)];
    linear for h = ∞: 1 − (1/π)[β − 2c artanh(sinβ) + c² tanβ] with c = cosβ = d/D.
    """
    _require(distance > 0 and height > 0, f"distance, height: expected > 0, got {distance}, {height}")
    return trench(inf, distance, height, tau, max_distance)


def trench(left: float, right: float, height: float, tau: Rate = None, max_distance: float = inf) -> float:
    """Floor of an infinitely long trench of the given depth h, between walls at distances x = left and W − x = right.

    Binary ½[(W−x)/√((W−x)² + h²) + x/√(x² + h²)]. A wall at ∞ is absent.
    """
    _require(min(left, right, height) > 0, f"left, right, height: expected > 0, got {left}, {right}, {height}")

    def one(d: float, t: float, limit: float, n: int) -> float:
        """What a wall at distance d takes away."""
        if d >= limit:
            return 0.0
        if t == 0.0 and isinf(limit):
            return 0.5 - (0.5 * d / hypot(d, height) if height < inf else 0.0)
        reach = acos(d / limit)
        top = acos(min(1.0, d / sqrt(limit**2 - height**2))) if limit > height and not isinf(limit) else 0.0
        return 2 * _upright(lambda a: d / cos(a), height, t, limit, (0.0, reach), (top,), n)

    return _obscurance(lambda t, limit, n=0: one(left, t, limit, n) + one(right, t, limit, n), tau, max_distance)


def corner(first: float, second: float, tau: Rate = None) -> float:
    """Two perpendicular walls of infinite height and length, at the given distances from p: ¼ binary.

    Exponential 1 − (1/π) ∫ E3(τρ(φ)) dφ over the three quadrants of azimuth that a wall closes.
    """
    _require(min(first, second) > 0, f"first, second: expected > 0, got {first}, {second}")
    return 0.25 if tau is None else box((first, second, inf, inf), inf, tau)


def box(sides: tuple[float, float, float, float], height: float, tau: Rate = None,
        max_distance: float = inf) -> float:  # fmt: skip
    """Floor of a closed box, p at distances `sides` = (+x, +y, −x, −y) from its four walls: 0 binary and unlimited.

    The unit cube from the centre of its floor is box((.5, .5, .5, .5), 1): .553728 for τ = 1, .975138 for τ = 5.
    """
    _require(min(*sides, height) > 0, f"sides, height: expected > 0, got {sides}, {height}")
    if tau is None and isinf(max_distance):
        return 0.0

    def transform(t: float, limit: float, n: int = 0) -> float:
        """What all walls and the top take away."""

        def quadrant(a: float, b: float) -> float:
            """What a quarter of the box takes away, from the azimuth of a wall at a to that of one at b."""

            def to_wall(azimuth: float) -> float:
                return min(a / max(cos(azimuth), 1e-300), b / max(sin(azimuth), 1e-300))

            def top(azimuth: float) -> float:
                return shell(t, height, min(limit, hypot(to_wall(azimuth), height)), n)

            breaks = [atan2(b, a)]
            for reach in (limit, sqrt(max(limit**2 - height**2, 0.0))):  # where D leaves a wall, and its top edge
                breaks += [acos(a / reach)] if a < reach < inf else []
                breaks += [asin(b / reach)] if b < reach < inf else []
            walls = _upright(to_wall, height, t, limit, (0.0, pi / 2), breaks, n)
            return walls + (_integral(top, 0.0, pi / 2, breaks) / pi if height < limit else 0.0)

        return sum(quadrant(a, b) for a, b in zip(sides, (*sides[1:], sides[0]), strict=True))

    return _obscurance(transform, tau, max_distance)


def groove(angle: float, distance: float, tau: Rate = None) -> float:
    """V-groove of interior angle α (0…π, radians), p on one side at `distance` s from the edge: sin²(α/2) binary.

    In the cross-section the other side is met at ρ(φ) = s sinα/sin(φ − α), φ > α (law of sines).
    """
    _require(0 < angle < pi and distance > 0, f"angle, distance: expected 0 to π, > 0, got {angle}, {distance}")
    if tau is None:
        return sin(angle / 2) ** 2
    return _obscurance(
        lambda t, _: _extruded(lambda a: distance * sin(angle) / max(sin(a - angle), 1e-300), t, (angle, pi)), tau
    )


def sphere(radius: float, height: float, offset: float = 0.0, tau: Rate = None) -> float:
    """Sphere of radius R whose centre is H ≥ R above the plane, r aside: 1 − R²H/(r² + H²)^{3/2} binary.

    Exponential 1 − 2(H/C) ∫ e^(−τd(γ)) cosγ sinγ dγ, γ the angle to the centre, C = √(r² + H²) its distance and
    d = C cosγ − √(R² − C² sin²γ); the azimuthal mean of cosθ is (H/C) cosγ.
    """
    _require(0 < radius <= height, f"radius: expected 0 to height ({height}), got {radius}")
    centre = hypot(offset, height)
    if tau is None:
        return 1.0 - radius**2 * height / centre**3

    def transform(t: float, _: float) -> float:
        def integrand(v: float) -> float:  # C sinγ = R sin v removes the square root's end-point
            cosine = sqrt(1 - (radius * sin(v) / centre) ** 2)
            return exp(-t * (centre * cosine - radius * cos(v))) * (radius / centre) ** 2 * sin(v) * cos(v)

        return 2 * height / centre * _integral(integrand, 0.0, pi / 2)

    return _obscurance(transform, tau)


def inside_sphere(radius: float, tau: Rate = None) -> float:
    """p on the inner face of a sphere: 0 binary, 1 − 2[1 − (1 + a)e^(−a)]/a² with a = 2τR exponential."""
    _require(radius > 0, f"radius: expected > 0, got {radius}")

    def transform(t: float, _: float) -> float:
        a = 2 * t * radius
        return 2 * (-expm1(-a) - a * exp(-a)) / a**2 if a > 1e-4 else 1 - 2 * a / 3

    return _obscurance(transform, tau)


def inside_cylinder(radius: float, tau: Rate = None) -> float:
    """p on the inner face of an infinite cylinder: 0 binary, 1 − (4/π) ∫₀^{π/2} cosψ Ki3(2τR cosψ) dψ exponential."""
    _require(radius > 0, f"radius: expected > 0, got {radius}")
    if tau is None:
        return 0.0
    return _obscurance(lambda t, _: _extruded(lambda a: 2 * radius * sin(a), t, (0.0, pi)), tau)


def cylinder(radius: float, height: float, offset: float = 0.0, tau: Rate = None) -> float:
    """Infinite cylinder parallel to the plane, axis H ≥ R above it and x aside: 1 − RH/(x² + H²) binary.

    Exponential by its cross-section, a circle met at C cosγ − √(R² − C² sin²γ), γ the angle to its centre.
    """
    _require(0 < radius <= height, f"radius: expected 0 to height ({height}), got {radius}")
    centre = hypot(offset, height)
    towards = atan2(height, offset)
    if tau is None:
        return 1.0 - radius * height / centre**2

    def transform(t: float, _: float) -> float:
        def integrand(v: float) -> float:  # C sinγ = R sin v
            gamma = asin(radius * sin(v) / centre)
            near = max(centre * cos(gamma) - radius * cos(v), 0.0)
            slope = radius * cos(v) / (centre * cos(gamma))
            return sin(towards + gamma) * bickley(3, t * near) * slope

        return 2 / pi * _integral(integrand, -pi / 2, pi / 2)

    return _obscurance(transform, tau)


def _clipped_to_horizon(points: Float64s, normal: Float64s) -> Float64s:
    """The part of a polygon (k, 3) in the half-space x·normal ≥ 0 (Sutherland & Hodgman 1974), (j, 3), j ≥ 0."""
    height = points @ normal
    kept: list[Float64s] = []
    for a, b, ha, hb in zip(points, np.roll(points, -1, axis=0), height, np.roll(height, -1), strict=True):
        if ha >= 0:
            kept.append(a)
        if (ha >= 0) != (hb >= 0):
            kept.append(a + (b - a) * (ha / (ha - hb)))
    return np.array(kept, dtype=np.float64).reshape(-1, 3)


def polygon_form_factor(polygon: npt.ArrayLike, point: npt.ArrayLike, normal: npt.ArrayLike) -> float:
    """Cosine-weighted part F of the hemisphere at `point` that a planar polygon covers; w = 1 − F when binary.

    F = |(1/2π) Σ Θ_i n·Γ_i|, Θ_i the angle that edge i subtends and Γ_i the unit normal of its plane through the point
    (Lambert 1760; Baum, Rushmeier & Winget 1989), after clipping to the horizon. Polygons that do not overlap as seen
    from the point add up.

    Args: polygon: (k, 3), its corners in order; it need not be convex. point: not on it. normal: any length > 0.
    """
    up = np.asarray(normal, dtype=np.float64)
    up = up / np.linalg.norm(up)
    seen = _clipped_to_horizon(np.asarray(polygon, np.float64) - np.asarray(point, np.float64), up)
    if len(seen) < 3:
        return 0.0
    seen /= np.linalg.norm(seen, axis=1, keepdims=True)
    following = np.roll(seen, -1, axis=0)
    across = np.cross(seen, following)
    sine = np.linalg.norm(across, axis=1)
    angle = np.arctan2(sine, (seen * following).sum(axis=1))
    turns = angle * np.divide(across @ up, sine, out=np.zeros_like(sine), where=sine > 0)
    return float(abs(turns.sum()) / (2 * np.pi))
